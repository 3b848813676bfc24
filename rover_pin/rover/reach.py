"""How far the bodies of a rover reach, by their masses and inertias alone."""

from functools import lru_cache

import numpy as np
import pinocchio as pin

from rover_pin.rover.rover import Rover


@lru_cache(maxsize=16)
def reach_of(rover: Rover) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest x, y, z of the rover's bodies in the base's axes, all joints at zero [m].

    A body is as large as the uniform cuboid of its mass m and inertia J: along axis i it reaches sqrt(3 S_ii / m) to
    either side of its centre, S = tr(J) / 2 - J the second moment of its mass. Source: rigid-body statics.
    """
    model, data = rover.model, rover.model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for place, body in zip(data.oMi[1:], model.inertias[1:], strict=True):
        J = place.rotation @ body.inertia @ place.rotation.T
        second = np.trace(J) / 2.0 - np.diag(J)
        half = np.sqrt(np.maximum(3.0 * second / body.mass, 0.0)) if body.mass > 0.0 else np.zeros(3)
        centre = place.act(body.lever)
        low, high = np.minimum(low, centre - half), np.maximum(high, centre + half)
    return low, high
