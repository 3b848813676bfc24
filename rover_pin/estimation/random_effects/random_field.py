"""What differs from fold to fold by chance, as ground prepared anew: columns of known shape, SDs that are learnt.

y = predicted(u) + G gamma + eps, gamma ~ N(0, diag tau^2), eps the noise. With whitened columns B, one scale d of each
kind for its SD over the size that made the column, rows have the covariance I + B d^2 B^T: what gamma may have done is
taken out of them, and no number has to imitate it. The d are those of greatest restricted likelihood, every uncertain
number and every candidate left free, so that a missing effect is not taken for chance.
Source: Patterson and Thompson, Biometrika 58 (1971) 545; Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425;
Brynjarsdottir and O'Hagan, Inverse Problems 30 (2014) 114007 (without a prior of what is left, numbers absorb it).
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from rover_pin.estimation.columns import IDENTIFIABLE_SHARE

MOST_SCALE = 10.0
"""Greatest SD of a kind that is looked for, in the sizes of its columns."""


class Kind(NamedTuple):
    """One way in which folds differ by chance, and the size that makes each of its columns."""

    name: str
    size: float
    unit: str
    is_known: bool = False
    "whether the size is the SD with which folds differ, and nothing is to be learnt"


@dataclass(frozen=True, eq=False)
class RandomField:
    """What a draw of each kind at each place would move: `moved` (columns, folds, channels, samples), one fold each."""

    kinds: tuple[Kind, ...]
    kind: np.ndarray
    "index of the kind of each column"
    fold: np.ndarray
    "index of the fold that each column moves"
    moved: np.ndarray = dataclasses.field(repr=False)


def join(parts: Sequence[tuple[Sequence[Kind], Mapping[str, np.ndarray]]]) -> RandomField:
    """Return one field of several kinds and their columns: each `kind`, among its own, `fold` and `moved`."""
    kinds = [kind for of_part, _ in parts for kind in of_part]
    kind = [kinds.index(of_part[0]) + columns["kind"] for of_part, columns in parts]
    others = (np.concatenate([columns[name] for _, columns in parts]) for name in ("fold", "moved"))
    return RandomField(tuple(kinds), np.concatenate(kind), *others)


class LearntSd(NamedTuple):
    """The SD with which folds differ in one way, and what it gains in restricted likelihood."""

    kind: Kind
    sd: float
    "in the kind's unit; 0 where nothing speaks for it"
    gain: float
    "fall of -2 ln of the restricted likelihood against this SD at 0, the others as they are"


@dataclass(frozen=True, eq=False)
class RandomEffectsFilter:
    """The learnt SDs, and what they take out of the whitened rows of each fold: r -> r - W W^T r.

    W = U sqrt(1 - 1 / sqrt(1 + s^2)) with B d = U s V^T, so that I - W W^T is the inverse root of I + B d^2 B^T.
    """

    field: RandomField = dataclasses.field(repr=False)
    "of what the SDs were learnt"
    learnt: tuple[LearntSd, ...]
    basis: np.ndarray = dataclasses.field(repr=False)
    "W (folds, channels, samples, columns)"

    def taken_out(self, rows: np.ndarray, good: np.ndarray) -> np.ndarray:
        """Return rows (..., n) of the compared samples, fold after fold, without what chance may have done."""
        ends = np.cumsum(good.sum(axis=(1, 2)))[:-1]
        parts = np.split(rows, ends, axis=-1)
        filtered = [
            part - (part @ table[fold_mask]) @ table[fold_mask].T
            for part, table, fold_mask in zip(parts, self.basis, good, strict=True)
        ]
        return np.concatenate(filtered, axis=-1)


def scales(field: RandomField, learnt: Sequence[LearntSd]) -> np.ndarray:
    """Return the learnt SD of each column, in its size."""
    return np.array([learnt_sd.sd / learnt_sd.kind.size for learnt_sd in learnt])[field.kind]


def expected_draws(field: RandomField, learnt: Sequence[LearntSd], columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return what each column is expected to have drawn, in its kind's unit, given whitened columns and rows (n, ...).

    E[gamma | r] = d (I + d G d)^-1 d b in the columns' sizes.
    """
    size, d = np.array([kind.size for kind in field.kinds])[field.kind], scales(field, learnt)
    scaled = columns * d
    return np.asarray(size * d * np.linalg.solve(np.eye(len(d)) + scaled.T @ scaled, scaled.T @ rows))


