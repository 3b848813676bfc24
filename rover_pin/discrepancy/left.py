"""What the last model of a search leaves: whether that is more than its noise, has a pattern, or is the law's fault."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rover_pin.discrepancy.cross_validation import fall_of, held_out_losses
from rover_pin.discrepancy.draft import Draft
from rover_pin.discrepancy.search import Search
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import Noise
from rover_pin.estimation.numbers import is_adequate

ENOUGH = 0.9
"""Share of chi2 beyond the noise from which a law holds though more than the noise is left: real laws never hold to
the last digit."""
LEFT = 0.01
"""What is left with less than this probability, beside too small a share, keeps a law from holding."""
SCATTER = 4.0
"""Reduced chi-square up to which what has no pattern is scatter: noise declared too small by a factor of two."""
BETTER = 0.5
"""Share of what a law leaves on held-out folds that a curve in its place takes, from which the law does not stand: of
causes on no list curves took 51 % and more, of other laws of what is listed 41 % at most (98 generated rigs)."""


class Left(NamedTuple):
    """What the last model of a search leaves."""

    unlisted: bool
    "whether it is more than the noise, and more than the form of a law that holds may leave"
    said: str = ""
    "how it acts, in words, where that can be described"
    described: bool = False
    "whether it can be described, and drafted as an effect that holds up when it is tried"
    patterned: bool = False
    "whether a draft describes what the law that was found leaves"
    outdone: bool = False
    "whether a draft in place of what was found predicts so much better that no law of the list is like it"


def what_is_left(found: Search) -> Left:
    """Return what is left by the stated noise."""
    return Left(not (holds(found) if found.found else is_adequate(found.base)))


def described(found: Search, can_draft: bool, drafts: Callable[[Fit], Draft | None]) -> tuple[Left, Draft | None]:
    """Return what a search leaves, and what the base leaves as a draft that was tried, if an effect may be unlisted.

    What a found law leaves is more than its form's if a draft describes it; without a pattern it is scatter. Where a
    draft on the base model, in place of what was found, predicts much better, something else acts.
    """
    left = what_is_left(found)
    if not can_draft or not (left.unlisted or found.found):
        return left, None
    rest = drafts(found.last) if found.found else None
    patterned = rest is not None and rest.accepted
    if found.found and not patterned and found.last.misfit < SCATTER:
        left = Left(False)
    draft = drafts(found.base) if left.unlisted or rest is not None else None
    if found.found and draft is not None and outdone(found, draft):
        return Left(True, described=True, patterned=patterned, outdone=True), draft
    if not left.unlisted:
        return left._replace(patterned=patterned), None
    return left._replace(described=draft is not None and draft.accepted, patterned=patterned), draft


def outdone(found: Search, draft: Draft) -> bool:
    """Return whether a draft on the base takes, beyond chance, half of what the law leaves on folds left out."""
    if draft.refit is None or not draft.accepted:
        return False
    fall, beyond = _fall_and_room(found.base.task.noise, found.last, draft.refit.fit)
    return fall > max(BETTER * beyond, draft.refit.fee)


def holds(found: Search) -> bool:
    """Return whether a law holds by the declared noise: it leaves that, or takes nearly all that was missed."""
    return is_adequate(found.last, LEFT) or share_taken(found) >= ENOUGH


def share_taken(found: Search) -> float:
    """Return the share of the base's chi2 beyond the noise that what was found takes."""
    beyond = found.base.chi2 - found.base.freedom
    taken = found.base.chi2 - found.last.chi2
    return float(np.clip(taken / beyond, 0.0, 1.0)) if beyond > 0 else float(taken > 0)


def held_out_share(base: Fit, last: Fit) -> float:
    """Return the share of the held-out losses beyond the noise that what was added takes; 0 where it loses a fold."""
    fall, beyond = _fall_and_room(base.task.noise, base, last)
    return float(np.clip(np.nan_to_num(fall / beyond), 0.0, 1.0)) if beyond > 0 else float(fall > 0)


def _fall_and_room(noise: Noise, before: Fit, after: Fit) -> tuple[float, float]:
    """Return `fall_of` the held-out losses, and those before beyond the noise, on the folds that both predict."""
    was, now = (held_out_losses(one) for one in (before, after))
    both = np.isfinite(was + now)
    return fall_of(was, now), float(was[both].sum() - noise.good[both].sum())
