"""The mechanical energy of the rover."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rover_pin.rover.forward_dynamics import checked_configuration, checked_state
from rover_pin.rover.rover import Rover


def kinetic_energy(rover: Rover, q: np.ndarray, v: np.ndarray) -> float:
    """Return v^T H v / 2 [J]; the rotors' armature is included, as it is in H."""
    q, v = checked_state(rover, q, v)
    return float(pin.computeKineticEnergy(rover.model, rover.model.createData(), q, v))


def potential_energy(rover: Rover, q: np.ndarray) -> float:
    """Return the energy in the rover's gravity [J], zero where the centre of mass is at the height of the world's."""
    q = checked_configuration(rover, q)
    return float(pin.computePotentialEnergy(rover.model, rover.model.createData(), q))
