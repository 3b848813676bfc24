"""Find the columns of clock, position, heading and wheel rates of a recording that agree best on one motion of the
rover.

The probability of an interpretation of the columns follows from two relations. First, if the rims of a rover run at
speed v, the rover travels at the velocity c = dx/dt + i dy/dt = b v exp(i psi), where psi is the heading and b is 1
minus the slip. Second, the rover turns at psi' = g (v_right - v_left) / (2 y), where y is half its track and g is less
than 1 because of scrub. So two pairs of signals must be related by positive factors: c with v exp(i psi), and psi' with
the difference of the rim speeds. `evidence` has the Bayes factors of these relations. All signals are averaged over
blocks of rows. Uphill, v / |c| grows, which shows the sign of the height.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.importing.evidence import independent, relation, scale_evidence, sense, shares
from rover_pin.importing.places import COURSE
from rover_pin.importing.recording import Choice, Recording
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of

MAX_SPEED = 5.0
"""Maximum speed of a rover of this kind and of its rims [m/s]. An interpretation of the columns that implies a higher
speed is excluded."""
MAX_SLOPE = 1.0
"""Maximum RMS slope of the terrain over a whole drive [-]. A coordinate that rises more steeply is not taken as the
height."""
LOG_PACE = (math.log(0.15), 1.5)
"""Prior mean and SD of log(RMS speed of a rover / 1 m/s). The prior decides between units of the position."""
LOG_GROUND = (math.log(0.9), 0.15)
"""Prior mean and SD of log(b), where b is the ratio of ground speed to rim speed."""
LOG_SCRUB = (math.log(0.75), 0.35)
"""Prior mean and SD of log(g), where g is the measured turn rate divided by the turn rate that the rims would give
without scrub."""
MAX_BLOCKS, MIN_ROWS = 300, 10
"""Maximum number of blocks over which the signals of a file are averaged, and minimum number of rows of a block."""
SAME = 0.02
"""Maximum relative difference between the numbers of two choices, for example of two position columns. Up to this
value, the user need not choose between them."""


class Signals(NamedTuple):
    """Signals of one file, averaged over blocks of rows, for every possible position, heading and set of wheel rates.

    The arrays have one row for each possible choice of columns, and one column for each block.
    """

    places: np.ndarray
    """ground velocity dx/dt + i dy/dt of each possible position [m/s] (positions, blocks), complex"""
    climbs: np.ndarray
    """rate of rise of each possible position [m/s] (positions, blocks); 0 if no height is recorded"""
    headings: np.ndarray
    """exp(i psi) of each possible heading psi (headings, blocks); NaN if the course replaces the heading"""
    turns: np.ndarray
    """turn rate of each possible heading [rad/s] (headings, blocks); NaN if the course replaces the heading"""
    rims: np.ndarray
    """mean rim speed of each possible set of wheel rates [m/s] (sets, blocks)"""
    spins: np.ndarray
    """turn rate that each possible set of wheel rates would give without scrub [rad/s] (sets, blocks)"""
    rates: np.ndarray
    """rates of all wheels for each possible set of wheel rates [rad/s] (sets, wheels, blocks); NaN for a wheel without
    a column"""
    fastest: np.ndarray
    """largest 99th percentile of the rim speeds of all wheels, for each possible set of wheel rates [m/s] (sets,)"""
    dt: np.ndarray
    """duration of each block [s] (blocks,)"""


class Options(NamedTuple):
    """The possible columns for the position, the heading and the wheel rates of a recording, as three lists of
    choices.
    """

    places: Sequence[Choice]
    headings: Sequence[Choice]
    wheels: Sequence[Choice]


def signals(recording: Recording, options: Options, rover: Rover) -> Signals:
    """Return the signals of a recording, averaged over blocks of rows, for all possible columns of position, heading
    and wheels.

    `log_likelihood` compares these signals to find the columns that agree on one motion.

    Parameters
    ----------
    recording : Recording
        The rows of a file on one clock.
    options : Options
        The possible columns. The axes of the result have their order.
    rover : Rover
        Names, sides, radii and track of the wheels.
    """
    t = recording.t
    # Block borders lie between rows where the number of rows is no multiple of the block length, so values are
    # interpolated.
    edges = np.linspace(0, len(t) - 1, max(3, min(MAX_BLOCKS, len(t) // MIN_ROWS)) + 1)
    rows = np.arange(len(t))
    dt = np.diff(np.interp(edges, rows, t))

    def change(values: np.ndarray) -> np.ndarray:
        """Return the rate of change of a channel over each block (n,). Missing rows are interpolated."""
        good = np.isfinite(values)
        if good.sum() < 2:
            return np.zeros(len(dt))
        return np.diff(np.interp(edges, rows[good], values[good])) / dt

    def mean(values: np.ndarray) -> np.ndarray:
        """Return the mean of a channel over each block (n,), without the missing rows."""
        good = np.isfinite(values)
        total = np.concatenate([[0.0], np.cumsum(np.where(good, values, 0.0))])
        count = np.concatenate([[0.0], np.cumsum(good)])
        at = np.round(edges).astype(int)
        return np.diff(total[at]) / np.maximum(np.diff(count[at]), 1.0)

    def of(choice: Choice, name: str) -> np.ndarray:
        """Return the values of the channel `name` in SI (rows,), computed from the columns of a choice."""
        return recording.values(choice.entries[name], name)

    velocity = np.array([change(of(choice, "body_x")) + 1j * change(of(choice, "body_y")) for choice in options.places])
    climbs = [change(of(choice, "body_z")) if "body_z" in choice.entries else 0.0 * dt for choice in options.places]
    pointing, turning = [], []
    for choice in options.headings:
        # The course depends on the choice of the position, so `log_likelihood` computes it for each one.
        if choice.entries["body_yaw"].get("formula") == COURSE:
            pointing.append(np.full(len(dt), np.nan, complex))
            turning.append(np.full(len(dt), np.nan))
            continue
        yaw = of(choice, "body_yaw")
        pointing.append(mean(np.cos(yaw)) + 1j * mean(np.sin(yaw)))
        turning.append(change(yaw))
    names = [f"wheel_rate_{mount.name}" for mount in rover.wheels]
    unknown = np.full(len(dt), np.nan)
    rates = np.array([[mean(of(choice, name)) if name in choice.entries else unknown for name in names]
                      for choice in options.wheels])  # fmt: skip
    # Rims of the two sides: their mean gives the speed, their difference over the track the turn rate without scrub.
    sides = np.array([mount.side for mount in rover.wheels])
    speeds = rates * rover.radii[:, None]
    left, right = (np.nanmean(speeds[:, sides == side], axis=1) for side in "lr")
    fastest = np.nanmax(np.percentile(np.abs(speeds), 99, axis=2), axis=1)
    motion = velocity, np.array(climbs), np.array(pointing), np.array(turning)
    return Signals(*motion, np.nanmean(speeds, axis=1), (right - left) / base_of(rover).track, rates, fastest, dt)


def log_likelihood(blocks: Signals, options: Options) -> np.ndarray:
    """Return the log Bayes factor of each interpretation of one file's columns, compared with signals that agree by
    chance.

    The result has the shape (positions, headings, wheels). An interpretation is one choice of columns, units and signs
    for position, heading and wheels. If the speed or the slope that it implies is impossible for a rover, its value is
    minus infinity.

    Parameters
    ----------
    blocks : Signals
        The signals of one file.
    options : Options
        The possible columns that the signals were computed from.
    """
    free = np.array([choice.free for choice in options.wheels])
    size = np.linalg.norm(blocks.rims, axis=1)
    by_course = np.isnan(blocks.turns[:, 0])
    result = np.zeros((len(options.places), len(options.headings), len(options.wheels)))
    turning = np.where(by_course[:, None], -np.inf, turn_evidence(np.nan_to_num(blocks.turns), blocks, free))
    for p, velocity in enumerate(blocks.places):
        length = float(np.linalg.norm(velocity))
        if np.percentile(np.abs(velocity), 99) > MAX_SPEED or np.linalg.norm(blocks.climbs[p]) > MAX_SLOPE * length:
            result[p] = -np.inf
        if length == 0.0 or np.isinf(result[p, 0, 0]):
            continue
        # With a heading, the vector relation c = b v exp(i psi) counts: direction and size of the ground velocity.
        n = np.array([independent(velocity, rim) for rim in blocks.rims])
        dot = np.real(np.conj(np.nan_to_num(blocks.headings)) * velocity) @ blocks.rims.T
        result[p] = relation(dot, length, size, 2.0 * n, LOG_GROUND, free)
        # Without a heading, only speeds can be compared. Both are positive and so correlated by chance, so their
        # variations are compared, and the ratio of their sizes.
        ours, theirs = np.abs(velocity), np.abs(blocks.rims)
        varying, rims_varying = ours - ours.mean(), theirs - theirs.mean(axis=1, keepdims=True)
        pace = relation(rims_varying @ varying, np.linalg.norm(varying), np.linalg.norm(rims_varying, axis=1), n, None)
        ratio = scale_evidence(np.linalg.norm(ours), np.linalg.norm(theirs, axis=1), n, LOG_GROUND, free)
        result[p][by_course] = pace + ratio
        # Wheels slip more uphill, so that log |rim speed / ground velocity| grows with the slope. This relation decides
        # the sign of the height. Only the sign of the relation counts. Its strength is no evidence that a coordinate is
        # the height: a wrong coordinate taken as height also removes distance from the plane, and so correlates with
        # the slip.
        advances = (ours > 0.3 * np.max(ours)) & np.all(blocks.rims != 0.0, axis=0)
        if advances.sum() >= MIN_ROWS:
            slope = (blocks.climbs[p] / np.maximum(ours, 1e-12))[advances]
            log_ratios = np.log(np.abs(blocks.rims[:, advances]) / ours[advances])
            slope, log_ratios = slope - slope.mean(), log_ratios - log_ratios.mean(axis=1, keepdims=True)
            effective = np.array([independent(slope, row) for row in log_ratios])
            result[p] += sense(log_ratios @ slope, np.linalg.norm(log_ratios, axis=1), np.linalg.norm(slope), effective)
        # The rims may agree with the turn of the heading or of the course. Squaring the ratio of successive velocities
        # removes the half turn of the course when the rover reverses.
        moves = np.abs(velocity) > 0.3 * np.median(np.abs(velocity))
        turned = np.angle((velocity[1:] * np.conj(velocity[:-1])) ** 2) / 2.0
        course = np.concatenate([[0.0], np.where(moves[1:] & moves[:-1], turned, 0.0) / blocks.dt[1:]])
        result[p] += np.maximum(turning, turn_evidence(np.array([course]), blocks, free))
    result[:, :, ~free & (blocks.fastest > MAX_SPEED)] = -np.inf
    return result


def turn_evidence(turns: np.ndarray, blocks: Signals, free: np.ndarray) -> np.ndarray:
    """Return the log Bayes factor that turn rates agree with the difference between the rim speeds of both sides.

    The result has the shape (h, w) for h possible headings, which give the turn rates, and w possible sets of wheel
    rates.

    Parameters
    ----------
    turns : array (h, n)
        Turn rates [rad/s].
    blocks : Signals
        The signals of the file. Their rim speeds are used.
    free : array of bool (w,)
        Whether the scale of a set of wheel rates is unknown.
    """
    # Neighbouring blocks of a turn are correlated, so fewer samples than blocks are independent.
    n = np.array([[independent(turn, spin) for spin in blocks.spins] for turn in turns])
    size, spin = np.linalg.norm(turns, axis=1)[:, None], np.linalg.norm(blocks.spins, axis=1)
    # A difference as small as the round-off error of the rim speeds is no evidence.
    spin[spin < np.sqrt(np.finfo(float).eps) * np.linalg.norm(blocks.rims, axis=1)] = 0.0
    return relation(turns @ blocks.spins.T, size, spin, n, LOG_SCRUB, free)


def log_prior(blocks: Signals, options: Options) -> np.ndarray:
    """Return the log prior of each interpretation of one file's columns (positions, headings, wheels).

    The log prior is the sum of the log priors of the chosen columns and of three terms: the RMS speed should be usual
    for rovers, a heading should count clockwise if and only if z points down, and a rover without a recorded heading
    should mostly drive forwards.

    Parameters
    ----------
    blocks : Signals
        The signals of one file.
    options : Options
        The possible columns that the signals were computed from.
    """
    # A position in mm that is taken as m gives a thousandfold speed, which this prior makes improbable.
    pace = np.log(np.maximum(np.sqrt(np.mean(np.abs(blocks.places) ** 2, axis=1)), 1e-12))
    place, heading, wheel = (np.array([choice.weight for choice in choices]) for choices in options)
    place = place - 0.5 * ((pace - LOG_PACE[0]) / LOG_PACE[1]) ** 2
    prior = place[:, None, None] + heading[:, None] + wheel
    # A clockwise heading agrees with z down, so that both together are e^6 times as probable as one without the other.
    down = np.array([choice.turned for choice in options.places])[:, None]
    course = np.isnan(blocks.turns[:, 0])
    clockwise = np.array([choice.turned for choice in options.headings])
    prior += (down * np.where(course, 0.0, np.where(clockwise, 3.0, -3.0)))[:, :, None]
    ahead = np.log(0.05 + 0.9 * np.mean(blocks.rims > 0.0, axis=1))
    return np.asarray(prior + course[:, None] * ahead)


class Selection(NamedTuple):
    """The most probable interpretation of the columns, with its probabilities and its most probable alternatives.

    The parts of an interpretation are clock, position, heading and wheels. Each part is given as an index into its list
    of possible columns.
    """

    parts: tuple[int, int, int, int]
    """indices of the chosen clock, position, heading and wheels"""
    share: Mapping[str, float]
    """name of the part -> probability that the chosen column is right, summed over all interpretations that use this
    column"""
    rival: Mapping[str, tuple[int, int, int, int]]
    """name of the part -> the most probable interpretation that uses another column in this part"""
    fits: float
    """probability that one of the interpretations is right"""
    gear: float
    """ratio of rim travel to ground travel, corrected for the usual slip; about 1 unless the wheel rates have a wrong
    scale"""


PARTS = ("clock", "place", "heading", "wheels")
"""Names of the four parts of an interpretation of the columns, in the order of `Selection.parts`."""


def choose(
    blocks: Sequence[Sequence[Signals]], lasts: Sequence[float], options: Options, weights: Sequence[float]
) -> Selection:
    """Return the most probable choice of clock, position, heading and wheel columns for all files together.

    Parameters
    ----------
    blocks : sequence of sequences of Signals
        For each possible clock, the signals of every file.
    lasts : sequence of float
        Duration of the first file by each possible clock [s].
    options : Options
        The possible columns that the signals were computed from.
    weights : sequence of float
        Log prior of each possible clock.

    Returns
    -------
    Selection
        The choice with its posterior probabilities, from prior and likelihood by Bayes' theorem.
    """
    logs = np.array([
        weight + log_prior(files[0], options) + np.sum([log_likelihood(file, options) for file in files], axis=0)
        for files, weight in zip(blocks, weights, strict=True)
    ])  # fmt: skip
    posterior = shares(logs)
    best = np.unravel_index(int(np.argmax(logs)), logs.shape)
    parts = tuple(int(choice) for choice in best)

    def like(values: np.ndarray, at: int, tolerance: float = SAME) -> np.ndarray:
        """Return a mask of the choices whose values differ from the values of choice `at` by at most the relative
        tolerance.
        """
        # A missing signal (NaN) is compared as 0, so that two choices without this signal count as equal.
        flat = np.nan_to_num(values.reshape(len(values), -1))
        return np.asarray(np.linalg.norm(flat - flat[at], axis=1) <= tolerance * np.linalg.norm(flat[at]))

    # Columns with the same numbers as the chosen one count as one choice, because it does not matter which of them is
    # taken. For clock, position, heading and wheels, a mask marks these columns among the possible ones.
    clock, place, heading, wheel = parts
    chosen = blocks[clock][0]
    free = np.array([choice.free for choice in options.wheels])
    agreeing = [
        np.abs(np.array(lasts) / lasts[clock] - 1.0) < SAME,
        like(chosen.places, place),
        like(chosen.headings, heading, 5.0 * SAME),
        like(chosen.rates, wheel) & (free == free[wheel]),
    ]
    share, rival = {}, {}
    for axis, (part, agree) in enumerate(zip(PARTS, agreeing, strict=True)):
        along = np.moveaxis(posterior, axis, 0)
        share[part] = float(along[agree].sum() / max(posterior.sum(), 1e-300))
        rivals = np.where(np.moveaxis(np.broadcast_to(agree[:, None, None, None], along.shape), 0, axis), -np.inf, logs)
        rival[part] = tuple(int(choice) for choice in np.unravel_index(int(np.argmax(rivals)), logs.shape))
    travelled, rolled = (np.linalg.norm(np.concatenate(series)) for series in zip(
        *((file.places[parts[1]], file.rims[parts[3]]) for file in blocks[parts[0]]), strict=True))  # fmt: skip
    gear = math.exp(LOG_GROUND[0]) * float(rolled) / max(float(travelled), 1e-12)
    return Selection(parts, share, rival, float(posterior.sum()), gear)  # type: ignore[arg-type]
