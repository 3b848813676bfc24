"""A drive step after step in Python: slow, readable, and the reference of the compiled loop."""

from __future__ import annotations

import numpy as np

from rover_pin.simulation.checkpoint import Checkpoint
from rover_pin.simulation.driving import OFTEN, Drive, Progress, Ran, Stepper, obey, stop_reason
from rover_pin.simulation.failure import failure
from rover_pin.simulation.instant import Instant, Places
from rover_pin.simulation.pace import Pace, look
from rover_pin.simulation.state import base_rotation, roll_pitch_yaw
from rover_pin.simulation.trace.rows import row_type


def run_plain(drive: Drive, duration: float, progress: Progress | None) -> Ran:
    """Step until the end: command, step, log, and look whether the drive can go on."""
    timing, state, stepper = drive.timing, drive.state, drive.stepper
    steps = max(1, round(duration / timing.dt))
    per_control, per_sample = round(timing.control / timing.dt), round(timing.sample / timing.dt)
    places, pace = Places.of(drive.model), Pace(stepper, timing.dt, timing.rough)
    rows, count = np.zeros(steps // per_sample, dtype=row_type(drive.model)), 0
    begun = drive.checkpoint or Checkpoint(state.t, 0, pace.size)
    pace.go_on(begun)
    for k in range(begun.steps, begun.steps + steps):
        if k % per_control == 0:
            now = np.zeros(1, dtype=rows.dtype)
            _log(drive, now[0])
            obey(drive, Instant(now, 0, places))
        if drive.followed is None:
            ends = k + 1
            status = pace.advance(0 in (k % per_control, k % per_sample), 0 in (ends % per_control, ends % per_sample))
        else:
            status = pace.follow(drive.followed, (k + 1) * timing.dt)
        if status:
            return _ran(rows[:count], stop_reason(status, state.t), pace, pace.checkpoint(begun, k))
        state.t = begun.begin + (k + 1) * timing.dt
        if k % per_sample == per_sample - 1:
            _log(drive, rows[count])
            count += 1
            reason = failure(drive.model, state, rows[count - 1]["record"])
            if reason:
                return _ran(rows[:count], f"{reason} at {state.t:.2f} s", pace, pace.checkpoint(begun, k + 1))
            if progress and count % OFTEN == 0:
                progress(state.t)
    return _ran(rows[:count], "duration", pace, pace.checkpoint(begun, begun.steps + steps))


def _ran(rows: np.ndarray, stop: str, pace: Pace, checkpoint: Checkpoint) -> Ran:
    return Ran(rows, stop, checkpoint, np.array(pace.lengths))


def _log(drive: Drive, row: np.void) -> None:
    """Write the present instant into a row."""
    state, stepper = drive.state, drive.stepper
    row["record"], row["differential"] = record_of_instant(stepper)
    row["t"], row["q"], row["v"] = state.t, state.q, state.v
    row["duty"], row["servo"] = stepper.duty, stepper.servo_target[: len(row["servo"])]
    row["energy"], row["impulse"] = stepper.energy, stepper.impulse
    row["mechanical"], row["attitude"] = stepper.energies(), roll_pitch_yaw(state.q)
    row["velocity"] = base_rotation(state.q) @ state.v[:3]


def record_of_instant(stepper: Stepper) -> tuple[np.ndarray, float]:
    """Return the wheels' record and the differential's torque of this instant; a step's own are of its begin."""
    with look(stepper):
        return stepper.record.copy(), float(stepper.differential[0])
