"""Clock, place, heading and wheels chosen together, by what they say of one motion.

In each block of rows a rover of wheels with the rim speed v goes c = (dx + i dy) / dt = b v exp(i psi) and turns at
psi' = g (v_right - v_left) / (2 y), y being half its track. b is 1 less the slip, g below 1 by the scrub. So c with
v exp(i psi), and psi' with the difference of the rims, must be related by positive factors near these (`evidence`).
Uphill v / |c| grows, which tells the sense of the height's axis.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.logs.importing.evidence import independent, relation, scale_evidence, sense, shares
from rover_pin.logs.importing.places import COURSE
from rover_pin.logs.importing.recording import Choice, Recording
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of

FASTEST = 5.0
"""No rover of this kind drives or turns its rims faster [m/s]."""
STEEPEST = 1.0
"""No ground is steeper than this over all of a drive, root mean square: what rises so is no height."""
PACE = (math.log(0.15), 1.5)
"""Logarithm of the usual speed of a rover [m/s], and its spread."""
GROUND = (math.log(0.9), 0.15)
"""Logarithm of the usual b, and its spread."""
SCRUB = (math.log(0.75), 0.35)
"""Logarithm of the usual g, and its spread."""
BLOCKS, ROWS = 300, 10
"""Blocks of a file at most, and rows in each at least."""
SAME = 0.02
"""Two readings whose numbers differ by less than this share are one."""


class Signals(NamedTuple):
    """What every choice makes of the blocks of a file."""

    places: np.ndarray
    "(p, n) complex velocity [m/s]"
    climbs: np.ndarray
    "(p, n) rise [m/s], 0 where no height is recorded"
    headings: np.ndarray
    "(h, n) exp(i psi), NaN for the course"
    turns: np.ndarray
    "(h, n) [rad/s]"
    rims: np.ndarray
    "(w, n) [m/s]"
    spins: np.ndarray
    "(w, n) turn rate that the rims would make without scrub [rad/s]"
    rates: np.ndarray
    "(w, wheels, n) [rad/s]"
    fastest: np.ndarray
    "(w,) rim speed that one in a hundred blocks of a wheel exceeds [m/s]"
    dt: np.ndarray
    "(n,) [s]"


class Options(NamedTuple):
    """The choices that are weighed together."""

    places: Sequence[Choice]
    headings: Sequence[Choice]
    wheels: Sequence[Choice]


def signals(recording: Recording, options: Options, rover: Rover) -> Signals:
    """Return the blocks of a file under every choice."""
    t = recording.t
    edges = np.linspace(0, len(t) - 1, max(3, min(BLOCKS, len(t) // ROWS)) + 1)
    rows = np.arange(len(t))
    dt = np.diff(np.interp(edges, rows, t))

    def change(values: np.ndarray) -> np.ndarray:
        good = np.isfinite(values)
        if good.sum() < 2:
            return np.zeros(len(dt))
        return np.diff(np.interp(edges, rows[good], values[good])) / dt

    def mean(values: np.ndarray) -> np.ndarray:
        good = np.isfinite(values)
        total = np.concatenate([[0.0], np.cumsum(np.where(good, values, 0.0))])
        count = np.concatenate([[0.0], np.cumsum(good)])
        at = np.round(edges).astype(int)
        return np.diff(total[at]) / np.maximum(np.diff(count[at]), 1.0)

    def of(choice: Choice, name: str) -> np.ndarray:
        return recording.values(choice.entries[name], name)

    velocity = np.array([change(of(choice, "body_x")) + 1j * change(of(choice, "body_y")) for choice in options.places])
    climbs = [change(of(choice, "body_z")) if "body_z" in choice.entries else 0.0 * dt for choice in options.places]
    pointing, turning = [], []
    for choice in options.headings:
        if choice.entries["body_yaw"].get("formula") == COURSE:
            pointing.append(np.full(len(dt), np.nan, complex))
            turning.append(np.full(len(dt), np.nan))
            continue
        yaw = of(choice, "body_yaw")
        pointing.append(mean(np.cos(yaw)) + 1j * mean(np.sin(yaw)))
        turning.append(change(yaw))
    names = [f"wheel_rate_{mount.name}" for mount in rover.wheels]
    rates = np.array([[mean(of(choice, name)) for name in names] for choice in options.wheels])
    sides = np.array([mount.side for mount in rover.wheels])
    speeds = rates * rover.radii[:, None]
    left, right = (speeds[:, sides == side].mean(axis=1) for side in "lr")
    fastest = np.percentile(np.abs(speeds), 99, axis=2).max(axis=1)
    motion = velocity, np.array(climbs), np.array(pointing), np.array(turning)
    return Signals(*motion, speeds.mean(axis=1), (right - left) / base_of(rover).track, rates, fastest, dt)


def log_likelihood(blocks: Signals, options: Options) -> np.ndarray:
    """Return how much likelier than chance each reading (place, heading, wheels) makes what a file holds, as a log."""
    free = np.array([choice.free for choice in options.wheels])
    size = np.linalg.norm(blocks.rims, axis=1)
    by_course = np.isnan(blocks.turns[:, 0])
    result = np.zeros((len(options.places), len(options.headings), len(options.wheels)))
    turning = np.where(by_course[:, None], -np.inf, _turning(np.nan_to_num(blocks.turns), blocks, free))
    for p, velocity in enumerate(blocks.places):
        length = float(np.linalg.norm(velocity))
        if np.percentile(np.abs(velocity), 99) > FASTEST or np.linalg.norm(blocks.climbs[p]) > STEEPEST * length:
            result[p] = -np.inf
        if length == 0.0 or np.isinf(result[p, 0, 0]):
            continue
        n = np.array([independent(velocity, rim) for rim in blocks.rims])
        dot = np.real(np.conj(np.nan_to_num(blocks.headings)) * velocity) @ blocks.rims.T
        result[p] = relation(dot, length, size, 2.0 * n, GROUND, free)
        result[p][by_course] = _paces(np.abs(velocity), np.abs(blocks.rims), n, free)
        result[p] += _slips(velocity, blocks.climbs[p], blocks.rims)
        course = _course_turns(velocity, blocks.dt)
        result[p] += np.maximum(turning, _turning(np.array([course]), blocks, free))
    result[:, :, ~free & (blocks.fastest > FASTEST)] = -np.inf
    return result


def _paces(speed: np.ndarray, rims: np.ndarray, n: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return how much likelier than chance the speed changes with the rims', where no heading tells their sense.

    Neither is below 0, so that they would be alike about zero by chance: what counts is how they vary, and their ratio.
    """
    ours, theirs = speed - speed.mean(), rims - rims.mean(axis=1, keepdims=True)
    varying = relation(theirs @ ours, np.linalg.norm(ours), np.linalg.norm(theirs, axis=1), n, None)
    return varying + scale_evidence(np.linalg.norm(speed), np.linalg.norm(rims, axis=1), n, GROUND, free)


