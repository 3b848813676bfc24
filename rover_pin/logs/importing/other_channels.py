"""What else was recorded, once the motion is known: tilts, currents, duties, steering and joints."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import ndtri
from scipy.stats import rankdata

from rover_pin.base.formula import change, quote
from rover_pin.logs.importing import column_names as called
from rover_pin.logs.importing.column_names import Word, corner
from rover_pin.logs.importing.evidence import NONE_FITS, SURE, independent, mean_known, relation, shares
from rover_pin.logs.importing.inertial import inertial_units
from rover_pin.logs.importing.places import quaternions
from rover_pin.logs.importing.recording import Choice, Entry, Guess, Recording, column, formula_of
from rover_pin.logs.importing.wheels import families
from rover_pin.rover.rover import Rover

TILT = (math.log(0.07), 1.2)
"""Logarithm of the usual RMS [rad] of an angle of body, steering or suspension, and its spread."""
NOSE_DOWN, RIGHT_DOWN = 0.6, 0.98
"""How often pitch counts nose down, and roll right side down, as positive, as axes with x ahead and z up have it."""
UNTOLD = {0.01: 0.7, 1.0 / 255.0: 0.3}
"""Scales of duties above 1 whose unit is not told, and how often."""
ANGLES = ("", "rad", "deg")
Values = Sequence[Mapping[str, np.ndarray]]


def channels(
    words: Sequence[Word],
    recordings: Sequence[Recording],
    values: Values,
    rover: Rover,
    declared: Mapping[str, Entry],
    reading: Sequence[Any],
) -> tuple[list[Guess], list[str]]:
    """Return the guesses of the further channels, and a question for each that can be read in several ways."""
    guesses = [Guess(name, entry, "as given", True) for name, entry in declared.items()]
    questions: list[str] = []

    def take(options: Sequence[tuple[Guess, float]], none_fits: float = -math.inf) -> None:
        """Take the likeliest of the ways to read a channel, each with its logarithm, or ask."""
        if not options or options[0][0].target in declared:
            return
        share = shares(np.array([log for _, log in options]), none_fits)
        first, *others = (options[at][0] for at in np.argsort(-share))
        if share.max() >= SURE:
            guesses.append(first._replace(share=float(share.max())))
            return
        ways = " or ".join(f"'{formula_of(item.target, item.entry)}'" for item in (first, *others[:1]))
        questions.append(
            f"{first.target} is open (P = {share.max():.2f}) and left out: say --column {first.target}={ways}"
        )

    pitch = _tilts("body_pitch", called.PITCH, words, recordings, reading)
    take([(item, log + _climbs(item, recordings, values, rover)) for item, log in pitch], NONE_FITS)
    unit = next((item.entry.get("unit") for item in guesses if item.target == "body_pitch"), None)
    roll = _tilts("body_roll", called.ROLL, words, recordings, reading)
    take([(item, log + 3.0 * (item.entry.get("unit") == unit)) for item, log in roll])
    order = _order(reading[3].entries, words)
    for wheel, options in _of_wheels(words, rover, called.CURRENT, order).items():
        take([(_current(wheel, word), math.log(share)) for word, share in options])
    for wheel, options in _of_wheels(words, rover, called.DUTY, order).items():
        take([way for word, share in options for way in _duties(wheel, word, math.log(share), recordings)])
    steered = {mount.name for mount in rover.wheels if mount.steer_dof is not None}
    for wheel, options in _of_wheels(words, rover, called.STEER, order).items():
        if wheel in steered:
            take(list(_angles(f"steer_{wheel}", options[0][0], recordings, "its name; left is positive")))
    for readings in inertial_units(words, recordings, values):
        for way in zip(*(guesses for guesses, _ in readings), strict=True):
            take([(guess, log) for guess, (_, log) in zip(way, readings, strict=True)], NONE_FITS)
    for name, joint in _joints(words, rover):
        take(list(_angles(name, joint, recordings, "its name")))
    return guesses, questions


def _tilts(
    target: str, names: set[str], words: Sequence[Word], recordings: Sequence[Recording], reading: Sequence[Any]
) -> Iterator[tuple[Guess, float]]:
    """Yield the ways to read pitch or roll, of a column or of a quaternion, and the logarithms of their priors."""
    is_pitch = target == "body_pitch"
    fits = [item for item in words if item.has(names) and not item.has(called.NO_ANGLE) and item.unit in ANGLES]
    best = min(fits, key=lambda item: (item.name != target, item.has(called.ODOMETRY)), default=None)
    if best is not None and best.name == target:
        yield Guess(target, {"column": target}, "its name", True), 0.0
    elif best is not None:
        likely_sign = NOSE_DOWN if is_pitch else RIGHT_DOWN
        sides = ("nose down", "nose up") if is_pitch else ("right side down", "left side down")
        for guess, log in _angles(target, best, recordings, "its name"):
            sure, why = guess.sure and not is_pitch, f"{guess.why}; {{}} is positive there"
            for side, scale, share in zip(sides, ({}, {"scale": -1.0}), (likely_sign, 1.0 - likely_sign), strict=True):
                yield Guess(target, {**guess.entry, **scale}, why.format(side), sure), log + math.log(share)
    else:
        yield from _of_quaternion(target, words, reading[2])


def _of_quaternion(target: str, words: Sequence[Word], heading: Choice) -> Iterator[tuple[Guess, float]]:
    """Yield the pitch or the roll of the heading's quaternion, the pitch turned where that counts clockwise."""
    for four, often, why in quaternions(words):
        inner = ", ".join(map(quote, four))
        text = str(heading.entries["body_yaw"].get("formula", ""))
        if "yaw(" in text and inner not in text:
            continue
        for sign in ("", "-"):
            likely_sign = (sign == "-") == (heading.turned and target == "body_pitch")
            entry = {"formula": f"{sign}{target.removeprefix('body_')}({inner})"}
            log = math.log(often) + math.log(0.97 if likely_sign else 0.03)
            yield Guess(target, entry, f"a quaternion, {why}, world z-y-x", often == 1.0), log


