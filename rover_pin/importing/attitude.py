"""Which way the rover pointed: yaw, pitch and roll from angles, quaternions, a compass, or its course."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np

from rover_pin.formula import course, evaluate, quoted, unwrapped
from rover_pin.importing.guess import Guess, Recording, column
from rover_pin.importing.words import COMPASS, COURSE, NO_ANGLE, ODOMETRY, PITCH, ROLL, YAW, Word

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


def headings(seen: Recording, x: np.ndarray | None, y: np.ndarray | None) -> Iterator[Guess]:
    """Yield body_yaw: a yaw, a quaternion's, a compass's, else the course."""
    angle, sure, why = _yaw(seen)
    if angle:
        told = seen.values({"formula": angle}, "body_yaw")
        if x is not None and y is not None:
            yield _turned(seen, angle, told, x, y, (sure, why))
        else:
            yield Guess("body_yaw", {"formula": angle}, why, sure)
    elif x is not None and y is not None:
        why = "no heading is recorded, so the course stands for it: wrong by the angle of any crabbing"
        yield Guess("body_yaw", {"formula": BY_COURSE}, why)


def _yaw(seen: Recording) -> tuple[str, bool, str]:
    """Return a formula of the yaw as recorded [rad], whether that is certain, and why it is thought."""
    exact = next((each for each in seen.words if each.name == "body_yaw"), None)
    if exact is not None:
        return f"unwrapped({quoted(exact.name)})", True, "its name"
    four = quaternion(seen)
    if four:
        return f"yaw({', '.join(four)})", True, "a quaternion, world z-y-x"
    each = seen.best(lambda one: _score(one, YAW))
    if each is None:
        return "", False, ""
    unit, sure = angle_unit(seen, each)
    inner = quoted(each.name)
    return (
        f"unwrapped(radians({inner}))" if unit == "deg" else f"unwrapped({inner})",
        sure,
        f"its name; taken as {unit}",
    )


def _turned(
    seen: Recording, angle: str, told: np.ndarray, x: np.ndarray, y: np.ndarray, known: tuple[bool, str]
) -> Guess:
    """Return the way of counting under which the heading follows the course, the usual one if it does."""
    sure, why = known
    way = course(x, y, seen.t)
    usual = _off(told, way)
    if usual < FOLLOWS:
        return Guess("body_yaw", {"formula": angle}, why, sure)
    others = {form: _off(evaluate(form.format("told"), {"told": told}, "a heading"), way) for form in TURNS}
    best = min(others, key=lambda form: others[form])
    if others[best] > FOLLOWS or others[best] > 0.5 * usual:
        return Guess("body_yaw", {"formula": angle}, f"{why}; it does not follow the course", False)
    return Guess("body_yaw", {"formula": best.format(angle)}, f"{why}; it follows the course if {TURNS[best]}")


def _off(told: np.ndarray, way: np.ndarray) -> float:
    """Return the angle [rad] between heading and course in the middle; a rover may drive backwards now and then."""
    off = np.abs(np.angle(np.exp(1j * (told - way))))
    known = off[np.isfinite(off)]
    return float(np.median(known)) if known.size else math.pi


def tilts(seen: Recording) -> Iterator[Guess]:
    """Yield body_pitch and body_roll."""
    four = quaternion(seen)
    for target, words, function in (("body_pitch", PITCH, "pitch"), ("body_roll", ROLL, "roll")):
        each = seen.best(partial(_tilt_score, words=words, target=target))
        if each is not None:
            unit, sure = angle_unit(seen, each)
            sign = "; nose down is taken as positive" if target == "body_pitch" else "; right side down is positive"
            own = each.name == target
            yield Guess(
                target, column(each, unit), "its name" + ("" if own else sign), own or (sure and target != "body_pitch")
            )
        elif four:
            yield Guess(target, {"formula": f"{function}({', '.join(four)})"}, "a quaternion, world z-y-x", True)


def _tilt_score(each: Word, words: set[str], target: str) -> float:
    return 100.0 if each.name == target else _score(each, words)


def _score(each: Word, words: set[str]) -> float:
    if not each.has(words) or each.has(NO_ANGLE) or (each.unit and each.unit not in ANGLES):
        return 0.0
    return 1.0 - 0.5 * each.has(ODOMETRY) - 0.2 * each.has(COMPASS) - 0.3 * each.has(COURSE)


def angle_unit(seen: Recording, each: Word) -> tuple[str, bool]:
    """Return the unit of an angle, and whether that is certain: told by its name, or beyond a turn in radians."""
    if each.unit in ANGLES:
        return each.unit, True
    values = seen.table[each.name].to_numpy(dtype=float)
    known = values[np.isfinite(values)]
    most = float(np.max(np.abs(known), initial=0.0))
    return ("deg", True) if most > 2.0 * math.pi + 0.1 and not _is_unwrapped(known) else ("rad", False)


def _is_unwrapped(values: np.ndarray) -> bool:
    """Whether a large angle comes of turning on and on: it then never jumps, and grows slowly from row to row."""
    steps = np.abs(np.diff(values))
    return bool(
        values.size > 1
        and np.max(steps) < 0.5
        and np.ptp(unwrapped(values)) < 20.0 * math.pi
        and np.max(np.abs(values)) < 20.0
    )


def quaternion(seen: Recording) -> tuple[str, ...]:
    """Return the columns x, y, z, w of a quaternion as a formula names them, or nothing."""
    for pattern in (_lettered, _numbered):
        found = pattern(seen)
        if found:
            square = sum(seen.table[name].to_numpy(dtype=float) ** 2 for name in found)
            if abs(float(np.nanmedian(square)) - 1.0) < 0.05:
                return tuple(map(quoted, found))
    return ()


def _lettered(seen: Recording) -> tuple[str, ...]:
    def named(letter: str) -> Callable[[Word], float]:
        def score(each: Word) -> float:
            own = {"q", "quat", "quaternion", "orientation", "rot", "rotation"}
            last = each.tokens[-1] if each.tokens else ""
            told = last == f"q{letter}" or (last == letter and each.has(own))
            return float(told) * (1.0 - 0.5 * each.has(ODOMETRY) - 0.3 * each.has({"imu"}))

        return score

    found = [seen.best(named(letter)) for letter in "xyzw"]
    return tuple(each.name for each in found if each) if all(found) else ()


def _numbered(seen: Recording) -> tuple[str, ...]:
    """Return q0 to q3 with the real part first, as their numbers from 0 have it."""
    found = {each.tokens[-1]: each.name for each in seen.words if len(each.tokens) > 1 and each.tokens[-2] == "q"}
    return tuple(found[str(at)] for at in (1, 2, 3, 0)) if {"0", "1", "2", "3"} <= found.keys() else ()