def _slips(velocity: np.ndarray, climb: np.ndarray, rims: np.ndarray) -> np.ndarray:
    """Return how much likelier than either sense it is that wheels (w,) slip more uphill: log |v / c| by the slope.

    That they go together at all is no evidence: what is no height makes up for the way that it lacks.
    """
    size = np.abs(velocity)
    moves = (size > 0.3 * np.max(size)) & np.all(rims != 0.0, axis=0)
    if moves.sum() < ROWS:
        return np.zeros(len(rims))
    slope, ratio = (climb / np.maximum(size, 1e-12))[moves], np.log(np.abs(rims[:, moves]) / size[moves])
    slope, ratio = slope - slope.mean(), ratio - ratio.mean(axis=1, keepdims=True)
    n = np.array([independent(slope, row) for row in ratio])
    return sense(ratio @ slope, np.linalg.norm(ratio, axis=1), np.linalg.norm(slope), n)


def _turning(turns: np.ndarray, blocks: Signals, free: np.ndarray) -> np.ndarray:
    """Return how much likelier than chance turns (h, n) and the difference of the rims are, (h, w).

    A difference that is the rims' round-off tells nothing.
    """
    n = np.array([[independent(turn, spin) for spin in blocks.spins] for turn in turns])
    size, spin = np.linalg.norm(turns, axis=1)[:, None], np.linalg.norm(blocks.spins, axis=1)
    spin[spin < np.sqrt(np.finfo(float).eps) * np.linalg.norm(blocks.rims, axis=1)] = 0.0
    return relation(turns @ blocks.spins.T, size, spin, n, SCRUB, free)


