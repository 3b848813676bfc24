"""Where the wheels stand under the rover."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError
from rover_pin.rover.rover import Rover


class Base(NamedTuple):
    """What a rover stands on."""

    length: float
    "between its outer axles [m]"
    track: float
    "between its sides' wheels in the middle [m]"


def wheel_mounts(rover: Rover, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rotations [n, 3, 3] of the wheels' frames, and their centres in the world [n, 3] (m)."""
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, q)
    placed = [data.oMi[wheel.joint] for wheel in rover.wheels]
    return np.array([pose.rotation for pose in placed]), np.array([pose.translation for pose in placed])


def wheel_places(rover: Rover) -> dict[str, np.ndarray]:
    """Return the place of each wheel's centre in the base frame, all joints at zero [m]."""
    _, centres = wheel_mounts(rover, pin.neutral(rover.model))
    return {wheel.name: centre for wheel, centre in zip(rover.wheels, centres, strict=True)}


def corners(rover: Rover) -> np.ndarray:
    """Return where a rover stands, (front, back) x (left, right) x (x, y) in the base frame [m].

    The front is the first axle, the back the last, left and right the mean of the wheels of a side.
    """
    places = wheel_places(rover)
    xs = [place[0] for place in places.values()]
    left, right = ([places[wheel.name][1] for wheel in rover.wheels if wheel.side == side] for side in "lr")
    return np.array([[(x, np.mean(left)), (x, np.mean(right))] for x in (max(xs), min(xs))])


def base_of(rover: Rover) -> Base:
    """Return the length and the mean width of what a rover stands on [m]."""
    (front_left, front_right), (back_left, _) = corners(rover)
    return Base(float(front_left[0] - back_left[0]), float(front_left[1] - front_right[1]))


def effective_track(rover: Rover, resistance: float = 0.0) -> float:
    """Return the track B' [m] of wheels that do not slip and turn as fast as those of a rover without steering do.

    Wheels at x from the middle of the axles slide sideways by Omega x and along by Omega s, the sides against each
    other. Equal loads, one friction mu against the slide, whatever its direction, and a motion resistance R against
    the rolling leave no moment where, `resistance` = R / mu,

        sum ((s B / 2 - x^2) / |(s, x)| - R B / (2 mu)) = 0,  B' = B + 2 s;  of two axles L apart, R = 0: B + L^2 / B.

    Source: quasi-static balance, as for skid-steered vehicles on firm ground. A slow build-up of shear takes more.

    Raises ParameterError: r is mu or more: such a rover does not turn.
    """
    from scipy.optimize import brentq  # a steered rover has no use for it

    if not 0.0 <= resistance < 1.0:
        raise ParameterError(
            f"{rover.name} has no wheel that steers, and its motion resistance is {resistance:.3g} of what the soil "
            "holds: it does not turn by its sides' speeds; lower R, or give control.track."
        )
    length = np.array([place[0] for place in wheel_places(rover).values()])
    x, track = np.abs(length - np.mean(length)), base_of(rover).track

    def moment(s: float) -> float:
        return float(np.sum((0.5 * s * track - x**2) / np.maximum(np.hypot(s, x), 1e-12) - 0.5 * resistance * track))

    most = float(np.max(2.0 * x**2 / track + resistance * x)) / (1.0 - resistance)
    return track + (2.0 * float(brentq(moment, 0.0, most)) if most > 0.0 else 0.0)
