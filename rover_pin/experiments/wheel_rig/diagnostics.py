"""Diagnose a fit to rig data: compare fitted constants with other measurements, test the residuals, and state cautions.

`diagnose` returns the diagnostics of one model of one data set. A verdict is the result of the loop, the search for
missing effects. `RigExtra` holds the results that only a verdict on one rig data set has, and `JointExtra` the results
of a verdict on several. `cautions` turns the diagnostics into sentences for the report.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import permutation_test

from rover_pin.base.public import brief
from rover_pin.contact import Soil
from rover_pin.discrepancy.rivals import is_better
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import curves
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.profile import CONFIDENCE
from rover_pin.estimation.wording import Against, against, format_value, interval
from rover_pin.experiments.wheel_rig.describe import RigChannelResidual, channel_residuals
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.runs import RigRuns
from rover_pin.measurements.rig_set import Independent, RigSet

PERMUTATIONS = 1999
"""Number of permutations of the residuals in a test. The smallest possible p-value is then 1 / 2000."""

SLIP_SQUARED, ORDER, NEIGHBOURS, NEXT_RUN = "slip^2", "run order", "neighbour in slip", "next run"
"""Names of the quantities that are correlated with residuals, in addition to slip and load."""
MIN_AGREEING_FRACTION = 0.8
"""Minimum fraction of the searches without one slip level that must choose the effects of the verdict. If fewer do, a
caution lists the other choices."""
MIN_LEVELS = 6
"""Minimum number of slip levels for fine intervals of held-out errors. With fewer levels, a caution states that the
intervals are coarse, because they come from a bootstrap over the levels."""


class ResidualTest(NamedTuple):
    """Test whether the residual of one channel is correlated with one quantity."""

    channel: str
    against: str
    "name of the quantity, such as slip or load"
    correlation: float
    p: float
    """two-sided probability that shuffled residuals have at least as strong a correlation"""
    of: int = 1
    """number of tests that were made together; the probability is corrected for this number"""

    @property
    def is_significant(self) -> bool:
        """Whether the correlation is larger than chance explains at the 95 % level, corrected for the number of tests
        (Bonferroni).
        """
        return self.of * self.p < 1.0 - CONFIDENCE


def residual_tests(data: RigSet, residual: np.ndarray, seed: int) -> tuple[ResidualTest, ...]:
    """Test whether the residuals of a model are correlated with a quantity or with each other, and return the tests.

    The residuals of each channel are correlated with the slip, with the part of slip^2 that is not linear in the slip,
    with the order of the rows, and with the load if the loads vary. Two tests of whiteness correlate each residual with
    the next one, once in the order of the slip and once in the order of the rows. The p-values are two-sided and come
    from permutations of the residuals.

    Parameters
    ----------
    data : RigSet
        The measured runs.
    residual : array (channels, runs)
        Measured minus predicted, in SDs of the stated noise.
    seed : int
        Seed of the permutations.
    """

    def correlate(quantity: np.ndarray, row: np.ndarray, axis: int = -1) -> np.ndarray:
        # The quantity (runs,) has the mean 0 and the length 1.
        return np.asarray(row @ quantity / np.linalg.norm(row, axis=axis))

    def correlate_neighbours(order: np.ndarray, row: np.ndarray, axis: int = -1) -> np.ndarray:
        # Correlation of each residual with the next one in the given order of the runs (runs,).
        sorted_row = row[..., order]
        products = sorted_row[..., 1:] * sorted_row[..., :-1]
        return np.asarray(products.sum(axis=axis) / np.sum(row**2, axis=axis))

    tests = []
    for channel, row in zip(data.channels, residual, strict=True):
        values, slip = row[channel.has_value], data.slip[channel.has_value]
        # Over a short range of slips, slip^2 is nearly linear in the slip, so only the rest of it is a test of its own.
        design = np.column_stack([np.ones_like(slip), slip])
        curvature = slip**2 - design @ np.linalg.lstsq(design, slip**2, rcond=None)[0]
        against = {"slip": slip, SLIP_SQUARED: curvature, ORDER: np.arange(slip.size, dtype=float)}
        if data.loads_vary:
            against["load"] = data.load[channel.has_value]
        # Name of each quantity -> function of residuals (..., runs) and an axis that returns the correlation along it.
        statistics: dict[str, Callable[..., np.ndarray]] = {}
        for name, quantity in against.items():
            centred = quantity - quantity.mean()
            statistics[name] = partial(correlate, centred / max(np.linalg.norm(centred), 1e-300))
        statistics[NEIGHBOURS] = partial(correlate_neighbours, np.argsort(slip, kind="stable"))
        statistics[NEXT_RUN] = partial(correlate_neighbours, np.arange(slip.size))
        for name, statistic in statistics.items():
            correlation, p = 0.0, 1.0
            # A constant residual correlates with nothing.
            if np.ptp(values) > 0:
                result = permutation_test(
                    (values - values.mean(),), statistic, permutation_type="pairings", n_resamples=PERMUTATIONS,
                    vectorized=True, random_state=seed,
                )  # fmt: skip
                correlation, p = float(result.statistic), float(result.pvalue)
            tests.append(ResidualTest(channel.name, name, correlation, p))
    return tuple(test._replace(of=len(tests)) for test in tests)


class Flag(NamedTuple):
    """Comparison of a fitted constant with an independent measurement of this constant, in SI."""

    name: str
    unit: str
    fitted: tuple[float, float, float]
    """fitted value, lower end and upper end of its 95 % interval"""
    independent: Independent
    "the independent measurement, with its source"
    says: Against
    """result of the comparison, with the phrase that reports use for it"""

    @property
    def agrees(self) -> bool:
        """Whether the fitted interval overlaps the range of the measurement, and is narrow enough for a comparison."""
        return self.says is Against.AGREES

    @property
    def sentence(self) -> str:
        """A sentence with the fitted value, its interval, the result of the comparison, and the independent value."""
        range_text = format_value(self.independent.low, self.unit)
        if self.independent.high > self.independent.low:
            range_text += f" to {format_value(self.independent.high, self.unit)}"
        fitted = interval(*self.fitted, self.unit)
        return f"{self.name} = {fitted} {self.says.value} {range_text} ({self.independent.source})"

    def as_dict(self) -> dict:
        """Return the comparison as numbers and texts, for verdict.json."""
        # `independent` and `says` are objects that JSON cannot hold, so they are replaced by numbers and text.
        reference = {"independent": [self.independent.low, self.independent.high], "source": self.independent.source}
        return self._asdict() | reference | {"agrees": self.agrees, "says": self.says.value}


def flags(data: RigSet, soil: Soil, b: float, fitted: tuple[Number, ...]) -> tuple[Flag, ...]:
    """Compare every fitted constant that was also measured independently with this measurement, and return the
    comparisons.

    A fitted constant agrees with the measurement if its 95 % interval overlaps the range of the measurement. This range
    is widened by its tolerance on both sides, unless it is a bound. If the interval of the fit covers nearly all
    allowed values, no comparison is possible.

    Parameters
    ----------
    data : RigSet
        The data set. Its rig.toml declares the other measurements.
    soil : Soil
        The fitted soil.
    b : float
        Width of the wheel [m].
    fitted : tuple of Number
        The fitted numbers.
    """
    # Measurements name a soil constant without the prefix "soil.".
    numbers_by_name = {number.name.removeprefix("soil."): number for number in fitted}
    rows = {name: (number.value, number.low, number.high) for name, number in numbers_by_name.items()}
    covered = {name: number.covered for name, number in numbers_by_name.items()}
    # A wheel of one width identifies only K_eff = (k_1 + k_2 b) / b^n, so that k_1 is compared by means of K_eff.
    if "k_1" in rows:
        rows["K_eff"] = tuple((value + soil.k_2 * b) / b**soil.n for value in rows["k_1"])
        covered["K_eff"] = covered["k_1"]
    comparisons = []
    for reference in data.independent(float(soil.n)):
        if reference.name in rows:
            tolerated = reference.low * (1 - reference.tolerance), reference.high * (1 + reference.tolerance)
            says = against(rows[reference.name][1:], tolerated, covered[reference.name])
            comparisons.append(Flag(reference.name, reference.unit, rows[reference.name], reference, says))
    return tuple(comparisons)


@brief
class FitDiagnostics(NamedTuple):
    """Diagnostics of one fitted model: comparisons with other measurements, descriptions of the residuals, and their
    tests.
    """

    flags: tuple[Flag, ...]
    residuals: tuple[RigChannelResidual, ...]
    tests: tuple[ResidualTest, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return comparisons, tests and residuals as numbers and texts, for verdict.json."""
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
    """Return the diagnostics of a fitted model of one data set: comparisons, residuals, and tests of the residuals.

    Parameters
    ----------
    data : RigSet
        The measured runs.
    model : RigModel
        The fitted model.
    numbers : tuple of Number
        The fitted numbers of the model.
    residual : array (channels, runs)
        Measured minus predicted, in SDs of the stated noise.
    seed : int
        Seed of the permutation tests.
    """
    reference_flags = flags(data, model.soil, float(model.wheel.b), numbers)
    return FitDiagnostics(reference_flags, channel_residuals(data, residual), residual_tests(data, residual, seed))


