"""The drive that would distinguish two effects: the candidate run with the greatest expected information."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.discrepancy.question import Progress
from rover_pin.estimation.fit import Fit
from rover_pin.experiments.drive_log.candidate_runs import DURATION, CandidateRun, candidate_runs, on_own_ground
from rover_pin.experiments.drive_log.discrimination import (
    Instruments,
    PredictedDifference,
    logged_instruments,
    predict_difference,
    with_currents,
)
from rover_pin.experiments.drive_log.experiment import logged
from rover_pin.simulation.model.cruise import CRUISE_DUTY

TELLS, ENOUGH = 9.0, 25.0
"""Expected chi2 from which a run tells two models apart, and above which no further sensor is asked for."""
CLOSER = 4
"""How many runs, of those whose predictions differ most, are judged with the doubt of both fits."""
ROLLS = "rolling"
"""Word of a run in which the motors let the rover roll: wheels that are held to a rate do not."""
MOVING = 0.1
"""Duty above which a rover is driving."""

Named = tuple[str, Fit]


class SeparatingDrive(NamedTuple):
    """One more drive, and by how much of chi2 it is expected to tell two candidates apart."""

    first: str
    second: str
    run: str
    "what to drive, in words"
    channel: str
    "the channel that shows the difference most"
    expected: float
    runner_up: str = ""
    runner_up_expected: float = 0.0

    @property
    def sentence(self) -> str:
        """One sentence for a reader."""
        return (
            f"to tell {self.first} from {self.second}: {DURATION:g} s {self.run}; "
            f"{self.channel} shows it most (expected chi2 {self.expected:.3g})"
        )


class _RunScore(NamedTuple):
    """One candidate run, evaluated."""

    expected: float
    label: str
    channel: str


def separating_drive(first: Named, second: Named, progress: Progress = lambda message: None) -> SeparatingDrive | None:
    """Return the candidate run with the greatest expected information, or None where none distinguishes the two.

    d^T (I + J_1 C_1 J_1^T + J_2 C_2 J_2^T)^-1 d, with d the difference of the two predictions in units of the noise
    and C the covariance of each fit. Runs are judged by the log's own channels; by motor currents too where they are
    not logged and the log's channels do not suffice.
    """
    fits = (first[1], second[1])
    instruments = logged_instruments(fits[0])
    richer = (
        instruments
        if logged(fits[0]).rate_driven
        else with_currents(instruments, [wheel.name for wheel in fits[0].model.rover.wheels])
    )
    differences = []
    for run in _choice(first, second):
        progress(f"predicting a run {run.label}")
        differences.append(predict_difference(run, fits, richer.names))
    driven = [difference for difference in differences if difference is not None]
    scores = _score_runs(driven, instruments, "", progress)
    if len(richer.names) > len(instruments.names) and (not scores or scores[0].expected < ENOUGH):
        scores = sorted(
            scores + _score_runs(driven, richer, ", with the motor currents logged", progress), reverse=True
        )
    if not scores or scores[0].expected < TELLS:
        return None
    best, runner_up = scores[0], scores[1] if len(scores) > 1 else _RunScore(0.0, "", "")
    return SeparatingDrive(
        first[0], second[0], best.label, best.channel, best.expected, runner_up.label, runner_up.expected
    )


def _score_runs(
    driven: Sequence[PredictedDifference], instruments: Instruments, more: str, progress: Progress
) -> list[_RunScore]:
    """Return the runs that differ most, judged with the doubt of both fits, the best first."""
    scores = []
    for difference in sorted(driven, key=lambda candidate: -candidate.plain(instruments))[:CLOSER]:
        progress(f"weighing the doubt on a run {difference.run.label}{more}")
        expected, channel = difference.expected_chi2(instruments)
        scores.append(_RunScore(expected, difference.run.label + more, channel))
    return sorted(scores, reverse=True)


def _choice(first: Named, second: Named) -> tuple[CandidateRun, ...]:
    """Return the runs to choose from, at shares of the fastest logged rate where the wheels are held to rates."""
    runs, experiment = _applicable_runs(first, second), logged(first[1])
    if not experiment.rate_driven:
        return runs
    rates = [np.abs(run.commands.rate) for run in experiment.runs if run.commands.rate is not None]
    fastest = max(float(np.max(rate)) for rate in rates)
    return tuple(run.held_to(fastest) for run in runs if ROLLS not in run.label)


def _applicable_runs(first: Named, second: Named) -> tuple[CandidateRun, ...]:
    """Return the candidate runs; where an effect is tied to a place of the log, those that cross the log's ground."""
    experiment, rover = logged(first[1]), first[1].model.rover
    duty = np.concatenate([np.abs(run.commands.duty).mean(axis=1) for run in experiment.runs])
    moving = duty[duty > MOVING]
    cruise = round(float(np.median(moving)), 2) if moving.size else CRUISE_DUTY
    log_start = experiment.runs[0].commands.start
    if any("x_from" in effect.places for _, fit in (first, second) for effect in fit.model.all_effects):
        return on_own_ground(rover, cruise, log_start)
    marks = [name.partition("[")[2].rstrip("]") for name, _ in (first, second)]
    alone = [at for at, wheel in enumerate(rover.wheels) if wheel.name in marks or str(at) in marks]
    return candidate_runs(rover, cruise, log_start, alone or [0])