def _angles(target: str, word: Word, recordings: Sequence[Recording], why: str) -> Iterator[tuple[Guess, float]]:
    """Yield an angle in the unit that its name tells, else in each, by the size that it then has."""
    series = np.concatenate([item.columns[word.name] for item in recordings])
    size = math.sqrt(max(float(np.nanmean(series**2)), 1e-12))
    for unit, factor in {"rad": 1.0, "deg": math.pi / 180.0}.items():
        if word.unit == unit or word.name == target:
            yield Guess(target, column(word, "" if word.name == target else unit), why, True), 0.0
            return
        if not word.unit:
            likely = -0.5 * ((math.log(size * factor) - TILT[0]) / TILT[1]) ** 2
            yield Guess(target, column(word, unit), f"{why}; taken as {unit}"), likely


def _climbs(guess: Guess, recordings: Sequence[Recording], values: Values, rover: Rover) -> float:
    """Return the log Bayes factor of a pitch: nose up where the rover rises ahead, and slips more than downhill."""
    total = 0.0
    for recording, logged in zip(recordings, values, strict=True):
        t = recording.t
        climb = -np.sin(recording.values(guess.entry, guess.target, logged))
        rim = mean_known([mount.wheel.r * logged[f"wheel_rate_{mount.name}"] for mount in rover.wheels])
        good = np.isfinite(logged["body_x"] + logged["body_y"])
        if good.sum() < 20 or not np.any(np.isfinite(climb)):
            continue
        dx, dy = (change(logged[name], t, good) for name in ("body_x", "body_y"))
        ahead = np.cos(logged["body_yaw"]) * dx + np.sin(logged["body_yaw"]) * dy
        at = np.unique(np.searchsorted(t, np.arange(t[0], t[-1], 1.0)))
        if "body_z" in logged and np.any(np.isfinite(logged["body_z"])):
            rises = change(logged["body_z"], t, np.isfinite(logged["body_z"]))
            total += _relation((climb * ahead)[at], rises[at], (0.0, 0.15))
        moves = np.abs(rim[at]) > 0.3 * np.nanmax(np.abs(rim), initial=0.0)
        slips, uphill = 1.0 - (ahead / np.where(rim == 0.0, np.nan, rim))[at], (climb * np.sign(rim))[at]
        keep = moves & np.isfinite(slips + uphill)
        if keep.sum() > 10:
            total += _relation(_normal_scores(uphill[keep]), _normal_scores(slips[keep]), None)
    return total