@brief
class RigExtra(NamedTuple):
    """Results that only a verdict on one rig data set has: diagnostics of the base model and of the model with added
    effects.

    A verdict is the result of the loop, the search for missing effects.
    """

    before: FitDiagnostics
    "diagnostics of the base model"
    after: FitDiagnostics
    "diagnostics of the model with the added effects"
    declared: tuple[str, ...] = ()
    "sentences on the use of the declared lugs and sand"

    def lines(self, added: bool) -> list[str]:
        """Return the results as lines for the summary of a verdict. `added` states whether an effect was added to the
        base model.
        """
        # Comparisons after the fit are printed only if an effect was added; otherwise they equal those before.
        lines = [f"declared: {line}" for line in self.declared]
        lines += [f"before: {flag.sentence}" for flag in self.before.flags]
        lines += [f"after: {flag.sentence}" for flag in self.after.flags] if added else []
        return [*lines, *(f"residual after the fit: {residual.sentence}" for residual in self.after.residuals)]

    def as_dict(self) -> dict[str, Any]:
        """Return the diagnostics of both models and the sentences on declarations as numbers and texts, for
        verdict.json.
        """
        sides = {"before": self.before.as_dict(), "after": self.after.as_dict()}
        return {**sides, "declared": list(self.declared)}