def _course_turns(velocity: np.ndarray, dt: np.ndarray) -> np.ndarray:
    """Return how fast the course turns [rad/s]; a rover that backs up has not turned."""
    moves = np.abs(velocity) > 0.3 * np.median(np.abs(velocity))
    turned = np.angle((velocity[1:] * np.conj(velocity[:-1])) ** 2) / 2.0
    return np.concatenate([[0.0], np.where(moves[1:] & moves[:-1], turned, 0.0) / dt[1:]])


def log_prior(blocks: Signals, options: Options) -> np.ndarray:
    """Return the log prior of each reading: those of its choices; rovers drive at their pace, with y to the east where
    x is to the north, and forward where only their course is recorded."""
    pace = np.log(np.maximum(np.sqrt(np.mean(np.abs(blocks.places) ** 2, axis=1)), 1e-12))
    place, heading, wheel = (np.array([choice.weight for choice in some]) for some in options)
    place = place - 0.5 * ((pace - PACE[0]) / PACE[1]) ** 2
    prior = place[:, None, None] + heading[:, None] + wheel
    down = np.array([choice.turned for choice in options.places])[:, None]
    course = np.isnan(blocks.turns[:, 0])
    clockwise = np.array([choice.turned for choice in options.headings])
    prior += (down * np.where(course, 0.0, np.where(clockwise, 3.0, -3.0)))[:, :, None]
    ahead = np.log(0.05 + 0.9 * np.mean(blocks.rims > 0.0, axis=1))
    return np.asarray(prior + course[:, None] * ahead)


class Chosen(NamedTuple):
    """A reading, how sure each of its parts is, and the likeliest reading that differs in each part."""

    parts: tuple[int, int, int, int]
    "clock, place, heading, wheels"
    share: Mapping[str, float]
    rival: Mapping[str, tuple[int, int, int, int]]
    fits: float
    "probability that any reading is right"
    gear: float
    "ratio of the rims to the ground, less the usual slip"


PARTS = ("clock", "place", "heading", "wheels")


def choose(
    blocks: Sequence[Sequence[Signals]], lasts: Sequence[float], options: Options, weights: Sequence[float]
) -> Chosen:
    """Return the likeliest reading of all files together.

    `seen` holds every file's blocks on each clock, `lasts` how long the first takes by it [s], `weights` its log prior.
    """
    logs = np.array([
        weight + log_prior(files[0], options) + np.sum([log_likelihood(file, options) for file in files], axis=0)
        for files, weight in zip(blocks, weights, strict=True)
    ])  # fmt: skip
    posterior = shares(logs)
    best = np.unravel_index(int(np.argmax(logs)), logs.shape)
    parts = tuple(int(choice) for choice in best)
    agreeing = _same(blocks[parts[0]][0], lasts, options, parts)
    share, rival = {}, {}
    for axis, (part, agree) in enumerate(zip(PARTS, agreeing, strict=True)):
        along = np.moveaxis(posterior, axis, 0)
        share[part] = float(along[agree].sum() / max(posterior.sum(), 1e-300))
        rivals = np.where(np.moveaxis(np.broadcast_to(agree[:, None, None, None], along.shape), 0, axis), -np.inf, logs)
        rival[part] = tuple(int(choice) for choice in np.unravel_index(int(np.argmax(rivals)), logs.shape))
    went, rolled = (np.linalg.norm(np.concatenate(series)) for series in zip(
        *((file.places[parts[1]], file.rims[parts[3]]) for file in blocks[parts[0]]), strict=True))  # fmt: skip
    gear = math.exp(GROUND[0]) * float(rolled) / max(float(went), 1e-12)
    return Chosen(parts, share, rival, float(posterior.sum()), gear)  # type: ignore[arg-type]


def _same(blocks: Signals, lasts: Sequence[float], options: Options, best: tuple[int, ...]) -> list[np.ndarray]:
    """Return which choices of each part give the numbers of the best one."""

    def like(values: np.ndarray, at: int, tolerance: float = SAME) -> np.ndarray:
        flat = np.nan_to_num(values.reshape(len(values), -1))
        return np.asarray(np.linalg.norm(flat - flat[at], axis=1) <= tolerance * np.linalg.norm(flat[at]))

    clock, place, heading, wheel = best
    free = np.array([choice.free for choice in options.wheels])
    return [
        np.abs(np.array(lasts) / lasts[clock] - 1.0) < SAME,
        like(blocks.places, place),
        like(blocks.headings, heading, 5.0 * SAME),
        like(blocks.rates, wheel) & (free == free[wheel]),
    ]
