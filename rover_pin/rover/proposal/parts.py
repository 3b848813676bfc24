"""What `new-rover` proposes of a URDF's joints, as plain records."""

import math
from dataclasses import dataclass, field

import numpy as np

from rover_pin.rover.proposal.wheel_shape import WheelSize

FRAMES = {
    (0.0, 0.0, 0.0): "x forward, y left, z up",
    (math.pi, 0.0, 0.0): "x forward, y right, z down",
    (0.0, 0.0, -math.pi / 2): "x right, y forward, z up",
    (math.pi / 2, 0.0, 0.0): "x forward, y up, z right",
}
"""Base frames that are tried, by the base_rpy that turns each to x forward, y left, z up.

No frame tells which end is the front: of two that differ in that alone the usual one stands here."""


@dataclass(frozen=True)
class GuessedWheel:
    """A joint that may be a wheel's: where its centre lies, in axes x forward, y left, z up [m], and its size."""

    joint: str
    centre: np.ndarray
    size: WheelSize


@dataclass(frozen=True)
class GuessedAxle:
    """Two wheels beside each other, and the joints that steer them."""

    name: str
    wheels: tuple[GuessedWheel, GuessedWheel]
    steering: tuple[str, str] | None


@dataclass
class Proposal:
    """What is proposed, and why."""

    base: str
    base_rpy: tuple[float, float, float]
    axles: tuple[GuessedAxle, ...]
    suspension: dict[str, tuple[str, ...]] = field(default_factory=dict)
    differential: str = ""
    coupled: dict[str, tuple[str, float]] = field(default_factory=dict)
    "joint -> the joint of the suspension that it follows, and by how much"
    held_joints: dict[str, float] = field(default_factory=dict)
    cut: tuple[str, ...] = ()
    reasons: dict[str, str] = field(default_factory=dict)
    "part or joint -> why"
    skid: bool = False
    "whether it turns by its sides' speeds alone"

    @property
    def wheels(self) -> list[GuessedWheel]:
        """The wheels, from front to rear, left before right."""
        return [wheel for axle in self.axles for wheel in axle.wheels]
