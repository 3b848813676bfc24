"""Control of the step size during a drive: if the forces change differently from a step's prediction, the step is
repeated in parts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, Protocol

import numpy as np

from rover_pin.simulation.state import Checkpoint

FINEST = 64
"""Largest number of parts into which a step is divided during a drive. It is also the unit of step sizes: FINEST parts
are one step dt."""
ROUGH, CALM = 0.0025, 0.0001
"""Limits of the forecast error, the difference between a wheel's load and the load that the previous step predicted,
divided by the normal force. Above ROUGH, the step is divided by four; below CALM, the step is doubled."""
GROWS, LEAST_GROWN = 2.0, 1e-3
"""Limits of the growth of a speed in a step. A step is repeated in quarters if the forces enlarge a speed by more than
the factor GROWS twice in a row, and the speed exceeds LEAST_GROWN [m/s, rad/s], which round-off does not reach. Reason:
a speed that grows so fast is wrong by a quarter after the step, and soon grows without bound."""
GLANCE = 1e-7
"""Length [s] of a step that is taken only to evaluate the forces in the present state: nothing moves in such a short
time."""

Saved = Sequence[np.ndarray]
"""Copies of all arrays that a step changes."""


class AdjustableStepper(Protocol):
    """An object that advances a drive by steps, whose step size can be changed, and whose steps can be undone."""

    @property
    def dt(self) -> float:
        """Length of the steps [s]."""

    @property
    def misjudged(self) -> float:
        """Forecast error of the last step [-].

        At its end, each step predicts the load on every wheel; the next step computes the true load. The error is the
        difference between both, divided by the wheel's normal force; the largest one of all wheels is returned.
        """

    @property
    def growth(self) -> float:
        """Largest growth factor of a speed in the last step, if forces push the speed away from zero; 0 if no factor
        exceeds GROWS. A large factor shows that the step is too long.
        """

    def set_step(self, dt: float) -> None:
        """Set the length of the following steps [s]."""

    def step(self) -> int:
        """Advance the drive by one step. Return 0 if the step succeeded, otherwise the status of the failure."""

    def saved_arrays(self) -> Saved:
        """Return copies of all arrays that a step changes. `restore` puts these copies back to undo the step."""

    def restore(self, saved: Saved) -> None:
        """Put the copies `saved`, which `saved_arrays` returned, back into the arrays. This undoes all steps taken
        since then.
        """


def growth(first: np.ndarray, second: np.ndarray, third: np.ndarray) -> float:
    """Return the largest growth factor of a speed from the second to the third of three successive solutions for the
    speeds, arrays (nv,). A step that is too long for forces that push a speed away from zero has such growing
    solutions.

    Only speeds that kept their sign and grew by more than the factor GROWS twice in a row are considered. If there is
    no such speed, the result is 0.
    """
    # Three successive stages of a step: a speed that forces push away grows from each stage to the next.
    pairs = (first, second), (second, third)
    grown = [np.abs(after) > np.maximum(GROWS * np.abs(before), LEAST_GROWN) for before, after in pairs]
    twice = grown[0] & grown[1] & (first * third > 0.0)
    return float(np.max(np.abs(third[twice] / second[twice]), initial=0.0))


@contextmanager
def look(stepper: AdjustableStepper) -> Iterator[None]:
    """Evaluate the forces in the present state of a drive, for the body of a `with` statement, which reads them from
    the stepper; afterwards undo the evaluation.

    A normal step stores the forces at its beginning, so that the stored forces are one step old when the step ends.
    """
    # A step of length GLANCE evaluates the forces, and is then undone.
    before, dt = stepper.saved_arrays(), stepper.dt
    stepper.set_step(GLANCE)
    stepper.step()
    yield
    stepper.restore(before)
    stepper.set_step(dt)


class StepStart(NamedTuple):
    """State of a drive at the beginning of a step. The drive returns to it if the step has to be repeated with a
    smaller size.
    """

    saved: Saved
    size: int
    """size of the step, counted in parts of dt: FINEST parts are one dt"""


class Pace:
    """Advances a drive by whole steps dt, and divides a step into parts if the forces change too fast for dt.

    A step takes the forces as linear functions of the speeds, and so predicts the load on each wheel at its end. The
    next step computes the true load. The forecast error is the difference between both in f_t, f_y or torque, divided
    by f_n. It is large if a slip changes much within one step while the shear is stiff (small k). There are three
    rules.

    - If the error exceeds ROUGH, the step that made the prediction is repeated in quarters, down to dt / FINEST, and
      the following steps are divided too, until the error falls below CALM. The error of a linear prediction falls with
      the square of the step. If a whole drive is repeated with its steps divided by n, its limits are therefore divided
      by n^2 (parameter `rough`), so that all parts of its steps become n times shorter too.
    - A step before a command to the motors or before a row of the trace cannot be repeated later. Its prediction is
      therefore checked at once, by evaluating the forces at its end.
    - A step is repeated in parts if it fails, or if a speed grows faster than the step can follow. For u' = D u, each
      stage of a step multiplies u by 1 / (1 - gamma z) with z = D dt. This factor is infinite at z = 1 / gamma, where
      the true factor exp(z) is 30.

    Parameters
    ----------
    stepper : AdjustableStepper
        The object that takes the steps of the drive.
    dt : float
        Length of a step [s] before it is divided into parts.
    rough : float
        Factor on the limits ROUGH and CALM of the forecast error.
    """

    def __init__(self, stepper: AdjustableStepper, dt: float, rough: float = 1.0):
        self.rough, self.calm = rough * ROUGH, rough * CALM
        self.stepper, self.dt, self.unit, self.size = stepper, dt, dt / FINEST, FINEST
        self.before: StepStart | None = None
        """beginning of the last step, if this step may still be repeated; otherwise None"""
        self.lengths: list[float] = []
        """length of each step that was taken [s], in order"""

    def continue_from(self, checkpoint: Checkpoint) -> None:
        """Continue an earlier drive at its checkpoint, with the step size that this drive had there."""
        if checkpoint.size != self.size:
            self._set_size(checkpoint.size)

    def checkpoint(self, start: Checkpoint, steps: int) -> Checkpoint:
        """Return the checkpoint of the drive that began at `start` and has now taken `steps` steps of the length dt.
        The drive can be continued from it.
        """
        return Checkpoint(start.begin, steps, self.size)

    def advance(self, commanded: bool = True, looks: bool = False) -> int:
        """Advance the drive by dt. Return 0 if this succeeded, or the status of the failure if even a step of the
        smallest size failed.

        Parameters
        ----------
        commanded : bool
            Whether the command to the motors has changed since the last step, or a row has been written; the last step
            can then not be repeated.
        looks : bool
            Whether a row of the trace or a command follows; the prediction of the last part is then checked at its
            end.
        """
        if commanded:
            self.before = None
        # `remaining` counts the parts of dt that are still to be driven.
        remaining = FINEST
        while remaining:
            step_start = StepStart(self.stepper.saved_arrays(), self.size)
            status = self.stepper.step()
            error = 0.0 if status else self.stepper.misjudged
            # If this step failed or enlarged a speed, it is taken again. If its first forces contradict the forecast of
            # the step before, the step before is taken again.
            fails = status or (self.stepper.growth > 0.0 and step_start.size > 1)
            again = step_start if fails else self.before if error > self.rough else None
            if again and again.size > 1:
                if again is self.before:
                    remaining += again.size
                    self.lengths.pop()
                self._take_again(again)
            elif status:
                return status
            else:
                remaining -= step_start.size
                self.lengths.append(self.stepper.dt)
                # The size of the next step: a larger size must fit into the rest of dt.
                if error > self.rough:
                    self._set_size(max(1, self.size // 4))
                elif error < self.calm and self.size < FINEST and remaining % (2 * self.size) == 0:
                    self._set_size(2 * self.size)
                self.before = step_start
                if looks and not remaining:
                    # No later step will check this forecast: evaluate the forces at the end of the step now.
                    with look(self.stepper):
                        error_at_end = self.stepper.misjudged
                    if error_at_end > self.rough and step_start.size > 1:
                        remaining = step_start.size
                        self.lengths.pop()
                        self._take_again(step_start)
        return 0

    def follow(self, followed: np.ndarray, end: float) -> int:
        """Advance the drive to the time `end` [s] after its start, by steps of the given lengths `followed` [s]. The
        forecast error is not checked.

        Return 0 if all steps succeeded, otherwise the status of the step that failed.
        """
        # The steps before `taken` belong to earlier calls.
        elapsed, taken = sum(self.lengths), len(self.lengths)
        for length in followed[taken:]:
            # Half a step of margin, because sums of lengths are rounded.
            if not elapsed + 0.5 * length < end:
                break
            self.stepper.set_step(length)
            elapsed += length
            self.lengths.append(length)
            status = self.stepper.step()
            if status:
                return status
        return 0

    def _take_again(self, step_start: StepStart) -> None:
        """Go back to the beginning of a step, and set the step size to a quarter of the size of this step, so that the
        drive continues from there with smaller steps.
        """
        self.stepper.restore(step_start.saved)
        self.before = None
        self._set_size(max(1, step_start.size // 4))

    def _set_size(self, size: int) -> None:
        """Set the step size, counted in parts of dt (FINEST parts are one dt)."""
        self.size = size
        self.stepper.set_step(size * self.unit)
