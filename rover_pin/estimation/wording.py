"""How numbers, intervals and changes are put into words: once, for every summary, table, caution and figure."""

import math
import re
from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

NOISE_LIKE = 1.5
"""Times its stated noise up to which what is left is called noise. Why: beds scatter besides (assumed)."""
AT_FLOOR = 1.25
"""Times its noise up to which nothing is left to gain. Why: 20 white numbers exceed it in 5 % of sets."""
SAME = 5e-5
"""A relative change below this is none: less than any table shows."""
NEARLY = 0.8
"""Share of what is allowed that an interval covers from which it says nothing. Why: that of a flat law covers 0.95."""
NO_SPREAD = 1e-9
"""Data do not identify an SD, or an interval's width, below this share of the number, or of one unit of a size."""
MAX_LISTED = 3
"""Things of a kind that a sentence, or the table beside it, lists; of more, the first."""
MAX_NAMED = 4
"""Places, channels, sets or reasons that a line or the first screen names; of more, the first and how many more."""
WORTH = 0.01
"""Relative change, or share, below which one is not worth a word. Why: it is none, to two digits."""
NOT_PREDICTED = "not predicted"
READERS_UNITS = {"rad": (180 / math.pi, "deg"), "m": (1e3, "mm"), "Pa": (1e-3, "kPa"), "Pa/m^n": (1e-3, "kPa/m^n")}
PREFIXED = re.compile(r"(A|N|V|W|s|m|rad|ohm)\b(?!\^)")
"""How units begin that a prefix may stand before; each with its least size, factor and letter."""
PREFIXES = ((1e4, 1e-3, "k"), (1e-2, 1.0, ""), (1e-5, 1e3, "m"), (0.0, 1e6, "\N{MICRO SIGN}"))


def in_words(unit: str, size: float = 1.0) -> tuple[float, str]:
    """Return the factor to, and the name of, the unit in which a reader wants an SI value of this size."""
    if unit in READERS_UNITS or not PREFIXED.match(unit) or not (size and math.isfinite(size)):
        return READERS_UNITS.get(unit, (1.0, unit))
    return next((factor, f"{letter}{unit}") for least, factor, letter in PREFIXES if abs(size) >= least)


def format_value(value: float, unit: str, like: float = math.nan) -> str:
    """Return a number as a reader wants it: degrees, millimetres, milliamperes; NaN is what is not predicted.

    Its unit is that of a number `like` it, where one is given.
    """
    factor, name = in_words(unit, value if math.isnan(like) else like)
    return figure(factor * value, ".4g", f" {name}".rstrip())


def figure(value: float, form: str, unit: str = "") -> str:
    """Return a number in a format, with its unit; NaN is what is not predicted."""
    return NOT_PREDICTED if math.isnan(value) else f"{value:{form}}{unit}"


def share(value: float) -> str:
    """Return a relative change in percent, with a digit more where it is below one."""
    if not math.isfinite(value):
        return "unknown"
    return "0%" if abs(value) < SAME else f"{value:+.0%}" if abs(value) >= 0.0095 else f"{100 * value:+.1g}%"


def spread(sd: float, size: float = 1.0) -> str:
    """Return " +- SD", or that there is none: an SD of nothing is no certainty."""
    return f" +- {sd:.2g}" if sd > NO_SPREAD * abs(size) else " (SD not identified)"


def interval(value: float, low: float, high: float, unit: str) -> str:
    """Return a value with its 95 % interval, or that the data give none."""
    if not high - low > NO_SPREAD * abs(value):
        return f"{format_value(value, unit)} (no interval)"
    factor, name = in_words(unit, value)
    ends = f"[{figure(factor * low, '.4g')}, {figure(factor * high, '.4g')}]"
    return f"{figure(factor * value, '.4g', f' {name}'.rstrip())} {ends}"


class Against(Enum):
    """What an interval says of a value that is known from elsewhere."""

    AGREES = "agrees with"
    AWAY = "sits away from"
    NOTHING = "says nothing of"


