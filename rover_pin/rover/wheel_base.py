"""Where the wheels stand under the rover, all joints at zero."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.rover.rover import Rover


class Base(NamedTuple):
    """What a rover stands on."""

    length: float
    "between its outer axles [m]"
    track: float
    "between its sides' wheels in the middle [m]"


def wheel_places(rover: Rover) -> dict[str, np.ndarray]:
    """Return the place of each wheel's centre in the base frame, all joints at zero [m]."""
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, pin.neutral(rover.model))
    return {wheel.name: np.array(data.oMi[wheel.joint].translation) for wheel in rover.wheels}


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
