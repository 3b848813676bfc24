"""Where the rover was: x, y and height of any names, or latitude and longitude, in metres."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rover_pin.formula import quoted
from rover_pin.importing.guess import Guess, Recording, column
from rover_pin.importing.words import LATITUDE, LONGITUDE, MEASURED, NO_PLACE, ODOMETRY, Word, X, Y, Z

FASTEST = 3.0
"""No planetary rover drives faster [m/s]; places whose unit is not told are then in millimetres."""
LENGTHS = ("m", "mm", "cm", "km")


def places(seen: Recording) -> Iterator[Guess]:
    """Yield body_x, body_y and body_z."""
    x, y = _pair(seen)
    if x is None or y is None:
        yield from _geographic(seen)
    else:
        unit = x.unit if x.unit in LENGTHS else _unit(seen, x, y)
        told = x.unit in LENGTHS
        why = "its name and unit" if told else f"its name; taken as {unit} by the speed that follows"
        odometry = "; its name says odometry, which knows no slip" if x.has(ODOMETRY) else ""
        for target, each in (("body_x", x), ("body_y", y)):
            yield Guess(target, column(each, unit), why + odometry, each.name == target or (told and not odometry))
        yield from _height(seen, unit)
        return
    yield from _height(seen, "m")


def _pair(seen: Recording) -> tuple[Word | None, Word | None]:
    """Return x and y that are called alike but for that letter."""
    x = seen.best(lambda each: _score(each, X, "body_x"))
    if x is None:
        return None, None
    stem = set(x.tokens) - X
    return x, seen.best(lambda each: _score(each, Y, "body_y") * (1.0 if set(each.tokens) - Y == stem else 0.3))


def _score(each: Word, letters: set[str], exact: str) -> float:
    if each.name == exact:
        return 100.0
    if not each.has(letters) or each.has(NO_PLACE) or (each.unit and each.unit not in LENGTHS):
        return 0.0
    return (1.0 + 2.0 * each.has(MEASURED) - 0.7 * each.has(ODOMETRY)) / (1.0 + 0.02 * len(each.tokens))


def _unit(seen: Recording, x: Word, y: Word) -> str:
    values = seen.table[x.name].to_numpy(dtype=float) + 1j * seen.table[y.name].to_numpy(dtype=float)
    known = np.isfinite(values)
    t, values = seen.t[known], values[known]
    step = max(1, round(1.0 / max(float(np.median(np.diff(t))), 1e-3))) if len(t) > 1 else 1
    if len(t) < 10 or len(t) <= step:
        return "m"
    speed = np.abs(values[step:] - values[:-step]) / (t[step:] - t[:-step])
    return "mm" if float(np.percentile(speed, 75)) > FASTEST else "m"


def _height(seen: Recording, unit: str) -> Iterator[Guess]:
    z = seen.best(lambda each: _score(each, Z, "body_z"))
    if z is not None:
        yield Guess("body_z", column(z, unit), "its name", z.name == "body_z" or z.unit in LENGTHS)


def _geographic(seen: Recording) -> Iterator[Guess]:
    lat = seen.best(lambda each: float(each.has(LATITUDE)))
    lon = seen.best(lambda each: float(each.has(LONGITUDE)))
    if lat is None or lon is None:
        return
    pair = f"({quoted(lat.name)}, {quoted(lon.name)})"
    for target, function in (("body_x", "east"), ("body_y", "north")):
        why = f"metres {function} of the first place, from latitude and longitude [deg]"
        yield Guess(target, {"formula": f"{function}{pair}"}, why)
