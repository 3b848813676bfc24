"""Words of a report: titles of effects instead of class names, short numbers, and the words for each kind of data."""

import math
import re
from collections.abc import Callable, Iterable
from textwrap import fill
from typing import Any, NamedTuple

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import display_name, meaning_of, title_of
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.wording import in_words
from rover_pin.inference.beliefs import Hypothesis
from rover_pin.inference.cause import Cause
from rover_pin.simulation.model.effect_files import installed_effects

MAX_LEGEND_LINE = 36
"""Maximum number of characters in a line of a figure's legend. Longer texts continue on the next line. Two columns of
such lines are as wide as a panel."""


def _same(name: str) -> str:
    return name


class Labels(NamedTuple):
    """The words of a report that differ between kinds of data, such as "runs" or "levels of slip".

    All other words of the report's sentences are common to all kinds of data.
    """

    unseen: str
    """phrase for the held-out data, such as 'in runs that were not fitted'"""
    folds: str
    """plural of the word for the parts of the data that are held out one after another: 'runs'"""
    channel: Callable[[str], str] = _same
    "function that returns a channel's name in words"
    placed: Callable[[str], str] = _same
    "function that returns a text with the places of causes in words: WeakMotor[wheel mr] for WeakMotor[2]"
    fold: Callable[[str], str] = _same
    """function that returns the meaning of a held-out part from its name: 'S = 0.5'"""
    evidence: tuple[str, ...] = ()
    """reasons to believe the verdict that only this kind of data gives"""
    besides: str = ""
    """sentence about the data that a reader must know before the results; empty if there is none"""


def brief(value: float, unit: str, digits: int = 2, like: float = math.nan) -> str:
    """Return an SI number as text with few digits, in a unit that needs no power of ten, such as mm for small lengths.

    Parameters
    ----------
    value : float
        Number in `unit`.
    unit : str
        SI unit, or empty.
    digits : int
        Number of significant digits.
    like : float
        Number that chooses the unit in place of `value`, so that two numbers of one sentence have one unit.

    Examples
    --------
    >>> brief(0.0012, "m")
    '1.2 mm'
    """
    factor, name = in_words(unit, value if math.isnan(like) else like)
    return f"{_digits(factor * value, digits)} {name}".rstrip() if math.isfinite(value) else "unknown"


def _digits(size: float, digits: int) -> str:
    """Return a number as text with `digits` significant digits, without an exponent."""
    # Number of decimal places that shows the wanted number of significant digits.
    places = max(digits - 1 - math.floor(math.log10(abs(size))), 0) if size else 0
    return f"{float(f'{size:.{digits}g}'):.{places}f}"


def with_interval(number: Number) -> str:
    """Return a fitted number with its 95 % interval as text: "1.2 mm [0.9, 1.5]".

    If an end of the interval is a bound of the number and not a result of the data, the remark "limited by its bounds"
    follows. If the data hardly narrow the prior, the remark is "not determined by these data". If the data give no
    interval, the text ends in "(no interval)".
    """
    factor, _ = in_words(number.unit, number.value)
    if not math.isfinite(number.low + number.high) or number.low == number.high:
        return f"{brief(number.value, number.unit)} (no interval)"
    # Two digits, or as many more as make the ends of a narrow interval different.
    for digits in (2, 3, 4):
        low, high = (_digits(factor * end, digits) for end in (number.low, number.high))
        if low != high:
            break
    interval = f"{brief(number.value, number.unit, digits)} [{low}, {high}]"
    if not number.closed:
        return f"{interval}, limited by its bounds"
    return interval if number.is_determined else f"{interval}, not determined by these data"


def pair(before: float, after: float, unit: str) -> tuple[str, str]:
    """Return two numbers as texts in one unit, with two to four digits: as few as make the two texts different."""
    for digits in (2, 3, 4):
        texts = brief(before, unit, digits, before), brief(after, unit, digits, before)
        if texts[0] != texts[1]:
            break
    return texts


