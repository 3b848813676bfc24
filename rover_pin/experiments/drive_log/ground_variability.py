"""Describe how the ground varies between the drives of a log: learnt SDs of grip and slope, and slopes not declared."""

import dataclasses
import math
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import LEARNT_NOISE_INFLATION
from rover_pin.estimation.parameter import posterior_covariance
from rover_pin.estimation.profile import MAJORITY
from rover_pin.estimation.random_effects.random_field import LearntSd, expected_draws, scales
from rover_pin.estimation.wording import format_value
from rover_pin.experiments.drive_log.experiment import experiment_of_log
from rover_pin.experiments.drive_log.random_effects import GROUND_ERROR, KINDS, SLOPE, SLOPE_OF_RUN, shares_of
from rover_pin.simulation.logged_inputs import fill_gaps

MIN_GAIN = 10.8 * LEARNT_NOISE_INFLATION
"""Minimum decrease of -2 ln L by significant random slopes of the ground, where L is the likelihood of the log. Chance
exceeds 10.8, the value of chi2 with one degree of freedom, once in 1,000 logs."""
MAX_SURVEY_ERROR = math.radians(0.1)
"""Maximum RMS difference between the slope of the ground and the declared slope [rad]: 2 mm in a metre (assumed). Up to
this value, the ground counts as declared, even if the difference is significant."""


class Stretch(NamedTuple):
    """The stretch of one run's path on which the slope of the ground differs most from the declared slope."""

    run: str
    slope: float
    """mean slope along the heading minus the declared slope [rad]; positive if the ground rises more than declared"""
    begin: tuple[float, float]
    """x and y of the rover's base at the beginning of the stretch [m]; the rover faces from `begin` to `end`"""
    end: tuple[float, float]
    """x and y of the rover's base at the end of the stretch [m]"""


class GroundVariability(NamedTuple):
    """Variability of the ground and drift of the tracker, as a fit has learnt them from a drive log."""

    learnt: tuple[LearntSd, ...]
    "learnt SDs of grip, slope and tracker drift"
    rms: float
    """RMS difference between the slope and the declared slope over all runs [rad], as expected given the log"""
    worst: Stretch | None
    """stretch with the largest difference from the declared slope; None if the ground is as declared (see
    MAX_SURVEY_ERROR), or if no ground is declared"""
    estimate_sd: float | None = None
    """RMS posterior SD of the slope along the paths of the runs whose ground was estimated from their attitude [rad];
    None if there is no such run"""

    @property
    def sentence(self) -> str:
        """A sentence on the stretch whose slope differs most from the declared slope; empty if the ground is as
        declared.
        """
        if self.worst is None:
            return ""
        run, slope, *ends = self.worst
        begin, end = (f"({x:.2f}, {y:.2f})" for x, y in ends)
        uphill = "more uphill" if slope > 0 else "more downhill"
        rms, difference = (f"{math.degrees(angle):.2g} deg" for angle in (self.rms, abs(slope)))
        return (
            f"The ground is not as declared: its slope differs by {rms} rms, most in {run}, "
            f"{difference} {uphill} from (x, y) = {begin} to {end} m."
        )

    @property
    def lines(self) -> list[str]:
        """The learnt SDs as lines of text: one line for the ground and one for the tracker. A line without positive SDs
        is omitted.
        """
        # An SD of 0 means that the log shows no such variability.
        groups: dict[str, list[str]] = {"ground": [], "tracker": []}
        for row in self.learnt:
            if row.sd > 0:
                size = format_value(row.sd, row.kind.unit) if row.kind.unit else f"{row.sd:.1%}"
                groups["ground" if row.kind in KINDS else "tracker"].append(f"{row.kind.name} {size}")
        lines = [f"{source}, learnt (SD): {', '.join(sizes)}" for source, sizes in groups.items() if sizes]
        if self.estimate_sd is not None:
            sd = format_value(self.estimate_sd, "rad")
            lines.append(f"ground, estimated from the attitude: SD of its slope along the paths {sd}")
        return lines

    def as_dict(self) -> dict[str, Any]:
        """Return the learnt SDs, the RMS slope and the worst stretch as numbers and texts, for a JSON file."""
        sds = {
            learnt_sd.kind.name: {"sd": learnt_sd.sd, "unit": learnt_sd.kind.unit, "gain": learnt_sd.gain}
            for learnt_sd in self.learnt
        }
        worst = self.worst._asdict() if self.worst else None
        return {"sds": sds, "slope_rms": self.rms, "worst": worst, "estimate_sd": self.estimate_sd}


