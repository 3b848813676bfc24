"""The answer as a sentence for a reader, of any kind of data."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import beyond_floor, most_left
from rover_pin.discrepancy.search import Search
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.numbers import chance_of, implausible, is_adequate, numbers
from rover_pin.estimation.wording import shown

MOST_SAID = 3
"""Channels that a sentence names."""
RARE = 0.05
"""Share of sets in which chance leaves as much, below which that is said."""


def sentence(answer: Answer, found: Search, share: float, besides: tuple[str, Sequence[str]]) -> str:
    """Return the answer as a sentence; `besides` is how what is left acts, and what speaks against a lone name."""
    return SENTENCES[answer](found, share, *besides)


def _takes(found: Search, share: float) -> str:
    missed = f"takes {share:.0%} of what the base model misses beyond the noise where it was not fitted"
    return f"{missed}{_bent(found)}"


def _bent(found: Search) -> str:
    """Return how far the base model already had to bend the numbers that were freed, if any."""
    freed = {size for one in found.added if one.effect is None for size in one.sizes}
    bent = [one for one in numbers(found.base) if one.name in freed] if freed else []
    told = [f"{one.name} to {shown(one.value, one.unit)}, {one.away}" for one in bent]
    return f"; the base model already had to bend {' and '.join(told)}, so its errors are small too" if told else ""


def _names(found: Search) -> str:
    return " and ".join(one.name for one in found.added)


def _rest(found: Search) -> str:
    declared = found.base.task.experiment.noise() is not None
    more = declared and not is_adequate(found.last)
    return " What is left is still more than the noise: see what is left." if more else ""


def _named(found: Search, share: float, left: str, against: Sequence[str]) -> str:
    return f"the data are consistent with {_names(found)}, which {_takes(found, share)}.{_rest(found)}"


def _set(found: Search, share: float, left: str, against: Sequence[str]) -> str:
    ways = " or ".join(found.alike)
    return f"these cannot be distinguished: {ways}; the first {_takes(found, share)}.{_rest(found)}"


def _like(found: Search, share: float, left: str, against: Sequence[str]) -> str:
    lone = (
        f"but the name does not stand alone: {'; '.join(against)}" if against else "but its law does not hold exactly"
    )
    change = f"reduced chi-square {found.base.misfit:.3g} -> {found.last.misfit:.3g}"
    like = " or ".join(found.alike)
    return f"something like {like} is missing: the first {_takes(found, share)} ({change}), {lone}."


def _none_needed(found: Search, share: float, left: str, against: Sequence[str]) -> str:
    if found.base.task.experiment.noise() is not None and chance_of(found.base) < RARE:
        return _rare(found.base)
    over = () if found.base.task.experiment.floor() is None else beyond_floor(found.base)
    if not over:
        return "the calibrated base model meets the data within their noise, and no candidate gains more than chance."
    worst = ", ".join(f"{one.channel} {one.times:.3g} times (most in {one.fold})" for one in over[:MOST_SAID])
    more = f" and {len(over) - MOST_SAID} channels more" if len(over) > MOST_SAID else ""
    return (
        "no candidate gains more than chance, but the calibrated base model leaves more than the samples scatter: "
        f"{worst}{more}."
    )


def _rare(base: Fit) -> str:
    """Return what is said where declared noise leaves so much seldom, though no candidate takes it."""
    most = most_left(base)
    return (
        "no candidate gains more than chance, but the calibrated base model leaves more than the declared noise mostly "
        f"does: reduced chi-square {base.misfit:.3g}, as chance has it in {chance_of(base):.1%} of sets, most in "
        f"{most.channel} of {most.fold} ({most.times:.2g} times its noise); measure again, or doubt the declared noise."
    )


def _unlisted(found: Search, share: float, left: str, against: Sequence[str]) -> str:
    near = f" The nearest of the list, {found.alike[0]}, does not take it." if found.alike else ""
    if left:
        return f"something acts that is not on the list: it {left}.{near}"
    missed = f"reduced chi-square {found.base.misfit:.3g}"
    return f"the base model misses the data by more than their noise ({missed}), and no candidate explains it.{near}"


def _inadequate(found: Search, share: float, left: str, against: Sequence[str]) -> str:
    if not found.found and is_adequate(found.base):
        away = ", ".join(implausible(found.base))
        return f"the base model meets the data only with numbers far from what is declared of them: {away}."
    missed = f"reduced chi-square {found.base.misfit:.3g}"
    said = f"the base model misses the data by more than their noise ({missed}), and no candidate describes it"
    return f"{said}{_unpatterned(found)}."


def _unpatterned(found: Search) -> str:
    """Return what more than the noise may be that nothing describes, where the noise is declared."""
    times = math.sqrt(found.base.misfit)
    if found.base.task.experiment.noise() is None or found.base.misfit <= 1.0:
        return ""
    return f": single values may stray, or the noise may be {times:.2g} times what is declared"


SENTENCES: dict[Answer, Callable[[Search, float, str, Sequence[str]], str]] = {
    Answer.NAMED: _named,
    Answer.SET: _set,
    Answer.LIKE: _like,
    Answer.NONE_NEEDED: _none_needed,
    Answer.NONE_FITS: _unlisted,
    Answer.INADEQUATE: _inadequate,
}