def kinds_of(verdict: Verdict) -> tuple[type, ...]:
    """Return the classes of all effects that sentences about a verdict may name.

    These are the effects of the package and of other installed packages, the added effects, and the effects
    whose probability was computed.
    """
    kinds = {kind.__name__: kind for kind in (*installed_effects(), *map(type, verdict.effects))}
    for hypothesis in verdict.beliefs.hypotheses if verdict.beliefs is not None else ():
        for missing in hypothesis.causes:
            if missing.owner and re.split(r"[\[@]", missing.name)[0] not in kinds:
                kind = type(hypothesis.experiment.records(model_with(hypothesis, missing))[missing.owner])
                kinds[kind.__name__] = kind
    return tuple(kinds.values())


def model_with(hypothesis: Hypothesis, missing: Cause) -> Any:
    """Return the model of a hypothesis (causes that act together), with the cause `missing` in it.

    If the hypothesis was evaluated only by a linear estimate, its model lacks its causes, and the cause is added.
    """
    has_it = not missing.owner or missing.owner in hypothesis.experiment.records(hypothesis.model)
    return hypothesis.model if has_it else missing.on(hypothesis.model)


def human(text: str, kinds: Iterable[type]) -> str:
    """Return a text with the class names of effects replaced by their titles: "digging" for DiggingMemory.

    A class name before a dot is part of a parameter's name, as in DiggingMemory.c_d, and is kept. `kinds` are the
    classes of effects.
    """
    titles = {kind.__name__: title_of(kind) for kind in kinds}
    return re.sub(r"\b[A-Z]\w+\b(?!(\[[^\]]*\])?\.)", lambda match: titles.get(match[0], match[0]), text)


def cause(name: str, kinds: Iterable[type], placed: Callable[[str], str] = _same) -> str:
    """Return a cause as a clause, with title and place in brackets: "soil is dug away (digging, wheel mr)".

    If the cause is not an effect but an error of a declared number, the clause is "NAME differs from its declared
    value". `kinds` are the classes of effects, and `placed` writes the place of a cause in words.
    """
    kind = {effect_class.__name__: effect_class for effect_class in kinds}.get(re.split(r"[\[@]", name)[0])
    if kind is None:
        return f"{name} differs from its declared value"
    # The place of a cause is in brackets (a wheel or channel), or follows an @ (a position x).
    where = re.fullmatch(r"\w+(?:\[(.*)\])?(?:@(.*))?", placed(name))
    place = "" if where is None else f", {where[1]}" if where[1] else f", at x = {where[2]} m" if where[2] else ""
    return f"{meaning_of(kind)} ({title_of(kind)}{place})"


def listing(parts: Iterable[str], last: str = "and") -> str:
    """Return texts as a list within a sentence, such as "a, b and c". `last` is the word before the last text."""
    parts = list(parts)
    return f" {last} ".join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else "".join(parts)


def key(added: str) -> str:
    """Return the legend text "with ..." for a model with the effects `added`, in lines that fit into a narrow
    figure.
    """
    return fill(f"with {added}", MAX_LEGEND_LINE)


def two_digits(value: float) -> str:
    """Return a number as text with two significant digits, such as "280". Below a million the text has no exponent."""
    return f"{float(f'{value:.2g}'):g}"


def capital(text: str) -> str:
    """Return a text with a capital first letter, unless it begins with the name of a parameter or column."""
    # Names such as soil.k or load_N must keep their small letters.
    first = text.partition(" ")[0].rstrip(".,:;")
    if "." in first or "_" in first:
        return text
    return text[:1].upper() + text[1:]


def full(name: str, kinds: Iterable[type], labels: Labels) -> str:
    """Return the title of an effect with its place, followed by its class name in brackets: "digging (DiggingMemory)".

    `name` is the name of a cause. If it has no title, it is returned unchanged.
    """
    title = display_name(labels.placed(name), kinds)
    return title if title == name else f"{title} ({name})"
