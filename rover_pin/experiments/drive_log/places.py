"""Where on the way an effect begins and ends: the places next to those at which it was tried."""

import dataclasses
from typing import Any

from rover_pin.discrepancy.candidate import Candidate

NARROWEST = 0.05
"""Least length of a stretch of ground [m]."""


def neighbours(candidate: Candidate, step: float) -> list[Candidate]:
    """Return a candidate with a place on the way with each of its edges moved either way."""
    effect: Any = candidate.effect
    if not candidate.place_searched:
        return []
    begin, end = float(effect.x_from), float(effect.x_from + effect.length)
    edges = [(begin - step, end), (begin + step, end), (begin, end - step), (begin, end + step)]
    there = [effect.replace(x_from=start, length=stop - start) for start, stop in edges if stop - start > NARROWEST]
    return [
        dataclasses.replace(candidate, effect=shifted_effect, place=f"{float(shifted_effect.x_from):.3f}")
        for shifted_effect in there
    ]
