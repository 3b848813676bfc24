"""A logged run driven again: the model under the logged commands, held to the place where the log was.

Commands are duties, which the motors turn into torques, or the measured wheel rates themselves: then the wheels turn as
they did, whatever torque that takes, motors are out of sight, and what is compared is where that moves the rover.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.effects.tracked_point import DRAWN
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.failure import FASTEST, failure
from rover_pin.simulation.logged_inputs import (
    PLACE,
    duty_before,
    fill_gaps,
    means_at,
    rates_of,
    tied_means,
    true_inputs,
)
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.loop import Loop, Outcome
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.pace import FINEST
from rover_pin.simulation.resolution import parts
from rover_pin.simulation.start.place import SharedRest, Start, settled_state, taken_over
from rover_pin.simulation.timing import Timing
from rover_pin.simulation.trace.inertial import GRAVITY, has_inertial
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain

PERIOD = 0.05
"""Time between rows of a replay [s], unless the log's rows are further apart."""
ROUGH = 20.0
"""How many times `pace.ROUGH` its steps may misjudge: a tracker sees less than a drive's tolerance."""
HOLD = 1.0
"""Time constant [s] with which the simulated rover is drawn to the logged place and heading."""
CHECKED = 10
"""Rows between two looks whether the rover still drives."""
FIRST_ROWS = 5
"""Rows at the start whose mean is the place where the run began, unless the log declares it."""


@dataclass(frozen=True, eq=False)
class Commands:
    """What a logged run did, on the rows of its replay: `t` [s] (T,), duty (T, wheels), steering and place.

    `place` (T, 3) is the logged x, y [m] and heading [rad], not a number where the log has a gap. Where the wheels are
    held to their measured `rate` [rad/s] (T, wheels), the duty is that rate as a share of the fastest.
    """

    t: np.ndarray
    duty: np.ndarray
    steer: np.ndarray
    place: np.ndarray
    start: Start
    rate: np.ndarray | None = None
    terrain: Terrain | None = None
    "the ground of this run alone, instead of the model's"
    inertial: bool = False
    "whether an inertial unit was logged"

    def on(self, model: Model) -> Model:
        """Return a model on the ground of this run."""
        return model if self.terrain is None else model.replace(terrain=self.terrain)

    @property
    def rate_driven(self) -> bool:
        """Whether the wheels are held to their measured rates."""
        return self.rate is not None

    @property
    def period(self) -> float:
        """Time between rows [s]."""
        return float(self.t[1] - self.t[0])


@dataclass(frozen=True, eq=False)
class Perturbation:
    """Small additions for a description of what a model lacks, one row a time step: torques, force, grip.

    `torque` (T, wheels) [N m] is added at the wheels, `force` (T,) [N] along the heading, `grip` (T,) changes tan phi
    of the soil by this share. Any of them may be left out.
    """

    torque: np.ndarray | None = None
    force: np.ndarray | None = None
    grip: np.ndarray | None = None


class StepsTaken(NamedTuple):
    """The step [s] at which commands are looked at, and the lengths [s] of all that were taken, shorter where forces
    ask for it."""

    dt: float
    lengths: np.ndarray


@dataclass(frozen=True, eq=False)
class Replay:
    """What the model did: channels as in a trace, on the rows of the commands; `stop` says why it ended early.

    Slips, sinkages and forces, with which no log is compared, are those of the last step before the row.
    """

    channels: dict[str, np.ndarray] = field(repr=False)
    stop: str = ""
    steps: StepsTaken | None = field(default=None, repr=False)
    "None: it did not begin"


