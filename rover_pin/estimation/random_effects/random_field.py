"""Random differences between folds, for example terrain that is prepared anew: changes of the prediction that have a
known shape and an estimated SD.

A fold is a group of samples that cross-validation leaves out together, such as a run. The model of the measured values
is y = predicted(u) + G gamma + eps, where each column of G is the change of the prediction by one random difference,
gamma ~ N(0, diag tau^2) are the unknown sizes of these differences, and eps is the noise. With the whitened columns B,
and one scale d for each kind of difference (its SD divided by the size of its column), the whitened residuals (rows)
have the covariance I + B d^2 B^T. The expected contribution of gamma is removed from the rows, so that no parameter has
to imitate this contribution. The scales d maximise the restricted likelihood with all parameters and candidates free,
so that a missing effect is not taken for chance. Source: Patterson and Thompson, Biometrika 58 (1971) 545; Kennedy and
O'Hagan, J. R. Stat. Soc. B 63 (2001) 425; Brynjarsdottir and O'Hagan, Inverse Problems 30 (2014) 114007 (without a
prior of the discrepancy, parameters absorb it).
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from rover_pin.estimation.columns import MIN_IDENTIFIABLE_SHARE

MAX_SCALE = 10.0
"""Largest allowed SD of a kind of random difference, divided by the expected size of this difference. A larger estimate
is reduced to this value: an SD of ten times the expected size would be a missing effect, not a random difference."""


class Kind(NamedTuple):
    """One kind of random difference between folds (such as the slope of newly prepared terrain): its name, its expected
    size, and the unit of the size.
    """

    name: str
    size: float
    unit: str
    is_known: bool = False
    """whether `size` is the known SD between folds; the SD is then not estimated"""


@dataclass(frozen=True, eq=False)
class RandomField:
    """Random differences between folds, and how each of them changes the prediction.

    Each column belongs to one random difference and one fold, or to several folds (SHARED). It holds the change of the
    prediction if this difference has its expected size (`Kind.size`).
    """

    kinds: tuple[Kind, ...]
    """kinds of random differences"""
    kind: np.ndarray
    """index of the kind of each column (columns,)"""
    fold: np.ndarray
    """index of the fold that each column changes (columns,); SHARED for a column that changes several folds"""
    moved: np.ndarray = dataclasses.field(repr=False)
    """change of the prediction by each column (columns, folds, channels, samples)"""


def join(parts: Sequence[tuple[Sequence[Kind], Mapping[str, np.ndarray]]]) -> RandomField:
    """Return one `RandomField` that contains the random differences of several parts.

    Each part is a pair: its kinds of random differences, and a mapping with the arrays `kind` (index within the part),
    `fold` and `moved` of its columns (see `RandomField`).
    """
    kinds = [kind for of_part, _ in parts for kind in of_part]
    # The indices of the kinds within a part are shifted to the joint list.
    kind = [kinds.index(of_part[0]) + columns["kind"] for of_part, columns in parts]
    others = (np.concatenate([columns[name] for _, columns in parts]) for name in ("fold", "moved"))
    return RandomField(tuple(kinds), np.concatenate(kind), *others)


SHARED = -1
"""Value of `RandomField.fold` for a random effect that changes several folds at once, such as an error of the terrain
under all runs that drive over it."""


class LearntSd(NamedTuple):
    """Estimated SD of one kind of random difference between folds, and the evidence for it."""

    kind: Kind
    sd: float
    """SD in the unit of the kind; 0 if the data give no evidence for such differences"""
    gain: float
    """evidence for the difference: decrease of -2 ln of the restricted likelihood compared with an SD of 0, while the
    SDs of the other kinds stay unchanged"""


@dataclass(frozen=True, eq=False)
class RandomEffectsFilter:
    """The estimated SDs of random differences between folds, and the filter that removes the expected differences from
    whitened residuals.

    For the whitened residuals r of a fold the filter is r - W W^T r. With the columns B (the change of the whitened
    residuals by each difference), the scales d (SD of each difference divided by its expected size) and the singular
    value decomposition B d = U s V^T, the matrix is W = U sqrt(1 - 1 / sqrt(1 + s^2)). Then I - W W^T is the inverse
    root of the residuals' covariance I + B d^2 B^T.

    Differences that several folds share are removed by a second filter of the same form, from the residuals of all
    folds together after the first filter. A held-out fold is then predicted with the shared differences as they are
    known from all folds.
    """

    field: RandomField = dataclasses.field(repr=False)
    """random differences whose SDs were estimated"""
    learnt: tuple[LearntSd, ...]
    basis: np.ndarray = dataclasses.field(repr=False)
    """the matrix W of the filter (folds, channels, samples, columns)"""
    shared: np.ndarray | None = dataclasses.field(default=None, repr=False)
    """residuals of the first filter that each shared difference changes by, if it has its SD (folds, channels, samples,
    differences); None if the folds share no random difference"""
    shared_roots: dict[bytes, np.ndarray] = dataclasses.field(default_factory=dict, repr=False)
    """mask of the compared samples, as bytes -> the matrix W of the second filter (n, directions) for these samples"""

    def taken_out(self, rows: np.ndarray, good: np.ndarray) -> np.ndarray:
        """Return the whitened residuals `rows` (..., n) without the expected contribution of the random differences
        between folds.

        `good` (folds, channels, samples) marks the n compared samples of the residuals, fold after fold.
        """
        # The whitened residuals lie fold after fold; each fold has its own filter, because a difference changes one
        # fold only.
        ends = np.cumsum(good.sum(axis=(1, 2)))[:-1]
        parts = np.split(rows, ends, axis=-1)
        filtered = [
            part - (part @ table[fold_mask]) @ table[fold_mask].T
            for part, table, fold_mask in zip(parts, self.basis, good, strict=True)
        ]
        rows = np.concatenate(filtered, axis=-1)
        if self.shared is None:
            return rows
        # The filter depends on the compared samples, because each of them changes what is known of a shared difference.
        key = good.tobytes()
        if key not in self.shared_roots:
            self.shared_roots[key] = _root(self.shared[good])
        return np.asarray(rows - (rows @ self.shared_roots[key]) @ self.shared_roots[key].T)


def scales(field: RandomField, learnt: Sequence[LearntSd]) -> np.ndarray:
    """Return the estimated SD of the random difference of each column (columns,), divided by its expected size."""
    return np.array([learnt_sd.sd / learnt_sd.kind.size for learnt_sd in learnt])[field.kind]


def expected_draws(field: RandomField, learnt: Sequence[LearntSd], columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the size that each random difference most probably had in the data, in the unit of its kind (columns,
    ...).

    This is the expected size given the whitened residuals. Divided by the expected size of the kind it is d (I + d G
    d)^-1 d b, with G = B^T B and b = B^T r, for the whitened `columns` B (n, columns), the whitened residuals `rows` r
    (n, ...) and the scales d (estimated SDs divided by the expected sizes).
    """
    size, d = np.array([kind.size for kind in field.kinds])[field.kind], scales(field, learnt)
    scaled = columns * d
    return np.asarray(size * d * np.linalg.solve(np.eye(len(d)) + scaled.T @ scaled, scaled.T @ rows))


