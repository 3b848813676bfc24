"""What `new-rover` proposes of a URDF's joints, as plain records."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rover_pin.rover.description.tree import Joint, UrdfTree, turn
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


class Topology:
    """Which link carries which in a URDF; a loop is cut at all joints but the first to a link."""

    def __init__(self, tree: UrdfTree):
        self.tree, self.places = tree, tree.placements
        first = {joint.child: joint.name for joint in reversed(tree.joints)}
        self.cut = tuple(joint.name for joint in tree.joints if first[joint.child] != joint.name)
        self.joints = {joint.name: joint for joint in tree.joints if joint.name not in self.cut}
        self.above = {joint.child: joint for joint in self.joints.values()}
        free = [joint for joint in tree.joints if joint.kind == "floating" and joint.parent in tree.roots]
        self.base = free[0].child if free else (tree.roots or [""])[0]
        self.dropped = {joint.name for joint in free}
        if self.base in self.places:
            inverse = np.linalg.inv(self.places[self.base])
            self.places = {name: inverse @ place for name, place in self.places.items()}

    def ancestors(self, joint: str) -> list[Joint]:
        """Return the moving joints above a joint, nearest first."""
        ancestors: list[Joint] = []
        link = self.joints[joint].parent
        while link in self.above and len(ancestors) <= len(self.joints):
            up = self.above[link]
            if up.moves and up.name not in self.dropped:
                ancestors.append(up)
            link = up.parent
        return ancestors

    @property
    def moving(self) -> list[Joint]:
        """The joints that move, but for a floating one at the root."""
        return [joint for joint in self.joints.values() if joint.moves and joint.name not in self.dropped]

    def below(self, joint: str, wheels: Sequence[str]) -> list[str]:
        """Return which of these wheels hang below a joint."""
        return [wheel for wheel in wheels if joint in [up.name for up in self.ancestors(wheel)]]

    def axis(self, joint: Joint, rpy: tuple[float, float, float]) -> np.ndarray:
        """Return a joint's axis [3] in axes x forward, y left, z up."""
        unit = joint.axis / max(float(np.linalg.norm(joint.axis)), 1e-12)
        return np.asarray(rotation(rpy) @ self.places[joint.child][:3, :3] @ unit)

    def centre(self, joint: Joint, rpy: tuple[float, float, float]) -> np.ndarray:
        """Return where a joint lies [3] (m)."""
        return np.asarray(rotation(rpy) @ self.places[joint.child][:3, 3])


def rotation(rpy: tuple[float, float, float]) -> np.ndarray:
    """Return the rotation of roll, pitch and yaw [3, 3]."""
    return np.asarray(turn("z", rpy[2]) @ turn("y", rpy[1]) @ turn("x", rpy[0]))
