"""Find the columns of the remaining channels after the motion is known: tilts, currents, duties, steering, joints,
inertial unit.

The motion decides the signs and units of these channels. For example, a rover pitches nose up where it climbs, and a
gyroscope shows the turn rate of the heading.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.special import ndtri
from scipy.stats import rankdata

from rover_pin.base.files import column_names as called
from rover_pin.base.files.column_names import COMMAND, ODOMETRY, Word, corner
from rover_pin.base.formula import change, integral, quote
from rover_pin.importing.evidence import (
    NONE_FITS,
    NOT_AS_NAMED,
    independent,
    is_settled,
    mean_known,
    relation,
    scale_evidence,
    shares,
)
from rover_pin.importing.places import is_angle, quaternions
from rover_pin.importing.recording import Choice, Entry, Guess, Recording, column, formula_of
from rover_pin.importing.wheels import families
from rover_pin.rover.rover import Rover

LOG_TILT = (math.log(0.07), 1.2)
"""Prior mean and SD of log(RMS angle / 1 rad) for angles of body, steering and suspension. The prior decides between
degrees and radians."""
NOSE_DOWN_SHARE, RIGHT_DOWN_SHARE = 0.6, 0.98
"""Prior probability that positive pitch means nose down, and prior probability that positive roll means right side
down. Both signs hold for axes with x ahead and z up."""
DUTY_SCALES = {0.01: 0.7, 1.0 / 255.0: 0.3}
"""Factor -> prior probability. The factors convert a duty without a unit whose values exceed 1 to a fraction: from
percent, or from counts of 255."""
Values = Sequence[Mapping[str, np.ndarray]]
"""For each recording: channel name -> values (rows,) in SI."""
WheelOptions = dict[str, list[tuple[Word, float]]]
"""Wheel name -> the columns that may belong to this wheel, each with its prior probability."""


def channels(
    words: Sequence[Word],
    recordings: Sequence[Recording],
    values: Values,
    rover: Rover,
    declared: Mapping[str, Entry],
    heading: Choice,
    wheels: Choice,
) -> tuple[list[Guess], list[str]]:
    """Return the source of each remaining channel, and a question to the user for each channel that stays ambiguous.

    Parameters
    ----------
    words : sequence of Word
        The columns of the recordings.
    recordings, values : sequences
        The recordings, and the channels of the motion (positions, heading, wheel rates) in each of them.
    rover : Rover
        Names of its wheels, steering angles and suspension joints.
    declared : mapping
        Channel -> entry of [columns] that the user gave. No guess replaces such an entry.
    heading, wheels : Choice
        The columns that were chosen for the heading and for the wheel rates.
    """
    guesses = [Guess(name, entry, "given by the user", True) for name, entry in declared.items()]
    questions: list[str] = []

    def take(options: Sequence[tuple[Guess, float]], none_fits: float = -math.inf) -> None:
        """Take the most probable of several sources of a channel; add a question to the user if none is probable
        enough.

        Each source comes with its log posterior. `none_fits` is the log prior that no source is right.
        """
        if not options or options[0][0].target in declared:
            return
        share = shares(np.array([log for _, log in options]), none_fits)
        first, *others = (options[at][0] for at in np.argsort(-share))
        if is_settled(float(share.max())):
            guesses.append(first._replace(share=float(share.max())))
            return
        ways = " or ".join(f"'{formula_of(item.target, item.entry)}'" for item in (first, *others[:1]))
        questions.append(
            f"{first.target} is left out, because no source of it is probable enough (P = {share.max():.2f}): give "
            f"--column {first.target}={ways}"
        )

    pitch = list(_tilts("body_pitch", called.PITCH, words, recordings, heading))
    # The climb of the drive is evidence for or against a pitch; a column with the channel's own name needs none.
    has_own_name = any(item.entry == {"column": item.target} for item, _ in pitch)
    take(
        [(item, log + _climb_evidence(item, recordings, values, rover)) for item, log in pitch],
        NOT_AS_NAMED if has_own_name else NONE_FITS,
    )
    # One sensor measures pitch and roll, so that both probably have the same unit.
    unit = next((item.entry.get("unit") for item in guesses if item.target == "body_pitch"), None)
    roll = _tilts("body_roll", called.ROLL, words, recordings, heading)
    take([(item, log + 3.0 * (item.entry.get("unit") == unit)) for item, log in roll])
    # If the columns of the wheel rates are numbered, other numbered columns follow the same order of wheels.
    order: dict[str, str] = {}
    for name, entry in wheels.entries.items():
        text = formula_of(name, entry)
        numbered = [item for item in words if quote(item.name) in text and corner(item.tokens)[0].isdigit()]
        order |= {corner(item.tokens)[0]: name.removeprefix("wheel_rate_") for item in numbered[:1]}
    for wheel, options in _of_wheels(words, rover, called.CURRENT, order).items():
        currents: list[tuple[Guess, float]] = []
        for word, share in options:
            amperes, counts = f"current_{wheel}_A", f"raw_current_{wheel}"
            if word.unit in ("A", "mA") or word.name == amperes:
                source = Guess(amperes, column(word), "its name", word.name == amperes)
            else:
                # Counts of a converter have an unknown scale and zero, which the loop estimates.
                why = "its name; it has no unit, so it is taken as counts with unknown scale and zero"
                source = Guess(counts, column(word._replace(unit="")), why, word.name == counts)
            currents.append((source, math.log(share)))
        take(currents)
    recorded = _of_wheels(words, rover, called.DUTY, order)
    duties, open_duty = _complete_duties(recorded, rover, recordings, declared)
    questions += open_duty
    for wheel, options in duties.items():
        take([way for word, share in options for way in _duties(wheel, word, math.log(share), recordings)])
    steered = {mount.name for mount in rover.wheels if mount.steer_dof is not None}
    for wheel, options in _of_wheels(words, rover, called.STEER, order).items():
        if wheel in steered:
            take(
                list(_angles(f"steer_{wheel}", options[0][0], recordings, "its name; steering to the left is positive"))
            )
    # The axes of a sensor are judged together, but each axis is a channel of its own.
    for readings in inertial_units(words, recordings, values):
        for way in zip(*(of_axes for of_axes, _ in readings), strict=True):
            take([(guess, log) for guess, (_, log) in zip(way, readings, strict=True)], NONE_FITS)
    for name, joint in _joints(words, rover):
        take(list(_angles(name, joint, recordings, "its name")))
    return guesses, questions


def _tilts(
    target: str, names: set[str], words: Sequence[Word], recordings: Sequence[Recording], heading: Choice
) -> Iterator[tuple[Guess, float]]:
    """Yield the possible sources of pitch or roll (a column or a quaternion, with either sign), each with its log
    prior.

    Parameters
    ----------
    target : str
        body_pitch or body_roll.
    names : set of str
        Words that mean this angle.
    heading : Choice
        The chosen heading. A quaternion that is the source of the heading is also the source of pitch and roll.
    """
    is_pitch = target == "body_pitch"
    # A column with the channel's own name comes first, then any attitude that is not computed from odometry.
    fits = [item for item in words if item.has(names) and not item.has(called.NO_ANGLE) and is_angle(item.unit)]
    best = min(fits, key=lambda item: (item.name != target, item.has(called.ODOMETRY)), default=None)
    if best is not None and best.name == target:
        yield Guess(target, {"column": target}, "its name", True), 0.0
    elif best is not None:
        likely_sign = NOSE_DOWN_SHARE if is_pitch else RIGHT_DOWN_SHARE
        sides = ("nose down", "nose up") if is_pitch else ("right side down", "left side down")
        for guess, log in _angles(target, best, recordings, "its name"):
            sure, why = guess.sure and not is_pitch, f"{guess.why}; {{}} counts as positive"
            for side, scale, share in zip(sides, ({}, {"scale": -1.0}), (likely_sign, 1.0 - likely_sign), strict=True):
                yield Guess(target, {**guess.entry, **scale}, why.format(side), sure), log + math.log(share)
    else:
        # If the heading of the quaternion counts clockwise (z down), its pitch has the other sign too.
        for four, often, why in quaternions(words):
            inner = ", ".join(map(quote, four))
            text = str(heading.entries["body_yaw"].get("formula", ""))
            if "yaw(" in text and inner not in text:
                continue
            for sign in ("", "-"):
                is_likely = (sign == "-") == (heading.turned and is_pitch)
                entry = {"formula": f"{sign}{target.removeprefix('body_')}({inner})"}
                log = math.log(often) + math.log(0.97 if is_likely else 0.03)
                yield Guess(target, entry, f"a quaternion, {why}, world z-y-x", often == 1.0), log


def _angles(target: str, word: Word, recordings: Sequence[Recording], why: str) -> Iterator[tuple[Guess, float]]:
    """Yield the possible sources of an angle that use one column, each with a unit and its log prior.

    If the column states its unit, there is one source. Otherwise radians and degrees are possible, and the unit that
    gives a usual RMS of the angle (LOG_TILT) has the larger prior.
    """
    if word.unit or word.name == target:
        yield Guess(target, column(word, "" if word.name == target else word.unit), why, True), 0.0
        return
    # An angle of 5 is improbable in rad and usual in deg: the RMS decides.
    series = np.concatenate([item.columns[word.name] for item in recordings])
    size = math.sqrt(max(float(np.nanmean(series**2)), 1e-12))
    for unit, factor in {"rad": 1.0, "deg": math.pi / 180.0}.items():
        likely = -0.5 * ((math.log(size * factor) - LOG_TILT[0]) / LOG_TILT[1]) ** 2
        yield Guess(target, column(word, unit), f"{why}; taken as {unit}"), likely


def _climb_evidence(guess: Guess, recordings: Sequence[Recording], values: Values, rover: Rover) -> float:
    """Return the log Bayes factor that a possible pitch, with its sign, agrees with the rises and the slip of the
    drive.

    A rover is nose up where it rises, and where its wheels slip more.

    Both relations are evaluated once a second, because neighbouring rows are correlated.
    """
    total = 0.0
    for recording, logged in zip(recordings, values, strict=True):
        t = recording.t
        climb = -np.sin(recording.values(guess.entry, guess.target, logged))
        rim = mean_known([mount.wheel.r * logged[name] for mount in rover.wheels
                          if (name := f"wheel_rate_{mount.name}") in logged])  # fmt: skip
        good = np.isfinite(logged["body_x"] + logged["body_y"])
        if good.sum() < 20 or not np.any(np.isfinite(climb)):
            continue
        dx, dy = (change(logged[name], t, good) for name in ("body_x", "body_y"))
        # Speed along the heading; its product with the sine of the pitch must be the rise of the measured height.
        ahead = np.cos(logged["body_yaw"]) * dx + np.sin(logged["body_yaw"]) * dy
        at = np.unique(np.searchsorted(t, np.arange(t[0], t[-1], 1.0)))
        if "body_z" in logged and np.any(np.isfinite(logged["body_z"])):
            rises = change(logged["body_z"], t, np.isfinite(logged["body_z"]))
            total += _relation((climb * ahead)[at], rises[at], (0.0, 0.15))
        moves = np.abs(rim[at]) > 0.3 * np.nanmax(np.abs(rim), initial=0.0)
        slips, uphill = 1.0 - (ahead / np.where(rim == 0.0, np.nan, rim))[at], (climb * np.sign(rim))[at]
        keep = moves & np.isfinite(slips + uphill)
        if keep.sum() > 10:
            # Ranks are mapped to normal scores, so that no single start or bump decides the sign.
            scores = [ndtri(rankdata(x) / (len(x) + 1.0)) for x in (uphill[keep], slips[keep])]
            total += _relation(scores[0], scores[1], None)
    return total


def _relation(x: np.ndarray, y: np.ndarray, prior: tuple[float, float] | None) -> float:
    """Return the log Bayes factor that two signals (rows,) are related by y = b x with b > 0, compared with unrelated
    signals.

    Rows without one of the signals are omitted. The result is 0 if fewer than 10 rows remain.

    `prior` holds the expected mean and SD of log b; None means that b is unknown.
    """
    good = np.isfinite(x + y)
    x, y = x[good], y[good]
    if len(x) < 10:
        return 0.0
    return float(relation(x @ y, np.linalg.norm(y), np.linalg.norm(x), independent(x, y), prior))


def _of_wheels(words: Sequence[Word], rover: Rover, kind: set[str], order: Mapping[str, str]) -> WheelOptions:
    """Return, for each wheel, the columns that may hold one quantity of this wheel, such as its current or its duty.

    A family is a group of columns whose names differ only by the wheel. The columns belong to the best family whose
    name has a word for the quantity.

    Parameters
    ----------
    kind : set of str
        Words that mean the quantity, for example current or duty.
    order : mapping
        Number in a column name -> wheel, in the order of the numbers of the wheel rates; empty if they have no numbers.
    """
    # The rate of a current and the voltage of the battery are other quantities.
    unlike = called.RATE - {"v", "w"} | {"battery"}
    fits = [(stem, maps) for stem, _, maps in families(words, rover) if stem & kind and not stem & unlike]
    if not fits:
        return {}
    # Measured values precede commands, and families of all wheels precede families that lack some.
    _, maps = min(fits, key=lambda item: (bool(item[0] & called.COMMAND), -len(item[1][0][0])))
    matching = [
        (family, 1.0)
        for family, _ in maps
        if all(order.get(corner(word.tokens)[0]) == wheel for wheel, word in family.items())
    ]
    maps = matching[:1] or maps
    # A column that belongs to a whole side is no channel of a single wheel.
    if len({word.name for word in maps[0][0].values()}) < len(maps[0][0]):
        return {}
    options: WheelOptions = {}
    for family, share in maps:
        for wheel, word in family.items():
            options.setdefault(wheel, []).append((word, share))
    return {mount.name: options[mount.name] for mount in rover.wheels if mount.name in options}


def _complete_duties(
    duties: WheelOptions, rover: Rover, recordings: Sequence[Recording], declared: Mapping[str, Entry]
) -> tuple[WheelOptions, list[str]]:
    """Return the possible duty columns of every wheel, and questions to the user about wheels without a duty.

    A simulated drive needs the duty of every wheel. If all recorded wheels of each side have one duty, as skid steering
    commands it, a wheel without a recorded duty gets the duty of its side. Otherwise no duty column is returned at all.
    """
    # A wheel without a duty gets the duty of its side only if all recorded duties of each side are equal.
    complete = dict(duties)
    names = {
        side: [mount.name for mount in rover.wheels if mount.side == side and mount.name in duties] for side in "lr"
    }
    series = {name: np.concatenate([item.columns[duties[name][0][0].name] for item in recordings]) for name in duties}
    alike = all(np.array_equal(series[name], series[on[0]], equal_nan=True) for on in names.values() for name in on)
    by_sides = alike and max(map(len, names.values())) > 1
    for mount in rover.wheels if duties else ():
        if mount.name in duties or f"duty_{mount.name}" in declared:
            continue
        if not by_sides or not names[mount.side]:
            return {}, [
                f"duty_{mount.name} is not recorded, and the duties of the other wheels do not determine it. So all "
                "duties are left out, and simulated wheels turn at the measured rates: give --column "
                f"duty_{mount.name}='FORMULA'"
            ]
        complete[mount.name] = duties[names[mount.side][0]]
    return complete, []


def _duties(wheel: str, word: Word, log: float, recordings: Sequence[Recording]) -> Iterator[tuple[Guess, float]]:
    """Yield the possible sources of a wheel's duty that use one column: as a fraction, in percent, or in counts of 255.

    The unit of the column or its largest value decides which scales are possible.

    `log` is the log prior of the column. If the values exceed 100 and the unit is not %, nothing is yielded.
    """
    largest = max(float(np.nanmax(np.abs(item.columns[word.name]), initial=0.0)) for item in recordings)
    by_size = {1.0: 1.0} if largest <= 1.0 else DUTY_SCALES if largest <= 100.0 else {}
    for scale, often in ({0.01: 1.0} if word.unit == "%" else by_size).items():
        why = "its name" + ("" if scale == 1.0 else f"; taken as {'percent' if scale == 0.01 else 'of 255'}")
        entry = {"column": word.name, **({} if scale == 1.0 else {"scale": scale})}
        yield Guess(f"duty_{wheel}", entry, why, word.name == f"duty_{wheel}"), log + math.log(often)


def _joints(words: Sequence[Word], rover: Rover) -> Iterator[tuple[str, Word]]:
    """Yield the suspension angles among the columns as (channel, column). They are found by the joint names in the
    rover's TOML or URDF.
    """
    model = rover.model
    joints = {model.joints[joint].idx_q: model.names[joint] for joint in range(2, model.njoints)}
    for name, place in rover.angles.items():
        if name.startswith("steer_"):
            continue
        for label in filter(None, (joints.get(place, ""), name)):
            tokens = called.word(label).tokens
            # The rate and the effort of a joint have the joint's name too, as in ROS joint states.
            other_quantities = called.RATE - {"v", "rad"} | {"effort", "torque", "current"}
            is_joint = (item.tokens[-len(tokens) :] == tokens and not item.has(other_quantities) for item in words)
            word = next(itertools.compress(words, is_joint), None)
            if word is not None:
                yield name, word
                break


STANDARD_GRAVITY = 9.80665
"""Acceleration that corresponds to 1 g [m/s^2]. The local gravity on Earth differs from it by less than 0.3 %."""
GYRO = {"gyro", "gyr", "gyroscope", "drehrate", "gyroskop"}
"""Words in the name of a column that comes from a gyroscope."""
ACCELEROMETER = {"acc", "accel", "accelerometer", "acceleration", "beschleunigung", "acelerometro"}
"""Words in the name of a column that comes from an accelerometer."""
KINDS = {
    "gyro": (GYRO, {"rad/s": 1.0, "deg/s": math.pi / 180.0}),
    "accelerometer": (ACCELEROMETER, {"m/s^2": 1.0, "g": STANDARD_GRAVITY}),
}
"""Inertial sensor -> the words in its column names, and its possible units with their factors to SI."""
FRAMES = {"z up": (1.0, 1.0, 1.0), "z down": (1.0, -1.0, -1.0)}
"""Orientation of an inertial unit -> signs that convert its axes x, y, z to x ahead, y left, z up. If z points down, y
and z are reversed."""
LOG_TURN_RATIO, LOG_GRAVITY_RATIO = (0.0, 0.05), (0.0, 0.05)
"""Prior mean and SD of the logarithms of two ratios: gyroscope's turn rate about z divided by the turn rate of the
heading, and mean upward acceleration divided by gravity."""
Reading = tuple[list[Guess], float]
"""Sources of the axes of one inertial sensor for one orientation and unit, and the log Bayes factor of this
interpretation."""


def inertial_units(
    words: Sequence[Word], recordings: Sequence[Recording], values: Sequence[Mapping[str, np.ndarray]]
) -> Iterator[list[Reading]]:
    """Yield the possible interpretations of the gyroscope's columns, then of the accelerometer's columns, each with
    evidence.

    An interpretation consists of an orientation of the axes and a unit. Its log Bayes factor compares the turn rate
    about z with the change of the heading, or the mean upward acceleration with gravity.

    Parameters
    ----------
    words : sequence of Word
        The columns of the recordings.
    recordings, values : sequences
        The recordings, and the channels of the motion in each of them.
    """
    for kind, (names, units) in KINDS.items():
        # The first column of each axis x, y, z. The axis is the last letter of a word: either of the sensor's word
        # ("gyrox"), or of a word next to it ("gyro x").
        axes: dict[str, Word] = {}
        for word in words:
            tokens = set(word.tokens)
            ends = {token[:-1]: token[-1] for token in word.tokens if token[-1] in "xyz"}
            marks = tokens | ({"gyro"} if {"imu", "angular"} <= tokens else set())
            letter = next((end for start, end in ends.items() if start in names or (not start and marks & names)), "")
            if letter and not tokens & (COMMAND | ODOMETRY | {"cov", "covariance"}):
                axes.setdefault(letter, word)
        if "z" not in axes:
            continue
        unit_of_name = axes["z"].unit if axes["z"].unit in units else ""
        readings: list[Reading] = []
        for unit in (unit_of_name,) if unit_of_name else units:
            for frame, signs in FRAMES.items():
                why = f"its name; {frame}" + ("" if unit_of_name else f", in {unit}")
                z = [units[unit] * signs[2] * item.columns[axes["z"].name] for item in recordings]
                if kind == "gyro":
                    log = _turn_evidence(z, recordings, values)
                else:
                    # The mean upward acceleration of a drive is gravity; a negative mean means the wrong frame.
                    known = np.concatenate(z)
                    mean = float(known[np.isfinite(known)].mean()) if np.isfinite(known).any() else 0.0
                    ratio = scale_evidence(mean, STANDARD_GRAVITY, len(known), LOG_GRAVITY_RATIO)
                    log = float(ratio) if mean > 0.0 else -math.inf
                guesses = [
                    Guess(f"{kind}_{axis}", _entry(axes[axis], unit, sign), why)
                    for axis, sign in zip("xyz", signs, strict=True)
                    if axis in axes
                ]
                readings.append((guesses, log))
        yield readings


def _entry(word: Word, unit: str, sign: float) -> Entry:
    """Return the source of one axis of an inertial unit, as an entry of the table [columns] in drive.toml.

    The sign is reversed if `sign` is -1, and the unit g becomes a scale.
    """
    scale = sign * (STANDARD_GRAVITY if unit == "g" else 1.0)
    entry = column(word._replace(unit="" if unit == "g" else unit))
    return entry if scale == 1.0 else {**entry, "scale": scale}


def _turn_evidence(
    z: Sequence[np.ndarray], recordings: Sequence[Recording], values: Sequence[Mapping[str, np.ndarray]]
) -> float:
    """Return the evidence that a recorded turn rate belongs to the z axis, as a log Bayes factor. The turn rate,
    integrated over one second, is compared with the change of the heading in this second.

    Parameters
    ----------
    z : sequence of arrays (rows,)
        Turn rate of each recording [rad/s].
    """
    total = 0.0
    for rate, recording, logged in zip(z, recordings, values, strict=True):
        # The first and last second are left out, because differences over a second are not defined there.
        t, yaw = recording.t, np.unwrap(np.nan_to_num(logged["body_yaw"]))
        at = np.unique(np.searchsorted(t, np.arange(t[0] + 1.0, t[-1] - 1.0, 1.0)))
        good = np.isfinite(rate)
        if good.sum() < 2 or len(at) < 10:
            continue
        x, y = change(integral(rate, t), t, good)[at], change(yaw, t, np.isfinite(logged["body_yaw"]))[at]
        total += float(relation(x @ y, np.linalg.norm(y), np.linalg.norm(x), independent(x, y), LOG_TURN_RATIO))
    return total