def ground_variability(fitted: Fit, undeclared: Collection[str] = ()) -> GroundVariability | None:
    """Return the variability of the ground that a fit to a drive log has learnt, or None if the fit has learnt none.

    The slope of the ground in each row of each run is the slope that is expected given the residual of the fit and the
    learnt SDs. If random slopes are significant (MIN_GAIN) and larger than MAX_SURVEY_ERROR, the result also holds the
    stretch of ground that differs most from the declared terrain. An estimated ground is no declaration, so that runs
    over it have no such stretch; instead, the result holds the SD of the estimate.

    Parameters
    ----------
    fitted : Fit
        The fit to the drive log.
    undeclared : collection of str
        Names of the runs whose ground is not declared.
    """
    noise, experiment = fitted.task.noise, experiment_of_log(fitted)
    if noise.random_effects is None:
        return None
    field, learnt = noise.random_effects.field, noise.random_effects.learnt
    # Expectation of each random effect given the residual; the noise without random effects whitens both.
    plain = dataclasses.replace(noise, random_effects=None)
    draws = expected_draws(field, learnt, plain.white(field.moved).T, plain.white(fitted.residual))
    slopes = []
    for index, run in enumerate(experiment.runs):
        # Slope of a row: that of the whole run plus the slopes of the knots, interpolated along the path.
        weights = shares_of(run, fitted.model.rover)
        at_knots, of_run = (
            draws[(field.fold == index) & (field.kind == KINDS.index(kind))] for kind in (SLOPE, SLOPE_OF_RUN)
        )
        along = at_knots @ weights if at_knots.size else np.zeros(weights.shape[1])
        slopes.append(np.asarray(float(of_run.sum()) + along))
    # SDs that are known, such as those of duty steps, are no result of the fit.
    learnt = tuple(learnt_sd for learnt_sd in learnt if not learnt_sd.kind.is_known)
    rms = math.sqrt(float(np.mean(np.concatenate(slopes) ** 2)))
    estimate_sd = _estimate_sd(fitted)
    # All conditions must hold: a ground was declared, the slopes are no chance, and they are larger than an error of
    # the survey.
    declared = [index for index, run in enumerate(experiment.runs) if run.name not in undeclared]
    is_significant = any(row.kind in (SLOPE, SLOPE_OF_RUN) and row.gain > MIN_GAIN for row in learnt)
    if not (declared and is_significant and rms > MAX_SURVEY_ERROR):
        return GroundVariability(learnt, rms, None, estimate_sd)
    # The stretch lies around the largest difference from the declared slope. It extends on both sides to the rows in
    # which the difference falls below half of its maximum.
    worst_run = max(declared, key=lambda index: float(np.abs(slopes[index]).max()))
    slope, run = slopes[worst_run], experiment.runs[worst_run]
    top = int(np.argmax(np.abs(slope)))
    outside = np.flatnonzero(~(slope * np.sign(slope[top]) > MAJORITY * abs(slope[top])))
    begin = int(outside[outside < top].max(initial=-1)) + 1
    end = int(outside[outside > top].min(initial=len(slope)))
    path = np.column_stack([fill_gaps(run.commands.place[:, axis])[begin:end] for axis in (0, 1)])
    # If the rover drives backwards, the ends are exchanged, because the slope is along the heading.
    facing = np.array([math.cos(run.heading[top]), math.sin(run.heading[top])])
    ends = path[[0, -1]] if (path[-1] - path[0]) @ facing >= 0 else path[[-1, 0]]
    first, last = ((float(x), float(y)) for x, y in ends)
    return GroundVariability(learnt, rms, Stretch(run.name, float(slope[begin:end].mean()), first, last), estimate_sd)


def _estimate_sd(fitted: Fit) -> float | None:
    """Return the RMS posterior SD of the slope along the paths over estimated ground [rad]; None if no run has one.

    The error of the ground, the other random effects and the parameters are uncertain together, so that the covariance
    is that of all of them (`posterior_covariance`).
    """
    noise, runs = fitted.task.noise, experiment_of_log(fitted).runs
    if noise.random_effects is None or all(run.ground is None for run in runs):
        return None
    field, learnt = noise.random_effects.field, noise.random_effects.learnt
    plain = dataclasses.replace(noise, random_effects=None)
    numbers = plain.white(np.array([fitted.slopes[parameter.name] for parameter in fitted.parameters]))
    columns = np.concatenate([scales(field, learnt)[:, None] * plain.white(field.moved), numbers])
    covariance = posterior_covariance(columns)
    # The columns of one ground follow each other in the order of its shapes, and grounds in the order of their runs.
    is_error = np.flatnonzero(field.kind == field.kinds.index(GROUND_ERROR[0]))
    variances, first = [], 0
    for ground in dict.fromkeys(run.ground for run in runs if run.ground is not None):
        at = is_error[first : first + len(ground.shapes)]
        first += len(ground.shapes)
        for run in runs:
            if run.ground is ground:
                slopes = ground.slopes_along(*run.commands.place.T)
                variances.append(np.einsum("ts,su,tu->t", slopes, covariance[np.ix_(at, at)], slopes))
    return math.sqrt(float(np.nanmean(np.concatenate(variances))))
