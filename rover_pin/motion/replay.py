"""A logged run driven again: the model under the logged commands, held to the place where the log was."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from rover_pin.errors import DataError
from rover_pin.motion.failure import failure, suspension_of
from rover_pin.motion.kernel import Kernel
from rover_pin.motion.model import Model
from rover_pin.motion.native.shared import RECORD
from rover_pin.motion.pace import Pace
from rover_pin.motion.place import Start, settled
from rover_pin.motion.resolution import parts
from rover_pin.motion.state import DriveState, base_rotation, roll_pitch_yaw
from rover_pin.motion.trace import Trace

PERIOD = 0.05
"""Time between rows of a replay [s], unless the log's rows are further apart."""
DT = 0.01
"""Step of a replay [s], divided where the ground asks for it: within a tenth of a tracker's noise of the default step,
at half its time."""
HOLD = 1.0
"""Time constant [s] with which the simulated rover is drawn to the logged place and heading."""
CHECKED = 10
"""Rows between two looks whether the rover still drives."""
FIRST_ROWS = 5
"""Rows at the start whose mean is the place where the run began, unless the log declares it."""


@dataclass(frozen=True, eq=False)
class Commands:
    """What a logged run did, on the rows of its replay: `t` [s] (T,), duty (T, wheels), steering and place.

    `place` (T, 3) is the logged x, y [m] and heading [rad], not a number where the log has a gap.
    """

    t: np.ndarray
    duty: np.ndarray
    steer: np.ndarray
    place: np.ndarray
    start: Start

    @property
    def period(self) -> float:
        """Time between rows [s]."""
        return float(self.t[1] - self.t[0])


@dataclass(frozen=True, eq=False)
class Nudge:
    """Small additions for a description of what a model lacks, one row a time step: torques, force, grip.

    `torque` (T, wheels) [N m] is added at the wheels, `force` (T,) [N] along the heading, `grip` (T,) changes tan phi
    of the soil by this share. Any of them may be left out.
    """

    torque: np.ndarray | None = None
    force: np.ndarray | None = None
    grip: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Replay:
    """What the model did: channels as in a trace, on the rows of the commands; `stop` says why it ended early."""

    channels: dict[str, np.ndarray] = field(repr=False)
    stop: str = ""


def commands(log: Trace, wheels: tuple[str, ...], steered: tuple[str, ...]) -> Commands:
    """Return the commands and the place of a logged run, on rows of equal distance.

    The duty of a row holds since the row before, as the simulator logs it.

    Raises
    ------
    DataError
        A channel that a replay needs and the log does not have, or fewer than two rows.
    """
    t, x, y, yaw = log.need("t_s", "body_x", "body_y", "body_yaw")
    duties = np.column_stack(log.need(*(f"duty_{wheel}" for wheel in wheels)))
    if len(t) < 2:
        raise DataError(f"{log.attrs.get('file', 'the run')}: a replay needs two rows at least.")
    period = max(PERIOD, round(float(np.median(np.diff(t))) / DT) * DT)
    rows = t[0] + period * np.arange(1 + math.floor((t[-1] - t[0]) / period + 1e-6))
    at = np.minimum(np.searchsorted(t, rows - period / 2), len(t) - 1)
    steer = [_held(log[f"steer_{wheel}"])[at] if f"steer_{wheel}" in log else np.zeros(len(rows)) for wheel in steered]
    duty = np.column_stack([_held(column)[at] for column in duties.T])
    place = np.column_stack([averaged(t, column, rows, period) for column in (x, y, np.unwrap(_held(yaw)))])
    declared = log.attrs.get("start")
    start = Start(**declared) if declared else Start(*np.nanmean(place[:FIRST_ROWS], axis=0).tolist())
    return Commands(rows, duty, np.column_stack(steer) if steer else np.zeros((len(rows), 0)), place, start)


def _held(values: np.ndarray) -> np.ndarray:
    """Return the values with every gap filled by the last value before it, or the first after it."""
    good = np.flatnonzero(np.isfinite(values))
    if not good.size:
        return np.zeros_like(values)
    return np.asarray(values[good[np.maximum(np.searchsorted(good, np.arange(len(values)), "right") - 1, 0)]])


def averaged(t: np.ndarray, values: np.ndarray, rows: np.ndarray, period: float) -> np.ndarray:
    """Return the mean of the finite values within half a period of each row; not a number where there is none."""
    at = np.rint((t - rows[0]) / period).astype(int)
    use = np.isfinite(values) & (at >= 0) & (at < len(rows))
    count = np.bincount(at[use], minlength=len(rows))
    total = np.bincount(at[use], values[use], minlength=len(rows))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def replay(model: Model, run: Commands, nudge: Nudge = Nudge(), rest: DriveState | None = None) -> Replay:
    """Return what `model` does under the logged commands, from where it comes to rest, or from another's `rest`.

    The rover is drawn to the logged x, y and heading with the time constant HOLD, so that it stays on the ground where
    the log was and errors do not add up. `body_x`, `body_y` and `body_yaw` are what the model itself has driven from
    the start, without those corrections: the integral of its velocity.

    Raises
    ------
    SimulationError
        The rover does not settle at the start, or the ground is too stiff for any step.
    """
    state = settled(model, run.start) if rest is None else _taken_over(model, rest)
    model = model.begun(run.start.x, run.start.y)
    dt = DT / parts(model, state, DT)
    return _Rerun(model, run, nudge, state, Kernel(model, state, dt, symmetric=False)).drive()


