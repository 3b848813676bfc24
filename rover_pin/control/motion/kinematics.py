"""How fast wheels roll, and where they point, for a motion of the body: floats or expressions."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Scalar
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_places


class BodyMotion(NamedTuple):
    """Of the point between the wheels, on the line on which turning centres lie."""

    speed: Scalar
    "forwards [m/s]"
    yaw_rate: Scalar
    "to the left [rad/s]"
    aside: Scalar = 0.0
    "speed to the left [m/s]"


class Rolling(NamedTuple):
    """What the wheels do for a motion."""

    speeds: list[Any]
    "of their rims [m/s]"
    angles: list[Any]
    "of those that steer [rad]"


def steers(rover: Rover) -> tuple[bool, ...]:
    """Return whether each wheel steers."""
    return tuple(wheel.steer_dof is not None for wheel in rover.wheels)


def turning_places(rover: Rover, track: float = 0.0) -> np.ndarray:
    """Return x of each wheel ahead of the line on which turning centres lie, and y, (wheels, 2) [m].

    The line is level with the mean of the wheels that do not steer, or of all. Where none steers, x is 0 and y the mean
    of the wheel's side, or what an effective `track` [m] makes of it: a turn by the sides' speeds.
    """
    places = wheel_places(rover)
    if not any(steers(rover)):
        lateral = {side: np.mean([places[w.name][1] for w in rover.wheels if w.side == side]) for side in "lr"}
        middle, scale = sum(lateral.values()) / 2, track / (lateral["l"] - lateral["r"]) if track else 1.0
        return np.array([(0.0, middle + scale * (lateral[wheel.side] - middle)) for wheel in rover.wheels])
    fixed = [places[wheel.name][0] for wheel in rover.wheels if wheel.steer_dof is None]
    level = float(np.mean(fixed or [place[0] for place in places.values()]))
    return np.array([(places[wheel.name][0] - level, places[wheel.name][1]) for wheel in rover.wheels])


def rolling(places: Sequence[Any], steering: Sequence[bool], motion: BodyMotion) -> Rolling:
    """Return what wheels at x, y roll like: v = (speed - yaw_rate y, aside + yaw_rate x).

    One that steers points along v, at most 90 deg from straight ahead, and runs backwards where v does: |v| and
    atan2(v_y, v_x). One that does not rolls at v_x and is dragged sideways.
    """
    speeds, angles = [], []
    for (x, y), steered in zip(places, steering, strict=True):
        along, across = motion.speed - motion.yaw_rate * y, motion.aside + motion.yaw_rate * x
        sense = 2.0 * (along >= 0.0) - 1.0
        speeds.append(sense * ca.hypot(along, across) if steered else along)
        if steered:
            angles.append(ca.atan2(sense * across, sense * along))
    return Rolling(speeds, angles)
