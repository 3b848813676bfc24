"""What the last model of a search leaves: whether that is more than its noise, has a pattern, or is the law's fault."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rover_pin.discrepancy.cross_validation import fall_of, held_out_losses
from rover_pin.discrepancy.search import Search
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import Noise
from rover_pin.estimation.numbers import is_adequate

ENOUGH = 0.9
"""Share of chi2 beyond the noise from which a law holds though more than the noise is left: real laws never hold to
the last digit."""
MIN_MISFIT_PROBABILITY = 0.01
"""What is left with less than this probability, beside too small a share, keeps a law from holding."""


class ResidualAssessment(NamedTuple):
    """What the last model of a search leaves."""

    unlisted: bool
    "whether it is more than the noise, and more than the form of a law that holds may leave"
    description: str = ""
    "how it acts, in words, where that can be described"
    described: bool = False
    "whether it can be described, and drafted as an effect that holds up when it is tried"


def assess_residual(search_result: Search) -> ResidualAssessment:
    """Return what is left by the stated noise."""
    return ResidualAssessment(
        not (holds(search_result) if search_result.best_refits else is_adequate(search_result.base))
    )


def holds(search_result: Search) -> bool:
    """Return whether a law holds by the declared noise: it leaves that, or takes nearly all that was missed."""
    return is_adequate(search_result.last, MIN_MISFIT_PROBABILITY) or share_taken(search_result) >= ENOUGH


def share_taken(search_result: Search) -> float:
    """Return the share of the base's chi2 beyond the noise that what was found takes."""
    excess = search_result.base.chi2 - search_result.base.freedom
    taken = search_result.base.chi2 - search_result.last.chi2
    return float(np.clip(taken / excess, 0.0, 1.0)) if excess > 0 else float(taken > 0)


def held_out_share(base: Fit, last: Fit) -> float:
    """Return the share of the held-out losses beyond the noise that what was added takes; 0 where it loses a fold."""
    fall, excess = _fall_and_room(base.task.noise, base, last)
    return float(np.clip(np.nan_to_num(fall / excess), 0.0, 1.0)) if excess > 0 else float(fall > 0)


def _fall_and_room(noise: Noise, before: Fit, after: Fit) -> tuple[float, float]:
    """Return `fall_of` the held-out losses, and those before beyond the noise, on the folds that both predict."""
    was, now = (held_out_losses(fitted) for fitted in (before, after))
    both = np.isfinite(was + now)
    return fall_of(was, now), float(was[both].sum() - noise.good[both].sum())
