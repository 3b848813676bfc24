"""The one grammar of units, for every value, column and option that names one; inside, everything is SI.

A unit is symbols with whole powers one after another, over others: `N m`, `N·m`, `N.m`, `N*m`, `Nm`, `m/s2`, `m s^-2`,
`rad/(N m)`. Where letters can be read in several ways (`Nms` as N m s or newton milliseconds, a pound as force or mass)
the kind of quantity that is asked for decides. Capitals are looked at first, and forgiven where nothing is read so.
"""

from __future__ import annotations

import math
import re
import unicodedata
from fractions import Fraction
from functools import cache, lru_cache
from typing import NamedTuple

LBF, INCH, FOOT = 4.4482216152605, 0.0254, 0.3048
"""Pound-force [N], inch and foot [m]."""

BASE = ("m", "kg", "s", "A", "K", "rad")
"""Those of SI, and the angle beside them: a torque and a torsional stiffness are two kinds."""
PREFIXES = {"n": "1e-9", "u": "1e-6", "m": "1e-3", "c": "1e-2", "k": "1e3", "M": "1e6"}
METRIC = {"m": "", "s": "", "A": "", "K": "", "rad": "", "N": "kg m/s^2", "J": "N m", "W": "N m/s", "Pa": "N/m^2",
          "V": "W/A", "ohm": "V/A", "Hz": "1/s"}  # fmt: skip
"""Symbols that take a prefix, and what they are made of."""
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
"""Symbols and words that take none: how many of what. A pound is a force where one is asked for, else a mass."""
USUAL = {
    "": ("%",), "m": ("mm", "cm", "km", "in", "ft"), "rad": ("deg",), "s": ("ms", "us", "ns", "min"), "kg": ("g",),
    "N": ("kN", "lbf", "kgf"), "N m": ("mN m", "kN m", "lbf in", "lbf ft"), "V": ("mV",), "A": ("mA",), "ohm": (),
    "Pa": ("N/m^2", "kPa", "MPa", "kN/m^2", "psi"), "m/s": ("mm/s", "cm/s", "km/h"), "m/s^2": (), "rad/m": ("deg/m",),
    "rad/s": ("rpm", "deg/s", "rev/s"), "kg/m^3": ("g/cm^3", "t/m^3", "lb/ft^3"),
}  # fmt: skip
"""SI's name of a kind of quantity, and what else it is often given in: what errors and tables list."""
LONGEST = 24
"""Letters of a unit; what is longer is none."""
SPELLINGS = str.maketrans(
    {"°": "deg", "º": "deg", "Ω": "ohm", "μ": "u", "µ": "u", "−": "-", "·": " ", "⋅": " ", "*": " "}
)
POWER = re.compile(r"(?:\^?\(?([+-]?\d)\)?)?[ .-]*(.*)")


class Unit(NamedTuple):
    """One reading of a unit: what a number in it is multiplied by to be in SI, and the powers of `BASE`."""

    size: Fraction
    powers: tuple[int, ...]

    def times(self, factor: Unit, power: int) -> Unit:
        """Return the product with a whole power of another unit."""
        powers = tuple(mine + power * theirs for mine, theirs in zip(self.powers, factor.powers, strict=True))
        return Unit(self.size * factor.size**power, powers)


NONE = Unit(Fraction(1), (0,) * len(BASE))


@cache
def _symbols(folded: bool) -> dict[str, tuple[Unit, ...]]:
    """Return what every symbol stands for; `folded` in small letters."""
    symbols: dict[str, tuple[Unit, ...]] = {"1": (NONE,)}

    def add(name: str, size: float | str, unit: Unit) -> None:
        key = name.lower() if folded else name
        symbols[key] = (*symbols.get(key, ()), unit._replace(size=Fraction(str(size)) * unit.size))

    for name in BASE:
        add(name, 1.0, Unit(Fraction(1), tuple(int(base == name) for base in BASE)))
    exact = symbols if not folded else _symbols(False)
    for name, of in METRIC.items():
        unit = _over(of, exact)[0] if of else exact[name][0]
        for prefix, size in {"": "1", **PREFIXES}.items() if of else PREFIXES.items():
            add(prefix + name, size, unit)
    for name, count, of in OTHERS:
        for word in {name, f"{name}s"} if name.isalpha() and len(name) > 1 else {name}:
            add(word, count, _over(of, exact)[0])
    return symbols


def _over(text: str, symbols: dict[str, tuple[Unit, ...]]) -> list[Unit]:
    """Return the readings of a product over others."""
    above, *below = (re.sub(r"^\((.*)\)$", r"\1", part.strip()) for part in text.split("/"))
    ways = _product(above, symbols, {})
    for part in below:
        under = _product(part, symbols, {}) if part else []
        ways = [unit.times(divisor, -1) for unit in ways for divisor in under]
    return ways


def _product(text: str, symbols: dict[str, tuple[Unit, ...]], cache: dict[str, list[Unit]]) -> list[Unit]:
    """Return the readings of symbols one after another, with a blank, point or hyphen between them or nothing."""
    if not text:
        return [NONE]
    if text not in cache:
        ways = set()
        for end in range(1, len(text) + 1):
            for unit in symbols.get(text[:end], ()):
                power, tail = POWER.findall(text[end:])[0]
                ways |= {after.times(unit, int(power or 1)) for after in _product(tail, symbols, cache)}
        cache[text] = sorted(ways)
    return cache[text]


@lru_cache(maxsize=1024)
def readings(text: str, folded: bool = False) -> tuple[Unit, ...]:
    """Return every way to read a unit, none where it is no unit; `folded` takes small letters for capitals."""
    plain = unicodedata.normalize("NFKC", text.strip().translate(SPELLINGS)).translate(SPELLINGS)
    plain = plain.replace("**", "^").replace(" per ", "/")
    if plain in ("", "-"):
        return (NONE,)
    return tuple(_over(plain.lower() if folded else plain, _symbols(folded))) if len(plain) <= LONGEST else ()


def factor_to(unit: str, expected: str) -> float:
    """Return the factor from a unit to `expected`, an SI unit; NaN where it is of another kind."""
    if unit == expected:
        return 1.0
    kinds = {reading.powers for reading in readings(expected)}
    for folded in (False, True):
        factors = {reading.size for reading in readings(unit, folded) if reading.powers in kinds}
        if factors:
            return float(factors.pop()) if len(factors) == 1 else math.nan
    return math.nan


HEADER = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(((?:[^()]|\([^()]*\))*)\))\s*")


def name_and_unit(header: str) -> tuple[str, str]:
    """Return the name and the unit of a column: `Torque [N.m]`, `Torque (Nm)`, `Torque / Nm`, `torque_Nm`.

    What is in brackets at the end is the unit, also where it is none that can be read; empty where there is none.
    """
    bracketed = HEADER.fullmatch(header)
    if bracketed:
        return bracketed[1].strip(), (bracketed[2] or bracketed[3] or "").strip()
    for mark in re.finditer(r"\s*[/,]\s*|_+|\s+in\s+", header):
        name, unit = header[: mark.start()].strip(), header[mark.end() :].strip()
        if name and unit and (readings(unit) or readings(unit, folded=True)):
            return name, unit
    return header.strip(), ""


UNITS = {name: (si, factor_to(name, si)) for si, names in USUAL.items() for name in (si, *names) if name}
"""Units by the name that the package gives them: the SI unit of their kind, and how many of it."""
