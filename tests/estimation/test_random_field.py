"""What differs from fold to fold by chance: taken out of rows, learnt, and expected, against dense normal laws."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import null_space, sqrtm
from scipy.stats import multivariate_normal

from rover_pin.estimation.noise import Noise
from rover_pin.estimation.random_effects.random_field import (
    SHARED,
    Kind,
    LearntSd,
    RandomField,
    expected_draws,
    learnt_sds,
    random_effects_filter,
)

FOLDS, CHANNELS, SAMPLES = 3, 2, 12
KINDS = (Kind("grip", 0.05, ""), Kind("slope", 0.01, "rad"))
PER_FOLD = 4


@pytest.fixture(scope="module")
def field():
    """Smooth columns, four a fold, of two kinds."""
    random = np.random.default_rng(3)
    count = FOLDS * PER_FOLD
    field_columns = np.zeros((count, FOLDS, CHANNELS, SAMPLES))
    fold = np.repeat(np.arange(FOLDS), PER_FOLD)
    for at, block_fold in enumerate(fold):
        field_columns[at, block_fold] = np.cumsum(random.normal(size=(CHANNELS, SAMPLES)), axis=1)
    return RandomField(KINDS, np.tile([0, 0, 1, 1], FOLDS), fold, field_columns)


@pytest.fixture(scope="module")
def noise():
    """White noise of SD 2 and 0.5; one sample of the second fold is not compared."""
    good = np.ones((FOLDS, CHANNELS, SAMPLES), dtype=bool)
    good[1, 0, 3] = False
    return Noise(np.array([2.0, 0.5]), np.zeros(2), np.eye(2), good)


def learnt_as(*sds):
    return tuple(LearntSd(kind, sd, 0.0) for kind, sd in zip(KINDS, sds, strict=True))


def dense(columns, field, sds):
    """Return I + B d^2 B^T."""
    d = np.array([sd / kind.size for sd, kind in zip(sds, KINDS, strict=True)])[field.kind]
    return np.eye(len(columns)) + (columns * d**2) @ columns.T


def test_random_effects_are_removed_by_the_inverse_root(field, noise):
    sds, columns = (0.1, 0.03), noise.white(field.moved).T
    effects_filter = random_effects_filter(field, columns, noise.good, learnt_as(*sds))
    residual = np.random.default_rng(5).normal(size=(7, FOLDS, CHANNELS, SAMPLES))
    white = dataclasses.replace(noise, random_effects=effects_filter).white(residual)
    root = np.linalg.inv(np.real(sqrtm(dense(columns, field, sds))))
    np.testing.assert_allclose(white, noise.white(residual) @ root, atol=1e-9)


@pytest.mark.parametrize("left_out", [None, 1])
def test_shared_random_effects_are_whitened_with_all_compared_folds(field, noise, left_out):
    """Two effects change all folds; the rows then have the covariance 1, also where a fold is not compared."""
    random, good = np.random.default_rng(8), noise.good.copy()
    moved = field.moved.copy()
    moved[:2] = np.cumsum(random.normal(size=(2, FOLDS, CHANNELS, SAMPLES)), axis=3)
    shared = dataclasses.replace(field, fold=np.where(np.arange(len(field.fold)) < 2, SHARED, field.fold), moved=moved)
    effects_filter = random_effects_filter(shared, noise.white(moved).T, good, learnt_as(0.1, 0.03))
    if left_out is not None:
        good[left_out] = False
    plain = dataclasses.replace(noise, good=good)
    covariance = dense(plain.white(moved).T, shared, (0.1, 0.03))
    # The filter F is read off its rows for each unit residual: F C F' = 1.
    size = np.prod(good.shape)
    units = plain.white(np.eye(size).reshape(size, *good.shape)).T
    filtered = (
        dataclasses.replace(plain, random_effects=effects_filter).white(np.eye(size).reshape(size, *good.shape)).T
    )
    F = filtered @ np.linalg.pinv(units)
    np.testing.assert_allclose(F @ covariance @ F.T, np.eye(int(good.sum())), atol=1e-8)


def test_rows_without_one_fold_are_those_of_the_other_folds(field, noise):
    effects_filter = random_effects_filter(field, noise.white(field.moved).T, noise.good, learnt_as(0.1, 0.03))
    changed_noise = dataclasses.replace(noise, random_effects=effects_filter)
    good = noise.good.copy()
    good[1] = False
    residual = np.random.default_rng(6).normal(size=(FOLDS, CHANNELS, SAMPLES))
    owner = np.nonzero(noise.good)[0]
    white = dataclasses.replace(changed_noise, good=good).white(residual)
    np.testing.assert_allclose(white, changed_noise.white(residual)[owner != 1], atol=1e-12)


def restricted(rows, free, covariance):
    """Return -2 ln of the density of contrasts that no free column moves, by the normal law itself."""
    contrasts = null_space(free.T)
    law = multivariate_normal(np.zeros(contrasts.shape[1]), contrasts.T @ covariance @ contrasts)
    return -2 * law.logpdf(contrasts.T @ rows)


def test_an_sd_that_is_known_is_not_learnt(field, noise):
    """What data say of it moves it nowhere; the others are learnt beside it."""
    random = np.random.default_rng(3)
    columns, none = noise.white(field.moved).T, np.zeros((int(noise.good.sum()), 0))
    kinds = tuple(kind._replace(is_known=at == 0) for at, kind in enumerate(field.kinds))
    rows = 30.0 * columns @ random.normal(size=columns.shape[1])
    learnt, second = learnt_sds(rows, none, columns, dataclasses.replace(field, kinds=kinds))
    assert (learnt.sd, learnt.gain) == (kinds[0].size, 0.0)
    assert second.sd > 5.0 * kinds[1].size


def test_learnt_sds_maximise_the_restricted_likelihood(field, noise):
    random, columns = np.random.default_rng(8), noise.white(field.moved).T
    free = random.normal(size=(len(columns), 3))
    rows = np.linalg.cholesky(dense(columns, field, (0.06, 0.02))) @ random.normal(size=len(columns))
    sds = learnt_sds(rows + 20 * free @ [1.0, -2.0, 3.0], free, columns, field)
    best = [learnt.sd for learnt in sds]
    least = restricted(rows, free, dense(columns, field, best))
    for factors in ((1.2, 1.0), (0.8, 1.0), (1.0, 1.2), (1.0, 0.8)):
        changed_sds = [sd * factor for sd, factor in zip(best, factors, strict=True)]
        assert restricted(rows, free, dense(columns, field, changed_sds)) > least
    for at, learnt in enumerate(sds):
        without = [0.0 if at == second else sd for second, sd in enumerate(best)]
        assert learnt.gain == pytest.approx(restricted(rows, free, dense(columns, field, without)) - least, abs=1e-6)


def test_sds_are_recovered_on_average_and_absent_ones_stay_zero(field, noise):
    random, columns = np.random.default_rng(9), noise.white(field.moved).T
    free = random.normal(size=(len(columns), 2))
    root = np.linalg.cholesky(dense(columns, field, (0.1, 0.0)))
    learnt_runs = [learnt_sds(root @ random.normal(size=len(columns)), free, columns, field) for _ in range(60)]
    grip, slope = np.array([[learnt.sd for learnt in learnt_run] for learnt_run in learnt_runs]).T
    assert np.sqrt(np.mean(grip**2)) == pytest.approx(0.1, rel=0.15)
    assert np.mean(slope == 0.0) > 0.4
    assert np.mean([learnt_run[1].gain > 10.8 for learnt_run in learnt_runs]) == 0.0


def test_what_a_free_column_takes_is_not_taken_for_chance(field, noise):
    columns = noise.white(field.moved).T
    effect = columns @ np.where(field.kind == 0, 2.0, 0.0)
    rows = effect + 0.3 * np.random.default_rng(10).normal(size=len(columns))
    sds = [learnt_sds(rows, free, columns, field)[0].sd for free in (effect[:, None], 0.0 * effect[:, None])]
    assert sds[0] < 1e-3 < 0.05 < sds[1]


def test_the_expected_draws_are_those_of_the_joint_normal_law(field, noise):
    sds, columns = (0.1, 0.03), noise.white(field.moved).T
    rows = np.random.default_rng(11).normal(size=len(columns))
    sizes = np.array([KINDS[at].size for at in field.kind])
    variance = np.array([sds[at] ** 2 for at in field.kind])
    across = (variance / sizes)[:, None] * columns.T
    wanted = across @ np.linalg.solve(dense(columns, field, sds), rows)
    np.testing.assert_allclose(expected_draws(field, learnt_as(*sds), columns, rows), wanted, rtol=1e-9, atol=1e-12)


def test_two_kinds_that_say_the_same_share_what_one_would_have(field, noise):
    """Their variances add up: none is dropped for the other's sake, and the other not for its."""
    columns = noise.white(field.moved).T
    rows = np.linalg.cholesky(dense(columns, field, (0.2, 0.04))) @ np.random.default_rng(13).normal(size=len(columns))
    none, zeros = np.zeros((len(columns), 0)), np.zeros_like(field.kind)
    sds = learnt_sds(rows, none, columns, dataclasses.replace(field, kind=zeros))
    both = np.concatenate([columns, columns], axis=1)
    two = learnt_sds(rows, none, both, dataclasses.replace(field, kind=np.concatenate([zeros, zeros + 1])))
    assert sds[0].sd > 0.1
    assert sum((learnt.sd / learnt.kind.size) ** 2 for learnt in two) == pytest.approx(
        (sds[0].sd / 0.05) ** 2, rel=1e-2
    )


def alone(kind):
    """One column of this kind."""
    return RandomField((kind,), np.zeros(1, dtype=int), np.zeros(1, dtype=int), np.zeros((1, 1, 1, 4)))


def one_column(length, rows_along, size=0.05):
    """One kind with one column of this length, rows along it, and a free column of nothing."""
    columns = np.zeros((4, 1))
    columns[1, 0] = length
    rows = np.array([0.7, rows_along, -0.2, 0.1])
    return learnt_sds(rows, np.zeros((4, 0)), columns, alone(Kind("grip", size, "")))[0]


@pytest.mark.parametrize("length", [0.5, 1.0, 30.0])
@pytest.mark.parametrize("rows_along", [1.3, 2.0, 3.3])
def test_of_one_column_the_sd_and_its_gain_are_in_closed_form(length, rows_along):
    """ln(1 + d^2 g) - d^2 b^2 / (1 + d^2 g) is least at d^2 = (q - 1) / g, by q - 1 - ln q, with q = b^2 / g."""
    column, square = one_column(length, rows_along), rows_along**2
    assert column.sd == pytest.approx(0.05 * np.sqrt(square - 1) / length, rel=1e-3)
    assert column.gain == pytest.approx(square - 1 - np.log(square), rel=1e-5)
