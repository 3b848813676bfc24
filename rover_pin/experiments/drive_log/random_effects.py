"""Effects that are drawn anew in each run of a drive log: uneven ground, drift of the tracker, uncertain duty steps.

Because such a random effect differs from run to run, it is no candidate for a missing effect, but a part of the noise.
Each function returns how the compared features change per unit of each random effect, as arrays of a `RandomField`:
`kind` (index into KINDS, TRACKER or STEPS), `fold` (index of the run) and `moved` (random effects, runs, channels,
blocks). The noise model learns the SD of each kind from the log,
unless the SD is known.

* Ground: raking the sand changes grip and slope along the path from run to run.
* Tracker: its zero drifts over seconds by about its noise, longer than the correlation time of blocks, and a run may
  begin with a wrong zero. Without the drift, all runs together would seem to show a bias, a scale error, a tilt or a
  spring.
* Duty steps: see `excluded_rows.AmbiguousStep`.
* Error of an estimated terrain: the terrain was estimated from the rover's own attitude, which also depends on sinkage
  and suspension. Its prior is known (`logs.run_terrain.GroundEstimate`), and runs over the same ground share its error.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from rover_pin.estimation.random_effects.random_field import SHARED, Kind
from rover_pin.experiments.drive_log.features import BLOCK, DRIFT, HEADING, PATH, LoggedRun, blocks, leaky, remove_level
from rover_pin.rover.rover import Rover
from rover_pin.simulation.logged_inputs import fill_gaps
from rover_pin.simulation.model.defaults import scale
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import Perturbation, Replay
from rover_pin.terrain.terrain import Terrain

GRIP = Kind("grip along the way", 0.05, "")
SLOPE = Kind("slope along the way", 0.01, "rad")
GRIP_OF_RUN = Kind("grip of a run", 0.05, "")
SLOPE_OF_RUN = Kind("slope of a run", 0.01, "rad")
KINDS = (GRIP, SLOPE, GRIP_OF_RUN, SLOPE_OF_RUN)
"""Kinds of random effects of the ground: grip and slope at one knot of the path, and grip and slope of a whole run.
Grip is stated as a fraction of tan phi."""
KNOT_SPACING = 0.12
"""Distance between two knots of the path for the paper's wheels [m]. Between knots, grip and slope change linearly. The
distance is about the size of a wheel and is scaled with the size of other rovers."""
MAX_KNOTS = 12
"""Maximum number of knots of one run, both along the path and in time. In a longer run, the knots are farther apart."""

PLACE = Kind("wander of the tracked place", 0.002, "m")
HEIGHT = Kind("wander of the tracked height", 0.002, "m")
COURSE = Kind("wander of the tracked heading", 0.002, "rad")
TILT = Kind("wander of the tracked roll and pitch", 0.002, "rad")
TRACKER = (PLACE, HEIGHT, COURSE, TILT)
"""Kinds of tracker drift. Each is a random walk of some numbers of the tracked pose."""
TRACKER_KINDS = {PATH: PLACE, DRIFT: PLACE, HEADING: COURSE, "body_z": HEIGHT, "body_roll": TILT, "body_pitch": TILT}
"""Compared feature (half-second mean) -> the kind of tracker drift that changes it."""
WALK_INTERVAL = 4.0
"""Duration of one step of the tracker's random walk [s] (assumed: drifts over seconds, as of light and temperature)."""

STEPS = (Kind("instant of a step of the duty", 1.0, "", is_known=True),)
"""The kind of random effect of a duty step at an uncertain instant. Its SD is known and is not learnt."""

GROUND_ERROR = (Kind("error of the estimated terrain", 1.0, "", is_known=True),)
"""The kind of random effect of an estimated terrain's error: one shape of the error, in SDs of its prior."""
SHAPE_SLOPE = 0.002
"""RMS slope [rad] of the change of the terrain with which the derivative by a shape is computed. It is small compared
with the slopes of the ground, so that the change of the prediction is proportional to it, and large compared with the
round-off of a replay."""