def random_effects_filter(
    field: RandomField, columns: np.ndarray, good: np.ndarray, learnt: Sequence[LearntSd]
) -> RandomEffectsFilter:
    """Return what these SDs take out of rows, given the whitened columns (n, columns)."""
    parts = np.split(columns * scales(field, learnt), np.cumsum(good.sum(axis=(1, 2)))[:-1])
    roots = [_root(part[:, np.any(part != 0.0, axis=0)]) for part in parts]
    basis = np.zeros((*good.shape, max(root.shape[1] for root in roots)))
    for table, fold_mask, root in zip(basis, good, roots, strict=True):
        table[fold_mask, : root.shape[1]] = root
    return RandomEffectsFilter(field, tuple(learnt), basis)


def _root(part: np.ndarray) -> np.ndarray:
    u, s, _ = np.linalg.svd(part, full_matrices=False)
    return np.asarray(u[:, s > IDENTIFIABLE_SHARE] * np.sqrt(1 - 1 / np.sqrt(1 + s[s > IDENTIFIABLE_SHARE] ** 2)))


def spanning(columns: np.ndarray) -> np.ndarray:
    """Return orthonormal columns that span what these (n, ...) do, whatever their units, but for round-off."""
    Q, s, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-9), full_matrices=False)
    return np.asarray(Q[:, s > IDENTIFIABLE_SHARE * s[0]] if s.size else Q)


def learnt_sds(rows: np.ndarray, free: np.ndarray, columns: np.ndarray, field: RandomField) -> tuple[LearntSd, ...]:
    """Return the SDs of greatest restricted likelihood for whitened rows (n,), `free` and drawn `columns` (n, ...).

    -2 ln L = ln det(I + G d^2) + r^T r - b^T d^2 w with w = (I + G d^2)^-1 b, G = B^T B and b = B^T r, r and B without
    what the free columns take; its slope to d_j^2 is ((I + G d^2)^-1 G)_jj - w_j^2.
    """
    Q = spanning(free)
    unexplained = rows - Q @ (Q.T @ rows)
    B = columns - Q @ (Q.T @ columns)
    G, b, count = B.T @ B, B.T @ unexplained, len(field.kinds)

    def loss(variances: np.ndarray) -> tuple[float, np.ndarray]:
        d2 = variances[field.kind]
        M = np.eye(len(d2)) + G * d2
        left = np.linalg.solve(M, np.column_stack([G, b]))
        slope = np.bincount(field.kind, np.diag(left) - left[:, -1] ** 2, minlength=count)
        return float(np.linalg.slogdet(M)[1] - (d2 * b) @ left[:, -1]), slope

    fixed = np.array([kind.is_known for kind in field.kinds])
    bounds = [(1.0, 1.0) if is_fixed else (0.0, MOST_SCALE**2) for is_fixed in fixed]
    solution = minimize(loss, np.where(fixed, 1.0, 0.1), jac=True, method="L-BFGS-B", bounds=bounds).x
    best = np.where(solution > IDENTIFIABLE_SHARE**2, solution, 0.0)
    without = [np.where((np.arange(count) == at) & ~fixed, 0.0, 1.0) for at in range(count)]
    for mask in without:  # where data say nothing of a kind, it stays as it began
        best = best * mask if loss(best * mask)[0] <= loss(best)[0] + IDENTIFIABLE_SHARE else best
    gains = [loss(best * mask)[0] - loss(best)[0] for mask in without]
    rows_of = zip(field.kinds, np.sqrt(best), gains, strict=True)
    return tuple(LearntSd(kind, kind.size * float(d), max(gain, 0.0)) for kind, d, gain in rows_of)
