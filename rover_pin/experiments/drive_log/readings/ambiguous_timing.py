"""When a step of the duty was given: known where rows come at even times, else somewhere between two of them.

The duty of a row holds since the row before, as long as commands are given at the rows. Rows that are read late, or
were not written, tell only that the duty changed between them: half a row's doubt is 1 % of a half-second mean for each
percent that a wheel's rate changes, several times the noise of its tachogenerator where it starts or stops.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.estimation.random_effects.random_field import Kind
from rover_pin.simulation.logged_inputs import is_open
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import Commands, Perturbation, Replay
from rover_pin.simulation.trace.trace import Trace

STEPS = (Kind("instant of a step of the duty", 1.0, "", is_known=True),)
SAME_DUTY = 0.02
"""Duties that differ by less are one level, and no doubt about the time of a step shows. Why: five steps of a driver of
eight bits; from here the doubt shows by 4 mrad/s in half a second."""
USUAL = 5.0
"""Times the usual change of a duty that a step is at least: what changes all the time evens out. Why: assumed."""
RESPONSE_TIME = 0.1
"""Time that a wheel takes to its new rate [s]. Why: a series motor's, with its wheel (assumed)."""


class AmbiguousStep(NamedTuple):
    """A time between two rows of a log in which duties stepped at an unknown instant, and by how much, by channel."""

    begin: float
    end: float
    change: dict[str, float]


def ambiguous_steps(log: Trace) -> list[AmbiguousStep]:
    """Return the times between two rows of a log in which a duty stepped at an unknown instant."""
    names = [name for name in log.channels if name.startswith("duty_")]
    if log.rate_driven or not names or len(log.t) < 3:
        return []
    change = np.nan_to_num(np.diff(np.column_stack([log[name] for name in names]), axis=0))
    most = np.abs(change).max(axis=1)
    step = (most > max(SAME_DUTY, USUAL * float(np.median(most)))) & is_open(log.t)
    changes = [dict(zip(names, row.tolist(), strict=True)) for row in change]
    return [AmbiguousStep(float(log.t[at]), float(log.t[at + 1]), changes[at]) for at in np.flatnonzero(step)]


def unaffected_rows(steps: Sequence[AmbiguousStep], run: Commands) -> np.ndarray:
    """Return in which rows of a replay (T,) no such step acts, nor the wheels' way to their new rates after it."""
    rows = np.ones(len(run.t), dtype=bool)
    for begin, end, _ in steps:
        rows &= (run.t < begin) | (run.t - run.period > end + RESPONSE_TIME)
    return rows


def later_duties(step: AmbiguousStep, run: Commands, wheels: Sequence[str]) -> np.ndarray:
    """Return by what the duties of a replay (T, wheels) differ if a step comes later than half-way by one SD.

    It is anywhere between two rows with equal probability: with the SD of their distance / sqrt(12).
    """
    middle = (step.begin + step.end) / 2
    ends = np.clip([run.t - run.period, run.t], middle, middle + (step.end - step.begin) / np.sqrt(12.0))
    return -np.outer((ends[1] - ends[0]) / run.period, [step.change[f"duty_{wheel}"] for wheel in wheels])


def step_columns(
    late: Sequence[tuple[int, np.ndarray]],
    model: Model,
    still: np.ndarray,
    replays: Callable[[Sequence[tuple[int, Perturbation]]], Sequence[Replay]],
    read: Callable[[int, Replay], np.ndarray],
) -> dict[str, np.ndarray]:
    """Return how features move where duties are `later_duties` in one run, by index, and nowhere else.

    The other arguments are those of `ground_columns`; `kind`, `fold` and `moved` those of a `RandomField` of STEPS.
    """
    stall_torque = float(model.motor.stall_torque)
    driven = replays([(at, Perturbation(torque=stall_torque * duty)) for at, duty in late])
    table, fold = np.zeros((len(late), *still.shape)), np.array([at for at, _ in late])
    for row, at, replay in zip(table, fold, driven, strict=True):
        row[at] = np.nan_to_num(read(at, replay) - still[at], posinf=0.0, neginf=0.0)
    return {"kind": 0 * fold, "fold": fold, "moved": table}
