"""Honest selection: the effect chosen anew without each level, and that level predicted by what was chosen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.experiments.wheel_rig.compare import Candidate, Comparison
from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.experiments.wheel_rig.fit import RigFit
from rover_pin.experiments.wheel_rig.held_out import LOST, loss, without_level

NOTHING = "no effect"

TRIED = 4
"""Leading candidates that a fold refits."""


class Fold(NamedTuple):
    """What the runs of all levels but one choose."""

    level: str
    "the level that was left out"
    chosen: str


class Reselected(NamedTuple):
    """The choice of every fold, and the residuals [SD] of the levels that were left out [channels, runs]."""

    folds: tuple[Fold, ...]
    residual: np.ndarray

    def times(self, name: str) -> int:
        """Return how many folds choose this effect."""
        return sum(set(fold.chosen.split(" + ")) == set(name.split(" + ")) for fold in self.folds)


def reselect(data: RigSet, base: RigFit, singles: Comparison, pairs: Comparison) -> Reselected:
    """Leave every level out in turn, choose again among the leading candidates, and predict the level.

    The choice is made as on all runs: the best single that gains beyond its fee and predicts levels held out of the
    rest better, then a pair.
    """
    residual = np.full(base.residual.shape, LOST)
    folds = []
    for number, level in enumerate(data.level_names):
        left_out = data.level == number
        name, fit = _choice(data, (base, singles, pairs), ~left_out)
        folds.append(Fold(level, name))
        if fit is not None:
            own = fit.residual[:, left_out]
            residual[:, left_out] = np.where(np.isfinite(own), own, LOST)
    return Reselected(tuple(folds), residual)


def _choice(
    data: RigSet, compared: tuple[RigFit, Comparison, Comparison], keep: np.ndarray
) -> tuple[str, RigFit | None]:
    base, *groups = compared
    name, fit = NOTHING, without_level(base, keep)
    for group in groups:
        if fit is not None:
            name, fit = _better(data, (name, fit), group.ranked, keep)
    return name, fit


def _better(
    data: RigSet, parent: tuple[str, RigFit], ranked: Sequence[Candidate], keep: np.ndarray
) -> tuple[str, RigFit]:
    """Return the candidate with the greatest gain beyond its fee that also predicts better, or the parent."""
    refits = [(one, without_level(one.fit, keep)) for one in ranked[:TRIED] if one.net > -one.fee / 2]
    known = [(one, fit) for one, fit in refits if fit is not None]
    if not known:
        return parent
    left = max(1.0, min(fit.misfit for _, fit in known))
    known = [(one, fit) for one, fit in known if (parent[1].chi2 - fit.chi2) / left > one.fee]
    reference = _loss(data, parent[1], keep) if known else 0.0
    for one, fit in sorted(known, key=lambda pair: pair[1].chi2 / left + pair[0].fee):
        if _loss(data, fit, keep) < reference:
            return one.name, fit
    return parent


def _loss(data: RigSet, fit: RigFit, keep: np.ndarray) -> float:
    """Return the loss of each level of the rest, predicted by a fit to the others of the rest."""
    residual = np.full(fit.residual.shape, LOST)
    for number in np.unique(data.level[keep]):
        inner = data.level == number
        refit = without_level(fit, keep & ~inner)
        if refit is not None:
            residual[:, inner] = np.nan_to_num(refit.residual[:, inner], nan=LOST)
    return loss(residual[:, keep])
