"""What is compared: one side's words and numbers, and the table of two sides."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from rover_pin.estimation.wording import format_value, in_words, interval

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
        if self.low < self.high:
            return interval(self.value, self.low, self.high, self.unit)
        return format_value(self.value, self.unit)


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
        first_word, second_word = (side.words.get(name, ABSENT) for side in (first, second))
        yield Row(name, first_word, second_word, differs=first_word != second_word)


def number_rows(first: Side, second: Side) -> Iterator[Row]:
    """Yield the numbers of either, a row each."""
    for name in dict.fromkeys([*first.numbers, *second.numbers]):
        first_value, second_value = first.numbers.get(name), second.numbers.get(name)
        if first_value is None or second_value is None:
            yield Row(
                name,
                ABSENT if first_value is None else first_value.text,
                ABSENT if second_value is None else second_value.text,
            )
        elif first_value.unit != second_value.unit:
            yield Row(name, first_value.text, second_value.text, note="not of one unit")
        else:
            yield _both(name, first_value, second_value)


def _both(name: str, first_value: Value, second_value: Value) -> Row:
    differs = not math.isclose(first_value.value, second_value.value, abs_tol=1e-15)
    are_finite = math.isfinite(first_value.value) and math.isfinite(second_value.value)
    return Row(
        name,
        first_value.text,
        second_value.text,
        _change(first_value, second_value) if are_finite and differs else "",
        _note(first_value, second_value),
        differs,
    )


def _change(first_value: Value, second_value: Value) -> str:
    factor, unit = in_words(first_value.unit)
    by = f"{factor * (second_value.value - first_value.value):+.3g} {unit}".rstrip()
    ratio = second_value.value / first_value.value - 1.0 if first_value.value else math.inf
    return by + (f" ({ratio:+.1%})" if abs(ratio) < 1.0 else "")


def _note(first_value: Value, second_value: Value) -> str:
    if not (first_value.low < first_value.high and second_value.low < second_value.high):
        return ""
    return "" if first_value.low <= second_value.high and second_value.low <= first_value.high else "intervals apart"


def differences(first: Side, second: Side) -> dict[str, float]:
    """Return second - first of every number that both have in one unit [SI]."""
    both = [name for name in first.numbers if name in second.numbers]
    pairs = {name: (first.numbers[name], second.numbers[name]) for name in both}
    return {
        name: second_value.value - first_value.value
        for name, (first_value, second_value) in pairs.items()
        if first_value.unit == second_value.unit
    }