def against(ends: tuple[float, float], reference: tuple[float, float], covered: float) -> Against:
    """Return what an interval says of a known range, given the share of all that is allowed which it covers."""
    if covered >= NEARLY:
        return Against.NOTHING
    return Against.AGREES if ends[0] <= reference[1] and ends[1] >= reference[0] else Against.AWAY


class Outcome(Enum):
    """What may be claimed of a change."""

    BETTER = "better"
    WORSE = "worse"
    NONE = "unchanged"
    AT_FLOOR = "at its noise floor before: no gain to claim"
    SCATTER = "not beyond its scatter: no claim"
    UNTOLD = "too little to resample: no claim"
    LOST = "not predicted everywhere: not compared"


class Change(NamedTuple):
    """An error before and after, with the 95 % interval of after / before - 1, and what may be said of it."""

    before: float
    after: float
    low: float
    high: float
    floor: float
    "what no model can beat; 0 where it is not known"
    of: str
    "what is resampled: levels, or stretches of runs"

    @property
    def share(self) -> float:
        """after / before - 1."""
        return 0.0 if self.before == 0 else self.after / self.before - 1

    @property
    def lost(self) -> bool:
        """Whether an error is that of a fold that is not predicted."""
        return math.isnan(self.before + self.after)

    @property
    def none(self) -> bool:
        """Whether nothing changed, as where nothing was added."""
        return not self.lost and max(abs(self.share), abs(self.low), abs(self.high)) < SAME

    @property
    def has_interval(self) -> bool:
        """Whether the interval is one: an interval without width is that of a single resampled number."""
        return self.high - self.low > NO_SPREAD

    @property
    def text(self) -> str:
        """The change and its interval, in a few letters."""
        if self.none or self.lost:
            return "not compared" if self.lost else "unchanged"
        ends = f"95 % [{share(self.low)}, {share(self.high)}]" if self.has_interval else "no interval"
        return f"{share(self.share)}, {ends}"

    @property
    def outcome(self) -> Outcome:
        """What may be claimed, in a few words."""
        if self.lost:
            return Outcome.LOST
        at_floor = self.before <= AT_FLOOR * self.floor
        if at_floor and self.after <= AT_FLOOR * self.floor:
            return Outcome.AT_FLOOR
        if self.none or (abs(self.share) < SAME and self.low * self.high >= 0):
            return Outcome.NONE
        if self.has_interval and (self.high < 0 or self.low > 0):
            return Outcome.BETTER if self.high < 0 else Outcome.WORSE
        if at_floor and self.share <= 0:
            return Outcome.AT_FLOOR
        return Outcome.SCATTER if self.has_interval else Outcome.UNTOLD

    @property
    def claim(self) -> str:
        """What may be claimed, in a sentence."""
        sense = (Outcome.BETTER if self.share < 0 else Outcome.WORSE).value
        if self.outcome is Outcome.AT_FLOOR:
            return f"at its noise floor before ({self.before / self.floor:.2f} x): no gain to claim"
        if self.outcome is Outcome.UNTOLD:
            return f"{sense}, but too few {self.of} to resample: no claim"
        if self.outcome is Outcome.SCATTER:
            return f"{sense}, not beyond what the {self.of} scatter: no claim"
        return self.outcome.value


def got_worse(changes: Iterable[tuple[str, Change]]) -> str:
    """Return which of the named errors grew, in a sentence; those that did not grow beyond the scatter apart."""
    changes = list(changes)
    significant: list[str] = []
    within: list[str] = []
    for name, change in (row for row in changes if row[1].share >= SAME):
        words = f"{name} by {share(change.share).lstrip('+')}"
        (significant if change.outcome is Outcome.WORSE else within).append(words)
    sentence = f"Got worse: {', '.join(significant)}." if significant else "No channel got worse beyond its scatter."
    lost = [name for name, change in changes if change.lost]
    sentence += f" Not predicted everywhere, and not compared: {', '.join(lost)}." if lost else ""
    return f"{sentence} Higher within it: {', '.join(within)}." if within else sentence