def commands(log: Trace, wheels: tuple[str, ...], steered: tuple[str, ...]) -> Commands:
    """Return the commands and the place of a logged run, on rows of equal distance.

    The duty of a row holds since the row before, as the simulator logs it; of uneven rows, which are read at any time
    between two commands, and where rows are missing, the mean of both does.

    Raises
    ------
    DataError
        A channel that a replay needs and the log does not have, fewer than two rows, or no place where a run begins.
    """
    t, x, y, yaw = log.need("t_s", "body_x", "body_y", "body_yaw")
    rate_driven = log.rate_driven
    inputs = np.column_stack(log.need(*(f"{'wheel_rate' if rate_driven else 'duty'}_{wheel}" for wheel in wheels)))
    if len(t) < 2:
        raise DataError(f"{log.attrs.get('file', 'the run')}: a replay needs two rows at least.")
    period = max(PERIOD, round(float(np.median(np.diff(t))), 6))
    rows = t[0] + period * np.arange(1 + math.floor((t[-1] - t[0]) / period + 1e-6))
    at = np.searchsorted(t, rows - period / 2)
    steer = [_hold_last(log[f"steer_{name}"])[at] if f"steer_{name}" in log else np.zeros(at.size) for name in steered]
    rate = np.column_stack([fill_gaps(means_at(t, omega, rows, period)) for omega in inputs.T]) if rate_driven else None
    command = np.column_stack([_hold_last(column) for column in inputs.T])
    duty = duty_before(t, command, rows, period) if rate is None else shares(rate)
    course = np.unwrap(_hold_last(yaw))
    begun = np.column_stack([means_at(t, column, rows[:FIRST_ROWS], period) for column in (x, y, course)])
    declared = log.attrs.get("start")
    start = Start(**declared) if declared else _mean_start(log, begun, period)
    heading = np.where(np.isfinite(yaw), course, np.nan)
    place = np.column_stack([means_at(t, column, rows, period) for column in (x, y, heading)])
    steers = np.column_stack(steer) if steer else np.zeros((len(rows), 0))
    return Commands(rows, duty, steers, place, start, rate, inertial=has_inertial(log.channels))


def _mean_start(log: Trace, first: np.ndarray, period: float) -> Start:
    """Return the mean of the first rows as the start of a run that declares none."""
    if not np.isfinite(first).any(axis=0).all():
        raise DataError(
            f"{log.attrs.get('file', 'the run')}: no place is known in the first {len(first) * period:.2g} s and "
            "no start is declared; give its [[run]] a start (x, y, yaw), or drop the rows before the first known "
            "body_x and body_y."
        )
    return Start(*np.nanmean(first, axis=0).tolist())


def shares(rate: np.ndarray) -> np.ndarray:
    """Return rates as shares of the fastest of them."""
    return np.asarray(rate / max(float(np.max(np.abs(rate))), 1e-9))


def _hold_last(values: np.ndarray) -> np.ndarray:
    """Return the values with every gap filled by the last value before it, or the first after it."""
    good = np.flatnonzero(np.isfinite(values))
    if not good.size:
        return np.zeros_like(values)
    return np.asarray(values[good[np.maximum(np.searchsorted(good, np.arange(len(values)), "right") - 1, 0)]])


def replay(
    model: Model,
    run: Commands,
    perturbation: Perturbation = Perturbation(),
    rest_state: SharedRest | None = None,
    fine: bool = False,
    steps: StepsTaken | None = None,
) -> Replay:
    """Return what `model` does under the logged commands, from where it comes to rest, or from a `rest_state`.

    Steps are a drive's default ones, half as long and judged as a drive's where it is to be `fine`, or those of another
    replay: what a number changes is smooth then, where steps that each chooses for itself jump.
    Source: Bock, Recent advances in parameter identification techniques for ODE (1983), internal differentiation.

    The rover is drawn to the logged x, y and heading with the time constant HOLD, so that it stays on the ground where
    the log was and errors do not add up. `body_x`, `body_y` and `body_yaw` are what the model itself has driven from
    the start, without those corrections: the integral of its velocity.

    Raises
    ------
    DataError
        Commands of other wheels than the rover's.
    SimulationError
        The rover does not settle at the start, or the ground is too stiff for any step.
    """
    model = run.on(model)
    _check_widths(model, run)
    state = settled_state(model, run.start) if rest_state is None else taken_over(model, rest_state)
    model = model.begin_at(run.start.x, run.start.y)
    longest = Timing(control=run.period, sample=run.period).dt
    dt = steps.dt if steps else longest / parts(model, state, longest) / (1 + fine)
    kernel = Kernel(model, state, dt, symmetric=False)
    kernel.disable_energy_balance()
    per_row = round(run.period / dt)
    lengths = {"followed": np.append(steps.lengths, 0.0)} if steps else {}
    fields = {"rough": 1.0 if fine else ROUGH, **_fields(model, run, perturbation), **lengths}
    loop = Loop(kernel, dt, per_row * len(run.t), per_row, **fields)
    loop.keep_history(per_row * len(run.t) * FINEST)
    if run.rate is not None:
        kernel.hold(loop.keep["rate_rows"][0].copy())
    outcome = loop.run(len(run.t))
    while outcome is Outcome.FAILS:
        why = failure(model, state, loop.rows["record"][loop.row - 1])
        if why:
            break
        outcome = loop.run(len(run.t))
    else:
        why = "" if outcome is Outcome.DONE else "diverged"
    channels = _channels(model, run, _with_last(loop, loop.row - (outcome is Outcome.FAILS)))
    return Replay(channels, why, StepsTaken(dt, loop.steps_taken()))


