"""Which unknown fits: terms, what acts times what it depends on, ranked by the chi2 that they take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from rover_pin.discrepancy.screen import entry_fee
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import huber, huber_weights
from rover_pin.experiments.unlisted.actions import Act, Scene, acts, moved_features
from rover_pin.experiments.unlisted.regressors import Argument, arguments
from rover_pin.experiments.unlisted.term import Term

TOLD = 1e-3
"""Share of a direction's sum of squares that must be left after the uncertain numbers for it to be told."""
REWEIGHED, TURNS = 12, 4
"""How many of the best are weighed again by what they leave, and how often."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The whitened rows of a fit with the columns of its numbers, ready for projections."""

    fit: Fit = field(repr=False)
    rows: np.ndarray = field(repr=False)
    numbers: np.ndarray = field(repr=False)
    "d rows / d u, less those of numbers that lie on their bounds"
    prior: np.ndarray = field(repr=False)
    u: np.ndarray = field(repr=False)
    run_of: np.ndarray = field(repr=False)


def rows_of(fit: Fit) -> Rows:
    """Return the rows of a fit."""
    free = [at for at, one in enumerate(fit.parameters) if min(abs(fit.u[at] - np.array(one.bounds))) > 1e-6]
    prior = np.array([1.0 if fit.parameters[at].prior else 1e-9 for at in free])
    run_of = np.nonzero(fit.task.noise.good)[0]
    return Rows(fit, fit.rows, fit.columns[:, free], prior, np.asarray(fit.u)[free], run_of)


class Columns(NamedTuple):
    """The whitened columns (n, k) of a term; where every run has numbers of its own, those of run r act on its rows."""

    values: np.ndarray
    runs: tuple[slice, ...]
    "the rows of each run that has numbers of its own; all rows, once, where the runs share them"

    def normal(self, w: np.ndarray) -> np.ndarray:
        """Return C^T diag(w) C, C the whole columns."""
        return np.asarray(block_diag(*(part.T @ (w[run, None] * part) for run, part in self._parts)))

    def across(self, table: np.ndarray) -> np.ndarray:
        """Return table^T C of a table (n, ...)."""
        return np.concatenate([table[run].T @ part for run, part in self._parts], axis=-1)

    def times(self, size: np.ndarray) -> np.ndarray:
        """Return C size, one number a row."""
        sizes = np.split(size, len(self.runs))
        return np.concatenate([part @ own for (_, part), own in zip(self._parts, sizes, strict=True)])

    @property
    def _parts(self) -> list[tuple[slice, np.ndarray]]:
        return [(run, self.values[run]) for run in self.runs]


def columns_of(scene: Scene, rows: Rows, act: Act, argument: Argument) -> Columns:
    """Return the whitened columns of a term."""
    experiment, noise = scene.experiment, rows.fit.task.noise
    moved = [moved_features(scene, act, run, argument.shares(scene, act, run)) for run in range(len(experiment.runs))]
    whole = np.zeros((len(moved[0]), len(experiment.runs), len(experiment.channels), experiment.length))
    for run, one in enumerate(moved):
        whole[:, run, :, : one.shape[2]] = np.nan_to_num(one)
    ends = np.cumsum(noise.good.sum(axis=(1, 2)))
    runs = map(slice, np.append(0, ends[:-1]), ends) if argument.own else [slice(None)]
    return Columns(noise.white(whole).T, tuple(runs))


class _Solved(NamedTuple):
    size: np.ndarray
    covariance: np.ndarray
    numbers: np.ndarray
    columns: int
    gain: float


