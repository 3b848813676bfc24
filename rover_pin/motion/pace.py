"""Steps as fine as the forces need: shorter where one step misjudged what its speeds would make of them."""

from __future__ import annotations

from typing import Protocol

FINEST = 64
"""Parts into which a step may be divided."""
ROUGH, CALM = 0.05, 0.002
"""Misjudged share of a wheel's normal force above which steps are quartered, and below which they are doubled."""


class Steps(Protocol):
    """A drive from one step to the next whose step can change."""

    @property
    def misjudged(self) -> float:
        """How far a wheel's load was from what the step before took it to become, over its normal force."""

    def set_step(self, dt: float) -> None:
        """Let steps have this length [s] from now on."""

    def step(self) -> int:
        """Advance by a step; 0 when all is well."""


class Pace:
    """Advances a drive by whole steps `dt` [s], in parts where the forces turn faster than that.

    Every step takes the forces as straight lines over the speeds. Where a wheel's f_t, f_y or torque over its f_n then
    comes out by more than ROUGH from what the line said (a slip that swept across a stiff shear, small k, from one step
    to the next), the following steps are quartered, down to dt / FINEST, until less than CALM is left: the error of a
    line falls with the square of the step. The step found too long is not taken back.
    """

    def __init__(self, stepper: Steps, dt: float):
        self.stepper, self.dt, self.unit, self.size = stepper, dt, dt / FINEST, FINEST
        self.missed = 0.0
        "what was misjudged by more than ROUGH, times its step, summed [s]; times gravity it is a change of speed"

    def advance(self) -> int:
        """Advance by dt; return the first status that is not 0."""
        if self.size < FINEST:
            return self._in_parts()
        status = self.stepper.step()
        off = self.stepper.misjudged
        if off > ROUGH:
            self._quarter(off)
        return status

    def _in_parts(self) -> int:
        left = FINEST
        while left:
            status = self.stepper.step()
            if status:
                return status
            left -= self.size
            off = self.stepper.misjudged
            if off > ROUGH:
                self._quarter(off)
            elif off < CALM and left % (2 * self.size) == 0:
                self._change(2 * self.size)
        return 0

    def _quarter(self, off: float) -> None:
        self.missed += off * self.size * self.unit
        self._change(max(1, self.size // 4))

    def _change(self, size: int) -> None:
        self.size = size
        self.stepper.set_step(size * self.unit)
