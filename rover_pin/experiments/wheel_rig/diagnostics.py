"""What is wrong with a rig's fit: constants against what is known elsewhere, what each channel leaves, and chance."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import permutation_test

from rover_pin.base.public import brief
from rover_pin.contact import Soil
from rover_pin.discrepancy.rivals import is_better
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import curves
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.profile import SURE
from rover_pin.estimation.wording import Against, against, format_value, interval
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.residual import RigChannelResidual, channel_residuals
from rover_pin.experiments.wheel_rig.runs import RigRuns
from rover_pin.measurements.rig_set import Independent, RigSet

DRAWS = 1999
"""Permutations of a test: the least p-value is 1 / 2000."""

SLIP_SQUARED, ORDER, NEIGHBOURS, NEXT_RUN = "slip^2", "run order", "neighbour in slip", "next run"


class ResidualTest(NamedTuple):
    """The correlation of one channel's residual with one quantity, and how often chance gives as much."""

    channel: str
    against: str
    correlation: float
    p: float
    of: int = 1
    "how many tests there are, so that chance has as many tries"

    @property
    def is_significant(self) -> bool:
        """Whether chance hardly gives this in any of the tests (Bonferroni)."""
        return self.of * self.p < 1.0 - SURE


def residual_tests(data: RigSet, residual: np.ndarray, seed: int) -> tuple[ResidualTest, ...]:
    """Return the tests of residuals [channels, runs] in SDs.

    Correlation with slip, with slip^2 (what slip does not carry of it), with load where loads vary, and with the order
    of the rows; and of each residual with that of the run next to it in slip, and with that of the next run: whiteness.
    The p-values are two-sided, by permuting the residuals.
    """
    tests = [
        ResidualTest(channel.name, name, *_test_row(row[channel.has_value], statistic, seed))
        for channel, row in zip(data.channels, residual, strict=True)
        for name, statistic in _statistics(data, channel.has_value).items()
    ]
    return tuple(test._replace(of=len(tests)) for test in tests)


Statistic = Callable[..., np.ndarray]


def _statistics(data: RigSet, is_measured: np.ndarray) -> dict[str, Statistic]:
    """Return what the residuals of these runs are tested with."""
    slip, load = data.slip[is_measured], data.load[is_measured]
    against = {"slip": slip, SLIP_SQUARED: _curvature(slip), ORDER: np.arange(slip.size, dtype=float)}
    if data.loads_vary:
        against["load"] = load
    statistics = {name: _with(values) for name, values in against.items()}
    order = {NEIGHBOURS: np.argsort(slip, kind="stable"), NEXT_RUN: np.arange(slip.size)}
    return statistics | {name: _with_next(run_order) for name, run_order in order.items()}


def _test_row(row: np.ndarray, statistic: Statistic, seed: int) -> tuple[float, float]:
    centred = row - row.mean()
    if not np.ptp(row) > 0:
        return 0.0, 1.0
    test_result = permutation_test(
        (centred,), statistic, permutation_type="pairings", n_resamples=DRAWS, vectorized=True, random_state=seed
    )
    return float(test_result.statistic), float(test_result.pvalue)


