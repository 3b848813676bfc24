"""Terms that may describe a residual: each is an action of an unknown effect times a function of one signal.

Example: a torque on the front left wheel (action) times a sine of this wheel's angle (function). For the fit, a term
consists of columns, one for each unknown number of its function: the changes of the residual by one unit of the number,
divided by the noise. `terms` fits every term to the residual and ranks the terms by their decrease of chi2 beyond the
decrease that chance gives.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rover_pin.estimation.columns import MIN_IDENTIFIABLE_SHARE, Columns, no_columns
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.parameter import Parameter, prior_curvature
from rover_pin.estimation.profile import CLEAR_SDS
from rover_pin.estimation.residual import chi2, huber, huber_weights, null_gain
from rover_pin.estimation.wording import spread
from rover_pin.experiments.drive_log.checks.channels import stretches
from rover_pin.experiments.unlisted.actions import GRIP, READING, VOLTAGE, Act, Scene, acts, moved_features
from rover_pin.experiments.unlisted.regressors import Argument, Hats, Polynomial, Wave, arguments
from rover_pin.inference.residual_function import in_shares, rows_signal

MIN_SD_SHARE = 0.01
"""Minimum SD of a function's value that the data determine, as a fraction of the largest SD. No data depend on a value
with a smaller SD; the pseudo-inverse gives it the SD 0."""
GRIP_VARIABILITY = 0.03
"""RMS change of the grip of newly prepared sand, from run to run and along the path (assumed) [-]. A smaller change of
the grip needs no unlisted effect as its cause."""
MAX_ROBUST_TERMS = 12
"""Number of best descriptions of a residual (terms) that are fitted a second time with robust weights. It is small,
because the robust fit is slow."""
ROBUST_ITERATIONS = 4
"""Number of robust fits of one description of a residual (term). Each fit uses the weights that follow from the
residual of the previous fit."""
MAX_LISTED_STRETCHES = 3
"""Maximum number of intervals of place or time that the description of a residual lists, the clearest first."""
ARGUMENT_WORDS = {
    "rate": "the wheel's rate",
    "duty": "the duty",
    "slip": "the slip",
    "current": "the motor's current",
    "pitch": "the pitch",
    "roll": "the roll",
    "time": "the time since the run began",
    "place": "the place along x",
    "heading": "the heading (its cosine)",
}
"""Signal on which a smooth function depends -> its words in reports."""


class Curve(NamedTuple):
    """The estimated function of a signal at some points, with the SD of each value."""

    at: np.ndarray
    """values of the signal at which the function is evaluated (points,)"""
    value: np.ndarray
    """values of the function at these points, in the unit of the action: (points,), or (runs, points) if each run has
    its own function"""
    sd: np.ndarray
    """SD of each entry of `value`, in equal shape"""


@dataclass(frozen=True, eq=False)
class Term:
    """An action times a function of one signal, fitted to the residual of a drive model.

    Examples are a torque on one wheel times a sine of the wheel's angle, and a force against the motion times a
    function of the place.
    """

    act: Act = field(repr=False)
    argument: Argument = field(repr=False)
    runs: tuple[str, ...]
    "names of the runs that the term was fitted to"
    size: np.ndarray
    """fitted numbers of the function (k,); if each run has its own numbers, the numbers of all runs one after another
    (runs k,)"""
    covariance: np.ndarray = field(repr=False)
    "covariance of `size`"
    gain: float
    """decrease of the robust chi2 by this description of the residual"""
    detection_threshold: float
    """decrease of chi2 that the best of all descriptions with an equal number of unknowns has by chance"""
    held_out: float | None
    """decrease of chi2 in runs that the numbers were not fitted to; None if each run has its own numbers"""

    @property
    def net(self) -> float:
        """Decrease of chi2 by the term, minus the decrease that the best of all terms has by chance."""
        return self.gain - self.detection_threshold

    @property
    def curve(self) -> Curve:
        """The estimated function with its SDs at a grid of points, in the unit of the action."""
        grid = self.argument.basis.grid
        basis = self.argument.basis.of(grid)
        k = len(basis)
        # `size` holds the k coefficients of the first run, then those of the second run, and so on.
        spans = [slice(k * run, k * run + k) for run in range(len(self.size) // k)]
        values = np.array([self.size[span] @ basis for span in spans])
        variances = [np.einsum("ig,ij,jg->g", basis, self.covariance[span, span], basis) for span in spans]
        sds = np.array([np.sqrt(np.maximum(variance, 0)) for variance in variances])
        return Curve(grid, values if self.argument.per_run else values[0], sds if self.argument.per_run else sds[0])

    @property
    def strength(self) -> float:
        """Number for the ranking of terms: the decrease of chi2 by a term minus the decrease that chance gives, or the
        decrease of chi2 in held-out runs if this decrease is smaller.
        """
        return self.net if self.held_out is None else min(self.net, self.held_out)

    @property
    def is_raking(self) -> bool:
        """Whether the term is a small change of grip that differs from run to run, as raking the sand between runs
        causes it.
        """
        if self.act.kind != GRIP or not self.argument.per_run:
            return False
        curve = self.curve
        return float(np.sqrt(np.mean(curve.value[curve.sd > 0] ** 2))) < GRIP_VARIABILITY

    @property
    def description(self) -> str:
        """The term as a predicate for reports, such as "acts as a torque on wheel fl that ...", with its size and
        place.
        """
        # The form of the function decides how its values are put into words.
        name, basis, curve = self.argument.name, self.argument.basis, self.curve
        action = f"acts as {self.act.description}"
        if name == "nothing":
            return f"{action}: {_size(self, curve.value[0], curve.sd[0])} all the time"
        if name == "run":
            by_run = (f"{_size(self, row[0])} in {run}" for run, row in zip(self.runs, curve.value, strict=True))
            return f"{action} that differs from run to run: {', '.join(by_run)}"
        if isinstance(basis, Wave):
            # A sine of the place or of the wheel's angle is shown by its amplitude, which has no sign, and its phase.
            amplitude, phase = sine(self)
            size = _size(self, float(np.mean(amplitude)), float(np.max(curve.sd))).lstrip("+")
            if name == "periodic place":
                return f"{action} that varies with the place, wavelength {basis.length:.2f} m: amplitude {size}"
            twice = "twice " if basis.length < 2 * math.pi - 1e-9 else ""
            first = f"{action} that depends on {twice}the angle of the wheel"
            if self.argument.per_run:
                return f"{first}: amplitude {size}, its phase differs from run to run"
            return f"{first} since the start of the run: amplitude {size}, phase {math.degrees(phase[0]):.0f} deg"
        if isinstance(basis, Hats):
            # A piecewise linear function of place or time is shown by the intervals where it clearly differs from its
            # median. Intervals of all runs compete for the few that are listed.
            of_place = self.argument.unit == "m"
            letter, unit, signal = ("x", "m", "the place along x") if of_place else ("t", "s", "the moment")
            rows: list[int | None] = list(range(len(curve.value))) if self.argument.per_run else [None]
            located = [(row, stretch) for row in rows for stretch in clear_stretches(curve, row)]
            located.sort(key=lambda pair: -abs(pair[1].top / pair[1].sd))
            listed = [
                f"{_size(self, top, sd)} at {letter} = {low:.2f}..{high:.2f} {unit}"
                + ("" if row is None else f" in {self.runs[row]}")
                for row, (low, high, top, sd) in located[:MAX_LISTED_STRETCHES]
            ]
            return f"{action} that depends on {signal}: {'; '.join(listed) or 'nowhere clear of 0'}"
        assert isinstance(basis, Polynomial)
        # An error of a reading that depends on the reading itself is an offset and a gain error.
        if self.act.kind == READING and name == "its own value":
            zero, gain = self.size
            values = f"{_size(self, zero)} and {100 * gain:+.2g} % of the reading"
        else:
            unit = f" {self.argument.unit}" if self.argument.unit else ""
            # Both ends and the middle show a polynomial of degree two completely.
            points = (0, len(curve.at) // 2, len(curve.at) - 1)
            values = ", ".join(
                f"{_size(self, curve.value[point], curve.sd[point])} at {curve.at[point]:.3g}{unit}" for point in points
            )
        return f"{action} that depends on {ARGUMENT_WORDS.get(name, name)}: {values}"


def _size(term: Term, value: float, sd: float | None = None) -> str:
    """Return a value of a term's function as text with its SD and unit. A relative change is stated in percent."""
    # A duty is stated as a fraction of the full duty, a change of grip in percent.
    unit, scale = term.act.unit, 1.0
    if not unit:
        unit, scale = ("of full duty", 1.0) if term.act.kind == VOLTAGE else ("%", 100.0)
    return f"{scale * value:+.3g}{'' if sd is None else spread(scale * sd)} {unit}"


