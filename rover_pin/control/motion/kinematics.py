"""Rim speeds and steering angles of the wheels for a given motion of the body, as floats or as CasADi expressions."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Scalar
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_places


class BodyMotion(NamedTuple):
    """The motion of a rover's body: the velocity of its reference point and the yaw rate.

    The reference point lies on the longitudinal axis of the base (y = 0), where this axis crosses the line on which all
    centres of turning lie (see `turning_places`).
    """

    speed: Scalar
    "forward speed [m/s]"
    yaw_rate: Scalar
    "yaw rate to the left [rad/s]"
    aside: Scalar = 0.0
    "speed to the left [m/s]"


class Rolling(NamedTuple):
    """The rim speed and the steering angle of each wheel for a motion of the body."""

    speeds: list[Any]
    "rim speed of each wheel [m/s]"
    angles: list[Any]
    """steering angle of each wheel that can steer [rad]"""


def steers(rover: Rover) -> tuple[bool, ...]:
    """Return for each wheel of a rover whether the wheel can steer.

    Examples
    --------
    >>> from rover_pin.rover.rover import load_rover
    >>> steers(load_rover("nexus6"))  # the wheels in the middle cannot steer
    (True, True, False, False, True, True)
    """
    return tuple(wheel.steer_dof is not None for wheel in rover.wheels)


def turning_places(rover: Rover, track: float = 0.0) -> np.ndarray:
    """Return the position (x ahead, y to the left) of each wheel [m], an array (wheels, 2). x is measured from the line
    across the rover on which all centres of turning lie.

    The line passes through the mean x of the wheels that cannot steer, or of all wheels if every wheel steers.

    If no wheel steers, the rover turns by the speed difference of its left and right side. Then x is 0, and y is the
    mean y of the wheels on that side. If an effective `track` [m] is given, y is scaled so that the two sides are at
    this distance from each other.

    Examples
    --------
    >>> from rover_pin.rover.rover import load_rover
    >>> turning_places(load_rover("nexus6"))[0].round(3).tolist()  # front left
    [0.15, 0.16]
    >>> turning_places(load_rover("cart"), track=1.0)[0].round(3).tolist()  # no wheel steers
    [0.0, 0.5]
    """
    places = wheel_places(rover)
    if not any(steers(rover)):
        lateral = {side: np.mean([places[w.name][1] for w in rover.wheels if w.side == side]) for side in "lr"}
        # The two sides are moved apart symmetrically until their distance is the effective track.
        middle, scale = sum(lateral.values()) / 2, track / (lateral["l"] - lateral["r"]) if track else 1.0
        return np.array([(0.0, middle + scale * (lateral[wheel.side] - middle)) for wheel in rover.wheels])
    # x is measured from the mean of the wheels that cannot steer, because they can turn only about a centre abreast of
    # them.
    fixed = [places[wheel.name][0] for wheel in rover.wheels if wheel.steer_dof is None]
    line = float(np.mean(fixed or [place[0] for place in places.values()]))
    return np.array([(places[wheel.name][0] - line, places[wheel.name][1]) for wheel in rover.wheels])


def rolling(places: Sequence[Any], steering: Sequence[bool], motion: BodyMotion) -> Rolling:
    """Return the rim speeds and steering angles of wheels for a motion of the body.

    The centre of a wheel at (x, y) moves with v = (speed - yaw_rate y, aside + yaw_rate x). A wheel that steers points
    along v, at most 90 deg from straight ahead, and its rim speed is |v|. If v points backwards, the wheel runs
    backwards. A wheel that cannot steer has the rim speed v_x, and is dragged sideways by v_y.

    Parameters
    ----------
    places : sequence
        Position (x, y) of each wheel [m], as `turning_places` returns it.
    steering : sequence of bool
        Whether each wheel can steer.
    motion : BodyMotion
        Motion of the body.

    Examples
    --------
    >>> motion = BodyMotion(speed=0.1, yaw_rate=0.5)
    >>> rolling([(0.0, 0.2), (0.0, -0.2)], [False, False], motion).speeds  # left and right in a left turn
    [0.0, 0.2]
    """
    speeds, angles = [], []
    for (x, y), steered in zip(places, steering, strict=True):
        # Velocity of the wheel's centre: that of the reference point plus the yaw rate times the distance from it.
        along, across = motion.speed - motion.yaw_rate * y, motion.aside + motion.yaw_rate * x
        # For a wheel that runs backwards, both components are reversed, so that it steers by at most 90 deg.
        sense = 2.0 * (along >= 0.0) - 1.0
        speeds.append(sense * ca.hypot(along, across) if steered else along)
        if steered:
            angles.append(ca.atan2(sense * across, sense * along))
    return Rolling(speeds, angles)
