"""Replay of a logged run: the model drives under the logged commands, and is pulled to the logged position so that it
stays near it.

The commands are either duties, which the motors turn into torques, or the measured wheel rates. In the second case the
wheels turn at the measured rates, whatever torque this needs. The motors then have no influence, and the replay shows
the rover's motion by wheels with these rates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.effects.tracked_point import DRAWN
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.failure import MAX_SPEED, failure
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
from rover_pin.simulation.native.loop import Loop, LoopStatus
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.sensors import GRAVITY, has_inertial
from rover_pin.simulation.start import SharedRest, Start, settled_state, taken_over
from rover_pin.simulation.stepping.pace import FINEST
from rover_pin.simulation.stepping.resolution import parts
from rover_pin.simulation.stepping.timing import Timing
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain

PERIOD = 0.05
"""Shortest time between the rows of a replay [s]; it equals the usual time between the rows of a simulated drive. If
the rows of the log are further apart, the rows of the replay have their median distance. A log with closer rows does
not make the replay slower."""
ROUGH = 20.0
"""Factor of a replay on the limits of the forecast error (`pace.ROUGH`, `pace.CALM`), so that its steps may be longer
than the steps of a drive. Reason: a tracker that measures positions does not resolve the small errors that a drive
tolerates."""
HOLD = 1.0
"""Time constant [s] of the pull of the simulated rover to the logged position and heading (assumed). It is short enough
to keep the rover on the ground of the logged run, and long compared with the time steps."""
ROWS_PER_CHECK = 10
"""Number of rows between two checks whether the rover can still drive, or has capsized, for example."""
FIRST_ROWS = 5
"""Number of rows at the beginning of a log whose mean position is taken as the start of the run. The mean of five rows
has less than half the noise of a single row, and the rover hardly moves in them. They are not used if the log declares
the start."""


@dataclass(frozen=True, eq=False)
class ReplayCommands:
    """Commands and positions of a logged run, interpolated to the T rows of its replay, which have equal distances in
    time.
    """

    t: np.ndarray
    """(T,) times of the rows [s]"""
    duty: np.ndarray
    """(T, wheels) duties [-]; if the wheels turn at measured rates, these are the rates divided by the largest rate
    (`shares`)"""
    steer: np.ndarray
    """(T, servos) commanded angle of each steered wheel [rad]"""
    place: np.ndarray
    """(T, 3) logged x, y [m] and heading [rad] of the base; NaN in gaps of the log"""
    start: Start
    "position and heading at which the run begins"
    rate: np.ndarray | None = None
    "(T, wheels) measured rates [rad/s] at which the wheels turn in the replay; None: the duties drive the motors"
    terrain: Terrain | None = None
    """ground of this run; None: the ground of the model"""
    inertial: bool = False
    """whether the log has readings of an inertial measurement unit"""

    def on(self, model: Model) -> Model:
        """Return the model with the ground of this run, if the run has its own; otherwise the model itself."""
        return model if self.terrain is None else model.replace(terrain=self.terrain)

    @property
    def rate_driven(self) -> bool:
        """Whether the wheels turn at their measured rates in the replay. If not, the motors turn the wheels under the
        logged duties.
        """
        return self.rate is not None

    @property
    def period(self) -> float:
        """Time between two rows [s]."""
        return float(self.t[1] - self.t[0])


@dataclass(frozen=True, eq=False)
class Perturbation:
    """Small additions to a replay of T rows, which represent missing effects: a torque at each wheel, a force on the
    base, and a change of the soil's grip. None means that nothing is added.
    """

    torque: np.ndarray | None = None
    "(T, wheels) torque added at the wheels [N m]"
    force: np.ndarray | None = None
    """(T,) force on the base along its heading [N]"""
    grip: np.ndarray | None = None
    """(T,) relative change of tan phi of all soils [-], where phi is the friction angle"""


class StepsTaken(NamedTuple):
    """The time steps that a replay took. Another replay can take equal steps, so that the difference between the two
    replays contains no difference of step sizes.
    """

    dt: float
    "length of a step [s] before it is divided into parts"
    lengths: np.ndarray
    """length of each step that was taken [s]: dt, or a part of dt if forces changed fast"""


@dataclass(frozen=True, eq=False)
class Replay:
    """Result of a replay: its channels, the reason if it ended early, and the time steps that it took.

    Slips, sinkages and forces are the values in the last step before a row, not the values at the row itself. They are
    not compared with logs.
    """

    channels: dict[str, np.ndarray] = field(repr=False)
    """name of a channel, as in a trace -> its values at the rows of the commands"""
    stop: str = ""
    """reason why the replay ended early, such as "capsized"; empty if the replay is complete"""
    steps: StepsTaken | None = field(default=None, repr=False)
    """time steps that the replay took; None: the replay did not begin"""


def commands(log: Trace, wheels: tuple[str, ...], steered: tuple[str, ...]) -> ReplayCommands:
    """Return the commands and positions of a logged run for a replay, at rows of equal distance in time.

    Parameters
    ----------
    log : Trace
        A measured run. The duty of a row acts from the previous row until this row, as in the simulator's logs. If rows
        are uneven or missing, the mean of the duties of two neighbouring rows acts between them.
    wheels, steered : tuples of str
        Names of the driven wheels and of the steered wheels, in the rover's order.

    Raises
    ------
    DataError
        The log lacks a channel that a replay needs, has fewer than two rows, or states no position at which the run
        begins.
    """
    t, x, y, yaw = log.need("t_s", "body_x", "body_y", "body_yaw")
    rate_driven = log.rate_driven
    inputs = np.column_stack(log.need(*(f"{'wheel_rate' if rate_driven else 'duty'}_{wheel}" for wheel in wheels)))
    if len(t) < 2:
        raise DataError(
            f"{log.attrs.get('file', 'the run')}: the log has {len(t)} rows, but a replay needs at least two: give a "
            "longer log."
        )
    period = max(PERIOD, round(float(np.median(np.diff(t))), 6))
    rows = t[0] + period * np.arange(1 + math.floor((t[-1] - t[0]) / period + 1e-6))
    # Commands are steps in time: a row takes the value that was logged for it, never a mean of two commands.
    nearest = np.searchsorted(t, rows - period / 2)
    steer = [
        _hold_last(log[f"steer_{name}"])[nearest] if f"steer_{name}" in log else np.zeros(nearest.size)
        for name in steered
    ]
    rate = np.column_stack([fill_gaps(means_at(t, omega, rows, period)) for omega in inputs.T]) if rate_driven else None
    command = np.column_stack([_hold_last(column) for column in inputs.T])
    duty = duty_before(t, command, rows, period) if rate is None else shares(rate)
    # Position and heading are means around each row. In gaps of the log they are NaN, and the replay runs freely.
    course = np.unwrap(_hold_last(yaw))
    first = np.column_stack([means_at(t, column, rows[:FIRST_ROWS], period) for column in (x, y, course)])
    declared = log.attrs.get("start")
    if not declared and not np.isfinite(first).any(axis=0).all():
        raise DataError(
            f"{log.attrs.get('file', 'the run')}: a replay cannot begin, because the log has no position in the first "
            f"{len(first) * period:.2g} s and declares no start: give its [[run]] a start (x, y, yaw), or remove the "
            "rows before the first known body_x, body_y and body_yaw."
        )
    start = Start(**declared) if declared else Start(*np.nanmean(first, axis=0).tolist())
    heading = np.where(np.isfinite(yaw), course, np.nan)
    place = np.column_stack([means_at(t, column, rows, period) for column in (x, y, heading)])
    steers = np.column_stack(steer) if steer else np.zeros((len(rows), 0))
    return ReplayCommands(rows, duty, steers, place, start, rate, inertial=has_inertial(log.channels))


def shares(rate: np.ndarray) -> np.ndarray:
    """Return wheel rates [rad/s] divided by the largest absolute rate among them [-]. The result takes the place of
    duties that were not logged.
    """
    return np.asarray(rate / max(float(np.max(np.abs(rate))), 1e-9))


def _hold_last(values: np.ndarray) -> np.ndarray:
    """Return a channel with each gap (NaN) filled by the last value before it. Gaps at the beginning are filled with
    the first value after them. If all values are NaN, the result is zero.
    """
    good = np.flatnonzero(np.isfinite(values))
    if not good.size:
        return np.zeros_like(values)
    return np.asarray(values[good[np.maximum(np.searchsorted(good, np.arange(len(values)), "right") - 1, 0)]])


def replay(
    model: Model,
    run: ReplayCommands,
    perturbation: Perturbation = Perturbation(),
    rest_state: SharedRest | None = None,
    fine: bool = False,
    steps: StepsTaken | None = None,
) -> Replay:
    """Drive a model under the commands of a logged run, beginning at rest at the start of the run, and return the
    channels.

    The simulated rover is pulled to the logged x, y and heading with the time constant HOLD, so that it stays on the
    ground of the logged run, and errors do not accumulate. The channels `body_x`, `body_y` and `body_yaw` of the result
    do not contain these corrections: they are the integral of the model's own velocity from the start.

    Parameters
    ----------
    model : Model
        The model to drive.
    run : ReplayCommands
        Commands and positions of the logged run.
    perturbation : Perturbation
        Additions to torque, force and grip.
    rest_state : SharedRest, optional
        State at rest of another model of this rover, as the start of this model; if missing, the model is set down at
        the start of the run.
    fine : bool
        Take steps of half the default length, with the limits of the forecast error of a drive instead of the wider
        limits of a replay (ROUGH).
    steps : StepsTaken, optional
        Time steps of another replay, which this replay takes again. If two replays take equal steps, their difference
        is a smooth function of a parameter; if each replay chose its own steps, the difference would jump.

    Raises
    ------
    DataError
        The number of wheels in the commands differs from the rover's.
    SimulationError
        The rover does not come to rest at the start, or the ground is too stiff for every step size.

    Source: Bock, Recent advances in parameter identification techniques for ODE (1983), internal differentiation.
    """
    model = run.on(model)
    wheels = model.rover.wheels
    # Commands for another number of wheels would be given to the wrong wheels.
    needed = (len(wheels), sum(wheel.steer_dof is not None for wheel in wheels))
    given = (run.duty.shape[1], run.steer.shape[1])
    if given != needed:
        raise DataError(
            f"the commands are for {given[0]} driven and {given[1]} steered wheels, but the rover has {needed[0]} and "
            f"{needed[1]}: call `commands` with the names of all driven and all steered wheels."
        )
    # The replay begins at rest. Its step divides the time between rows, as finely as the ground needs.
    state = settled_state(model, run.start) if rest_state is None else taken_over(model, rest_state)
    model = model.begin_at(run.start.x, run.start.y)
    longest = Timing(control=run.period, sample=run.period).dt
    dt = steps.dt if steps else longest / parts(model, state, longest) / (1 + fine)
    kernel = Kernel(model, state, dt, symmetric=False)
    kernel.disable_energy_balance()
    per_row = round(run.period / dt)
    lengths = {"followed": np.append(steps.lengths, 0.0)} if steps else {}  # the 0 marks the end in C
    # Commands, logged positions and perturbations enter the C struct Loop with one entry for each row. At standstill, a
    # motor gives its stall torque times the duty, so that a torque is added as an additional duty.
    duty = run.duty if perturbation.torque is None else run.duty + perturbation.torque / float(model.motor.stall_torque)
    rows = {
        "duty_rows": duty,
        "steer_rows": run.steer,
        "force_rows": perturbation.force,
        "grip_rows": perturbation.grip,
    }
    fields: dict[str, Any] = {
        name: np.array(values, dtype=float, order="C") for name, values in rows.items() if values is not None
    }
    channels = true_inputs(model, run)
    if run.rate is not None:
        fields["rate_rows"] = rates_of(model, channels)
    fields |= {"gave": np.zeros(run.steer.shape[1]), "place_rows": np.column_stack([channels[name] for name in PLACE])}
    fields |= {"share": run.period / HOLD, "check_every": ROWS_PER_CHECK, "rough": 1.0 if fine else ROUGH, **lengths}
    loop = Loop(kernel, dt, per_row * len(run.t), per_row, **fields)
    loop.keep_history(per_row * len(run.t) * FINEST)
    # Wheels that are held to measured rates start with the rates of the first row.
    if run.rate is not None:
        kernel.hold(loop.keep["rate_rows"][0].copy())
    # The loop in C may report a failure that `failure` does not confirm. `failure` decides, and the loop goes on.
    status = loop.run(len(run.t))
    while status is LoopStatus.FAILS:
        stop = failure(model, state, loop.rows["record"][loop.row - 1])
        if stop:
            break
        status = loop.run(len(run.t))
    else:
        stop = "" if status is LoopStatus.DONE else "diverged"
    # After an early end the last good row fills the rest, so that all replays of a run have the same shape. Good rows
    # are those before the first that is faster than any rover.
    good = loop.row - (status is LoopStatus.FAILS)
    if good < len(loop.rows):
        too_fast = ~(np.abs(loop.rows["v"][:good, :3]).max(axis=1, initial=0.0) < MAX_SPEED)
        good = int(np.argmax(too_fast)) if too_fast.any() else good
        loop.rows[good:] = loop.rows[good - 1] if good else loop.now()
    return Replay(_channels(model, run, loop.rows), stop, StepsTaken(dt, loop.steps_taken()))


def _channels(model: Model, run: ReplayCommands, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Return the channels of a replay, named as in a drive log, from the rows that the loop has written."""
    rover = model.rover
    q, v, record, attitude, offset = (rows[name] for name in ("q", "v", "record", "attitude", "moved"))
    channels = {"t_s": run.t}
    current = record[:, :, RECORD.index("current")]
    if run.rate_driven:
        # Wheels that turn at measured rates have no motor in the model: the current follows from the torque of the
        # wheel.
        current = tied_means(model, record[:, :, RECORD.index("torque")]) / float(model.motor.constant)
    for i, wheel in enumerate(rover.wheels):
        channels[f"wheel_rate_{wheel.name}"] = v[:, wheel.dof]
        channels[f"current_{wheel.name}_A"] = current[:, i]
        for name in ("slip", "sinkage", "normal", "tangential"):
            channels[f"{name}_{wheel.name}"] = record[:, i, RECORD.index(name)]
    channels |= {name: q[:, index] for name, index in rover.angles.items()}
    # `moved` is the sum of the corrections towards the log; without them, the position is the model's own.
    channels |= {"body_x": q[:, 0] - offset[:, 0], "body_y": q[:, 1] - offset[:, 1], "body_z": q[:, 2]}
    channels |= {"body_roll": attitude[:, 0], "body_pitch": attitude[:, 1]}
    channels |= {"body_yaw": np.unwrap(attitude[:, 2]) - offset[:, 2], DRAWN: offset[:, 2]}
    channels |= {f"body_v{axis}": rows["velocity"][:, i] for i, axis in enumerate("xyz")}
    channels["battery_V"] = record[:, 0, RECORD.index("supply")]
    if run.inertial:
        gravity = model.built.model.gravity.linear
        channels |= {name: np.full(len(q), along) for name, along in zip(GRAVITY, gravity, strict=True)}
    return {name: np.ascontiguousarray(values) for name, values in channels.items()}