def ground_error_columns(
    runs: Sequence[LoggedRun],
    still: np.ndarray,
    predict_on: Callable[[Sequence[tuple[int, Terrain]]], Sequence[np.ndarray]],
) -> dict[str, np.ndarray]:
    """Return how the compared features of all runs change with each shape of the error of their estimated terrains.

    Parameters
    ----------
    runs : sequence of LoggedRun
        The runs of the log. Runs with the same object `ground` drive over one terrain and share its error.
    still : np.ndarray
        Features that the model predicts on the estimated terrains (runs, channels, blocks).
    predict_on : callable
        Function that takes pairs (index of a run, terrain), and returns the features (channels, blocks) of each run on
        this terrain, with the time steps of the replay on the estimated terrain.

    Returns
    -------
    dict
        The arrays `kind` (0, the index into GROUND_ERROR), `fold` and `moved` of a `RandomField`.
    """
    # One replay for each shape and each run on its ground, all in one request.
    columns, requests = [], list[tuple[int, Terrain]]()
    for ground in dict.fromkeys(run.ground for run in runs if run.ground is not None):
        for index, shape in enumerate(ground.shapes):
            steepness = np.concatenate([np.diff(shape, axis=axis).ravel() for axis in (0, 1)]) / ground.terrain.dx
            size = SHAPE_SLOPE / float(np.sqrt(np.mean(steepness**2)))
            members = [at for at, run in enumerate(runs) if run.ground is ground]
            columns.append((size, members))
            requests += [(member, ground.moved(index, size)) for member in members]
    changed = iter(predict_on(requests))
    table = np.zeros((len(columns), *still.shape))
    for row, (size, members) in zip(table, columns, strict=True):
        for member in members:
            # The change is 0 in blocks that are not compared, and after the end of a replay that broke off.
            row[member] = np.nan_to_num(next(changed) - still[member], posinf=0.0, neginf=0.0) / size
    return {"kind": np.zeros(len(table), dtype=int), "fold": np.full(len(table), SHARED), "moved": table}


def ground_columns(
    runs: Sequence[LoggedRun],
    model: Model,
    still: np.ndarray,
    replays: Callable[[Sequence[tuple[int, Perturbation]]], Sequence[Replay]],
    read: Callable[[int, Replay], np.ndarray],
) -> dict[str, np.ndarray]:
    """Return how the compared features of each run change with grip and slope of the ground, at each knot and in the
    whole run.

    A change of grip or slope at a knot decreases linearly to 0 at the neighbouring knots. The change of a whole run is
    the sum over its knots. A slope acts along the heading, as a force -m g slope on the rover with the mass m, and as a
    change of pitch and height.

    Parameters
    ----------
    runs : sequence of LoggedRun
        The runs of the log.
    model : Model
        The model for the simulation of the runs.
    still : np.ndarray
        Features that the model predicts without a perturbation (runs, channels, blocks).
    replays : callable
        Function that simulates the model for pairs (index of a run, perturbation).
    read : callable
        Function that returns the features (channels, blocks) of a replay, given the index of its run.

    Returns
    -------
    dict
        The arrays `kind` (indices into KINDS), `fold` and `moved` of a `RandomField`.
    """
    # One replay for each knot with more grip, and one with the force of a small additional slope.
    weight = model.built.mass * abs(model.gravity)
    knots = [(index, shape) for index, run in enumerate(runs) for shape in shares_of(run, model.rover)]
    grips = replays([(index, Perturbation(grip=GRIP.size * shape)) for index, shape in knots])
    pushed = replays([(index, Perturbation(force=-weight * SLOPE.size * shape)) for index, shape in knots])
    # The sensors of the body also see the additional slope: the pitch directly (nose down is positive), the height by
    # its sum along the path. A replay that did not start has no channels and stays unchanged.
    slopes = []
    for (index, shape), driven in zip(knots, pushed, strict=True):
        slope, channels = SLOPE.size * shape, dict(driven.channels)
        if "body_z" in channels:
            heading = runs[index].heading
            steps = np.array([np.diff(channels[f"body_{axis}"], prepend=np.nan) for axis in "xy"])
            ahead = np.nan_to_num(np.cos(heading) * steps[0] + np.sin(heading) * steps[1])
            channels["body_pitch"] = channels["body_pitch"] - slope
            channels["body_z"] = channels["body_z"] + np.cumsum(slope * ahead)
        slopes.append(dataclasses.replace(driven, channels=channels))
    columns = []
    for knot_kind, run_kind, replays_of_kind in ((GRIP, GRIP_OF_RUN, grips), (SLOPE, SLOPE_OF_RUN, slopes)):
        # A run with a single knot needs no effect for the knot, because it equals the effect of the whole run.
        changes: list[list[np.ndarray]] = [[] for _ in runs]
        for (index, _), driven in zip(knots, replays_of_kind, strict=True):
            # The change is 0 in blocks that are not compared, and after the end of a replay that broke off.
            changes[index].append(np.nan_to_num(read(index, driven) - still[index], posinf=0.0, neginf=0.0))
        for index, run_changes in enumerate(changes):
            columns += [(knot_kind, index, change) for change in run_changes if len(run_changes) > 1]
            columns.append((run_kind, index, np.sum(run_changes, axis=0)))
    table = np.zeros((len(columns), *still.shape))
    for row, (_, index, change) in zip(table, columns, strict=True):
        row[index] = change
    kind, fold = np.array([(KINDS.index(kind), index) for kind, index, _ in columns]).T
    return {"kind": kind, "fold": fold, "moved": table}


