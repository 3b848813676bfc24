"""Where on the ground a candidate begins and ends: sought by the score test, before anything is refitted."""

from __future__ import annotations

import dataclasses
from typing import Any

from rover_pin.evidence.drive_candidates import Candidate, name_of
from rover_pin.evidence.drive_fit import DriveFit
from rover_pin.evidence.drive_screen import Scored, score, signatures

FIRST, LAST = 0.08, 0.02
"""First and last step by which an edge is moved [m]; half a second's drive is 0.025 m."""
NARROWEST = 0.05
"""Least length of a stretch of ground [m]."""


def placed(base: DriveFit, row: Scored) -> Scored:
    """Return a located candidate's row where moving neither of its edges raises the gain; others as they are.

    Which stretch of the ground differs is not found by following slopes: an edge acts only where wheels pass it.
    """
    effect: Any = row.candidate.effect
    if effect is None or "x_from" not in effect.places:
        return row
    step = FIRST
    while step > LAST:
        tried = _scored(base, row.candidate, step)
        best = max(tried, key=lambda one: one.gain)
        if best.gain > row.gain:
            row = best
        else:
            step /= 2
    return row


def _scored(base: DriveFit, candidate: Candidate, step: float) -> list[Scored]:
    """Return the rows of the candidate with each of its edges moved either way."""
    effect: Any = candidate.effect
    begin, end = float(effect.x_from), float(effect.x_from + effect.length)
    moved = [(begin - step, end), (begin + step, end), (begin, end - step), (begin, end + step)]
    there = [effect.replace(x_from=one, length=other - one) for one, other in moved if other - one > NARROWEST]
    return score(
        base, signatures(base, [dataclasses.replace(candidate, effect=one, name=name_of(one)) for one in there])
    )
