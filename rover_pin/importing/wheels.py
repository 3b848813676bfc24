"""What the wheels did: rates of each, of each side, or of speed and turn; currents, duties, steering, joints."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from functools import partial

import numpy as np

from rover_pin.body.parts import WheelMount
from rover_pin.body.rover import Rover
from rover_pin.body.wheel_base import wheel_places
from rover_pin.formula import quoted
from rover_pin.importing.attitude import BOTH_WAYS, angle_unit, share_back
from rover_pin.importing.guess import Guess, Recording, column
from rover_pin.importing.words import (
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
from rover_pin.units import UNITS

RATES = ("rad/s", "rpm", "deg/s", "rev/s")
SPEEDS = ("m/s", "cm/s", "mm/s", "km/h")
UNTOLD = (*RATES, "m/s", "mm/s")
"""Units that rates of wheels have without saying so."""
USUAL = 1.1
"""Rim speed over travel speed that is usual."""
NEAR = math.log(2.5)
"""How far the best unit's ratio may be from that, as a logarithm."""


def wheel_guesses(seen: Recording, speed: np.ndarray | None) -> Iterator[Guess]:
    """Yield rates, currents, duties and steering, as far as recorded; `speed` [m/s] is along the heading."""
    yield from _rates(seen, speed)
    yield from (_current(mount, each) for mount, each in matched(seen, CURRENT).items())
    for mount, each in matched(seen, DUTY).items():
        scale = {"scale": 0.01} if _reach(seen, each) > 1.5 else {}
        percent = "; taken as percent" if scale else ""
        yield Guess(f"duty_{mount}", column(each, "", **scale), f"its name{percent}", each.name == f"duty_{mount}")
    steered = {mount.name for mount in seen.rover.wheels if mount.steer_dof is not None}
    for mount, each in matched(seen, STEER).items():
        if mount in steered:
            unit, sure = angle_unit(seen, each)
            yield Guess(f"steer_{mount}", column(each, unit), "its name; left is positive", sure)


def _current(mount: str, each: Word) -> Guess:
    """Return a current in amperes where its name says so, else as counts of unknown scale and zero."""
    name = f"current_{mount}_A"
    if each.unit in ("A", "mA") or each.name == name:
        return Guess(name, column(each), "its name", each.name == name)
    why = "its name; no unit is told, so it is taken as counts of unknown scale and zero"
    return Guess(f"raw_current_{mount}", column(each._replace(unit="")), why, each.name == f"raw_current_{mount}")


def _reach(seen: Recording, each: Word) -> float:
    return float(np.nanmax(np.abs(seen.table[each.name].to_numpy(dtype=float)), initial=0.0))


def matched(seen: Recording, words: set[str], units: Collection[str] = ()) -> dict[str, Word]:
    """Return the column of each wheel whose name has one of these words, or one of these units: that needs no language.

    Whose it is tells the name of the wheel's joint, or its corner.
    """
    found: dict[str, tuple[float, Word]] = {}
    for each in seen.words:
        if not (each.has(words) or each.unit in units):
            continue
        score = 0.5 + 0.5 * each.has(words) - 0.5 * each.has(COMMAND) + 0.5 * each.has(WHEEL)
        for mount in _owners(each, seen.rover):
            if score > found.get(mount, (0.0, each))[0]:
                found[mount] = (score, each)
    return {mount: each for mount, (_, each) in found.items()}


def _owners(each: Word, rover: Rover) -> list[str]:
    """Return the wheels that a column is of: by the joint's name, by its corner, or all of a side."""
    by_joint = [mount.name for mount in rover.wheels if rover.model.names[mount.joint] in each.name]
    if by_joint:
        return by_joint
    exact = [mount.name for mount in rover.wheels if each.tokens[-len(tokens(mount.name)) :] == tokens(mount.name)]
    if exact:
        return exact
    axle, side = corner(each.tokens)
    own = [mount for mount in rover.wheels if side in ("", mount.side)]
    if axle.isdigit():
        return _numbered(own, rover, int(axle), side)
    if not axle:
        return [mount.name for mount in own] if side else []
    return [mount.name for mount in own if side and mount.axle in _axles(rover, axle)]


def tokens(name: str) -> tuple[str, ...]:
    """Return a wheel's name as the tokens of a column's name."""
    return tuple(name.lower().split("_"))


def _numbered(own: list[WheelMount], rover: Rover, number: int, side: str) -> list[str]:
    """Return wheel `number`, counted from 1: along its side where that is told, else left before right, front first."""
    if side:
        return [mount.name for mount in own if mount.axle == number - 1]
    return [rover.wheels[number - 1].name] if 1 <= number <= len(rover.wheels) else []


def _axles(rover: Rover, place: str) -> list[int]:
    last = max(mount.axle for mount in rover.wheels)
    return {"front": [0], "rear": [last]}.get(place, list(range(1, last)))