class SetError(NamedTuple):
    """Held-out RMSE (root mean square error) of one channel of one data set, in a joint fit of several data sets.

    Each slip level is predicted by a fit to all other levels.
    """

    set: str
    channel: str
    unit: str
    before: float
    "RMSE of the base model"
    after: float
    "RMSE of the model with the added effects"
    noise: float
    """RMS of the SDs that the data set states for the channel"""
    curve: str
    """name of the simple curve through the points of this data set alone that predicts its held-out levels best"""
    curve_error: float
    """RMSE of this simple curve on held-out levels"""

    @property
    def sentence(self) -> str:
        """A sentence with the held-out errors without and with added effects, the noise, and the error of the simple
        curve.
        """
        errors = f"{format_value(self.before, self.unit)} -> {format_value(self.after, self.unit)}"
        curve = f"a {self.curve} of that set alone {format_value(self.curve_error, self.unit)}"
        return f"{self.set}: held-out {self.channel} {errors} (noise {format_value(self.noise, self.unit)}; {curve})"

    @property
    def is_lost(self) -> bool:
        """Whether the simple curve predicts the held-out levels of the data set better than the joint model does."""
        return is_better(self.curve_error, self.noise, self.after)

    @property
    def loss(self) -> str:
        """A clause for a caution, which states that the simple curve predicts the data set better than the model
        does.
        """
        return (
            f"held out, {self.channel} of {self.set} is predicted better by a {self.curve} of that set alone "
            f"({format_value(self.curve_error, self.unit)} against {format_value(self.after, self.unit)})"
        )