def _with(values: np.ndarray) -> Statistic:
    scaled = values - values.mean()
    scaled = scaled / max(np.linalg.norm(scaled), 1e-300)

    def correlation(row: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.asarray(row @ scaled / np.linalg.norm(row, axis=axis))

    return correlation


def _with_next(order: np.ndarray) -> Statistic:
    def correlation(row: np.ndarray, axis: int = -1) -> np.ndarray:
        sorted_row = row[..., order]
        products = sorted_row[..., 1:] * sorted_row[..., :-1]
        return np.asarray(products.sum(axis=axis) / np.sum(row**2, axis=axis))

    return correlation


def _curvature(slip: np.ndarray) -> np.ndarray:
    """Return slip^2 without its share that is linear in slip."""
    design = np.column_stack([np.ones_like(slip), slip])
    return np.asarray(slip**2 - design @ np.linalg.lstsq(design, slip**2, rcond=None)[0])


class Flag(NamedTuple):
    """A fitted constant against an independent measurement of it [SI]."""

    name: str
    unit: str
    fitted: tuple[float, float, float]
    "value, and the ends of its 95 % interval"
    independent: Independent
    says: Against

    @property
    def agrees(self) -> bool:
        """Whether the two meet, and the interval says anything at all."""
        return self.says is Against.AGREES

    @property
    def sentence(self) -> str:
        """One sentence for a reader."""
        range_text = format_value(self.independent.low, self.unit)
        if self.independent.high > self.independent.low:
            range_text += f" to {format_value(self.independent.high, self.unit)}"
        fitted = interval(*self.fitted, self.unit)
        return f"{self.name} = {fitted} {self.says.value} {range_text} ({self.independent.source})"

    def as_dict(self) -> dict:
        """Return plain values."""
        reference = {"independent": [self.independent.low, self.independent.high], "source": self.independent.source}
        return self._asdict() | reference | {"agrees": self.agrees, "says": self.says.value}


def flags(data: RigSet, soil: Soil, b: float, fitted: tuple[Number, ...]) -> tuple[Flag, ...]:
    """Return every fitted constant that is known from elsewhere, and whether the two agree.

    They agree where the 95 % interval meets the independent range, which is granted 10 % on both sides if it is a
    measurement of the constant and no bound; an interval that covers nearly all that is allowed says nothing.
    """
    numbers_by_name = {number.name.removeprefix("soil."): number for number in fitted}
    rows = {name: (number.value, number.low, number.high) for name, number in numbers_by_name.items()}
    covered = {name: number.covered for name, number in numbers_by_name.items()}
    if "k_1" in rows:
        rows["K_eff"] = tuple((value + soil.k_2 * b) / b**soil.n for value in rows["k_1"])
        covered["K_eff"] = covered["k_1"]
    raised_flags = []
    for reference in data.independent(float(soil.n)):
        if reference.name in rows:
            granted = reference.low * (1 - reference.tolerance), reference.high * (1 + reference.tolerance)
            says = against(rows[reference.name][1:], granted, covered[reference.name])
            raised_flags.append(Flag(reference.name, reference.unit, rows[reference.name], reference, says))
    return tuple(raised_flags)


@brief
class FitDiagnostics(NamedTuple):
    """What one model leaves."""

    flags: tuple[Flag, ...]
    residuals: tuple[RigChannelResidual, ...]
    tests: tuple[ResidualTest, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "flags": [flag.as_dict() for flag in self.flags],
            "residual_tests": [test._asdict() for test in self.tests],
            "remainder": [
                residual._asdict()
                | {"levels": [level._asdict() for level in residual.levels], "said": residual.sentence}
                for residual in self.residuals
            ],
        }


def diagnose(
    data: RigSet, model: RigModel, numbers: tuple[Number, ...], residual: np.ndarray, seed: int
) -> FitDiagnostics:
    """Return what a model leaves of a set (channels, runs) [SD], and its constants against other measurements."""
    reference_flags = flags(data, model.soil, float(model.wheel.b), numbers)
    return FitDiagnostics(reference_flags, channel_residuals(data, residual), residual_tests(data, residual, seed))


@brief
class RigExtra(NamedTuple):
    """What only a rig set has to say of the models before and after."""

    before: FitDiagnostics
    after: FitDiagnostics
    declared: tuple[str, ...] = ()
    "how what is declared of lugs and sand was used"

    def lines(self, added: bool) -> list[str]:
        """Return lines for a reader."""
        lines = [f"declared: {line}" for line in self.declared]
        lines += [f"before: {flag.sentence}" for flag in self.before.flags]
        lines += [f"after: {flag.sentence}" for flag in self.after.flags] if added else []
        return [*lines, *(f"left: {residual.sentence}" for residual in self.after.residuals)]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        sides = {"before": self.before.as_dict(), "after": self.after.as_dict()}
        return {**sides, "declared": list(self.declared)}


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
        return is_better(self.curve_error, self.noise, self.after)

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
