"""How a report speaks: human names for classes, short numbers, and what one kind of data calls its parts."""

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
from rover_pin.simulation.model.effect_files import package_effects

KEY = 36
"""Letters of a line of a picture's key: two columns of them are as wide as a panel."""


def _same(name: str) -> str:
    return name


class Labels(NamedTuple):
    """What one kind of data calls what it has."""

    unseen: str
    "where it predicts what it was not fitted to, as 'on slips it never saw'"
    folds: str
    "what is left out, in the plural"
    channel: Callable[[str], str] = _same
    "a channel's name for a reader"
    placed: Callable[[str], str] = _same
    "a text with the places of causes as a reader knows them: WeakMotor[2] is WeakMotor[wheel mr]"
    fold: Callable[[str], str] = _same
    "the meaning of a fold's name, as 'S = 0.5'"
    evidence: tuple[str, ...] = ()
    "what only this kind of data can say for a verdict"
    besides: str = ""
    "what else of these data is to be known first, a sentence"


def brief(value: float, unit: str, digits: int = 2, like: float = math.nan) -> str:
    """Return a number with few digits, in a reader's unit of a number `like` it, and never as a power of ten."""
    factor, name = in_words(unit, value if math.isnan(like) else like)
    return f"{_digits(factor * value, digits)} {name}".rstrip() if math.isfinite(value) else "unknown"


def _digits(size: float, digits: int) -> str:
    places = max(digits - 1 - math.floor(math.log10(abs(size))), 0) if size else 0
    return f"{float(f'{size:.{digits}g}'):.{places}f}"


def with_interval(number: Number) -> str:
    """Return a fitted number with few digits, its 95 % interval behind it where the data give one."""
    factor, _ = in_words(number.unit, number.value)
    if not (number.closed and math.isfinite(number.low + number.high)):
        return f"{brief(number.value, number.unit)} (no interval)"
    return f"{brief(number.value, number.unit)} [{_digits(factor * number.low, 2)}, {_digits(factor * number.high, 2)}]"


def pair(before: float, after: float, unit: str) -> tuple[str, str]:
    """Return two numbers in as few digits as tell them apart."""
    for digits in (2, 3, 4):
        texts = brief(before, unit, digits, before), brief(after, unit, digits, before)
        if texts[0] != texts[1]:
            break
    return texts


def kinds_of(verdict: Verdict) -> tuple[type, ...]:
    """Return the classes of effects that a verdict may name: the package's, what it added, what was weighed."""
    kinds = {kind.__name__: kind for kind in (*package_effects(), *map(type, verdict.effects))}
    for hypothesis in verdict.beliefs.hypotheses if verdict.beliefs is not None else ():
        for missing in hypothesis.causes:
            if missing.owner and re.split(r"[\[@]", missing.name)[0] not in kinds:
                kind = type(hypothesis.experiment.records(model_with(hypothesis, missing))[missing.owner])
                kinds[kind.__name__] = kind
    return tuple(kinds.values())


def model_with(hypothesis: Hypothesis, missing: Cause) -> Any:
    """Return a hypothesis's model with one of its causes, which that of an estimate may not have."""
    has_it = not missing.owner or missing.owner in hypothesis.experiment.records(hypothesis.model)
    return hypothesis.model if has_it else missing.on(hypothesis.model)


def human(text: str, kinds: Iterable[type]) -> str:
    """Return a text with its effects' human names in the place of their classes'."""
    titles = {kind.__name__: title_of(kind) for kind in kinds}
    return re.sub(r"\b[A-Z]\w+\b(?!(\[[^\]]*\])?\.)", lambda match: titles.get(match[0], match[0]), text)


def cause(name: str, kinds: Iterable[type], placed: Callable[[str], str] = _same) -> str:
    """Return what was found as a clause that follows 'because', its name in brackets."""
    kind = {effect_class.__name__: effect_class for effect_class in kinds}.get(re.split(r"[\[@]", name)[0])
    if kind is None:
        return f"{name} is not what was declared"
    where = re.fullmatch(r"\w+(?:\[(.*)\])?(?:@(.*))?", placed(name))
    place = "" if where is None else f", {where[1]}" if where[1] else f", at x = {where[2]} m" if where[2] else ""
    return f"{meaning_of(kind)} ({title_of(kind)}{place})"


def listing(parts: Iterable[str], last: str = "and") -> str:
    """Return parts as in a sentence: a, b and c."""
    parts = list(parts)
    return f" {last} ".join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else "".join(parts)


def key(added: str) -> str:
    """Return what stands beside the line of a model with what was added, in lines that fit in a narrow picture."""
    return fill(f"with {added}", KEY)


def two_digits(value: float) -> str:
    """Return a number to two digits, without an exponent up to a million: 280, not 2.8e+02."""
    return f"{float(f'{value:.2g}'):g}"


def capital(text: str) -> str:
    """Return a text that begins a sentence; a parameter's or a column's name, as soil.k, stays as it is."""
    first = text.partition(" ")[0].rstrip(".,:;")
    if "." in first or "_" in first:
        return text
    return text[:1].upper() + text[1:]


def full(name: str, kinds: Iterable[type], labels: Labels) -> str:
    """Return a candidate's human name with its class and place behind it: 'digging (DiggingMemory)'."""
    title = display_name(labels.placed(name), kinds)
    return title if title == name else f"{title} ({name})"


def as_text(name: str) -> str:
    """Return a name as matplotlib shows it letter by letter: a dollar sign starts no formula."""
    return name.replace("$", r"\$")
