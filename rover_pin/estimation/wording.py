"""Texts for parameters, intervals and changes of an error, common to all summaries, tables, cautions and figures."""

import math
import re
from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

MAX_NOISE_RATIO = 1.5
"""Largest ratio of a residual to the stated noise at which a report still calls the residual noise. Ratios above 1 are
accepted, because test rigs scatter in addition to their sensors (assumed)."""
FLOOR_RATIO = 1.25
"""Minimum ratio of an error to the noise. Below this value, a report claims no improvement of this error, because the
error cannot fall much further. The RMS of 20 values of white noise exceeds 1.25 SD in 5 % of cases."""
MIN_CHANGE = 5e-5
"""Minimum relative change of an error. Below this value, a report calls the error unchanged; no table shows smaller
changes."""
MAX_COVERED_SHARE = 0.8
"""Fraction of a parameter's allowed range: an interval that covers more of the range carries no information about the
parameter. The interval of a flat distribution covers 0.95."""
MIN_SPREAD = 1e-9
"""Smallest SD or interval width that counts as larger than zero, as a fraction of the value (or of one unit). A smaller
one is rounding of the computation, and a report calls it not identified."""
MAX_LISTED = 3
"""Maximum number of similar items in a sentence, or in the table next to the sentence; a reader does not
take in more."""
MAX_NAMED = 4
"""Maximum number of places, channels, sets of causes or reasons that a line of a report names; the line states the
number of the others."""
MIN_MENTIONED = 0.01
"""Minimum relative change or fraction. Below this value, a report omits the number, because it would be printed as
0."""
NOT_PREDICTED = "not predicted"
READERS_UNITS = {"rad": (180 / math.pi, "deg"), "m": (1e3, "mm"), "Pa": (1e-3, "kPa"), "Pa/m^n": (1e-3, "kPa/m^n")}
"""Units for reports, by SI unit: the factor from the SI value, and the name of the unit. Angles are printed in degrees,
for example."""
PREFIXED = re.compile(r"(A|N|V|W|s|m|rad|ohm)\b(?!\^)")
"""Pattern of the SI units that get a prefix (such as milli) in a report if the value is large or small."""
PREFIXES = ((1e4, 1e-3, "k"), (1e-2, 1.0, ""), (1e-5, 1e3, "m"), (0.0, 1e6, "\N{MICRO SIGN}"))
"""Prefixes for reports, from the largest value to the smallest: smallest SI value for this prefix, factor from the SI
value, and letter of the prefix."""


def in_words(unit: str, size: float = 1.0) -> tuple[float, str]:
    """Return the unit of an SI value of this size in a report: the factor from the SI value, and the unit's name.

    Example: `in_words("m")` gives `(1000.0, "mm")`.
    """
    if unit in READERS_UNITS or not PREFIXED.match(unit) or not (size and math.isfinite(size)):
        return READERS_UNITS.get(unit, (1.0, unit))
    return next((factor, f"{letter}{unit}") for least, factor, letter in PREFIXES if abs(size) >= least)


def format_value(value: float, unit: str, like: float = math.nan) -> str:
    """Return an SI value as text for a report, in a convenient unit such as degrees, millimetres or milliamperes. A NaN
    is printed as "not predicted".

    `like` is another SI value that decides the unit, so that two values of one sentence have one unit.

    Examples
    --------
    >>> format_value(0.0125, "m")
    '12.5 mm'
    """
    factor, name = in_words(unit, value if math.isnan(like) else like)
    return figure(factor * value, ".4g", f" {name}".rstrip())


def figure(value: float, form: str, unit: str = "") -> str:
    """Return a number as text in the number format `form`, followed by its unit. A NaN is printed as "not
    predicted".
    """
    return NOT_PREDICTED if math.isnan(value) else f"{value:{form}}{unit}"


def share(value: float) -> str:
    """Return a relative change as text in percent, with one more digit below 1 %: "-12%", "+0.3%"."""
    if not math.isfinite(value):
        return "unknown"
    return "0%" if abs(value) < MIN_CHANGE else f"{value:+.0%}" if abs(value) >= 0.0095 else f"{100 * value:+.1g}%"


def spread(sd: float, size: float = 1.0) -> str:
    """Return an SD as the text " +- SD", to be added to a value in a report.

    If the SD is below MIN_SPREAD times `size` (the size of the value), the text is " (SD not identified)".
    """
    return f" +- {sd:.2g}" if sd > MIN_SPREAD * abs(size) else " (SD not identified)"


def interval(value: float, low: float, high: float, unit: str) -> str:
    """Return a value with its 95 % interval as text for a report, in a convenient unit. An interval of no width is
    printed as "(no interval)".
    """
    if not high - low > MIN_SPREAD * abs(value):
        return f"{format_value(value, unit)} (no interval)"
    factor, name = in_words(unit, value)
    ends = f"[{figure(factor * low, '.4g')}, {figure(factor * high, '.4g')}]"
    return f"{figure(factor * value, '.4g', f' {name}'.rstrip())} {ends}"


class Against(Enum):
    """Relation of a fitted interval to a value that another measurement gave: the interval agrees with the value, does
    not contain it, or is too wide for a statement about it.
    """

    AGREES = "agrees with"
    AWAY = "sits away from"
    NOTHING = "says nothing of"