def sine(term: Term) -> tuple[np.ndarray, np.ndarray]:
    """Return the amplitudes A and the phases p [rad] of a term whose function of x is A sin(2 pi x / L + p) with the
    wavelength L.

    Each array has one value for each run if each run has its own numbers, and otherwise a single value.
    """
    # A sin(x + p) = A cos p sin x + A sin p cos x, and `size` holds the two factors.
    pairs = term.size.reshape(-1, 2)
    return np.hypot(*pairs.T), np.arctan2(pairs[:, 1], pairs[:, 0])


class Stretch(NamedTuple):
    """An interval of place or time with values of a piecewise linear function that clearly differ from its median."""

    low: float
    """lower end of the interval, in the unit of the place or time"""
    high: float
    """upper end of the interval, in the unit of the place or time"""
    top: float
    """value in the interval that differs most from the median in units of its SD, minus this median"""
    sd: float
    """SD of the value of the function that `top` is computed from"""


def clear_stretches(curve: Curve, row: int | None) -> list[Stretch]:
    """Return the intervals of clear difference between a piecewise linear function and its median, the clearest
    interval first.

    A report lists these intervals, because they show at which place or time an unlisted effect acts. The median is
    subtracted, because a constant part of the function can be explained by a motion resistance or by a motor that is
    stronger or weaker than declared.

    Parameters
    ----------
    curve : Curve
        The function at its nodes.
    row : int or None
        Index of the run if each run has its own function; None otherwise.
    """
    # Only values that the data determine enter the median.
    value, sd = (curve.value, curve.sd) if row is None else (curve.value[row], curve.sd[row])
    identified = sd > MIN_SD_SHARE * float(np.max(sd))
    value = value - (np.median(value[identified]) if identified.any() else 0.0)
    clear = identified & (np.abs(value) > CLEAR_SDS * sd)
    clear_parts, half = [], (curve.at[1] - curve.at[0]) / 2
    # Neighbouring values of one sign form an interval, which extends half a spacing beyond its outer nodes.
    for sign in (1, -1):
        for begin, end in stretches(clear & (np.sign(value) == sign)):
            top = begin + np.argmax(np.abs(value[begin:end]) / sd[begin:end])
            low, high = max(curve.at[begin] - half, curve.at[0]), min(curve.at[end - 1] + half, curve.at[-1])
            clear_parts.append(Stretch(low, high, float(value[top]), float(sd[top])))
    return sorted(clear_parts, key=lambda stretch: -abs(stretch.top / stretch.sd))


