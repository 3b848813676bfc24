"""What the wheels did: rates of each, of each side, or of speed and turn; currents, duties, steering, joints."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from functools import partial

import numpy as np

from rover_pin.base.formula import quoted
from rover_pin.base.units import UNITS
from rover_pin.logs.importing.attitude import BOTH_WAYS, angle_unit, share_back
from rover_pin.logs.importing.guess_record import Guess, Recording, column
from rover_pin.logs.importing.words import (
    AHEAD,
    COMMAND,
    CURRENT,
    DUTY,
    ODOMETRY,
    RATE,
    STEER,
    TURN,
    WHEEL,
    Word,
    corner,
)
from rover_pin.rover.parts import WheelMount
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_places

RATES = ("rad/s", "rpm", "deg/s", "rev/s")
SPEEDS = ("m/s", "cm/s", "mm/s", "km/h")
UNTOLD = (*RATES, "m/s", "mm/s")
"""Units that rates of wheels have without saying so."""
USUAL = 1.1
"""Rim speed over travel speed that is usual."""
NEAR = math.log(2.5)
"""How far the best unit's ratio may be from that, as a logarithm."""


def wheel_guesses(recording: Recording, speed: np.ndarray | None) -> Iterator[Guess]:
    """Yield rates, currents, duties and steering, as far as recorded; `speed` [m/s] is along the heading."""
    yield from _rates(recording, speed)
    yield from (_current(mount, word) for mount, word in matched(recording, CURRENT).items())
    for mount, word in matched(recording, DUTY).items():
        scale = {"scale": 0.01} if _reach(recording, word) > 1.5 else {}
        percent = "; taken as percent" if scale else ""
        yield Guess(f"duty_{mount}", column(word, "", **scale), f"its name{percent}", word.name == f"duty_{mount}")
    steered = {mount.name for mount in recording.rover.wheels if mount.steer_dof is not None}
    for mount, word in matched(recording, STEER).items():
        if mount in steered:
            unit, sure = angle_unit(recording, word)
            yield Guess(f"steer_{mount}", column(word, unit), "its name; left is positive", sure)


def _current(mount: str, word: Word) -> Guess:
    """Return a current in amperes where its name says so, else as counts of unknown scale and zero."""
    name = f"current_{mount}_A"
    if word.unit in ("A", "mA") or word.name == name:
        return Guess(name, column(word), "its name", word.name == name)
    why = "its name; it has no unit, so it is taken as counts of unknown scale and zero"
    return Guess(f"raw_current_{mount}", column(word._replace(unit="")), why, word.name == f"raw_current_{mount}")


def _reach(recording: Recording, word: Word) -> float:
    return float(np.nanmax(np.abs(recording.table[word.name].to_numpy(dtype=float)), initial=0.0))


def matched(recording: Recording, words: set[str], units: Collection[str] = ()) -> dict[str, Word]:
    """Return the column of each wheel whose name has one of these words, or one of these units: that needs no language.

    Whose it is tells the name of the wheel's joint, or its corner.
    """
    best: dict[str, tuple[float, Word]] = {}
    for word in recording.words:
        if not (word.has(words) or word.unit in units):
            continue
        score = 0.5 + 0.5 * word.has(words) - 0.5 * word.has(COMMAND) + 0.5 * word.has(WHEEL)
        for mount in _owners(word, recording.rover):
            if score > best.get(mount, (0.0, word))[0]:
                best[mount] = (score, word)
    return {mount: word for mount, (_, word) in best.items()}


def _owners(word: Word, rover: Rover) -> list[str]:
    """Return the wheels that a column is of: by the joint's name, by its corner, or all of a side."""
    by_joint = [mount.name for mount in rover.wheels if rover.model.names[mount.joint] in word.name]
    if by_joint:
        return by_joint
    exact = [mount.name for mount in rover.wheels if word.tokens[-len(tokens(mount.name)) :] == tokens(mount.name)]
    if exact:
        return exact
    axle, side = corner(word.tokens)
    mounts = [mount for mount in rover.wheels if side in ("", mount.side)]
    if axle.isdigit():
        return _numbered(mounts, rover, int(axle), side)
    if not axle:
        return [mount.name for mount in mounts] if side else []
    return [mount.name for mount in mounts if side and mount.axle in _axles(rover, axle)]


def tokens(name: str) -> tuple[str, ...]:
    """Return a wheel's name as the tokens of a column's name."""
    return tuple(name.lower().split("_"))


def _numbered(mounts: list[WheelMount], rover: Rover, number: int, side: str) -> list[str]:
    """Return wheel `number`, counted from 1: along its side where known, else left before right, front first."""
    if side:
        return [mount.name for mount in mounts if mount.axle == number - 1]
    return [rover.wheels[number - 1].name] if 1 <= number <= len(rover.wheels) else []


def _axles(rover: Rover, place: str) -> list[int]:
    last = max(mount.axle for mount in rover.wheels)
    return {"front": [0], "rear": [last]}.get(place, list(range(1, last)))


def _rates(recording: Recording, speed: np.ndarray | None) -> Iterator[Guess]:
    by_wheel = {mount: word for mount, word in matched(recording, RATE | {"drehzahl"}, RATES).items() if _is_rate(word)}
    if len(by_wheel) < len(recording.rover.wheels):
        yield from _of_twist(recording)
        return
    unit, sure = _rate_unit(recording, by_wheel, speed)
    radii = {mount.name: float(mount.wheel.r) for mount in recording.rover.wheels}
    for mount, word in by_wheel.items():
        values = recording.table[word.name].to_numpy(dtype=float)
        turned = _against(values, speed)
        why = "its name" + (f"; taken as {unit} by the speed of the rover" if not word.unit else "")
        why += "; turned round, as it runs against the travel" if turned else ""
        exact = word.name == f"wheel_rate_{mount}" and not turned
        yield Guess(
            f"wheel_rate_{mount}", _entry(word, unit, radii[mount], turned), why, exact or (sure and not turned)
        )


