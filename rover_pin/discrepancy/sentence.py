"""The answer as a sentence for a reader, of any kind of data."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import beyond_floor, largest_residual
from rover_pin.discrepancy.search import Search
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.numbers import implausible, is_adequate, numbers, p_value
from rover_pin.estimation.wording import format_value

MAX_NAMED_CHANNELS = 3
"""Channels that a sentence names."""
RARE = 0.05
"""Share of sets in which chance leaves as much, below which that is said."""


def sentence(answer: Answer, search_result: Search, share: float, besides: tuple[str, Sequence[str]]) -> str:
    """Return the answer as a sentence; `besides` is how what is left acts, and what speaks against a lone name."""
    return SENTENCES[answer](search_result, share, *besides)


def _takes(search_result: Search, share: float) -> str:
    missed = f"takes {share:.0%} of what the base model misses beyond the noise where it was not fitted"
    return f"{missed}{_bent(search_result)}"


def _bent(search_result: Search) -> str:
    """Return how far the base model already had to bend the numbers that were freed, if any."""
    unconstrained_names = {
        size for candidate in search_result.added if candidate.effect is None for size in candidate.amplitudes
    }
    bent = (
        [number for number in numbers(search_result.base) if number.name in unconstrained_names]
        if unconstrained_names
        else []
    )
    phrases = [f"{number.name} to {format_value(number.value, number.unit)}, {number.away}" for number in bent]
    return (
        f"; the base model already had to bend {' and '.join(phrases)}, so its errors are small too" if phrases else ""
    )


def _names(search_result: Search) -> str:
    return " and ".join(candidate.name for candidate in search_result.added)


def _rest(search_result: Search) -> str:
    declared = search_result.base.task.experiment.noise() is not None
    more = declared and not is_adequate(search_result.last)
    return " What is left is still more than the noise: see what is left." if more else ""


def _named(search_result: Search, share: float, description: str, against: Sequence[str]) -> str:
    takes, remaining = _takes(search_result, share), _rest(search_result)
    return f"the data are consistent with {_names(search_result)}, which {takes}.{remaining}"


def _set(search_result: Search, share: float, description: str, against: Sequence[str]) -> str:
    ways = " or ".join(search_result.indistinguishable)
    return f"these cannot be distinguished: {ways}; the first {_takes(search_result, share)}.{_rest(search_result)}"


def _like(search_result: Search, share: float, description: str, against: Sequence[str]) -> str:
    lone = (
        f"but the name does not stand alone: {'; '.join(against)}" if against else "but its law does not hold exactly"
    )
    change = f"reduced chi-square {search_result.base.misfit:.3g} -> {search_result.last.misfit:.3g}"
    like = " or ".join(search_result.indistinguishable)
    return f"something like {like} is missing: the first {_takes(search_result, share)} ({change}), {lone}."


def _none_needed(search_result: Search, share: float, description: str, against: Sequence[str]) -> str:
    if search_result.base.task.experiment.noise() is not None and p_value(search_result.base) < RARE:
        return _rare(search_result.base)
    over = () if search_result.base.task.experiment.floor() is None else beyond_floor(search_result.base)
    if not over:
        return "the calibrated base model meets the data within their noise, and no candidate gains more than chance."
    worst = ", ".join(
        f"{excess.channel} {excess.times:.3g} times (most in {excess.fold})" for excess in over[:MAX_NAMED_CHANNELS]
    )
    more = f" and {len(over) - MAX_NAMED_CHANNELS} channels more" if len(over) > MAX_NAMED_CHANNELS else ""
    return (
        "no candidate gains more than chance, but the calibrated base model leaves more than the samples scatter: "
        f"{worst}{more}."
    )


def _rare(base: Fit) -> str:
    """Return what is said where declared noise leaves so much seldom, though no candidate takes it."""
    most = largest_residual(base)
    return (
        "no candidate gains more than chance, but the calibrated base model leaves more than the declared noise mostly "
        f"does: reduced chi-square {base.misfit:.3g}, as chance has it in {p_value(base):.1%} of sets, most in "
        f"{most.channel} of {most.fold} ({most.times:.2g} times its noise); measure again, or doubt the declared noise."
    )


def _unlisted(search_result: Search, share: float, description: str, against: Sequence[str]) -> str:
    nearest = (
        f" The nearest of the list, {search_result.indistinguishable[0]}, does not take it."
        if search_result.indistinguishable
        else ""
    )
    if description:
        return f"something acts that is not on the list: it {description}.{nearest}"
    missed = f"reduced chi-square {search_result.base.misfit:.3g}"
    return f"the base model misses the data by more than their noise ({missed}), and no candidate explains it.{nearest}"


def _inadequate(search_result: Search, share: float, description: str, against: Sequence[str]) -> str:
    if not search_result.best_refits and is_adequate(search_result.base):
        away = ", ".join(implausible(search_result.base))
        return f"the base model meets the data only with numbers far from what is declared of them: {away}."
    missed = f"reduced chi-square {search_result.base.misfit:.3g}"
    message = f"the base model misses the data by more than their noise ({missed}), and no candidate describes it"
    return f"{message}{_unpatterned(search_result)}."


def _unpatterned(search_result: Search) -> str:
    """Return what more than the noise may be that nothing describes, where the noise is declared."""
    times = math.sqrt(search_result.base.misfit)
    if search_result.base.task.experiment.noise() is None or search_result.base.misfit <= 1.0:
        return ""
    return f": single values may be outliers, or the noise may be {times:.2g} times what is declared"


SENTENCES: dict[Answer, Callable[[Search, float, str, Sequence[str]], str]] = {
    Answer.NAMED: _named,
    Answer.SET: _set,
    Answer.LIKE: _like,
    Answer.NONE_NEEDED: _none_needed,
    Answer.NONE_FITS: _unlisted,
    Answer.INADEQUATE: _inadequate,
}