@dataclass(frozen=True, eq=False)
class Rows:
    """Residuals of a fit after whitening (rows), and their derivatives by the parameters that may still change.

    Whitened residuals are independent with the SD 1. A parameter that lies at a bound is omitted, because no term may
    decrease chi2 by moving the parameter beyond the bound.
    """

    fit: Fit = field(repr=False)
    numbers: np.ndarray = field(repr=False)
    "derivatives of the rows with respect to `u` (rows, parameters)"
    free: tuple[Parameter, ...] = field(repr=False)
    u: np.ndarray = field(repr=False)
    """the parameters that may change, in units of their prior SD (parameters,)"""


def rows_of(fit: Fit) -> Rows:
    """Return the whitened residuals of a fit, and their derivatives by the parameters that do not lie at a bound."""
    # A parameter at its bound would have to move beyond it, which the fit does not allow.
    free = [
        index
        for index, parameter in enumerate(fit.parameters)
        if min(abs(fit.u[index] - np.array(parameter.bounds))) > 1e-6
    ]
    return Rows(fit, fit.columns[:, free], tuple(fit.parameters[index] for index in free), np.asarray(fit.u)[free])


def columns_of(scene: Scene, rows: Rows, act: Act, argument: Argument) -> Columns:
    """Return the changes of the whitened residuals by one unit of each unknown number of a term's function, as columns.

    If each run has its own numbers, the columns of one run are 0 in the rows of all other runs.
    """
    experiment, noise = scene.experiment, rows.fit.task.noise
    responses = [
        moved_features(scene, act, run, argument.shares(scene, act, run)) for run in range(len(experiment.runs))
    ]
    # Runs differ in length, so the responses are padded with zeros to the longest run.
    padded_table = np.zeros((len(responses[0]), len(experiment.runs), len(experiment.channels), experiment.length))
    for run, response in enumerate(responses):
        padded_table[:, run, :, : response.shape[2]] = np.nan_to_num(response)
    ends = np.cumsum(noise.good.sum(axis=(1, 2)))
    runs = map(slice, np.append(0, ends[:-1]), ends) if argument.per_run else [slice(None)]
    return Columns(noise.white(padded_table).T, tuple(runs))


