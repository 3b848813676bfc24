"""Which unknown fits: terms, what acts times what it depends on, ranked by the chi2 that they take."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rover_pin.estimation.columns import IDENTIFIABLE_SHARE, Columns, no_columns
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import huber, huber_weights, null_gain
from rover_pin.estimation.parameter import Parameter, prior_curvature
from rover_pin.estimation.task import objective
from rover_pin.experiments.unlisted.actions import GRIP, Act, Scene, acts, moved_features
from rover_pin.experiments.unlisted.regressors import Argument, arguments
from rover_pin.experiments.unlisted.term import Term
from rover_pin.inference.residual_function import in_shares, rows_signal

REWEIGHED, TURNS = 12, 4
"""How many of the best are weighed again by what they leave, and how often."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The whitened rows of a fit with the columns of its numbers that do not lie on their bounds, for projections."""

    fit: Fit = field(repr=False)
    numbers: np.ndarray = field(repr=False)
    "d rows / d u"
    free: tuple[Parameter, ...] = field(repr=False)
    u: np.ndarray = field(repr=False)


def rows_of(fit: Fit) -> Rows:
    """Return the rows of a fit."""
    free = [
        at for at, parameter in enumerate(fit.parameters) if min(abs(fit.u[at] - np.array(parameter.bounds))) > 1e-6
    ]
    return Rows(fit, fit.columns[:, free], tuple(fit.parameters[at] for at in free), np.asarray(fit.u)[free])


def columns_of(scene: Scene, rows: Rows, act: Act, argument: Argument) -> Columns:
    """Return the whitened columns of a term."""
    experiment, noise = scene.experiment, rows.fit.task.noise
    responses = [
        moved_features(scene, act, run, argument.shares(scene, act, run)) for run in range(len(experiment.runs))
    ]
    padded_table = np.zeros((len(responses[0]), len(experiment.runs), len(experiment.channels), experiment.length))
    for run, response in enumerate(responses):
        padded_table[:, run, :, : response.shape[2]] = np.nan_to_num(response)
    ends = np.cumsum(noise.good.sum(axis=(1, 2)))
    runs = map(slice, np.append(0, ends[:-1]), ends) if argument.per_run else [slice(None)]
    return Columns(noise.white(padded_table).T, tuple(runs))


class _Solved(NamedTuple):
    size: np.ndarray
    covariance: np.ndarray
    numbers: np.ndarray
    columns: int
    gain: float


def _solve_term(rows: Rows, columns: Columns, weights: np.ndarray, use: np.ndarray) -> _Solved:
    """Return the term's numbers with the fit's own moved along; `use` are the rows that count."""
    w, prior = np.where(use, weights, 0.0), prior_curvature(rows.free)
    slopes = rows.numbers
    inner = columns.normal(w)
    scale = np.maximum(np.sqrt(np.diag(inner)), 1e-12)
    normal = slopes.T @ (w[:, None] * slopes) + prior
    right = -slopes.T @ (w * rows.fit.rows) - np.where(np.diag(prior) == 1.0, rows.u, 0.0)
    cross = columns.across(w[:, None] * slopes) / scale
    back = np.linalg.lstsq(normal, np.column_stack([cross, right]), rcond=None)[0]
    inner = inner / np.outer(scale, scale) - cross.T @ back[:, :-1]
    score = columns.across(w * rows.fit.rows) / scale + cross.T @ back[:, -1]
    values, vectors = np.linalg.eigh((inner + inner.T) / 2)
    identified = values > IDENTIFIABLE_SHARE
    q, values = vectors[:, identified], values[identified]
    along = q.T @ score
    size = q @ (along / values)
    numbers = back[:, -1] + back[:, :-1] @ size
    spread = (q / values) @ q.T / np.outer(scale, scale)
    return _Solved(size / scale, spread, numbers, int(identified.sum()), float(np.sum(along**2 / values)))