class JointExtra(NamedTuple):
    """Results that only a verdict on several rig data sets has: the held-out errors of each data set.

    A verdict is the result of the loop, the search for missing effects.
    """

    sets: tuple[SetError, ...]
    declared: tuple[str, ...]
    "sentences on the use of the declared lugs and sand"

    def lines(self, added: bool) -> list[str]:
        """Return the results as lines for the summary of a verdict. The argument `added` is not used."""
        return [*(set_error.sentence for set_error in self.sets), *(f"declared: {line}" for line in self.declared)]

    def as_dict(self) -> dict[str, Any]:
        """Return the errors of each data set and the sentences on declarations as numbers and texts, for
        verdict.json.
        """
        sets = [set_error._asdict() for set_error in self.sets]
        return {"sets": sets, "declared": list(self.declared)}


def set_errors(experiment: RigExperiment, verdict: Verdict) -> tuple[SetError, ...]:
    """Return the held-out errors of every channel of every data set, for the joint model and for the best simple curve.

    The simple curve uses the points of the data set alone. `verdict` is the verdict on the joint fit.
    """
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
            # A level without a measurement counts 0; a measured level that is not predicted stays NaN.
            squares = np.where(count[:, None] > 0, levels, 0.0) ** 2
            was, now = np.sqrt(count @ squares / count.sum()).tolist()
            rows.append(SetError(name, channel, unit, was, now, float(noise), best.curve, best.error))
    return tuple(rows)


def cautions(verdict: Verdict, diagnostics: FitDiagnostics) -> tuple[str, ...]:
    """Return the cautions of a verdict on one rig data set, as clauses for the report.

    The clauses warn of implausible fitted numbers, of large or correlated residuals, and of an uncertain choice of the
    effect. `diagnostics` are the diagnostics of the last model of the verdict.
    """
    # Cautions on the fitted numbers come first, then those on the residuals, then those on the choice.
    clauses = parameter_cautions(verdict.after.numbers if verdict.after else (), diagnostics.flags)
    clauses += [
        f"the residual of {residual.name} in the fit to all runs is {residual.rms:.1f} times its noise"
        for residual in diagnostics.residuals
        if not residual.is_noise
    ]
    clauses += [
        f"the residual of {test.channel} correlates with {test.against} (r = {test.correlation:+.2f}, "
        f"p = {test.p:.2g}, one of {test.of} tests)"
        for test in diagnostics.tests
        if test.is_significant
    ]
    # The choice: candidates that could not be tried, selections that differ, and few levels.
    clauses += [
        f"{name} was not tried: with this effect, however small, no sinkage carries the load of some run"
        for name in (verdict.beliefs.untried if verdict.beliefs is not None else ())
    ]
    selections = len(verdict.chosen)
    if verdict.agreeing_folds < MIN_AGREEING_FRACTION * selections:
        names = " + ".join(verdict.named) or "no effect"
        others = sorted({name or "no effect" for name in verdict.chosen.values()} - {names})
        clauses.append(
            f"only {verdict.agreeing_folds} of {selections} selections without one level choose {names}; the others "
            f"choose {', '.join(others)}"
        )
    if selections < MIN_LEVELS:
        clauses.append(
            f"the intervals of held-out errors are coarse, because they resample {selections} levels, fewer than "
            f"{MIN_LEVELS}"
        )
    return (*clauses, *verdict.cautions)


def parameter_cautions(fitted: Sequence[Number], flags: Sequence[Flag]) -> list[str]:
    """Return cautions about fitted numbers, as clauses for the report.

    A clause states that a number lies at its bound, that the data do not determine a number, or that a number differs
    from an independent measurement. `flags` holds the comparisons with independent measurements.
    """
    # A bound, an undetermined number, and a contradiction with another measurement are reported in this order.
    clauses = [
        f"{number.name} lies at its bound: the form of the model may be wrong" for number in fitted if number.at_bound
    ]
    clauses += [
        f"{number.name} is not determined by these data"
        for number in fitted
        if not number.closed and not number.at_bound
    ]
    clauses += [flag.sentence for flag in flags if flag.says is Against.AWAY]
    clauses += [
        f"{flag.name} is not identified: its interval covers its whole allowed range, so it neither confirms nor "
        "contradicts the independent value"
        for flag in flags
        if flag.says is Against.NOTHING
    ]
    return clauses