def random_effects_filter(
    field: RandomField, columns: np.ndarray, good: np.ndarray, learnt: Sequence[LearntSd]
) -> RandomEffectsFilter:
    """Return the filter that removes the random differences between folds from whitened residuals.

    `columns` (n, columns) are the whitened columns of the field, `good` (folds, channels, samples) marks the n compared
    samples, and `learnt` are the estimated SDs.
    """
    scaled, is_shared = columns * scales(field, learnt), field.fold == SHARED
    parts = np.split(scaled[:, ~is_shared], np.cumsum(good.sum(axis=(1, 2)))[:-1])
    # Columns of other folds are zero here and are left out.
    roots = [_root(part[:, np.any(part != 0.0, axis=0)]) for part in parts]
    basis = np.zeros((*good.shape, max(root.shape[1] for root in roots)))
    for table, fold_mask, root in zip(basis, good, roots, strict=True):
        table[fold_mask, : root.shape[1]] = root
    by_fold = RandomEffectsFilter(field, tuple(learnt), basis)
    if not is_shared.any():
        return by_fold
    # The shared columns are whitened by the first filter before their own filter is computed.
    shared = np.zeros((*good.shape, int(is_shared.sum())))
    shared[good] = by_fold.taken_out(scaled[:, is_shared].T, good).T
    return dataclasses.replace(by_fold, shared=shared)