class _TermFit(NamedTuple):
    """Result of fitting one term together with the parameters of the model: the fitted numbers of the term's function,
    and the steps of the model's parameters.
    """

    size: np.ndarray
    covariance: np.ndarray
    numbers: np.ndarray
    """steps of the model's parameters that accompany the term, in units of their prior SD"""
    columns: int
    """number of combinations of the term's numbers that the data determine"""
    gain: float
    """decrease of the weighted chi2 by the term"""


def _solve_term(rows: Rows, columns: Columns, weights: np.ndarray, use: np.ndarray) -> _TermFit:
    """Fit a term (an action of an unknown effect times a function of a signal) together with the parameters of the
    model.

    The fit is linear least squares. `weights` (rows,) are the robust weights, and the mask `use` (rows,) marks the rows
    that the term is fitted to.
    """
    # Normal equations of the term (scaled to a unit diagonal) and of the fit's own parameters with their priors.
    w, prior = np.where(use, weights, 0.0), prior_curvature(rows.free)
    slopes = rows.numbers
    inner = columns.normal(w)
    scale = np.maximum(np.sqrt(np.diag(inner)), 1e-12)
    normal = slopes.T @ (w[:, None] * slopes) + prior
    right = -slopes.T @ (w * rows.fit.rows) - np.where(np.diag(prior) == 1.0, rows.u, 0.0)
    cross = columns.across(w[:, None] * slopes) / scale
    back = np.linalg.lstsq(normal, np.column_stack([cross, right]), rcond=None)[0]
    # The parameters are eliminated (Schur complement), so that the term gains only what they cannot explain.
    inner = inner / np.outer(scale, scale) - cross.T @ back[:, :-1]
    score = columns.across(w * rows.fit.rows) / scale + cross.T @ back[:, -1]
    # Directions that the parameters or other columns explain almost fully are not identified, and are left out.
    values, vectors = np.linalg.eigh((inner + inner.T) / 2)
    identified = values > MIN_IDENTIFIABLE_SHARE
    q, values = vectors[:, identified], values[identified]
    along = q.T @ score
    size = q @ (along / values)
    numbers = back[:, -1] + back[:, :-1] @ size
    covariance = (q / values) @ q.T / np.outer(scale, scale)
    return _TermFit(size / scale, covariance, numbers, int(identified.sum()), float(np.sum(along**2 / values)))


def _residual_rows(rows: Rows, columns: Columns, solved: _TermFit) -> np.ndarray:
    """Return the whitened residuals (rows,) that remain after a fitted term is subtracted and the model's parameters
    are moved by the steps that accompany the term.
    """
    return np.asarray(rows.fit.rows - columns.times(solved.size) + rows.numbers @ solved.numbers)


