"""The loop over the steps of a drive in Python: slow and readable. Tests compare the compiled loop (native/loop.c) with
it.
"""

from __future__ import annotations

import numpy as np

from rover_pin.simulation.command import Instant, ReadingPlaces
from rover_pin.simulation.driving import (
    ROWS_PER_PROGRESS,
    LoopResult,
    Progress,
    RunningDrive,
    Stepper,
    obey,
    stop_reason,
)
from rover_pin.simulation.failure import failure
from rover_pin.simulation.state import Checkpoint, base_rotation, roll_pitch_yaw
from rover_pin.simulation.stepping.pace import Pace, look
from rover_pin.simulation.trace.record import row_type


def run_plain(drive: RunningDrive, duration: float, progress: Progress | None) -> LoopResult:
    """Drive for `duration` [s], and return the result. The loop calls the controller, takes steps, records rows, and
    checks whether the drive can go on.

    Parameters
    ----------
    drive : RunningDrive
        The drive; its state is changed in place.
    duration : float
        Time to drive [s].
    progress : callable, optional
        Called every ROWS_PER_PROGRESS rows with the simulated time [s].
    """
    # All times are counted in whole steps dt, so that no round-off builds up.
    timing, state, stepper = drive.timing, drive.state, drive.stepper
    steps = max(1, round(duration / timing.dt))
    per_control, per_sample = round(timing.control / timing.dt), round(timing.sample / timing.dt)
    places, pace = ReadingPlaces.of(drive.model), Pace(stepper, timing.dt, timing.rough)
    rows, count = np.zeros(steps // per_sample, dtype=row_type(drive.model)), 0
    start = drive.checkpoint or Checkpoint(state.t, 0, pace.size)
    pace.continue_from(start)

    def result(stop: str, steps_taken: int) -> LoopResult:
        return LoopResult(rows[:count], stop, pace.checkpoint(start, steps_taken), np.array(pace.lengths))

    for k in range(start.steps, start.steps + steps):
        # At a control instant the controller reads the state and sets the duties.
        if k % per_control == 0:
            now = np.zeros(1, dtype=rows.dtype)
            _log(drive, now[0])
            obey(drive, Instant(now, 0, places))
        # No step before a command or a row is repeated later.
        if drive.followed is None:
            next_k = k + 1
            begins_at_border = 0 in (k % per_control, k % per_sample)
            ends_at_border = 0 in (next_k % per_control, next_k % per_sample)
            status = pace.advance(begins_at_border, ends_at_border)
        else:
            status = pace.follow(drive.followed, (k + 1) * timing.dt)
        if status:
            return result(stop_reason(status, state.t), k)
        # At the end of a sample period the state becomes a row, and is checked.
        state.t = start.begin + (k + 1) * timing.dt
        if k % per_sample == per_sample - 1:
            _log(drive, rows[count])
            count += 1
            reason = failure(drive.model, state, rows[count - 1]["record"])
            if reason:
                return result(f"{reason} at {state.t:.2f} s", k + 1)
            if progress and count % ROWS_PER_PROGRESS == 0:
                progress(state.t)
    return result("duration", start.steps + steps)


def _log(drive: RunningDrive, row: np.void) -> None:
    """Write the present state, commands, loads and energies of a drive into `row`."""
    state, stepper = drive.state, drive.stepper
    row["record"], row["differential"] = record_of_instant(stepper)
    row["t"], row["q"], row["v"] = state.t, state.q, state.v
    row["duty"], row["servo"] = stepper.duty, stepper.servo_target[: len(row["servo"])]
    row["energy"], row["impulse"] = stepper.energy, stepper.impulse
    row["mechanical"], row["attitude"] = stepper.energies(), roll_pitch_yaw(state.q)
    row["velocity"] = base_rotation(state.q) @ state.v[:3]


def record_of_instant(stepper: Stepper) -> tuple[np.ndarray, float]:
    """Return the quantities of the wheels (columns: `RECORD`) and the torque of the differential [N m] in the present
    state of a drive.

    The stepper's own arrays hold these quantities at the beginning of its last step, so that they are one step old. The
    function therefore evaluates the forces again.
    """
    with look(stepper):
        return stepper.record.copy(), float(stepper.differential[0])
