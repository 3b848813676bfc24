"""Where the rover was: x, y and height of any names, or latitude and longitude, in metres."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rover_pin.base.formula import quoted
from rover_pin.logs.importing.guess_record import Guess, Recording, column
from rover_pin.logs.importing.words import LATITUDE, LONGITUDE, MEASURED, NO_PLACE, ODOMETRY, Word, X, Y, Z

FASTEST = 3.0
"""No planetary rover drives faster [m/s]; places whose unit is not given are then in millimetres."""
LENGTHS = ("m", "mm", "cm", "km")


def places(recording: Recording) -> Iterator[Guess]:
    """Yield body_x, body_y and body_z."""
    x, y = _pair(recording)
    if x is None or y is None:
        yield from _geographic(recording)
    else:
        unit = x.unit if x.unit in LENGTHS else _unit(recording, x, y)
        has_unit = x.unit in LENGTHS
        why = "its name and unit" if has_unit else f"its name; taken as {unit} by the speed that follows"
        odometry = "; its name says odometry, which knows no slip" if x.has(ODOMETRY) else ""
        for target, word in (("body_x", x), ("body_y", y)):
            yield Guess(target, column(word, unit), why + odometry, word.name == target or (has_unit and not odometry))
        yield from _height(recording, unit)
        return
    yield from _height(recording, "m")


def _pair(recording: Recording) -> tuple[Word | None, Word | None]:
    """Return x and y that are called alike but for that letter."""
    x = recording.best(lambda word: _score(word, X, "body_x"))
    if x is None:
        return None, None
    stem = set(x.tokens) - X
    return x, recording.best(lambda word: _score(word, Y, "body_y") * (1.0 if set(word.tokens) - Y == stem else 0.3))


def _score(word: Word, letters: set[str], exact: str) -> float:
    if word.name == exact:
        return 100.0
    if not word.has(letters) or word.has(NO_PLACE) or (word.unit and word.unit not in LENGTHS):
        return 0.0
    return (1.0 + 2.0 * word.has(MEASURED) - 0.7 * word.has(ODOMETRY)) / (1.0 + 0.02 * len(word.tokens))


def _unit(recording: Recording, x: Word, y: Word) -> str:
    values = recording.table[x.name].to_numpy(dtype=float) + 1j * recording.table[y.name].to_numpy(dtype=float)
    finite = np.isfinite(values)
    t, values = recording.t[finite], values[finite]
    step = max(1, round(1.0 / max(float(np.median(np.diff(t))), 1e-3))) if len(t) > 1 else 1
    if len(t) < 10 or len(t) <= step:
        return "m"
    speed = np.abs(values[step:] - values[:-step]) / (t[step:] - t[:-step])
    return "mm" if float(np.percentile(speed, 75)) > FASTEST else "m"


def _height(recording: Recording, unit: str) -> Iterator[Guess]:
    z = recording.best(lambda word: _score(word, Z, "body_z"))
    if z is not None:
        yield Guess("body_z", column(z, unit), "its name", z.name == "body_z" or z.unit in LENGTHS)


def _geographic(recording: Recording) -> Iterator[Guess]:
    lat = recording.best(lambda word: float(word.has(LATITUDE)))
    lon = recording.best(lambda word: float(word.has(LONGITUDE)))
    if lat is None or lon is None:
        return
    pair = f"({quoted(lat.name)}, {quoted(lon.name)})"
    for target, function in (("body_x", "east"), ("body_y", "north")):
        why = f"metres {function} of the first place, from latitude and longitude [deg]"
        yield Guess(target, {"formula": f"{function}{pair}"}, why)