def held_out(rows: Rows, columns: Columns) -> float:
    """Return the decrease of the robust chi2 in held-out runs by a term (an action times a function of a signal),
    summed over the runs.

    Each run is predicted with numbers that are fitted to the other runs, so a term that only imitates noise does not
    decrease this chi2.
    """
    weights, total = huber_weights(rows.fit.rows), 0.0
    for run in np.unique(rows.fit.task.noise.fold):
        # The run is predicted by two fits to the other runs, one without and one with the term.
        other_runs = rows.fit.task.noise.fold != run
        without = _solve_term(rows, no_columns(len(rows.fit.rows)), weights, other_runs)
        with_it = _solve_term(rows, columns, weights, other_runs)
        before = rows.fit.rows + rows.numbers @ without.numbers
        after = _residual_rows(rows, columns, with_it)
        total += huber(before[~other_runs]) - huber(after[~other_runs])
    return total


def functions(scene: Scene) -> Iterator[Columns]:
    """Yield all terms (each an action times a function of a signal) that the residual of a model may contain, as
    columns.

    The columns are scaled so that all terms are equally large before the data are considered. The evidence for an
    unlisted effect integrates over these terms. A grip that differs from run to run is omitted, because the noise model
    already contains the variability of newly prepared sand.
    """
    rows, signal = rows_of(scene.fit), rows_signal(scene.fit)
    weights = huber_weights(rows.fit.rows)
    for act in acts(scene):
        for argument in arguments(scene, act):
            if not (act.kind == GRIP and argument.per_run):
                yield in_shares(columns_of(scene, rows, act, argument), weights, signal)


def terms(scene: Scene, chosen_acts: Sequence[Act] | None = None) -> tuple[Term, ...]:
    """Fit every term (an action of an unknown effect times a function of a signal) to the residual of a model, the best
    first.

    Parameters
    ----------
    scene : Scene
        The fitted model with its runs.
    chosen_acts : sequence of Act, optional
        Actions that are tried. By default, all actions of an unknown effect are tried.
    """
    rows = rows_of(scene.fit)
    pairs = [(act, argument) for act in chosen_acts or acts(scene) for argument in arguments(scene, act)]
    everything, weights = np.ones(len(rows.fit.rows), dtype=bool), huber_weights(rows.fit.rows)
    names = tuple(run.name for run in scene.experiment.runs)

    def term_of(
        act: Act, argument: Argument, solved: _TermFit, gain: float, held_out_gain: float | None = None
    ) -> Term:
        # The more terms are tried, the more the best of them gains by chance.
        detection_threshold = 2.0 * solved.columns + null_gain(len(pairs))
        return Term(act, argument, names, solved.size, solved.covariance, gain, detection_threshold, held_out_gain)

    # First pass: every term is fitted with the robust weights of the residual without any term.
    fitted_terms = []
    for act, argument in pairs:
        solved = _solve_term(rows, columns_of(scene, rows, act, argument), weights, everything)
        fitted_terms.append(term_of(act, argument, solved, solved.gain))
    fitted_terms.sort(key=lambda term: -term.net)
    # Second pass, for the best terms: iteratively reweighted least squares, in which outliers of the term's own
    # residual lose their weight, and the prediction of held-out runs.
    refitted_terms = []
    base = chi2(rows.fit.rows, rows.u, rows.free)
    for term in fitted_terms[:MAX_ROBUST_TERMS]:
        columns = columns_of(scene, rows, term.act, term.argument)
        residual = rows.fit.rows
        for _ in range(ROBUST_ITERATIONS):
            solved = _solve_term(rows, columns, huber_weights(residual), everything)
            residual = _residual_rows(rows, columns, solved)
        gain = base - chi2(residual, rows.u + solved.numbers, rows.free)
        held_out_gain = None if term.argument.per_run else held_out(rows, columns)
        refitted_terms.append(term_of(term.act, term.argument, solved, gain, held_out_gain))
    ranked = (*sorted(refitted_terms, key=lambda term: -term.strength), *fitted_terms[MAX_ROBUST_TERMS:])
    # The responses of the channels are dropped, because they need much memory and no reader of a term uses them.
    return tuple(replace(term, act=term.act._replace(parts=())) for term in ranked)
