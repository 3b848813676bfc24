"""What one model of several sets leaves of each of them."""

from typing import Any, NamedTuple

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import curves
from rover_pin.estimation.wording import format_value
from rover_pin.experiments.rig_sets.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.runs import RigRuns


class SetError(NamedTuple):
    """The RMSE of one channel of one set, each of its levels predicted by a fit to all other levels of all sets."""

    set: str
    channel: str
    unit: str
    before: float
    after: float
    noise: float
    curve: str
    "the curve through that set's own points that predicts its levels best"
    curve_error: float

    @property
    def sentence(self) -> str:
        """One sentence for a reader."""
        errors = f"{format_value(self.before, self.unit)} -> {format_value(self.after, self.unit)}"
        curve = f"a {self.curve} of that set alone {format_value(self.curve_error, self.unit)}"
        return f"{self.set}: held-out {self.channel} {errors} (noise {format_value(self.noise, self.unit)}; {curve})"

    @property
    def is_lost(self) -> bool:
        """Whether that curve predicts the set's levels better than the joint model."""
        return self.curve_error < self.after

    @property
    def loss(self) -> str:
        """What that means for the model, in one sentence."""
        return (
            f"held out, {self.channel} of {self.set} is predicted better by a {self.curve} of that set alone "
            f"({format_value(self.curve_error, self.unit)} against {format_value(self.after, self.unit)})"
        )


class JointExtra(NamedTuple):
    """What only a joint fit has to say."""

    sets: tuple[SetError, ...]
    declared: tuple[str, ...]

    def lines(self, added: bool) -> list[str]:
        """Return lines for a reader."""
        return [*(set_error.sentence for set_error in self.sets), *(f"declared: {line}" for line in self.declared)]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        sets = [set_error._asdict() for set_error in self.sets]
        return {"sets": sets, "declared": list(self.declared)}


def set_errors(experiment: RigExperiment, verdict: Verdict) -> tuple[SetError, ...]:
    """Return the held-out errors of every channel of every set, and of the best curve through that set alone."""
    rows = []
    for data in experiment.sets:
        name, runs, folds = data.name, RigRuns(data.rolled), experiment.of_set(data.name)
        channels = [(channel, experiment.unit(channel)) for channel in runs.channels]
        baselines = curves(runs.observed, runs.inputs, channels)
        for (channel, unit), noise in zip(channels, runs.rms_sd, strict=True):
            best = min((row for row in baselines if row.channel == channel), key=lambda row: row.error)
            count = np.isfinite(experiment.observed[folds, experiment.channels.index(channel)]).sum(axis=1)
            score = next(score for score in verdict.scores if score.name == channel)
            levels = np.array([(level.before, level.after) for level in score.levels])[folds]
            squares = np.where(count[:, None] > 0, levels, 0.0) ** 2  # a lost level stays NaN, one not measured is none
            was, now = np.sqrt(count @ squares / count.sum()).tolist()
            rows.append(SetError(name, channel, unit, was, now, float(noise), best.curve, best.error))
    return tuple(rows)