def _is_rate(word: Word) -> bool:
    unit_fits = not word.unit or word.unit in (*RATES, *SPEEDS)
    return unit_fits and not word.has({"imu", "gyro", "angular", "gps", "body", "odom", "linear", "twist"})


def _entry(word: Word, unit: str, radius: float, turned: bool) -> dict[str, object]:
    sign = "-" if turned else ""
    if unit in SPEEDS:
        factor = UNITS[unit][1]
        scale = "" if factor == 1.0 else f"{factor:.6g} * "
        return {"formula": f"{sign}{scale}{quoted(word.name)} / {radius:.6g}"}
    return column(word, unit, **({"scale": -1.0} if turned else {}))


def _against(values: np.ndarray, speed: np.ndarray | None) -> bool:
    if speed is None:
        return False
    finite = np.isfinite(values + speed)
    back = share_back(values)
    if np.mean(speed[finite] < 0.0) < BOTH_WAYS and BOTH_WAYS < back < 1.0 - BOTH_WAYS:
        return False  # the heading is but the course, and tells no sense
    size = math.sqrt(float(np.sum(values[finite] ** 2)) * float(np.sum(speed[finite] ** 2)))
    return size > 0.0 and float(np.sum(values[finite] * speed[finite])) / size < -0.5


def _rate_unit(recording: Recording, by_wheel: Mapping[str, Word], speed: np.ndarray | None) -> tuple[str, bool]:
    """Return the unit of the rates: by a name, else that under which rims run about as fast as the rover."""
    stated_unit = next((word.unit for word in by_wheel.values() if word.unit), "")
    if stated_unit:
        return stated_unit, True
    if all(word.name == f"wheel_rate_{mount}" for mount, word in by_wheel.items()):
        return "rad/s", True
    rates = np.nanmean([np.abs(recording.table[word.name].to_numpy(dtype=float)) for word in by_wheel.values()], axis=0)
    if speed is None:
        return "rad/s", False
    use = np.isfinite(rates + speed) & (rates > 0.1 * np.nanmax(rates))
    if not use.any() or not np.median(np.abs(speed[use])) > 0.0:
        return "rad/s", False
    radius = float(np.mean(recording.rover.radii))
    times = {unit: UNITS[unit][1] * (1.0 if unit in SPEEDS else radius) for unit in UNTOLD}
    seen_ratio = float(np.median(rates[use]) / np.median(np.abs(speed[use])))
    off = {unit: abs(math.log(max(seen_ratio * times[unit], 1e-12) / USUAL)) for unit in times}
    best = min(off, key=lambda unit: off[unit])
    return (best, False) if off[best] < NEAR else ("rad/s", False)


def _of_twist(recording: Recording) -> Iterator[Guess]:
    """Yield side rates of a speed and a turn that are commanded or reported: v +- omega b / 2."""
    ahead = recording.best(lambda word: _twist_score(word, AHEAD) if word.tokens[-1:] != ("z",) else 0.0)
    turn = recording.best(
        lambda word: _twist_score(word, TURN) or 0.9 * (word.has({"angular"}) and word.tokens[-1] == "z")
    )
    if ahead is None or turn is None:
        return
    places = wheel_places(recording.rover)
    for mount in recording.rover.wheels:
        half = abs(float(places[mount.name][1]))
        sign = "-" if mount.side == "l" else "+"
        radius = float(mount.wheel.r)
        formula = f"({quoted(ahead.name)} {sign} {half:.6g} * {quoted(turn.name)}) / {radius:.6g}"
        why = "the wheels' own rates are not recorded; v -+ omega b / 2 of a speed and a turn, as a driver has it"
        yield Guess(f"wheel_rate_{mount.name}", {"formula": formula}, why)


def _twist_score(word: Word, words: set[str]) -> float:
    matches = word.has(ODOMETRY | COMMAND | {"twist"}) and word.has(words)
    return float(matches) * (1.0 + 0.2 * word.has(ODOMETRY) + 0.1 * (word.tokens[-1] == "x"))


def joint_guesses(recording: Recording) -> Iterator[Guess]:
    """Yield the angles of the suspension, known by their names in the rover's TOML or by their joints in the URDF."""
    model = recording.rover.model
    at = {model.joints[joint].idx_q: model.names[joint] for joint in range(2, model.njoints)}
    for name, place in recording.rover.angles.items():
        if name.startswith("steer_"):
            continue
        name_tokens = tokens(name)
        word = recording.best(partial(_joint_score, name_tokens=name_tokens, joint=at.get(place, "")))
        if word is not None:
            unit, sure = angle_unit(recording, word)
            yield Guess(name, column(word, unit), "its name", sure or word.name == name)


def _joint_score(word: Word, name_tokens: tuple[str, ...], joint: str) -> float:
    rate = word.has(RATE - {"v", "rad"}) or word.has({"effort", "torque", "current"})
    if rate:
        return 0.0
    if joint and joint in word.name:
        return 2.0
    return float(word.tokens[-len(name_tokens) :] == name_tokens)
