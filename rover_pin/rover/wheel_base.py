"""Geometry of a rover: positions of the wheels, wheelbase and track, effective track in a turn, and size of the
bodies.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError
from rover_pin.rover.rover import Rover


class WheelBase(NamedTuple):
    """Length and width of the rectangle between a rover's wheels."""

    length: float
    "distance between the first and the last axle [m]"
    track: float
    "distance between the mean y of the left wheels and the mean y of the right wheels [m]"


def wheel_mounts(rover: Rover, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses of the wheels at a configuration q [nq]: the rotations of their frames [n, 3, 3], and their
    centres in the world [n, 3] (m).
    """
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, q)
    poses = [data.oMi[wheel.joint] for wheel in rover.wheels]
    return np.array([pose.rotation for pose in poses]), np.array([pose.translation for pose in poses])


def wheel_places(rover: Rover) -> dict[str, np.ndarray]:
    """Return name of a wheel -> centre of the wheel in the base frame [3] (m), with all joint angles at zero."""
    _, centres = wheel_mounts(rover, pin.neutral(rover.model))
    return {wheel.name: centre for wheel, centre in zip(rover.wheels, centres, strict=True)}


def corners(rover: Rover) -> np.ndarray:
    """Return the four corners of the rectangle between the wheels, in the base frame (m), as an array [2, 2, 2].

    The indices of the array are (front, back), (left, right) and (x, y). The x of the front corners is the x of the
    foremost wheels, and the x of the back corners is the x of the rearmost wheels. The y of a corner is the mean y of
    the wheels of its side.
    """
    places = wheel_places(rover)
    xs = [place[0] for place in places.values()]
    left, right = ([places[wheel.name][1] for wheel in rover.wheels if wheel.side == side] for side in "lr")
    return np.array([[(x, np.mean(left)), (x, np.mean(right))] for x in (max(xs), min(xs))])


def base_of(rover: Rover) -> WheelBase:
    """Return the length and the track (mean width) of the rectangle between a rover's wheels [m]."""
    (front_left, front_right), (back_left, _) = corners(rover)
    return WheelBase(float(front_left[0] - back_left[0]), float(front_left[1] - front_right[1]))


def effective_track(rover: Rover, resistance: float = 0.0) -> float:
    """Return the effective track B' [m] of a rover that turns by different speeds of its two sides (skid steering).

    A skid-steered rover yaws more slowly than its wheel speeds and its track B suggest, because its wheels are dragged
    sideways. A rover without slip and with the track B' would yaw at the same rate if its wheels had the same
    speeds.

    At the yaw rate Omega, a wheel at the distance x ahead of the middle of the axles slides sideways with the speed
    Omega x and along its heading with the speed Omega s, where s is the unknown. All wheels carry equal loads. Friction
    with the coefficient mu acts against the direction of sliding, and motion resistance with the coefficient R acts
    against rolling. In a turn on the spot the moments of all wheels balance:

        sum over wheels of ((s B / 2 - x^2) / sqrt(s^2 + x^2) - R B / (2 mu)) = 0,  B' = B + 2 s

    For two axles L apart and R = 0 this gives B' = B + L^2 / B.

    Parameters
    ----------
    rover : Rover
        The rover.
    resistance : float
        R / mu [-], in [0, 1).

    Raises
    ------
    ParameterError
        R is not smaller than mu, so that the rover does not turn.

    Source: quasi-static balance, as for skid-steered vehicles on firm ground. Simplified: shear that builds up slowly
    makes the effective track larger.

    Examples
    --------
    >>> from rover_pin.rover.rover import load_rover
    >>> round(effective_track(load_rover("cart")), 3)  # B + L^2 / B = 0.52 + 0.56^2 / 0.52
    1.123
    """
    from scipy.optimize import brentq  # imported here, because a rover with steering does not need it

    if not 0.0 <= resistance < 1.0:
        raise ParameterError(
            f"Rover '{rover.name}' has no steered wheel, and its motion resistance is {resistance:.3g} times the "
            "friction of the soil, so that different speeds of its sides do not turn the rover. Lower the motion "
            "resistance R, or give the effective track as control.track."
        )
    # x is the distance of each wheel from the middle of the axles.
    length = np.array([place[0] for place in wheel_places(rover).values()])
    x, track = np.abs(length - np.mean(length)), base_of(rover).track

    def moment(s: float) -> float:
        """Return the sum of the wheels' moments about the middle of the axles, divided by mu and a wheel's load [m].

        The rover turns on the spot, and the sum is 0 for the sought value of s. `effective_track` defines s and mu.
        """
        return float(np.sum((0.5 * s * track - x**2) / np.maximum(np.hypot(s, x), 1e-12) - 0.5 * resistance * track))

    # At this s even the wheel that is furthest from the middle of the axles drives the turn, so the root lies below.
    upper = float(np.max(2.0 * x**2 / track + resistance * x)) / (1.0 - resistance)
    return track + (2.0 * float(brentq(moment, 0.0, upper)) if upper > 0.0 else 0.0)


@lru_cache(maxsize=16)
def reach_of(rover: Rover) -> tuple[np.ndarray, np.ndarray]:
    """Return the box around the rover's bodies as two corners: the smallest (x, y, z) and the largest (x, y, z), each
    [3] (m).

    All joint angles are zero, and coordinates are in the base's axes. The shapes of the URDF are not needed, because
    each body is replaced by the uniform cuboid with its mass m and its inertia J. Along axis i such a cuboid extends
    sqrt(3 S_ii / m) to either side of its centre, where S = tr(J) / 2 - J is the second moment of its mass. Source:
    rigid-body statics.
    """
    model, data = rover.model, rover.model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    # The world (index 0) has no body.
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    # A body is replaced by a uniform box of equal mass and equal moments of inertia.
    for pose, body in zip(data.oMi[1:], model.inertias[1:], strict=True):
        J = pose.rotation @ body.inertia @ pose.rotation.T
        second = np.trace(J) / 2.0 - np.diag(J)
        half = np.sqrt(np.maximum(3.0 * second / body.mass, 0.0)) if body.mass > 0.0 else np.zeros(3)
        centre = pose.act(body.lever)
        low, high = np.minimum(low, centre - half), np.maximum(high, centre + half)
    return low, high
