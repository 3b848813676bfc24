"""The grammar of units, which holds for every value, column and option that names a unit.

Within the package, all numbers are in SI units.

A unit is a product of symbols with whole powers, divided by other products: `N m`, `N·m`, `N.m`, `N*m`, `Nm`, `m/s2`,
`m s^-2`, `rad/(N m)`. A text can have several meanings: `Nms` can be N m s or newton milliseconds, and `lb` can be a
force or a mass. The caller states the kind of quantity, and the meaning of this kind is taken. Small and capital
letters are distinguished first; only if the text then has no meaning, the distinction is dropped.
"""

from __future__ import annotations

import math
import re
import unicodedata
from fractions import Fraction
from functools import cache, lru_cache
from typing import NamedTuple

LBF, INCH, FOOT = 4.4482216152605, 0.0254, 0.3048
"""One pound-force [N], one inch [m] and one foot [m]."""

BASE = ("m", "kg", "s", "A", "K", "rad")
"""The base units: five base units of SI, and the radian. The radian distinguishes a torque [N m] from a torsional
stiffness [N m/rad]."""
PREFIXES = {"n": "1e-9", "u": "1e-6", "m": "1e-3", "c": "1e-2", "k": "1e3", "M": "1e6"}
"""SI prefix -> its factor, as text, so that the factor becomes an exact fraction."""
METRIC = {"m": "", "s": "", "A": "", "K": "", "rad": "", "N": "kg m/s^2", "J": "N m", "W": "N m/s", "Pa": "N/m^2",
          "V": "W/A", "ohm": "V/A", "Hz": "1/s"}  # fmt: skip
"""Symbol of a unit that takes a prefix -> the product of base units that equals it; empty for a base unit."""
OTHERS: tuple[tuple[str, float, str], ...] = (
    ("g", 1e-3, "kg"), ("t", 1e3, "kg"), ("lb", 0.45359237, "kg"), ("lb", LBF, "N"), ("lbf", LBF, "N"),
    ("kgf", 9.80665, "N"), ("newton", 1.0, "N"), ("in", INCH, "m"), ("inch", INCH, "m"), ("ft", FOOT, "m"),
    ("metre", 1.0, "m"), ("meter", 1.0, "m"), ("psi", 1.0, "lbf/in^2"), ("bar", 1e5, "Pa"), ("sec", 1.0, "s"),
    ("min", 60.0, "s"), ("h", 3600.0, "s"), ("hr", 3600.0, "s"), ("deg", math.pi / 180.0, "rad"),
    ("degree", math.pi / 180.0, "rad"), ("rev", 2.0 * math.pi, "rad"), ("rpm", math.pi / 30.0, "rad/s"),
    ("rps", 2.0 * math.pi, "rad/s"), ("dps", math.pi / 180.0, "rad/s"), ("mps", 1.0, "m/s"), ("kmh", 1.0, "km/h"),
    ("kph", 1.0, "km/h"), ("volt", 1.0, "V"), ("amp", 1.0, "A"), ("%", 0.01, "1"), ("percent", 0.01, "1"),
    ("pct", 0.01, "1"),
)  # fmt: skip
"""Symbols and words of units that take no prefix: name, factor, and the unit to multiply the factor by. A pound (lb) is
listed twice, because it can be a mass or a force."""
USUAL = {
    "": ("%",), "m": ("mm", "cm", "km", "in", "ft"), "rad": ("deg",), "s": ("ms", "us", "ns", "min"), "kg": ("g",),
    "N": ("kN", "lbf", "kgf"), "N m": ("mN m", "kN m", "lbf in", "lbf ft"), "V": ("mV",), "A": ("mA",), "ohm": (),
    "Pa": ("N/m^2", "kPa", "MPa", "kN/m^2", "psi"), "m/s": ("mm/s", "cm/s", "km/h"), "m/s^2": (), "rad/m": ("deg/m",),
    "rad/s": ("rpm", "deg/s", "rev/s"), "kg/m^3": ("g/cm^3", "t/m^3", "lb/ft^3"),
}  # fmt: skip
"""SI unit of a kind of quantity -> other units that are common for this kind; errors and tables list them."""
MAX_UNIT_LETTERS = 24
"""Maximum number of letters of a unit. A longer text does not count as a unit, because trying all its meanings would
take long. The units in `USUAL` have at most seven letters."""
SPELLINGS = str.maketrans(
    {"°": "deg", "º": "deg", "Ω": "ohm", "μ": "u", "µ": "u", "−": "-", "·": " ", "⋅": " ", "*": " "}
)
"""Character of a unit -> the plain letters that replace it before the unit is read."""
POWER = re.compile(r"(?:\^?\(?([+-]?\d)\)?)?[ .-]*(.*)")
"""Pattern of the text after a symbol: a power such as `2`, `^-1` or `^(2)`, which may be missing, and the following
text."""


class Unit(NamedTuple):
    """One possible meaning of a text as a unit.

    `size` is the factor that converts a number in this unit to SI. `powers` are the exponents of the `BASE` units.
    """

    size: Fraction
    powers: tuple[int, ...]

    def times(self, factor: Unit, power: int) -> Unit:
        """Return the product of this unit and another unit, `factor`, raised to a whole power."""
        powers = tuple(mine + power * theirs for mine, theirs in zip(self.powers, factor.powers, strict=True))
        return Unit(self.size * factor.size**power, powers)


NONE = Unit(Fraction(1), (0,) * len(BASE))
"""The unit of a number without a unit."""


