"""What binds a rover's joints to each other: the differential, and joints that follow others: the rows G of Eq (8)."""

import numpy as np

from rover_pin.rover.rover import Rover


def constraint_rows(rover: Rover, *, differential: bool = True) -> np.ndarray:
    """Return G [m, nv]: first the row of a rigid `differential`, if there is one, then one a joint that follows."""
    pairs: list[tuple[int | None, int | None, float]]
    pairs = [(coupling.follower, coupling.leader, coupling.ratio) for coupling in rover.couplings]
    if rover.differential is not None and differential:
        pairs.insert(0, (rover.differential.left, rover.differential.right, -1.0))
    return _rows(pairs, rover.model.nv)


def angle_rows(rover: Rover) -> np.ndarray:
    """Return the same for the angles [m, nq]; a row of zeros for wheels that are tied, which have rates only."""
    pairs = [(coupling.q_follower, coupling.q_leader, coupling.ratio) for coupling in rover.couplings]
    if rover.differential is not None:
        pairs.insert(0, (rover.differential.q_left, rover.differential.q_right, -1.0))
    return _rows(pairs, rover.model.nq)


def _rows(pairs: list[tuple[int | None, int | None, float]], size: int) -> np.ndarray:
    rows = np.zeros((len(pairs), size))
    for row, (follower, leader, ratio) in zip(rows, pairs, strict=True):
        if follower is not None:
            row[follower], row[leader] = 1.0, -ratio
    return rows
