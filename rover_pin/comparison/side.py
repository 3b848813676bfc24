"""What is compared: one side's words and numbers, and the table of two sides."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from rover_pin.estimation.wording import in_words, shown

SAME = 1e-9
"""Relative difference of two numbers from which they count as different."""
ABSENT = "not there"


class Value(NamedTuple):
    """A number [SI unit], with the ends of its 95 % interval where it has one."""

    value: float
    unit: str
    low: float = math.nan
    high: float = math.nan

    @property
    def text(self) -> str:
        """The number as a reader wants it, its interval behind it."""
        if not math.isfinite(self.value):
            return "not known"
        ends = f" [{shown(self.low, self.unit)}, {shown(self.high, self.unit)}]" if self.low < self.high else ""
        return shown(self.value, self.unit) + ends


class Side(NamedTuple):
    """One of the two: what it is called, what it says in words, and its numbers by name."""

    label: str
    words: Mapping[str, str]
    numbers: Mapping[str, Value]


class Row(NamedTuple):
    """One line of the table."""

    name: str
    first: str
    second: str
    change: str = ""
    "second - first, and as a share of the first"
    note: str = ""
    differs: bool = True


class Comparison(NamedTuple):
    """Two of a kind, compared."""

    kind: str
    first: str
    second: str
    sentence: str
    rows: tuple[Row, ...]
    differences: Mapping[str, float]
    "second - first of every number that both have [SI]"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**self._asdict(), "rows": [row._asdict() for row in self.rows], "differences": dict(self.differences)}


def word_rows(first: Side, second: Side) -> Iterator[Row]:
    """Yield what the two say in words, a row each."""
    for name in dict.fromkeys([*first.words, *second.words]):
        one, other = (side.words.get(name, ABSENT) for side in (first, second))
        yield Row(name, one, other, differs=one != other)


def number_rows(first: Side, second: Side) -> Iterator[Row]:
    """Yield the numbers of either, a row each."""
    for name in dict.fromkeys([*first.numbers, *second.numbers]):
        one, other = first.numbers.get(name), second.numbers.get(name)
        if one is None or other is None:
            yield Row(name, ABSENT if one is None else one.text, ABSENT if other is None else other.text)
        elif one.unit != other.unit:
            yield Row(name, one.text, other.text, note="not of one unit")
        else:
            yield _both(name, one, other)


def _both(name: str, one: Value, other: Value) -> Row:
    differs = not math.isclose(one.value, other.value, rel_tol=SAME, abs_tol=1e-15)
    known = math.isfinite(one.value) and math.isfinite(other.value)
    return Row(name, one.text, other.text, _change(one, other) if known and differs else "", _note(one, other), differs)


def _change(one: Value, other: Value) -> str:
    factor, unit = in_words(one.unit)
    by = f"{factor * (other.value - one.value):+.3g} {unit}".rstrip()
    ratio = other.value / one.value - 1.0 if one.value else math.inf
    return by + (f" ({ratio:+.1%})" if abs(ratio) < 1.0 else "")


def _note(one: Value, other: Value) -> str:
    if not (one.low < one.high and other.low < other.high):
        return ""
    return "" if one.low <= other.high and other.low <= one.high else "intervals apart"


def differences(first: Side, second: Side) -> dict[str, float]:
    """Return second - first of every number that both have in one unit [SI]."""
    both = [name for name in first.numbers if name in second.numbers]
    pairs = {name: (first.numbers[name], second.numbers[name]) for name in both}
    return {name: other.value - one.value for name, (one, other) in pairs.items() if one.unit == other.unit}
