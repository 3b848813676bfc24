"""The times of a drive: its step, how often it is controlled, how often it is sampled."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from fractions import Fraction

from rover_pin.base.errors import SimulationError

DT = 1 / 60
"""Default step [s]: x of the 30-deg-wall ditch over 20 s is within TOLERANCE of finer steps', measured 41 um where the
rover is stopped by the wall (k = 1 mm) and 58 um where it gets out (k = 10 mm), against a 32nd of the step."""
TOLERANCE = 1e-4
"""Error [m] of x and y that a drive keeps by itself, by smaller steps; of loads, see `step_error.LOADS`."""
FINER = 16
"""Parts of its step that a drive is driven in at most, to keep its tolerance."""
MIN_STEP = 1e-6
"""Least step [s]: ten seconds of driving then take minutes."""
MAX_STEP = 0.1
"""Greatest step [s]."""
MOST_PERIODS = 1000
"""Most parts of the shorter of two periods that make up the longer one."""
CONTROL_PERIOD = 0.05
"""Sample time of the controller [s] (assumed; the command is held in between)."""
SAMPLE = 0.05
"""Time between the trace's rows [s]."""


@dataclass(frozen=True)
class Timing:
    """Step, control period and time between rows of the trace [s].

    The step taken is the longest, `dt` at most, of which both periods are whole multiples.
    """

    dt: float = DT
    control: float = CONTROL_PERIOD
    sample: float = SAMPLE
    divided: int = 1
    "into how many parts every step is divided, besides those that the ground asks for (`resolution.parts`)"
    rough: float = 1.0
    "how many times `pace.ROUGH` a step may misjudge: the square of what `divided` makes of it"
    tolerance: float = TOLERANCE
    "error of x and y [m] above which a drive that measures it is driven again at half the step"

    def __post_init__(self) -> None:
        if not MIN_STEP <= self.dt <= MAX_STEP:
            raise SimulationError(f"dt = {self.dt:g} s is not allowed: it must lie in [{MIN_STEP:g}, {MAX_STEP:g}] s.")
        if not self.tolerance > 0.0:
            raise SimulationError(f"tolerance = {self.tolerance:g} m is not allowed: give a positive distance.")
        object.__setattr__(self, "dt", min(self.dt, self._shared / math.ceil(self._shared / self.dt - 1e-9)))

    @property
    def _shared(self) -> float:
        """The longest time of which both periods are whole multiples [s]."""
        for name in ("control", "sample"):
            if not MIN_STEP <= getattr(self, name) < math.inf:
                raise SimulationError(
                    f"The {name} period {getattr(self, name):g} s is not allowed: give {MIN_STEP:g} s or more."
                )
        shorter, longer = sorted((self.control, self.sample))
        ratio = Fraction(longer / shorter).limit_denominator(MOST_PERIODS)
        if abs(ratio * shorter / longer - 1.0) > 1e-7:
            raise SimulationError(
                f"The control period {self.control:g} s and the sample period {self.sample:g} s have no step in "
                "common: give one that is a whole multiple of the other."
            )
        return shorter / ratio.denominator

    def with_half_step(self) -> Timing:
        """Return the same with half the step, also where the ground asks for a finer one than `dt`."""
        return dataclasses.replace(self, divided=2 * self.divided)

    def with_parts(self, parts: int) -> Timing:
        """Return the same with the step that is taken: `dt` in as many parts, and divided."""
        step = self.dt / parts / self.divided
        return dataclasses.replace(self, dt=step, divided=1, rough=1.0 / self.divided**2)
