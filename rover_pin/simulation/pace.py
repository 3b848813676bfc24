"""Steps as fine as the forces need: taken again in parts where one misjudged what its speeds would make of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, Protocol

import numpy as np

from rover_pin.simulation.checkpoint import Checkpoint

FINEST = 64
"""Parts into which a step may be divided."""
ROUGH, CALM = 0.0025, 0.0001
"""Misjudged share of a wheel's normal force above which steps are quartered, and below which they are doubled."""

GROWS, LEAST_GROWN = 2.0, 1e-3
"""Times by which the forces push a speed away in a step, twice in a row, above which it is taken again in quarters, and
the least such speed [m/s, rad/s]. Why: what is pushed away is then off by a quarter, and soon without bound."""

GLANCE = 1e-7
"""Step [s] in which nothing moves: it only looks."""

Saved = Sequence[np.ndarray]


class Steps(Protocol):
    """A drive from one step to the next whose step can change, and be taken back."""

    @property
    def dt(self) -> float:
        """Length of its steps [s]."""

    @property
    def misjudged(self) -> float:
        """How far a wheel's load was from what the step before took it to become, over its normal force."""

    @property
    def growth(self) -> float:
        """By how much the last step enlarged a speed that forces push away; 0 where it was GROWS times or less."""

    def set_step(self, dt: float) -> None:
        """Let steps have this length [s] from now on."""

    def step(self) -> int:
        """Advance by a step; 0 when all is well."""

    def saved_arrays(self) -> Saved:
        """Return a copy of all that a step changes."""

    def restore(self, saved: Saved) -> None:
        """Go back to where `saved_arrays` was taken."""


def growth(first: np.ndarray, second: np.ndarray, third: np.ndarray) -> float:
    """Return by how much a speed grew from the second solve to the third that grew twice, at most; 0 of none."""
    pairs = (first, second), (second, third)
    grown = [np.abs(after) > np.maximum(GROWS * np.abs(before), LEAST_GROWN) for before, after in pairs]
    twice = grown[0] & grown[1] & (first * third > 0.0)
    return float(np.max(np.abs(third[twice] / second[twice]), initial=0.0))


@contextmanager
def look(stepper: Steps) -> Iterator[None]:
    """Look at this instant, by a step in which nothing moves; afterwards all but what it misjudged is as it was."""
    before, dt = stepper.saved_arrays(), stepper.dt
    stepper.set_step(GLANCE)
    stepper.step()
    yield
    stepper.restore(before)
    stepper.set_step(dt)


class Begun(NamedTuple):
    """Where a step began, and how many of the finest parts it is long."""

    saved: Saved
    size: int


class Pace:
    """Advances a drive by whole steps `dt` [s], in parts where the forces turn faster than that.

    Every step takes the forces as straight lines over the speeds. Where a wheel's f_t, f_y or torque over its f_n then
    comes out by more than ROUGH from what the line said (a slip that swept across a stiff shear, small k, from one step
    to the next), that step is taken again in quarters, down to dt / FINEST, and so are those after it until less than
    CALM is left: the error of a line falls with the square of the step. A drive whose step is halved may misjudge
    `rough` times as much: it then takes all of its parts at half their length. No step is taken again across a command
    to the motors or a row of the trace: the one before is judged there and then. One that ends in numbers that are not
    finite is taken again too, and one in which a speed is pushed away faster than it can follow: where u' = D u each of
    its solves makes 1 / (1 - gamma z) of the one before, z = D dt, without bound at z = 1 / gamma, where exp(z) is 30.
    """

    def __init__(self, stepper: Steps, dt: float, rough: float = 1.0):
        self.rough, self.calm = rough * ROUGH, rough * CALM
        self.stepper, self.dt, self.unit, self.size = stepper, dt, dt / FINEST, FINEST
        self.before: Begun | None = None
        "where the last step began, if it can be taken again"
        self.lengths: list[float] = []
        "of the steps taken [s]"

    def go_on(self, checkpoint: Checkpoint) -> None:
        """Go on with the steps that a drive ended with."""
        if checkpoint.size != self.size:
            self._change(checkpoint.size)

    def checkpoint(self, begun: Checkpoint, steps: int) -> Checkpoint:
        """Return how far the drive is that began there, after `steps` steps."""
        return Checkpoint(begun.begin, steps, self.size)

    def advance(self, commanded: bool = True, looks: bool = False) -> int:
        """Advance by dt; return the first status that is not 0.

        `commanded`: the motors have a new command since; `looks`: the end, before a row or command, is looked at.
        """
        if commanded:
            self.before = None
        remaining = FINEST
        while remaining:
            step_start = Begun(self.stepper.saved_arrays(), self.size)
            status = self.stepper.step()
            off = 0.0 if status else self.stepper.misjudged
            is_off = status or (self.stepper.growth > 0.0 and step_start.size > 1)
            long = step_start if is_off else self.before if off > self.rough else None
            if long and long.size > 1:
                if long is self.before:
                    remaining += long.size
                    self.lengths.pop()
                self._take_again(long)
            elif status:
                return status
            else:
                remaining -= step_start.size
                self.lengths.append(self.stepper.dt)
                self._keep(off, remaining)
                self.before = step_start
                if looks and not remaining and self._misjudged_now() > self.rough and step_start.size > 1:
                    remaining = step_start.size
                    self.lengths.pop()
                    self._take_again(step_start)
        return 0

    def _misjudged_now(self) -> float:
        """Return what the last step misjudged."""
        with look(self.stepper):
            return self.stepper.misjudged

    def follow(self, followed: np.ndarray, end: float) -> int:
        """Advance to `end` [s] after the begin by the steps of these lengths [s], whatever they misjudge."""
        elapsed, taken = sum(self.lengths), len(self.lengths)
        for length in followed[taken:]:
            if not elapsed + 0.5 * length < end:
                break
            self.stepper.set_step(length)
            elapsed += length
            self.lengths.append(length)
            status = self.stepper.step()
            if status:
                return status
        return 0

    def _take_again(self, long: Begun) -> None:
        """Go back to where a step began, to take it in quarters."""
        self.stepper.restore(long.saved)
        self.before = None
        self._change(max(1, long.size // 4))

    def _keep(self, off: float, remaining: int) -> None:
        """Choose the size of the steps that follow by what the one before misjudged."""
        if off > self.rough:
            self._change(max(1, self.size // 4))
        elif off < self.calm and self.size < FINEST and remaining % (2 * self.size) == 0:
            self._change(2 * self.size)

    def _change(self, size: int) -> None:
        self.size = size
        self.stepper.set_step(size * self.unit)