def _check_widths(model: Model, run: Commands) -> None:
    """Refuse commands of other wheels than the rover's: the compiled loop reads one a wheel from each row."""
    wheels = model.rover.wheels
    need = (len(wheels), sum(wheel.steer_dof is not None for wheel in wheels))
    have = (run.duty.shape[1], run.steer.shape[1])
    if have != need:
        raise DataError(
            f"the commands are of {have[0]} driven, {have[1]} steered wheels, the rover has {need[0]} and {need[1]}: "
            "give `commands` the names of all of them."
        )


def _fields(model: Model, run: Commands, perturbation: Perturbation) -> dict[str, Any]:
    """Return the fields of a replay's loop: its commands, row by row."""
    duty = run.duty if perturbation.torque is None else run.duty + perturbation.torque / float(model.motor.stall_torque)
    rows = {
        "duty_rows": duty,
        "steer_rows": run.steer,
        "force_rows": perturbation.force,
        "grip_rows": perturbation.grip,
    }
    fields = {name: np.array(values, dtype=float, order="C") for name, values in rows.items() if values is not None}
    channels = true_inputs(model, run)
    place = np.column_stack([channels[name] for name in PLACE])
    if run.rate is not None:
        fields["rate_rows"] = rates_of(model, channels)
    fields["gave"] = np.zeros(run.steer.shape[1])
    return {**fields, "place_rows": place, "share": run.period / HOLD, "check_every": CHECKED}


def _with_last(loop: Loop, good: int) -> np.ndarray:
    """Return the rows of a replay; after an early end the last good one stands for the rest, or where it is now.

    Good are those before the first that is faster than any rover.
    """
    if good < len(loop.rows):
        is_off = ~(np.abs(loop.rows["v"][:good, :3]).max(axis=1, initial=0.0) < FASTEST)
        good = int(np.argmax(is_off)) if is_off.any() else good
        loop.rows[good:] = loop.rows[good - 1] if good else loop.now()
    return loop.rows


def _channels(model: Model, run: Commands, rows: np.ndarray) -> dict[str, np.ndarray]:
    rover = model.rover
    q, v, record, attitude, offset = (rows[name] for name in ("q", "v", "record", "attitude", "moved"))
    channels = {"t_s": run.t}
    current = record[:, :, RECORD.index("current")]
    if run.rate_driven:
        current = tied_means(model, record[:, :, RECORD.index("torque")]) / float(model.motor.constant)
    for i, wheel in enumerate(rover.wheels):
        channels[f"wheel_rate_{wheel.name}"] = v[:, wheel.dof]
        channels[f"current_{wheel.name}_A"] = current[:, i]
        for name in ("slip", "sinkage", "normal", "tangential"):
            channels[f"{name}_{wheel.name}"] = record[:, i, RECORD.index(name)]
    channels |= {name: q[:, index] for name, index in rover.angles.items()}
    channels |= {"body_x": q[:, 0] - offset[:, 0], "body_y": q[:, 1] - offset[:, 1], "body_z": q[:, 2]}
    channels |= {"body_roll": attitude[:, 0], "body_pitch": attitude[:, 1]}
    channels |= {"body_yaw": np.unwrap(attitude[:, 2]) - offset[:, 2], DRAWN: offset[:, 2]}
    channels |= {f"body_v{axis}": rows["velocity"][:, i] for i, axis in enumerate("xyz")}
    channels["battery_V"] = record[:, 0, RECORD.index("supply")]
    if run.inertial:
        gravity = model.built.model.gravity.linear
        channels |= {name: np.full(len(q), along) for name, along in zip(GRAVITY, gravity, strict=True)}
    return {name: np.ascontiguousarray(values) for name, values in channels.items()}
