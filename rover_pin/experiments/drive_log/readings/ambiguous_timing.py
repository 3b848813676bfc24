"""When a step of the duty was given: known where rows come at even times, else somewhere between two of them.

The duty of a row holds since the row before, as long as commands are given at the rows. Rows that are read late, or
were not written, tell only that the duty changed between them: half a row's doubt is 1 % of a half-second mean for each
percent that a wheel's rate changes, several times the noise of its tachogenerator where it starts or stops.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.logged_inputs import is_uneven
from rover_pin.simulation.replay import Commands
from rover_pin.simulation.trace.trace import Trace

MISSED = 1.5
"""Times the usual time between rows from which one was not written, or very late. Why: half-way to the next."""
SAME_DUTY = 0.02
"""Duties that differ by less are one level, and no doubt about the time of a step shows. Why: five steps of a driver of
eight bits; from here the doubt shows by 4 mrad/s in half a second."""
USUAL = 5.0
"""Times the usual change of a duty that a step is at least: what changes all the time evens out. Why: assumed."""
RESPONSE_TIME = 0.1
"""Time that a wheel takes to its new rate [s]. Why: a series motor's, with its wheel (assumed)."""


class AmbiguousStep(NamedTuple):
    """A time between two rows of a log in which a duty stepped at an unknown instant."""

    begin: float
    end: float
    missed: bool
    "whether rows are missing in between: what was driven there is not known either"


def ambiguous_steps(log: Trace) -> list[AmbiguousStep]:
    """Return the times between two rows of a log in which a duty stepped at an unknown instant."""
    names = [name for name in log.channels if name.startswith("duty_")]
    if log.rate_driven or not names or len(log.t) < 3:
        return []
    change = np.abs(np.diff(np.column_stack([log[name] for name in names]), axis=0)).max(axis=1)
    change = np.nan_to_num(change)
    dt = np.diff(log.t)
    median_dt = float(np.median(dt))
    missed = dt > MISSED * median_dt
    step = (change > max(SAME_DUTY, USUAL * float(np.median(change)))) & (is_uneven(log.t) | missed)
    return [AmbiguousStep(float(log.t[at]), float(log.t[at + 1]), bool(missed[at])) for at in np.flatnonzero(step)]


def unaffected_rows(steps: Sequence[AmbiguousStep], run: Commands) -> np.ndarray:
    """Return in which rows of a replay (T,) no such step acts, nor the wheels' way to their new rates after it."""
    rows = np.ones(len(run.t), dtype=bool)
    for begin, end, _ in steps:
        rows &= (run.t < begin) | (run.t - run.period > end + RESPONSE_TIME)
    return rows
