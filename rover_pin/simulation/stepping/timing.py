"""The times of a drive: the step, the period of the controller, and the time between the rows of the trace."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from fractions import Fraction

from rover_pin.base.errors import SimulationError

DT = 1 / 60
"""Default step [s]. In the ditch with 30-deg walls, the x of a drive with this step differs over 20 s by less than
TOLERANCE from the x with finer steps (measured by tests/simulation/test_accuracy.py)."""
TOLERANCE = 1e-4
"""Default tolerance of x and y [m]: if the error that the step size causes exceeds it, the drive is repeated with
smaller steps. `step_error.LOADS` gives the corresponding tolerance of the loads."""
MAX_REFINEMENT = 16
"""Largest number of parts into which the steps of a drive are divided to keep the tolerance. If the error is still too
large, a warning states this."""
MIN_STEP = 1e-6
"""Smallest step that a caller may ask for [s]. With this step, ten seconds of driving take minutes to compute."""
MAX_STEP = 0.1
"""Largest step that a caller may ask for [s]; a drive with a larger one is refused."""
MAX_PERIOD_PARTS = 1000
"""Largest number of equal parts into which the shorter of control period and time between rows may be divided so that
the longer one is a whole number of these parts. If more parts were needed, the two times have no common step and are
refused."""
CONTROL_PERIOD = 0.05
"""Default time between two calls of the controller [s] (assumed). A command is held until the next call."""
SAMPLE = 0.05
"""Default time between the rows of the trace [s]."""


@dataclass(frozen=True)
class Timing:
    """Step, control period and time between the rows of the trace, all in [s].

    If necessary, the step `dt` is reduced to the longest step that divides both the control period and the time between
    rows.

    Raises
    ------
    SimulationError
        A time is beyond its limits, or the two periods have no common step.

    Examples
    --------
    >>> round(Timing(dt=0.02).dt, 6)
    0.016667
    """

    dt: float = DT
    """largest step of the drive [s]"""
    control: float = CONTROL_PERIOD
    """time between two calls of the controller [s]"""
    sample: float = SAMPLE
    "time between two rows of the trace [s]"
    divided: int = 1
    "number of parts into which every step is divided, in addition to the parts for the ground (`resolution.parts`)"
    rough: float = 1.0
    """factor on the limits `pace.ROUGH` and `pace.CALM` of the forecast error: 1 / n^2 if every step is divided into n
    parts"""
    tolerance: float = TOLERANCE
    """tolerance of x and y [m]: if the measured error of a drive exceeds it, the drive is repeated with half the
    step"""

    def __post_init__(self) -> None:
        if not MIN_STEP <= self.dt <= MAX_STEP:
            raise SimulationError(f"dt = {self.dt:g} s is not allowed: it must lie in [{MIN_STEP:g}, {MAX_STEP:g}] s.")
        if not self.tolerance > 0.0:
            raise SimulationError(f"tolerance = {self.tolerance:g} m is not allowed: give a positive distance.")
        for name in ("control", "sample"):
            if not MIN_STEP <= getattr(self, name) < math.inf:
                raise SimulationError(
                    f"The {name} period {getattr(self, name):g} s is not allowed: give {MIN_STEP:g} s or more."
                )
        # Find the longest time of which both periods are whole multiples, and its largest whole fraction up to dt.
        shorter, longer = sorted((self.control, self.sample))
        ratio = Fraction(longer / shorter).limit_denominator(MAX_PERIOD_PARTS)
        if abs(ratio * shorter / longer - 1.0) > 1e-7:
            raise SimulationError(
                f"The control period {self.control:g} s and the sample period {self.sample:g} s have no step in "
                "common: give two periods of which one is a whole multiple of the other."
            )
        shared = shorter / ratio.denominator
        object.__setattr__(self, "dt", min(self.dt, shared / math.ceil(shared / self.dt - 1e-9)))

    def with_half_step(self) -> Timing:
        """Return the timing of a drive with half the step. The drive then takes half of the step that it took before,
        even if this step was finer than `dt` because of stiff ground.
        """
        return dataclasses.replace(self, divided=2 * self.divided)

    def with_parts(self, parts: int) -> Timing:
        """Return the timing with the step that a drive actually takes: `dt` divided by `parts`, the number of parts
        that the ground needs, and by `divided`.
        """
        step = self.dt / parts / self.divided
        return dataclasses.replace(self, dt=step, divided=1, rough=1.0 / self.divided**2)
