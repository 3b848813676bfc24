"""An inertial unit among the columns: which axes it has, which way they point, and its units."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from rover_pin.base.formula import change, integral
from rover_pin.logs.importing.column_names import COMMAND, ODOMETRY, Word
from rover_pin.logs.importing.evidence import independent, relation, scale_evidence
from rover_pin.logs.importing.recording import Entry, Guess, Recording, column

STANDARD_GRAVITY = 9.80665
"""What a reading of 1 g is [m/s^2]; local gravity differs from it by 0.3 % at most."""
GYRO = {"gyro", "gyr", "gyroscope", "drehrate", "gyroskop"}
ACCELEROMETER = {"acc", "accel", "accelerometer", "acceleration", "beschleunigung", "acelerometro"}
KINDS = {
    "gyro": (GYRO, {"rad/s": 1.0, "deg/s": math.pi / 180.0}),
    "accelerometer": (ACCELEROMETER, {"m/s^2": 1.0, "g": STANDARD_GRAVITY}),
}
"""What columns of a kind are called, and what their units are in SI."""
FRAMES = {"z up": (1.0, 1.0, 1.0), "z down": (1.0, -1.0, -1.0)}
"""Signs of x, y and z, x ahead: y is left where z is up, else right."""
AS_HEADING, AT_REST = (0.0, 0.05), (0.0, 0.05)
"""Logarithms of the turn rate over the heading's, of the mean upward force over gravity, and their spreads."""
Reading = tuple[list[Guess], float]


def inertial_units(
    words: Sequence[Word], recordings: Sequence[Recording], values: Sequence[Mapping[str, np.ndarray]]
) -> Iterator[list[Reading]]:
    """Yield the ways to read the gyroscope, then the accelerometer: guesses of its axes, and their log evidence.

    A turn rate about z is the heading's; the force upwards is gravity's on average.
    """
    for kind, (names, units) in KINDS.items():
        axes = _axes(words, names)
        if "z" not in axes:
            continue
        unit_of_name = axes["z"].unit if axes["z"].unit in units else ""
        readings: list[Reading] = []
        for unit in (unit_of_name,) if unit_of_name else units:
            for frame, signs in FRAMES.items():
                why = f"its name; {frame}" + ("" if unit_of_name else f", in {unit}")
                z = [units[unit] * signs[2] * item.columns[axes["z"].name] for item in recordings]
                log = _turns(z, recordings, values) if kind == "gyro" else _weighs(z)
                guesses = [
                    Guess(f"{kind}_{axis}", _entry(axes[axis], unit, sign), why)
                    for axis, sign in zip("xyz", signs, strict=True)
                    if axis in axes
                ]
                readings.append((guesses, log))
        yield readings


def _entry(word: Word, unit: str, sign: float) -> Entry:
    """Return an axis in its unit and the other way round where its sign is -; of g there is no unit but a scale."""
    scale = sign * (STANDARD_GRAVITY if unit == "g" else 1.0)
    entry = column(word._replace(unit="" if unit == "g" else unit))
    return entry if scale == 1.0 else {**entry, "scale": scale}


def _axes(words: Sequence[Word], names: set[str]) -> dict[str, Word]:
    """Return the columns of the axes, the first of each."""
    axes: dict[str, Word] = {}
    for word in words:
        tokens = set(word.tokens)
        ends = {token[:-1]: token[-1] for token in word.tokens if token[-1] in "xyz"}
        called = tokens | ({"gyro"} if {"imu", "angular"} <= tokens else set())
        axis = next((end for start, end in ends.items() if start in names or (not start and called & names)), "")
        if axis and not tokens & (COMMAND | ODOMETRY | {"cov", "covariance"}):
            axes.setdefault(axis, word)
    return axes


def _turns(
    z: Sequence[np.ndarray], recordings: Sequence[Recording], values: Sequence[Mapping[str, np.ndarray]]
) -> float:
    """Return the log Bayes factor of a turn rate by the heading's change over seconds."""
    total = 0.0
    for rate, recording, logged in zip(z, recordings, values, strict=True):
        t, yaw = recording.t, np.unwrap(np.nan_to_num(logged["body_yaw"]))
        at = np.unique(np.searchsorted(t, np.arange(t[0] + 1.0, t[-1] - 1.0, 1.0)))
        good = np.isfinite(rate)
        if good.sum() < 2 or len(at) < 10:
            continue
        x, y = change(integral(rate, t), t, good)[at], change(yaw, t, np.isfinite(logged["body_yaw"]))[at]
        total += float(relation(x @ y, np.linalg.norm(y), np.linalg.norm(x), independent(x, y), AS_HEADING))
    return total


def _weighs(z: Sequence[np.ndarray]) -> float:
    """Return the log Bayes factor of a force by its mean against gravity."""
    force = np.concatenate(list(z))
    known = force[np.isfinite(force)]
    mean = float(known.mean()) if known.size else 0.0
    return float(scale_evidence(mean, STANDARD_GRAVITY, len(force), AT_REST)) if mean > 0.0 else -math.inf
