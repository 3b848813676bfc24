"""The joints of a rover's suspension: neither base, wheel nor steering."""

from functools import lru_cache

import numpy as np

from rover_pin.rover.rover import Rover
from rover_pin.simulation.compiled.body_law import Joints

NEXUS6_WEIGHT = 5.8 * 0.045
"""Mass times wheel radius [kg m] of Nexus 6, for which the gains of servos and end stops are made."""


def joint_strength(rover: Rover) -> float:
    """Return how much stiffer a rover's servos and end stops are than Nexus 6's: as its mass times wheel radius.

    To six digits, so that the round-off of a sum of masses decides nothing.
    """
    return float(f"{rover.mass * float(rover.radii.max()) / NEXUS6_WEIGHT:.6g}")


def suspension_dofs(rover: Rover) -> list[int]:
    """Return the suspension's joints' places in v, in its order."""
    return rover.free_dofs[6:]


@lru_cache(maxsize=8)
def suspension_places(rover: Rover) -> np.ndarray:
    """Return the same joints' places in q; not to be written to."""
    q_of = {joint.idx_v: joint.idx_q for joint in list(rover.model.joints)[2:]}
    return np.array([q_of[dof] for dof in suspension_dofs(rover)], dtype=np.int64)


def joints_of(rover: Rover) -> Joints:
    """Return the suspension as the law of the body counts it."""
    dofs, differential = suspension_dofs(rover), rover.differential
    channels = {place: name for name, place in rover.angles.items()}
    rockers = None if differential is None else (dofs.index(differential.left), dofs.index(differential.right))
    return Joints(len(dofs), rockers, tuple(channels[place] for place in suspension_places(rover)))