def _normal_scores(x: np.ndarray) -> np.ndarray:
    """Return the quantiles of the normal law by rank: no single start or bump tells which way a slope goes."""
    return np.asarray(ndtri(rankdata(x) / (len(x) + 1.0)))


def _relation(x: np.ndarray, y: np.ndarray, prior: tuple[float, float] | None) -> float:
    good = np.isfinite(x + y)
    x, y = x[good], y[good]
    if len(x) < 10:
        return 0.0
    return float(relation(x @ y, np.linalg.norm(y), np.linalg.norm(x), independent(x, y), prior))


def _order(rates: Mapping[str, Entry], words: Sequence[Word]) -> dict[str, str]:
    """Return the wheel of each number, where the columns of the rates are numbered."""
    order: dict[str, str] = {}
    for name, entry in rates.items():
        text = formula_of(name, entry)
        numbered = [item for item in words if quote(item.name) in text and corner(item.tokens)[0].isdigit()]
        order |= {corner(item.tokens)[0]: name.removeprefix("wheel_rate_") for item in numbered[:1]}
    return order


def _of_wheels(
    words: Sequence[Word], rover: Rover, kind: set[str], order: Mapping[str, str]
) -> dict[str, list[tuple[Word, float]]]:
    """Return the columns that may be of each wheel with such a word in their names, of one family, and how likely."""
    unlike = called.RATE - {"v", "w"} | {"battery"}
    fits = [(stem, maps) for stem, _, maps in families(words, rover) if stem & kind and not stem & unlike]
    if not fits:
        return {}
    _, maps = min(fits, key=lambda item: bool(item[0] & called.COMMAND))
    matching = [
        (family, 1.0)
        for family, _ in maps
        if all(order.get(corner(word.tokens)[0]) == wheel for wheel, word in family.items())
    ]
    maps = matching[:1] or maps
    if len({word.name for word in maps[0][0].values()}) < len(rover.wheels):
        return {}
    return {mount.name: [(family[mount.name], share) for family, share in maps] for mount in rover.wheels}


def _current(wheel: str, word: Word) -> Guess:
    """Return a current in amperes where its name says so, else as counts of unknown scale and zero."""
    name, raw = f"current_{wheel}_A", f"raw_current_{wheel}"
    if word.unit in ("A", "mA") or word.name == name:
        return Guess(name, column(word), "its name", word.name == name)
    why = "its name; it has no unit, so it is taken as counts of unknown scale and zero"
    return Guess(raw, column(word._replace(unit="")), why, word.name == raw)


def _duties(wheel: str, word: Word, log: float, recordings: Sequence[Recording]) -> Iterator[tuple[Guess, float]]:
    """Yield a duty as a share, in percent or of 255, by its unit or by how far it reaches."""
    most = max(float(np.nanmax(np.abs(item.columns[word.name]), initial=0.0)) for item in recordings)
    ways = {0.01: 1.0} if word.unit == "%" else {1.0: 1.0} if most <= 1.0 else UNTOLD if most <= 100.0 else {}
    for scale, often in ways.items():
        why = "its name" + ("" if scale == 1.0 else f"; taken as {'percent' if scale == 0.01 else 'of 255'}")
        entry = {"column": word.name, **({} if scale == 1.0 else {"scale": scale})}
        yield Guess(f"duty_{wheel}", entry, why, word.name == f"duty_{wheel}"), log + math.log(often)


def _joints(words: Sequence[Word], rover: Rover) -> Iterator[tuple[str, Word]]:
    """Yield the angles of the suspension, known by their names in the rover's TOML or by their joints in the URDF."""
    model = rover.model
    at = {model.joints[joint].idx_q: model.names[joint] for joint in range(2, model.njoints)}
    for name, place in rover.angles.items():
        if name.startswith("steer_"):
            continue
        for label in filter(None, (at.get(place, ""), name)):
            tokens = called.word(label).tokens
            word = next((item for item in words if _ends(item, tokens)), None)
            if word is not None:
                yield name, word
                break


def _ends(word: Word, tokens: tuple[str, ...]) -> bool:
    rate = word.has(called.RATE - {"v", "rad"}) or word.has({"effort", "torque", "current"})
    return not rate and word.tokens[-len(tokens) :] == tokens