def _root(part: np.ndarray) -> np.ndarray:
    """Return the filter's matrix W (m, directions) for the m whitened residuals of one fold (see
    `RandomEffectsFilter`).

    `part` (m, columns) are the whitened columns of the fold, multiplied by their SDs. Directions whose singular value
    is rounding are dropped.
    """
    u, s, _ = np.linalg.svd(part, full_matrices=False)
    return np.asarray(
        u[:, s > MIN_IDENTIFIABLE_SHARE] * np.sqrt(1 - 1 / np.sqrt(1 + s[s > MIN_IDENTIFIABLE_SHARE] ** 2))
    )


def spanning(columns: np.ndarray) -> np.ndarray:
    """Return orthonormal columns that span the space of the given columns (n, columns), which may have different units.

    Directions whose singular value is rounding are dropped.
    """
    Q, s, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-9), full_matrices=False)
    return np.asarray(Q[:, s > MIN_IDENTIFIABLE_SHARE * s[0]] if s.size else Q)


def learnt_sds(rows: np.ndarray, free: np.ndarray, columns: np.ndarray, field: RandomField) -> tuple[LearntSd, ...]:
    """Estimate the SD of each kind of random difference between folds: the SDs that maximise the restricted likelihood.

    For the scales d (SDs divided by the expected sizes), the restricted likelihood L is -2 ln L = ln det(I + G d^2) +
    r^T r - b^T d^2 w with w = (I + G d^2)^-1 b, G = B^T B and b = B^T r. Before that, the residuals r and the columns B
    are projected onto the complement of the columns `free`, so that a missing effect is not taken for a random
    difference. The derivative of -2 ln L by d_j^2 is ((I + G d^2)^-1 G)_jj - w_j^2.

    Parameters
    ----------
    rows : array (n,)
        Whitened residuals r.
    free : array (n, ...)
        Whitened columns of all parameters and candidate effects.
    columns : array (n, columns)
        Whitened columns B of the random differences.
    field : RandomField
        Kinds of the random differences, and the kind of each column.
    """
    # Remove the part of rows and columns that the free parameters and candidates explain, so that this part is not
    # taken for random differences.
    Q = spanning(free)
    unexplained = rows - Q @ (Q.T @ rows)
    B = columns - Q @ (Q.T @ columns)
    G, b, count = B.T @ B, B.T @ unexplained, len(field.kinds)

    def loss(variances: np.ndarray) -> tuple[float, np.ndarray]:
        # -2 ln L without its constant r^T r, and the derivative by the variance of each kind.
        d2 = variances[field.kind]
        M = np.eye(len(d2)) + G * d2
        left = np.linalg.solve(M, np.column_stack([G, b]))
        slope = np.bincount(field.kind, np.diag(left) - left[:, -1] ** 2, minlength=count)
        return float(np.linalg.slogdet(M)[1] - (d2 * b) @ left[:, -1]), slope

    # A kind with a known SD keeps its scale of 1.
    fixed = np.array([kind.is_known for kind in field.kinds])
    bounds = [(1.0, 1.0) if is_fixed else (0.0, MAX_SCALE**2) for is_fixed in fixed]
    solution = minimize(loss, np.where(fixed, 1.0, 0.1), jac=True, method="L-BFGS-B", bounds=bounds).x
    best = np.where(solution > MIN_IDENTIFIABLE_SHARE**2, solution, 0.0)
    # A kind without evidence is set to an SD of 0. Otherwise it would keep its starting value where the likelihood is
    # flat.
    without = [np.where((np.arange(count) == at) & ~fixed, 0.0, 1.0) for at in range(count)]
    for mask in without:
        best = best * mask if loss(best * mask)[0] <= loss(best)[0] + MIN_IDENTIFIABLE_SHARE else best
    gains = [loss(best * mask)[0] - loss(best)[0] for mask in without]
    rows_of = zip(field.kinds, np.sqrt(best), gains, strict=True)
    return tuple(LearntSd(kind, kind.size * float(d), max(gain, 0.0)) for kind, d, gain in rows_of)
