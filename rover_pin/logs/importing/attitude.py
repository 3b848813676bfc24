"""Which way the rover pointed: yaw, pitch and roll from angles, quaternions, a compass, or its course."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np

from rover_pin.base.formula import course, evaluate, quoted, unwrapped
from rover_pin.logs.importing.guess_record import Guess, Recording, column
from rover_pin.logs.importing.words import COMPASS, COURSE, NO_ANGLE, ODOMETRY, PITCH, ROLL, YAW, Word

ANGLES = ("rad", "deg")
FOLLOWS = 0.3
"""RMS angle [rad] between course and heading of a rover that goes where it points."""
TURNS = {
    "{}": "as it is",
    "pi / 2 - {}": "counted clockwise from north, the y axis",
    "-{}": "counted clockwise from the x axis",
    "{} + pi / 2": "a quarter of a turn behind the course",
    "{} - pi / 2": "a quarter of a turn ahead of the course",
    "{} + pi": "half a turn off the course",
}
"""Ways to count a heading, the usual ones first, as formulas of it."""


BY_COURSE = "course(body_x, body_y, t_s)"
"""What stands for a heading that is not recorded."""
BOTH_WAYS = 0.05
"""Share of rows at which the wheels run the other way, from which a rover drives both ways."""
TURNS_FROM = 0.1
"""Share of the fastest rate from which a wheel turns: less is noise of one that stands."""


def share_back(rates: np.ndarray) -> float:
    """Return the share of the rows at which a wheel turns backwards, of those at which it turns at all."""
    size = np.abs(np.nan_to_num(rates))
    turning = rates[size > TURNS_FROM * np.max(size, initial=0.0)]
    return float(np.mean(turning < 0.0)) if turning.size else 0.0


def backwards(rates: Mapping[str, np.ndarray]) -> Guess | None:
    """Return the heading by the course of a rover whose wheels run both ways; None where they run one way."""
    if not BOTH_WAYS < share_back(np.nanmean(list(rates.values()), axis=0)) < 1.0 - BOTH_WAYS:
        return None
    why = "no heading is recorded, so the course stands for it, turned round where the wheels run backwards"
    return Guess("body_yaw", {"formula": f"heading(body_x, body_y, t_s, {' + '.join(rates)})"}, why)


def headings(recording: Recording, x: np.ndarray | None, y: np.ndarray | None) -> Iterator[Guess]:
    """Yield body_yaw: a yaw, a quaternion's, a compass's, else the course."""
    angle, sure, why = _yaw(recording)
    if angle:
        yaw = recording.values({"formula": angle}, "body_yaw")
        if x is not None and y is not None:
            yield _turned(recording, angle, yaw, x, y, (sure, why))
        else:
            yield Guess("body_yaw", {"formula": angle}, why, sure)
    elif x is not None and y is not None:
        why = "no heading is recorded, so the course stands for it: wrong by the angle of any crabbing"
        yield Guess("body_yaw", {"formula": BY_COURSE}, why)


def _yaw(recording: Recording) -> tuple[str, bool, str]:
    """Return a formula of the yaw as recorded [rad], whether that is certain, and why it is thought."""
    exact = next((word for word in recording.words if word.name == "body_yaw"), None)
    if exact is not None:
        return f"unwrapped({quoted(exact.name)})", True, "its name"
    four = quaternion(recording)
    if four:
        return f"yaw({', '.join(four)})", True, "a quaternion, world z-y-x"
    word = recording.best(lambda candidate: _score(candidate, YAW))
    if word is None:
        return "", False, ""
    unit, sure = angle_unit(recording, word)
    inner = quoted(word.name)
    return (
        f"unwrapped(radians({inner}))" if unit == "deg" else f"unwrapped({inner})",
        sure,
        f"its name; taken as {unit}",
    )


def _turned(
    recording: Recording, angle: str, yaw: np.ndarray, x: np.ndarray, y: np.ndarray, certainty: tuple[bool, str]
) -> Guess:
    """Return the way of counting under which the heading follows the course, the usual one if it does."""
    sure, why = certainty
    way = course(x, y, recording.t)
    offset = _off(yaw, way)
    if offset < FOLLOWS:
        return Guess("body_yaw", {"formula": angle}, why, sure)
    others = {form: _off(evaluate(form.format("yaw"), {"yaw": yaw}, "a heading"), way) for form in TURNS}
    best = min(others, key=lambda form: others[form])
    if others[best] > FOLLOWS or others[best] > 0.5 * offset:
        return Guess("body_yaw", {"formula": angle}, f"{why}; it does not follow the course", False)
    return Guess("body_yaw", {"formula": best.format(angle)}, f"{why}; it follows the course if {TURNS[best]}")


def _off(yaw: np.ndarray, way: np.ndarray) -> float:
    """Return the angle [rad] between heading and course in the middle; a rover may drive backwards now and then."""
    off = np.abs(np.angle(np.exp(1j * (yaw - way))))
    finite = off[np.isfinite(off)]
    return float(np.median(finite)) if finite.size else math.pi


def tilts(recording: Recording) -> Iterator[Guess]:
    """Yield body_pitch and body_roll."""
    four = quaternion(recording)
    for target, words, function in (("body_pitch", PITCH, "pitch"), ("body_roll", ROLL, "roll")):
        word = recording.best(partial(_tilt_score, words=words, target=target))
        if word is not None:
            unit, sure = angle_unit(recording, word)
            sign = "; nose down is taken as positive" if target == "body_pitch" else "; right side down is positive"
            exact = word.name == target
            yield Guess(
                target,
                column(word, unit),
                "its name" + ("" if exact else sign),
                exact or (sure and target != "body_pitch"),
            )
        elif four:
            yield Guess(target, {"formula": f"{function}({', '.join(four)})"}, "a quaternion, world z-y-x", True)


def _tilt_score(word: Word, words: set[str], target: str) -> float:
    return 100.0 if word.name == target else _score(word, words)


def _score(word: Word, words: set[str]) -> float:
    if not word.has(words) or word.has(NO_ANGLE) or (word.unit and word.unit not in ANGLES):
        return 0.0
    return 1.0 - 0.5 * word.has(ODOMETRY) - 0.2 * word.has(COMPASS) - 0.3 * word.has(COURSE)


def angle_unit(recording: Recording, word: Word) -> tuple[str, bool]:
    """Return the unit of an angle, and whether that is certain: by its name, or beyond a turn in radians."""
    if word.unit in ANGLES:
        return word.unit, True
    values = recording.table[word.name].to_numpy(dtype=float)
    finite = values[np.isfinite(values)]
    most = float(np.max(np.abs(finite), initial=0.0))
    return ("deg", True) if most > 2.0 * math.pi + 0.1 and not _is_unwrapped(finite) else ("rad", False)


def _is_unwrapped(values: np.ndarray) -> bool:
    """Whether a large angle comes of turning on and on: it then never jumps, and grows slowly from row to row."""
    steps = np.abs(np.diff(values))
    return bool(
        values.size > 1
        and np.max(steps) < 0.5
        and np.ptp(unwrapped(values)) < 20.0 * math.pi
        and np.max(np.abs(values)) < 20.0
    )


def quaternion(recording: Recording) -> tuple[str, ...]:
    """Return the columns x, y, z, w of a quaternion as a formula names them, or nothing."""
    for pattern in (_lettered, _numbered):
        names = pattern(recording)
        if names:
            square = sum(recording.table[name].to_numpy(dtype=float) ** 2 for name in names)
            if abs(float(np.nanmedian(square)) - 1.0) < 0.05:
                return tuple(map(quoted, names))
    return ()


def _lettered(recording: Recording) -> tuple[str, ...]:
    def named(letter: str) -> Callable[[Word], float]:
        def score(word: Word) -> float:
            quaternion_words = {"q", "quat", "quaternion", "orientation", "rot", "rotation"}
            last = word.tokens[-1] if word.tokens else ""
            matches = last == f"q{letter}" or (last == letter and word.has(quaternion_words))
            return float(matches) * (1.0 - 0.5 * word.has(ODOMETRY) - 0.3 * word.has({"imu"}))

        return score

    parts = [recording.best(named(letter)) for letter in "xyzw"]
    return tuple(word.name for word in parts if word) if all(parts) else ()


def _numbered(recording: Recording) -> tuple[str, ...]:
    """Return q0 to q3 with the real part first, as their numbers from 0 have it."""
    names = {word.tokens[-1]: word.name for word in recording.words if len(word.tokens) > 1 and word.tokens[-2] == "q"}
    return tuple(names[str(at)] for at in (1, 2, 3, 0)) if {"0", "1", "2", "3"} <= names.keys() else ()
