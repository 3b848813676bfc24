"""What the drives of a log say of their ground: how much grip and slope differ, and where it is not as declared."""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import COLOURED
from rover_pin.estimation.profile import MOST
from rover_pin.estimation.random_effects.random_field import LearntSd, RandomField, expected_draws
from rover_pin.estimation.wording import format_value
from rover_pin.experiments.drive_log.experiment import experiment_of_log
from rover_pin.experiments.drive_log.ground.field import KINDS, SLOPE, SLOPE_OF_RUN, shares_of
from rover_pin.simulation.logged_inputs import fill_gaps

SURE = 10.8 * COLOURED
"""Gain in -2 ln L from which slopes are not chance: chi2 of one number passes 10.8 once in 1,000."""
SURVEYED = math.radians(0.1)
"""Slope [rad, rms] to which a ground counts as declared, however sure a difference is: 2 mm a metre (assumed)."""


class Stretch(NamedTuple):
    """The stretch of one run where the ground deviates most from the declared."""

    run: str
    slope: float
    "mean slope along the heading beside the declared one [rad], above 0 uphill"
    begin: tuple[float, float]
    end: tuple[float, float]
    "x and y of the base [m], in the direction that the rover faces"


class GroundVariability(NamedTuple):
    """The learnt SDs of ground and tracker, and the ground's worst stretch where slopes are off beyond SURVEYED."""

    learnt: tuple[LearntSd, ...]
    rms: float
    "of the slope beside the declared one over all runs, as expected from the log [rad]"
    worst: Stretch | None

    @property
    def sentence(self) -> str:
        """The finding as a sentence; empty where the ground is as declared."""
        if self.worst is None:
            return ""
        run, slope, *ends = self.worst
        begin, end = (f"({x:.2f}, {y:.2f})" for x, y in ends)
        uphill = "more uphill" if slope > 0 else "more downhill"
        return (
            f"The ground is not as declared: its slope differs by {_degrees(self.rms)} rms, most in {run}, "
            f"{_degrees(abs(slope))} {uphill} from (x, y) = {begin} to {end} m."
        )

    @property
    def lines(self) -> list[str]:
        """The learnt SDs, a line of the ground's and one of the tracker's."""
        groups: dict[str, list[str]] = {"ground": [], "tracker": []}
        for row in self.learnt:
            of = "ground" if row.kind in KINDS else "tracker"
            groups[of] += [f"{row.kind.name} {_size(row)}"] if row.sd > 0 else []
        return [f"{of}, learnt (SD): {', '.join(parts)}" for of, parts in groups.items() if parts]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        sds = {
            learnt_sd.kind.name: {"sd": learnt_sd.sd, "unit": learnt_sd.kind.unit, "gain": learnt_sd.gain}
            for learnt_sd in self.learnt
        }
        worst = self.worst._asdict() if self.worst else None
        return {"sds": sds, "slope_rms": self.rms, "worst": worst}


def _size(learnt_sd: LearntSd) -> str:
    return format_value(learnt_sd.sd, learnt_sd.kind.unit) if learnt_sd.kind.unit else f"{learnt_sd.sd:.1%}"


def _degrees(slope: float) -> str:
    return f"{math.degrees(slope):.2g} deg"


def ground_variability(fitted: Fit) -> GroundVariability | None:
    """Return what a fit says of the ground of its runs; None where none was learnt."""
    noise, experiment = fitted.task.noise, experiment_of_log(fitted)
    if noise.random_effects is None:
        return None
    field, learnt = noise.random_effects.field, noise.random_effects.learnt
    plain = dataclasses.replace(noise, random_effects=None)
    coefficients = expected_draws(field, learnt, plain.white(field.moved).T, plain.white(fitted.residual))
    slopes = [
        _slope(coefficients, field, at, shares_of(run, fitted.model.rover)) for at, run in enumerate(experiment.runs)
    ]
    learnt = tuple(learnt_sd for learnt_sd in learnt if not learnt_sd.kind.is_known)
    rms = math.sqrt(float(np.mean(np.concatenate(slopes) ** 2)))
    sure = any(learnt_sd.kind in (SLOPE, SLOPE_OF_RUN) and learnt_sd.gain > SURE for learnt_sd in learnt)
    if not (sure and rms > SURVEYED):
        return GroundVariability(learnt, rms, None)
    return GroundVariability(learnt, rms, _worst(fitted, slopes))


def _slope(coefficients: np.ndarray, field: RandomField, run: int, shares: np.ndarray) -> np.ndarray:
    """Return the expected slope at each row of a run (T,)."""
    along, run_slopes = (
        coefficients[(field.fold == run) & (field.kind == KINDS.index(kind))] for kind in (SLOPE, SLOPE_OF_RUN)
    )
    return np.asarray(float(run_slopes.sum()) + (along @ shares if along.size else np.zeros(shares.shape[1])))


def _worst(fitted: Fit, slopes: list[np.ndarray]) -> Stretch:
    run = max(range(len(slopes)), key=lambda at: float(np.abs(slopes[at]).max()))
    row, logged_run = slopes[run], experiment_of_log(fitted).runs[run]
    top = int(np.argmax(np.abs(row)))
    inside = row * np.sign(row[top]) > MOST * abs(row[top])
    outside = np.flatnonzero(~inside)
    begin = int(outside[outside < top].max(initial=-1)) + 1
    end = int(outside[outside > top].min(initial=len(row)))
    path = np.column_stack([fill_gaps(logged_run.commands.place[:, axis])[begin:end] for axis in (0, 1)])
    facing = np.array([math.cos(logged_run.heading[top]), math.sin(logged_run.heading[top])])
    ends = path[[0, -1]] if (path[-1] - path[0]) @ facing >= 0 else path[[-1, 0]]
    first, last = ((float(x), float(y)) for x, y in ends)
    return Stretch(logged_run.name, float(row[begin:end].mean()), first, last)