@cache
def _symbols(folded: bool) -> dict[str, tuple[Unit, ...]]:
    """Return a dict from each symbol of a unit to all units that it can mean.

    With `folded`, the symbols are in small letters, so that capital letters do not count.
    """
    symbols: dict[str, tuple[Unit, ...]] = {"1": (NONE,)}

    def add(name: str, size: float | str, unit: Unit) -> None:
        key = name.lower() if folded else name
        symbols[key] = (*symbols.get(key, ()), unit._replace(size=Fraction(str(size)) * unit.size))

    for name in BASE:
        add(name, 1.0, Unit(Fraction(1), tuple(int(base == name) for base in BASE)))
    # The products in METRIC and OTHERS are written with the right capital letters, so they are read without folding.
    exact = symbols if not folded else _symbols(False)
    # The symbols of METRIC are entered first, because the units in OTHERS are made of them: a bar is 1e5 Pa.
    for name, of in METRIC.items():
        unit = _over(of, exact)[0] if of else exact[name][0]
        for prefix, size in {"": "1", **PREFIXES}.items() if of else PREFIXES.items():
            add(prefix + name, size, unit)
    for name, count, of in OTHERS:
        for word in {name, f"{name}s"} if name.isalpha() and len(name) > 1 else {name}:
            add(word, count, _over(of, exact)[0])
    return symbols


def _over(text: str, symbols: dict[str, tuple[Unit, ...]]) -> list[Unit]:
    """Return all possible meanings of a text such as `rad/(N m)/s`: a product divided by further products.

    `symbols` maps each symbol to the units that it can mean.
    """
    # The first product is the numerator; each further product, with or without brackets, is a divisor.
    above, *below = (re.sub(r"^\((.*)\)$", r"\1", part.strip()) for part in text.split("/"))
    ways = _product(above, symbols, {})
    for part in below:
        under = _product(part, symbols, {}) if part else []
        ways = [unit.times(divisor, -1) for unit in ways for divisor in under]
    return ways


def _product(text: str, symbols: dict[str, tuple[Unit, ...]], cache: dict[str, list[Unit]]) -> list[Unit]:
    """Return all possible meanings of a product of unit symbols that a blank, a point, a hyphen or nothing separates.

    The function tries every symbol at the beginning of the text, and reads the text after this symbol by a recursive
    call. `symbols` maps each symbol to the units that it can mean. `cache` keeps the meanings of each text, so that no
    text is read twice.
    """
    if not text:
        # The end of the text is reached, so the product is complete.
        return [NONE]
    if text not in cache:
        ways = set()
        for end in range(1, len(text) + 1):
            # One symbol may mean several units, and each meaning is continued with the rest of the text.
            for unit in symbols.get(text[:end], ()):
                power, tail = POWER.findall(text[end:])[0]
                ways |= {after.times(unit, int(power or 1)) for after in _product(tail, symbols, cache)}
        cache[text] = sorted(ways)
    return cache[text]


@lru_cache(maxsize=1024)
def readings(text: str, folded: bool = False) -> tuple[Unit, ...]:
    """Return all units that a text can mean; an empty tuple if the text is not a unit.

    `N m` has one meaning; `Nms` has two, newton metre second and newton millisecond. With `folded`, capital letters do
    not count.
    """
    plain = unicodedata.normalize("NFKC", text.strip().translate(SPELLINGS)).translate(SPELLINGS)
    plain = plain.replace("**", "^").replace(" per ", "/")
    if plain in ("", "-"):
        return (NONE,)
    return tuple(_over(plain.lower() if folded else plain, _symbols(folded))) if len(plain) <= MAX_UNIT_LETTERS else ()


def factor_to(unit: str, expected: str) -> float:
    """Return the factor that converts a number in `unit` to the SI unit `expected`.

    The result is NaN if `unit` is not a unit, measures another kind of quantity than `expected`, or has two meanings of
    this kind.

    Examples
    --------
    >>> factor_to("km/h", "m/s")
    0.2777777777777778
    >>> factor_to("kg", "m/s")
    nan
    """
    if unit == expected:
        return 1.0
    # Only meanings that measure the expected kind of quantity count. Small and capital letters are distinguished first.
    kinds = {reading.powers for reading in readings(expected)}
    for folded in (False, True):
        factors = {reading.size for reading in readings(unit, folded) if reading.powers in kinds}
        if factors:
            return float(factors.pop()) if len(factors) == 1 else math.nan
    return math.nan


HEADER = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(((?:[^()]|\([^()]*\))*)\))\s*")
"""Pattern of a column's header that ends with a unit in square or round brackets."""


def name_and_unit(header: str) -> tuple[str, str]:
    """Return the name and the unit in a column's header, such as `Torque [N.m]`, `Torque / Nm` or `torque_Nm`.

    A text in brackets at the end counts as the unit even if it is not a known unit. The unknown unit is then reported
    later instead of being taken for part of the name. The unit is an empty text if the header states none.
    """
    # First form: a unit in brackets at the end of the header.
    bracketed = HEADER.fullmatch(header)
    if bracketed:
        return bracketed[1].strip(), (bracketed[2] or bracketed[3] or "").strip()
    # Other forms: the text after a slash, a comma, an underscore or "in", if this text is a known unit.
    for mark in re.finditer(r"\s*[/,]\s*|_+|\s+in\s+", header):
        name, unit = header[: mark.start()].strip(), header[mark.end() :].strip()
        if name and unit and (readings(unit) or readings(unit, folded=True)):
            return name, unit
    return header.strip(), ""


UNITS = {name: (si, factor_to(name, si)) for si, names in USUAL.items() for name in (si, *names) if name}
"""Name of a unit, as the package prints it -> the SI unit of the same kind of quantity, and the factor that converts a
number to this SI unit."""