def shares_of(run: LoggedRun, rover: Rover) -> np.ndarray:
    """Return the weight that each knot of a run's path has in each row of the run (knots, rows).

    The knots lie KNOT_SPACING apart along the smoothed logged path. The weight of a knot is 1 at the knot and falls
    linearly to 0 at its neighbours, so that the weights of a row add up to 1.
    """
    # The path is smoothed, because the noise of the tracker would make it longer.
    length = max(1, round(BLOCK / run.commands.period))
    x, y = (uniform_filter1d(fill_gaps(run.commands.place[:, axis]), length, mode="nearest") for axis in (0, 1))
    distance = np.cumsum(np.hypot(np.diff(x, prepend=x[0]), np.diff(y, prepend=y[0])))
    # A short run has a single knot, so that only its mean grip and slope vary.
    count = min(round(float(distance[-1]) / (KNOT_SPACING * scale(rover))), MAX_KNOTS - 1) + 1
    if count == 1:
        return np.ones((1, len(distance)))
    knots = np.linspace(0.0, distance[-1], count)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(distance - knots[:, None]) / (knots[1] - knots[0])))


def tracker_columns(
    runs: Sequence[LoggedRun], channels: Sequence[str], length: int, ahead: np.ndarray
) -> dict[str, np.ndarray]:
    """Return how the compared features of each run change with each step of the tracker's random walk.

    Parameters
    ----------
    runs : sequence of LoggedRun
        The runs of the log.
    channels : sequence of str
        Names of the features.
    length : int
        Number of blocks of the longest run.
    ahead : np.ndarray
        Change of each predicted feature for each metre of forward error in the place of the replay (runs, channels,
        length). It is needed because a replay is held to the logged place, so that an error of this place along the
        path also shifts bumps.

    Returns
    -------
    dict
        The arrays `kind` (indices into TRACKER), `fold` and `moved` of a `RandomField`.
    """
    # Each step of the walk of each run and channel is one random effect.
    labels, columns = [], []
    for index, run in enumerate(runs):
        # Fraction of each step of the walk that is made at each row (steps, T): linear in time. The first step is
        # complete at the start of the run: it is the tracker's zero.
        t, period = run.commands.t, run.commands.period
        count = min(max(round((t[-1] - t[0]) / WALK_INTERVAL), 1), MAX_KNOTS - 1) + 1
        done = (t - t[0]) / (t[-1] - t[0]) * (count - 1)
        fractions = np.clip(done - np.arange(-1, count - 1)[:, None], 0.0, 1.0)
        for row, name in enumerate(channels):
            for error in TRACKER_KINDS[name].size * fractions if name in TRACKER_KINDS else ():
                features, means = np.zeros((len(runs), len(channels), length)), blocks(error, period)
                if name in (PATH, DRIFT, HEADING):
                    # These features are leaky sums of increments, so only the change of the error counts.
                    change = blocks(leaky(run.summed_rows * np.diff(error, prepend=error[:1]), period), period)
                else:
                    change = remove_level(name, means, run.usable)
                features[index, row, : len(means)] = change
                if name == PATH:
                    features[index, :, : len(means)] -= ahead[index][:, : len(means)] * means
                if features.any():
                    labels.append((TRACKER.index(TRACKER_KINDS[name]), index))
                    columns.append(features)
    kind, fold = np.array(labels, dtype=int).reshape(-1, 2).T
    return {"kind": kind, "fold": fold, "moved": np.array(columns).reshape(-1, len(runs), len(channels), length)}


def step_columns(
    late: Sequence[tuple[int, np.ndarray]],
    model: Model,
    still: np.ndarray,
    replays: Callable[[Sequence[tuple[int, Perturbation]]], Sequence[Replay]],
    read: Callable[[int, Replay], np.ndarray],
) -> dict[str, np.ndarray]:
    """Return how the compared features change if an ambiguous duty step happens one SD later than assumed, for each
    such step.

    Parameters
    ----------
    late : sequence of (int, np.ndarray)
        For each step: index of its run, and change of the duties if the step is later (rows, wheels), from
        `later_duties`.
    model, still, replays, read
        The same as in `ground_columns`.

    Returns
    -------
    dict
        The arrays `kind` (0, the index into STEPS), `fold` and `moved` of a `RandomField`.
    """
    # A duty acts on a replay as the torque that it gives the standing motor: stall torque times duty.
    stall_torque = float(model.motor.stall_torque)
    driven = replays([(index, Perturbation(torque=stall_torque * duty)) for index, duty in late])
    table, fold = np.zeros((len(late), *still.shape)), np.array([index for index, _ in late])
    for row, index, late_replay in zip(table, fold, driven, strict=True):
        row[index] = np.nan_to_num(read(index, late_replay) - still[index], posinf=0.0, neginf=0.0)
    return {"kind": 0 * fold, "fold": fold, "moved": table}