def _solved(rows: Rows, columns: Columns, weights: np.ndarray, use: np.ndarray) -> _Solved:
    """Return the term's numbers with the fit's own moved along; `use` are the rows that count."""
    w = np.where(use, weights, 0.0)
    slopes = rows.numbers
    inner = columns.normal(w)
    scale = np.maximum(np.sqrt(np.diag(inner)), 1e-12)
    normal = slopes.T @ (w[:, None] * slopes) + np.diag(rows.prior)
    right = -slopes.T @ (w * rows.rows) - np.where(rows.prior == 1.0, rows.u, 0.0)
    cross = columns.across(w[:, None] * slopes) / scale
    back = np.linalg.lstsq(normal, np.column_stack([cross, right]), rcond=None)[0]
    inner = inner / np.outer(scale, scale) - cross.T @ back[:, :-1]
    score = columns.across(w * rows.rows) / scale + cross.T @ back[:, -1]
    values, vectors = np.linalg.eigh((inner + inner.T) / 2)
    told = values > TOLD
    q, values = vectors[:, told], values[told]
    along = q.T @ score
    size = q @ (along / values)
    numbers = back[:, -1] + back[:, :-1] @ size
    spread = (q / values) @ q.T / np.outer(scale, scale)
    return _Solved(size / scale, spread, numbers, int(told.sum()), float(np.sum(along**2 / values)))


def _objective(rows: Rows, left: np.ndarray, numbers: np.ndarray) -> float:
    held = rows.prior == 1.0
    return huber(left) + float(np.sum((rows.u + numbers)[held] ** 2))


def _left(rows: Rows, columns: Columns, solved: _Solved) -> np.ndarray:
    return np.asarray(rows.rows - columns.times(solved.size) + rows.numbers @ solved.numbers)


def _alone(rows: Rows) -> Columns:
    """Return no columns at all, to solve for the fit's numbers alone."""
    return Columns(np.zeros((len(rows.rows), 0)), (slice(None),))


def _reweighed(rows: Rows, columns: Columns) -> tuple[_Solved, float]:
    """Return the term weighed by what it leaves, and the fall of the robust chi2."""
    everything = np.ones(len(rows.rows), dtype=bool)
    left, solved = rows.rows, None
    for _ in range(TURNS):
        solved = _solved(rows, columns, huber_weights(left), everything)
        left = _left(rows, columns, solved)
    assert solved is not None
    base = _objective(rows, rows.rows, np.zeros(len(rows.u)))
    return solved, base - _objective(rows, left, solved.numbers)


def held_out(rows: Rows, columns: Columns) -> float:
    """Return the fall of the robust chi2 of each run under numbers that the other runs give, added up."""
    weights, total = huber_weights(rows.rows), 0.0
    for run in np.unique(rows.run_of):
        other = rows.run_of != run
        without = _solved(rows, _alone(rows), weights, other)
        with_it = _solved(rows, columns, weights, other)
        before = rows.rows + rows.numbers @ without.numbers
        after = _left(rows, columns, with_it)
        total += huber(before[~other]) - huber(after[~other])
    return total


def terms(scene: Scene, made: Sequence[Act] | None = None) -> tuple[Term, ...]:
    """Return every term, those with the greatest net gain first."""
    rows = rows_of(scene.fit)
    pairs = [(act, argument) for act in made or acts(scene) for argument in arguments(scene, act)]
    everything, weights = np.ones(len(rows.rows), dtype=bool), huber_weights(rows.rows)
    found = []
    for act, argument in pairs:
        solved = _solved(rows, columns_of(scene, rows, act, argument), weights, everything)
        found.append(_term(scene, (act, argument), solved, solved.gain, len(pairs)))
    found.sort(key=lambda one: -one.net)
    again = [_again(scene, rows, one, len(pairs)) for one in found[:REWEIGHED]]
    return tuple(map(_light, (*sorted(again, key=lambda one: -one.strength), *found[REWEIGHED:])))


def _light(one: Term) -> Term:
    """Return the term without the nudges, which are large."""
    return replace(one, act=one.act._replace(parts=()))


def _term(
    scene: Scene, what: tuple[Act, Argument], solved: _Solved, gain: float, count: int, held: float | None = None
) -> Term:
    fee = 2.0 * solved.columns + entry_fee(count)
    runs = tuple(run.name for run in scene.experiment.runs)
    return Term(*what, runs, solved.size, solved.covariance, gain, solved.columns, fee, held)


def _again(scene: Scene, rows: Rows, one: Term, count: int) -> Term:
    columns = columns_of(scene, rows, one.act, one.argument)
    solved, gain = _reweighed(rows, columns)
    held = None if one.argument.own else held_out(rows, columns)
    return _term(scene, (one.act, one.argument), solved, gain, count, held)