def _taken_over(model: Model, rest: DriveState) -> DriveState:
    """Return another model's rest: same place, the soil's shear unloaded, effects at the start of their states."""
    wheels = len(model.rover.wheels)
    contact = sum(len(effect.states) for effect in model.contact_effects)
    motor = sum(len(effect.states) for effect in model.motor_effects)
    taken = rest.copy()
    taken.contact, taken.motor = np.zeros((wheels, contact)), np.zeros((wheels, motor))
    return taken


class _Rerun:
    """One replay in progress."""

    def __init__(self, model: Model, run: Commands, nudge: Nudge, state: DriveState, kernel: Kernel):
        self.model, self.run, self.state, self.kernel = model, run, state, kernel
        self.duty = run.duty if nudge.torque is None else run.duty + nudge.torque / float(model.motor.stall_torque)
        self.force, self.grip = nudge.force, nudge.grip
        self.pace, self.suspension = Pace(kernel, float(kernel.struct.dt)), suspension_of(model)
        self.down = kernel.gravity.copy()
        self.moved = np.zeros(3)
        "corrections so far: x, y [m] and heading [rad]"
        self.rows: list[np.ndarray] = []

    def drive(self) -> Replay:
        """Step through all rows; after an early end the last row stands for the rest."""
        steps, stop = round(self.run.period / self.pace.dt), ""
        for row in range(len(self.run.t)):
            stop = stop or self._advance(row, steps)
            self.rows.append(self.rows[-1] if stop and self.rows else self._read())
            self._draw(row)
        return Replay(self._channels(), stop)

    def _advance(self, row: int, steps: int) -> str:
        kernel = self.kernel
        kernel.duty[:] = np.clip(self.duty[row], -1.0, 1.0)
        if kernel.servo_wheels:
            kernel.servo_target[:] = self.run.steer[row]
        if self.force is not None:
            self._lean(self.force[row])
        if self.grip is not None:
            self._grip(self.grip[row])
        for step in range(steps):
            if self.pace.advance(step == 0):
                return "diverged"
        if row % CHECKED:
            return ""
        return failure(self.model, self.state, kernel.record, self.suspension) or ""

    def _lean(self, force: float) -> None:
        """Let gravity lean forward by the force along the heading: it acts on the whole rover alike."""
        yaw = roll_pitch_yaw(self.state.q)[2]
        pull = force / self.model.built.mass
        forward = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        self.kernel.gravity[:] = self.down + pull * forward

    def _grip(self, share: float) -> None:
        soils = self.kernel.soils.copy()
        for at, soil in enumerate(self.model.soils):
            soils[at, list(soil.values()).index("phi")] = math.atan((1.0 + share) * math.tan(float(soil.phi)))
        self.kernel.resoil(soils)

    def _draw(self, row: int) -> None:
        """Move the rover towards the logged place and heading by the share of one row."""
        x, y, yaw = self.run.place[row]
        q, share = self.state.q, self.run.period / HOLD
        if math.isfinite(x) and math.isfinite(y):
            step = share * (np.array([x, y]) - q[:2])
            q[:2] += step
            self.moved[:2] += step
        if math.isfinite(yaw):
            turn = share * math.remainder(yaw - roll_pitch_yaw(q)[2], 2 * math.pi)
            about_z = pin.Quaternion(math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2))
            q[3:7] = (about_z * pin.Quaternion(q[6], q[3], q[4], q[5])).coeffs()
            self.moved[2] += turn

    def _read(self) -> np.ndarray:
        q, v = self.state.q, self.state.v
        attitude = roll_pitch_yaw(q)
        velocity = base_rotation(q) @ v[:3]
        return np.concatenate([q, v, self.kernel.record.ravel(), attitude, velocity, self.moved])

    def _channels(self) -> dict[str, np.ndarray]:
        rover = self.model.rover
        table = np.array(self.rows)
        nq, nv, wheels = rover.model.nq, rover.model.nv, len(rover.wheels)
        q, v, rest = table[:, :nq], table[:, nq : nq + nv], table[:, nq + nv :]
        record, rest = rest[:, :-9].reshape(len(table), wheels, len(RECORD)), rest[:, -9:]
        found = {"t_s": self.run.t}
        for i, wheel in enumerate(rover.wheels):
            found[f"wheel_rate_{wheel.name}"] = v[:, wheel.dof]
            found[f"current_{wheel.name}_A"] = record[:, i, RECORD.index("current")]
            for name in ("slip", "sinkage", "normal", "tangential"):
                found[f"{name}_{wheel.name}"] = record[:, i, RECORD.index(name)]
        found |= {name: q[:, index] for name, index in rover.angles.items()}
        found |= {"body_x": q[:, 0] - rest[:, 6], "body_y": q[:, 1] - rest[:, 7], "body_z": q[:, 2]}
        found |= {"body_roll": rest[:, 0], "body_pitch": rest[:, 1], "body_yaw": np.unwrap(rest[:, 2]) - rest[:, 8]}
        found |= {f"body_v{axis}": rest[:, 3 + i] for i, axis in enumerate("xyz")}
        found["battery_V"] = record[:, 0, RECORD.index("supply")]
        return found
