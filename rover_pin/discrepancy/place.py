"""Where a candidate with a place begins and ends: sought by the score test, before anything is refitted."""

from __future__ import annotations

from rover_pin.discrepancy.screen import Scored, score, signatures
from rover_pin.estimation.fit import Fit

FIRST, LAST = 0.08, 0.02
"""First and last step by which an edge is moved [m]; half a second's drive is 0.025 m."""


def placed(base: Fit, row: Scored) -> Scored:
    """Return a located candidate's row where moving neither of its edges raises the gain; others as they are.

    Which stretch of the way differs is not found by following slopes: an edge acts only where something passes it.
    """
    step = FIRST
    while step > LAST:
        near = base.task.experiment.neighbours(row.candidate, step)
        if not near:
            break
        best = max(score(base, signatures(base, near)), key=lambda one: one.gain)
        if best.gain > row.gain:
            row = best
        else:
            step /= 2
    return row
