"""What a controller reads and what it commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np


class Truth(NamedTuple):
    """What only a simulator or an external tracker knows, one value a wheel."""

    slip: np.ndarray
    "slip ratio, Eq (1) [-]"
    sinkage: np.ndarray
    "sinkage [m]"
    normal: np.ndarray
    "normal force [N]"
    travel: np.ndarray
    "travel speed of the wheel centre [m/s]"
    position: np.ndarray
    "base position (3) [m]"
    velocity: np.ndarray
    "base velocity in the world (3) [m/s]"


@dataclass(frozen=True, eq=False)
class Reading:
    """What is measured on board at a control instant, and the truth beside it."""

    t: float
    duty: np.ndarray
    "duty now applied, one a wheel [-]"
    wheel_rate: np.ndarray
    "rate of the wheel joints [rad/s]"
    current: np.ndarray
    "motor currents [A]"
    suspension: np.ndarray
    "angles of the suspension joints, in the order of the rover's joints [rad]"
    attitude: tuple[float, float, float]
    "roll, pitch (nose down positive), yaw of the base [rad]"
    truth: Truth

    def replace(self, **changes: Any) -> Reading:
        """Return the reading with other values, such as those of a noisy sensor."""
        return Reading(**{field.name: getattr(self, field.name) for field in fields(Reading)} | changes)


class Command(NamedTuple):
    """Duty a wheel, -1..1, and the steering angle of each steered wheel [rad]."""

    duty: np.ndarray | float
    steer: np.ndarray | float = 0.0


Controller = Callable[[Reading], Command | np.ndarray | float]
"""Any callable; one with a `reset()` is reset at the start of a drive."""
