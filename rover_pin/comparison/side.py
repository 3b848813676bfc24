"""The form in which two results are compared: the words and numbers of each result, and the table of differences."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from rover_pin.estimation.wording import format_value, in_words, interval

ABSENT = "not there"
"""Text in the table of a comparison if only one of the two compared results has the property or number of this row."""


class Value(NamedTuple):
    """A number with its SI unit, and the lower and upper end of its 95 % interval if it has one."""

    value: float
    unit: str
    low: float = math.nan
    high: float = math.nan

    @property
    def text(self) -> str:
        """The number with its unit in the form used in reports, followed by its 95 % interval if it has one."""
        if not math.isfinite(self.value):
            return "not known"
        if self.low < self.high:
            return interval(self.value, self.low, self.high, self.unit)
        return format_value(self.value, self.unit)


class Side(NamedTuple):
    """One of the two compared results: its label, its properties in words, and its numbers (name -> value)."""

    label: str
    words: Mapping[str, str]
    numbers: Mapping[str, Value]


class Row(NamedTuple):
    """One line in the table of a comparison: a property or a number in both compared results, and its change."""

    name: str
    first: str
    second: str
    change: str = ""
    """value in the second result minus value in the first, also as a percentage of the value in the first"""
    note: str = ""
    differs: bool = True


class Comparison(NamedTuple):
    """Result of a comparison: one sentence, a table of rows, and the differences as numbers.

    `kind` is the kind of the compared results (drives, models or verdicts), and `first` and `second` are the labels of
    the two results.
    """

    kind: str
    first: str
    second: str
    sentence: str
    rows: tuple[Row, ...]
    differences: Mapping[str, float]
    """value in the second result minus value in the first, for every number that both results have [SI]"""

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison as plain values that can be written to JSON."""
        return {**self._asdict(), "rows": [row._asdict() for row in self.rows], "differences": dict(self.differences)}


def word_rows(first: Side, second: Side) -> Iterator[Row]:
    """Yield one row of the comparison's table for each property in words that at least one of the two results has."""
    for name in dict.fromkeys([*first.words, *second.words]):
        first_word, second_word = (side.words.get(name, ABSENT) for side in (first, second))
        yield Row(name, first_word, second_word, differs=first_word != second_word)


def number_rows(first: Side, second: Side) -> Iterator[Row]:
    """Yield one row of the comparison's table for each number that at least one of the two results has."""
    for name in dict.fromkeys([*first.numbers, *second.numbers]):
        first_value, second_value = first.numbers.get(name), second.numbers.get(name)
        first_text, second_text = (ABSENT if value is None else value.text for value in (first_value, second_value))
        if first_value is None or second_value is None:
            yield Row(name, first_text, second_text)
        # Numbers in different units, such as k_1 for two exponents n, have no difference.
        elif first_value.unit != second_value.unit:
            yield Row(name, first_text, second_text, note="units differ")
        else:
            differs = not math.isclose(first_value.value, second_value.value, abs_tol=1e-15)
            are_finite = math.isfinite(first_value.value) and math.isfinite(second_value.value)
            change = _change(first_value, second_value) if are_finite and differs else ""
            yield Row(name, first_text, second_text, change, _note(first_value, second_value), differs)


def _change(first: Value, second: Value) -> str:
    """Return the change from the first to the second value in the unit used in reports.

    A percentage follows if the change is less than 100 % of the first value.
    """
    # Reports use mm and deg instead of m and rad.
    factor, unit = in_words(first.unit)
    change = f"{factor * (second.value - first.value):+.3g} {unit}".rstrip()
    ratio = second.value / first.value - 1.0 if first.value else math.inf
    return change + (f" ({ratio:+.1%})" if abs(ratio) < 1.0 else "")


def _note(first: Value, second: Value) -> str:
    """Return a remark if the 95 % intervals of two values do not overlap; an empty text otherwise."""
    # Without an interval, low and high are NaN and the comparison is False.
    if not (first.low < first.high and second.low < second.high):
        return ""
    return "" if first.low <= second.high and second.low <= first.high else "intervals apart"


def differences(first: Side, second: Side) -> dict[str, float]:
    """Return the difference of each number that both results have: its name -> second value minus first value [SI].

    The dict omits numbers whose units differ.
    """
    both = [name for name in first.numbers if name in second.numbers]
    pairs = {name: (first.numbers[name], second.numbers[name]) for name in both}
    return {
        name: second_value.value - first_value.value
        for name, (first_value, second_value) in pairs.items()
        if first_value.unit == second_value.unit
    }
