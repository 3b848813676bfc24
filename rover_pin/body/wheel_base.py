"""Where the wheels stand under the rover, all joints at zero."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.body.rover import Rover


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


def base_of(rover: Rover) -> Base:
    """Return the length and the mean width of what a rover stands on [m]."""
    places = wheel_places(rover)
    left, right = ([places[wheel.name][1] for wheel in rover.wheels if wheel.side == side] for side in "lr")
    return Base(float(np.ptp([place[0] for place in places.values()])), float(np.mean(left) - np.mean(right)))