def _rates(seen: Recording, speed: np.ndarray | None) -> Iterator[Guess]:
    found = {mount: each for mount, each in matched(seen, RATE | {"drehzahl"}, RATES).items() if _is_rate(each)}
    if len(found) < len(seen.rover.wheels):
        yield from _of_twist(seen)
        return
    unit, sure = _rate_unit(seen, found, speed)
    radii = {mount.name: float(mount.wheel.r) for mount in seen.rover.wheels}
    for mount, each in found.items():
        values = seen.table[each.name].to_numpy(dtype=float)
        turned = _against(values, speed)
        why = "its name" + (f"; taken as {unit} by the speed of the rover" if not each.unit else "")
        why += "; turned round, as it runs against the travel" if turned else ""
        exact = each.name == f"wheel_rate_{mount}" and not turned
        yield Guess(
            f"wheel_rate_{mount}", _entry(each, unit, radii[mount], turned), why, exact or (sure and not turned)
        )


def _is_rate(each: Word) -> bool:
    whole = not each.unit or each.unit in (*RATES, *SPEEDS)
    return whole and not each.has({"imu", "gyro", "angular", "gps", "body", "odom", "linear", "twist"})


def _entry(each: Word, unit: str, radius: float, turned: bool) -> dict[str, object]:
    sign = "-" if turned else ""
    if unit in SPEEDS:
        factor = UNITS[unit][1]
        scale = "" if factor == 1.0 else f"{factor:.6g} * "
        return {"formula": f"{sign}{scale}{quoted(each.name)} / {radius:.6g}"}
    return column(each, unit, **({"scale": -1.0} if turned else {}))


def _against(values: np.ndarray, speed: np.ndarray | None) -> bool:
    if speed is None:
        return False
    known = np.isfinite(values + speed)
    back = share_back(values)
    if np.mean(speed[known] < 0.0) < BOTH_WAYS and BOTH_WAYS < back < 1.0 - BOTH_WAYS:
        return False  # the heading is but the course, and tells no sense
    size = math.sqrt(float(np.sum(values[known] ** 2)) * float(np.sum(speed[known] ** 2)))
    return size > 0.0 and float(np.sum(values[known] * speed[known])) / size < -0.5


def _rate_unit(seen: Recording, found: Mapping[str, Word], speed: np.ndarray | None) -> tuple[str, bool]:
    """Return the unit of the rates: told by a name, else that under which rims run about as fast as the rover."""
    told = next((each.unit for each in found.values() if each.unit), "")
    if told:
        return told, True
    if all(each.name == f"wheel_rate_{mount}" for mount, each in found.items()):
        return "rad/s", True
    rates = np.nanmean([np.abs(seen.table[each.name].to_numpy(dtype=float)) for each in found.values()], axis=0)
    if speed is None:
        return "rad/s", False
    use = np.isfinite(rates + speed) & (rates > 0.1 * np.nanmax(rates))
    if not use.any() or not np.median(np.abs(speed[use])) > 0.0:
        return "rad/s", False
    radius = float(np.mean(seen.rover.radii))
    times = {unit: UNITS[unit][1] * (1.0 if unit in SPEEDS else radius) for unit in UNTOLD}
    seen_ratio = float(np.median(rates[use]) / np.median(np.abs(speed[use])))
    off = {unit: abs(math.log(max(seen_ratio * times[unit], 1e-12) / USUAL)) for unit in times}
    best = min(off, key=lambda unit: off[unit])
    return (best, False) if off[best] < NEAR else ("rad/s", False)


def _of_twist(seen: Recording) -> Iterator[Guess]:
    """Yield side rates of a speed and a turn that the wheels are told or report: v +- omega b / 2."""
    ahead = seen.best(lambda each: _twist_score(each, AHEAD) if each.tokens[-1:] != ("z",) else 0.0)
    turn = seen.best(lambda each: _twist_score(each, TURN) or 0.9 * (each.has({"angular"}) and each.tokens[-1] == "z"))
    if ahead is None or turn is None:
        return
    places = wheel_places(seen.rover)
    for mount in seen.rover.wheels:
        half = abs(float(places[mount.name][1]))
        sign = "-" if mount.side == "l" else "+"
        radius = float(mount.wheel.r)
        formula = f"({quoted(ahead.name)} {sign} {half:.6g} * {quoted(turn.name)}) / {radius:.6g}"
        why = "the wheels' own rates are not recorded; v -+ omega b / 2 of a speed and a turn, as a driver has it"
        yield Guess(f"wheel_rate_{mount.name}", {"formula": formula}, why)


def _twist_score(each: Word, words: set[str]) -> float:
    told = each.has(ODOMETRY | COMMAND | {"twist"}) and each.has(words)
    return float(told) * (1.0 + 0.2 * each.has(ODOMETRY) + 0.1 * (each.tokens[-1] == "x"))


def joint_guesses(seen: Recording) -> Iterator[Guess]:
    """Yield the angles of the suspension, known by their names in the rover's TOML or by their joints in the URDF."""
    model = seen.rover.model
    at = {model.joints[joint].idx_q: model.names[joint] for joint in range(2, model.njoints)}
    for name, place in seen.rover.angles.items():
        if name.startswith("steer_"):
            continue
        own = tokens(name)
        each = seen.best(partial(_joint_score, own=own, joint=at.get(place, "")))
        if each is not None:
            unit, sure = angle_unit(seen, each)
            yield Guess(name, column(each, unit), "its name", sure or each.name == name)


def _joint_score(each: Word, own: tuple[str, ...], joint: str) -> float:
    rate = each.has(RATE - {"v", "rad"}) or each.has({"effort", "torque", "current"})
    if rate:
        return 0.0
    if joint and joint in each.name:
        return 2.0
    return float(each.tokens[-len(own) :] == own)