def against(ends: tuple[float, float], reference: tuple[float, float], covered: float) -> Against:
    """Return how a fitted interval relates to the range that another measurement gave for this parameter.

    Parameters
    ----------
    ends : tuple of float
        Ends of the fitted interval.
    reference : tuple of float
        Ends of the range from the other measurement, in the unit of `ends`.
    covered : float
        Fraction of the parameter's allowed range that the fitted interval covers. Above MAX_COVERED_SHARE the interval
        is too wide for a statement.
    """
    if covered >= MAX_COVERED_SHARE:
        return Against.NOTHING
    return Against.AGREES if ends[0] <= reference[1] and ends[1] >= reference[0] else Against.AWAY


class Outcome(Enum):
    """Claim that a report may make about the change of an error; the values are the words of the report."""

    BETTER = "better"
    WORSE = "worse"
    NONE = "unchanged"
    AT_FLOOR = "at its noise floor before: no gain to claim"
    SCATTER = "not beyond its scatter: no claim"
    UNTOLD = "too little to resample: no claim"
    LOST = "not predicted everywhere: not compared"


class Change(NamedTuple):
    """An error before and after a change of the model, and the claim that the difference supports.

    `low` and `high` are the ends of the 95 % interval of the relative change, after / before - 1.
    """

    before: float
    after: float
    low: float
    high: float
    floor: float
    """smallest error that a model can reach (the noise); 0 if it is unknown"""
    of: str
    """name of the groups of samples that were resampled for the interval: levels, runs, or stretches of runs"""

    @property
    def share(self) -> float:
        """Relative change, after / before - 1."""
        return 0.0 if self.before == 0 else self.after / self.before - 1

    @property
    def lost(self) -> bool:
        """Whether one of the two errors is undefined (NaN), because the model does not predict every fold."""
        return math.isnan(self.before + self.after)

    @property
    def none(self) -> bool:
        """Whether the error did not change, for example because nothing was added to the model."""
        return not self.lost and max(abs(self.share), abs(self.low), abs(self.high)) < MIN_CHANGE

    @property
    def has_interval(self) -> bool:
        """Whether the relative change has an interval. An interval of width 0, which results from resampling a single
        value, counts as no interval.
        """
        return self.high - self.low > MIN_SPREAD

    @property
    def text(self) -> str:
        """The relative change with its 95 % interval, as a short text for reports."""
        if self.none or self.lost:
            return "not compared" if self.lost else "unchanged"
        ends = f"95 % [{share(self.low)}, {share(self.high)}]" if self.has_interval else "no interval"
        return f"{share(self.share)}, {ends}"

    @property
    def outcome(self) -> Outcome:
        """The claim that the change supports, such as BETTER or AT_FLOOR."""
        if self.lost:
            return Outcome.LOST
        # The order of these tests matters: an error at the noise cannot improve, whatever its interval says, and an
        # error without a change needs no interval.
        at_floor = self.before <= FLOOR_RATIO * self.floor
        if at_floor and self.after <= FLOOR_RATIO * self.floor:
            return Outcome.AT_FLOOR
        if self.none or (abs(self.share) < MIN_CHANGE and self.low * self.high >= 0):
            return Outcome.NONE
        if self.has_interval and (self.high < 0 or self.low > 0):
            return Outcome.BETTER if self.high < 0 else Outcome.WORSE
        # An error that started at the noise and did not grow significantly cannot be claimed as a gain either.
        if at_floor and self.share <= 0:
            return Outcome.AT_FLOOR
        return Outcome.SCATTER if self.has_interval else Outcome.UNTOLD

    @property
    def claim(self) -> str:
        """The claim that the change supports, in words for reports."""
        sense = (Outcome.BETTER if self.share < 0 else Outcome.WORSE).value
        if self.outcome is Outcome.AT_FLOOR:
            return f"at its noise floor before ({self.before / self.floor:.2f} x): no gain to claim"
        if self.outcome is Outcome.UNTOLD:
            return f"{sense}, but too few {self.of} to resample: no claim"
        if self.outcome is Outcome.SCATTER:
            return f"{sense}, not beyond what the {self.of} scatter: no claim"
        return self.outcome.value


def got_worse(changes: Iterable[tuple[str, Change]]) -> str:
    """Return a sentence for a report that names the errors that grew.

    `changes` are pairs of a name (of a channel) and its change. Errors that grew significantly (beyond their scatter)
    come first. Errors that grew within their scatter, and errors that are undefined because the model does not predict
    every fold, are listed separately.
    """
    changes = list(changes)
    significant: list[str] = []
    within: list[str] = []
    for name, change in (row for row in changes if row[1].share >= MIN_CHANGE):
        words = f"{name} by {share(change.share).lstrip('+')}"
        (significant if change.outcome is Outcome.WORSE else within).append(words)
    sentence = f"Got worse: {', '.join(significant)}." if significant else "No channel got worse beyond its scatter."
    lost = [name for name, change in changes if change.lost]
    sentence += f" Not predicted everywhere, and not compared: {', '.join(lost)}." if lost else ""
    return f"{sentence} Higher within it: {', '.join(within)}." if within else sentence