def _residual_rows(rows: Rows, columns: Columns, solved: _Solved) -> np.ndarray:
    return np.asarray(rows.fit.rows - columns.times(solved.size) + rows.numbers @ solved.numbers)


def _reweigh_term(rows: Rows, columns: Columns) -> tuple[_Solved, float]:
    """Return the term weighed by what it leaves, and the fall of the robust chi2."""
    everything = np.ones(len(rows.fit.rows), dtype=bool)
    residual, solved = rows.fit.rows, None
    for _ in range(TURNS):
        solved = _solve_term(rows, columns, huber_weights(residual), everything)
        residual = _residual_rows(rows, columns, solved)
    assert solved is not None
    base = objective(rows.fit.rows, rows.u, rows.free)
    return solved, base - objective(residual, rows.u + solved.numbers, rows.free)


def held_out(rows: Rows, columns: Columns) -> float:
    """Return the fall of the robust chi2 of each run under numbers that the other runs give, added up."""
    weights, total = huber_weights(rows.fit.rows), 0.0
    for run in np.unique(rows.fit.task.noise.fold):
        other_runs = rows.fit.task.noise.fold != run
        without = _solve_term(rows, no_columns(len(rows.fit.rows)), weights, other_runs)
        with_it = _solve_term(rows, columns, weights, other_runs)
        before = rows.fit.rows + rows.numbers @ without.numbers
        after = _residual_rows(rows, columns, with_it)
        total += huber(before[~other_runs]) - huber(after[~other_runs])
    return total


def functions(scene: Scene) -> Iterator[Columns]:
    """Yield what a model may leave: each act times what it may depend on, in shares of what was measured.

    A grip that differs from run to run is not among them: the noise has that of ground prepared anew.
    """
    rows, signal = rows_of(scene.fit), rows_signal(scene.fit)
    weights = huber_weights(rows.fit.rows)
    for act in acts(scene):
        for argument in arguments(scene, act):
            if not (act.kind == GRIP and argument.per_run):
                yield in_shares(columns_of(scene, rows, act, argument), weights, signal)


def terms(scene: Scene, chosen_acts: Sequence[Act] | None = None) -> tuple[Term, ...]:
    """Return every term, those with the greatest net gain first."""
    rows = rows_of(scene.fit)
    pairs = [(act, argument) for act in chosen_acts or acts(scene) for argument in arguments(scene, act)]
    everything, weights = np.ones(len(rows.fit.rows), dtype=bool), huber_weights(rows.fit.rows)
    fitted_terms = []
    for act, argument in pairs:
        solved = _solve_term(rows, columns_of(scene, rows, act, argument), weights, everything)
        fitted_terms.append(_term(scene, (act, argument), solved, solved.gain, len(pairs)))
    fitted_terms.sort(key=lambda term: -term.net)
    again = [_again(scene, rows, term, len(pairs)) for term in fitted_terms[:REWEIGHED]]
    ranked = (*sorted(again, key=lambda term: -term.strength), *fitted_terms[REWEIGHED:])
    return tuple(replace(term, act=term.act._replace(parts=())) for term in ranked)  # perturbations are large


def _term(
    scene: Scene,
    what: tuple[Act, Argument],
    solved: _Solved,
    gain: float,
    count: int,
    held_out_gain: float | None = None,
) -> Term:
    detection_threshold = 2.0 * solved.columns + null_gain(count)
    runs = tuple(run.name for run in scene.experiment.runs)
    return Term(*what, runs, solved.size, solved.covariance, gain, detection_threshold, held_out_gain)


def _again(scene: Scene, rows: Rows, term: Term, count: int) -> Term:
    columns = columns_of(scene, rows, term.act, term.argument)
    solved, gain = _reweigh_term(rows, columns)
    held_out_gain = None if term.argument.per_run else held_out(rows, columns)
    return _term(scene, (term.act, term.argument), solved, gain, count, held_out_gain)
