"""Noise that drifts in the order of measurement: whitened, and learnt, against dense normal laws."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import null_space

from rover_pin.estimation.noise import declared_noise
from rover_pin.estimation.random_effects.drift import STEPS, Drift, learnt_drift

FOLDS, CHANNELS, SAMPLES = 6, 2, 5
COUNT = FOLDS * SAMPLES
TURN = np.random.default_rng(1).permutation(COUNT).reshape(FOLDS, SAMPLES)


@pytest.fixture
def good():
    """Two samples of the first channel are not compared."""
    good = np.ones((FOLDS, CHANNELS, SAMPLES), dtype=bool)
    good[2, 0, 3] = good[4, 0, 0] = False
    return good


def correlations(rho, seen, turn=TURN):
    """rho^|t - t'| of what is seen (folds, samples), in its turn, and the order that puts it so."""
    at = np.argsort(turn[seen])
    turns = turn[seen][at]
    return rho ** np.abs(turns[:, None] - turns), at


def drawn(rho, random):
    """Residuals of SD 1 (folds, channels, samples)."""
    rows = [np.linalg.cholesky(correlations(one, np.ones((FOLDS, SAMPLES), bool))[0]) for one in rho]
    return np.stack([(root @ random.normal(size=COUNT))[TURN] for root in rows], axis=1)


def test_innovations_match_the_correlations_cholesky_factor(good):
    residual = np.random.default_rng(2).normal(size=(3, FOLDS, CHANNELS, SAMPLES))
    rho = np.array([0.7, 0.4])
    found = Drift(rho, TURN).innovations(residual, good)
    for channel in range(CHANNELS):
        R, at = correlations(rho[channel], good[:, channel])
        wanted = np.linalg.solve(np.linalg.cholesky(R), residual[:, :, channel][:, good[:, channel]][:, at].T).T
        np.testing.assert_allclose(found[:, :, channel][:, good[:, channel]][:, at], wanted, atol=1e-12)
    assert Drift(rho, TURN).log_determinant(good) == pytest.approx(
        sum(np.linalg.slogdet(correlations(one, good[:, at])[0])[1] for at, one in enumerate(rho))
    )


def test_noise_of_declared_sds_whitens_by_its_drift(good):
    sd = np.full((FOLDS, CHANNELS, SAMPLES), 0.5)
    residual = np.where(good, np.random.default_rng(3).normal(size=good.shape), np.nan)
    drift = Drift(np.array([0.6, 0.0]), TURN)
    found = dataclasses.replace(declared_noise(sd, residual), drift=drift).white(residual)
    np.testing.assert_allclose(found, drift.innovations(residual / sd, good)[good], atol=1e-12)
    other = np.broadcast_to(np.arange(CHANNELS)[None, :, None] == 1, good.shape)[good]
    np.testing.assert_allclose(found[other], (residual / sd)[good][other], atol=1e-12)


def test_drift_is_found_in_its_channel_also_beside_free_columns():
    random, good = np.random.default_rng(4), np.ones((FOLDS, CHANNELS, SAMPLES), dtype=bool)
    free = random.normal(size=(3, FOLDS, CHANNELS, SAMPLES))
    made = [drawn((0.8, 0.0), random) + np.tensordot([9.0, -20.0, 5.0], free, 1) for _ in range(40)]
    found = [learnt_drift(one, free, good, TURN) for one in made]
    told = np.array([one.rho for one in found if one is not None])
    assert len(told) > 25
    assert np.median(told, axis=0) == pytest.approx([0.8, 0.0], abs=0.15)


@pytest.mark.parametrize("scale", [0.4, 2.0])
def test_white_noise_drifts_in_at_most_one_set_of_forty(scale):
    random, good = np.random.default_rng(5), np.ones((FOLDS, CHANNELS, SAMPLES), dtype=bool)
    free = random.normal(size=(3, FOLDS, CHANNELS, SAMPLES))
    found = [learnt_drift(scale * drawn((0.0, 0.0), random), free, good, TURN) for _ in range(40)]
    assert sum(one is not None for one in found) <= 1


def restricted(rows, free, R):
    """-2 ln of the density of contrasts that no free column moves, its scale the likeliest, but for a constant."""
    contrasts = null_space(free.T)
    V = contrasts.T @ R @ contrasts
    y = contrasts.T @ rows
    return len(y) * np.log(y @ np.linalg.solve(V, y)) + np.linalg.slogdet(V)[1]


def test_the_gain_is_that_of_the_restricted_likelihood(good):
    random = np.random.default_rng(6)
    free = random.normal(size=(2, FOLDS, CHANNELS, SAMPLES))
    residual = drawn((0.9, 0.9), random)
    found = learnt_drift(residual, free, good, TURN)
    alone = told((0.0, 0.0), good, residual, free)
    assert found.gain == pytest.approx(alone - told(found.rho, good, residual, free), rel=1e-6)
    assert found.gain > 16.3


def told(rho, good, residual, free):
    """-2 ln of the restricted likelihood of correlations, one a channel, by the full matrix."""
    R, owner = np.zeros((good.sum(), good.sum())), np.nonzero(good)[1]
    turns = np.broadcast_to(TURN[:, None], good.shape)[good]
    for channel, one in enumerate(rho):
        own = owner == channel
        R[np.ix_(own, own)] = one ** np.abs(turns[own][:, None] - turns[own])
    return restricted(residual[good], free[:, good].T, R)


def test_correlations_stand_close_enough_to_tell_a_drift():
    """From none to nearly whole, no two further apart than the SD with which 50 measurements tell one."""
    assert (STEPS[0], STEPS[-1]) == (0.0, 0.95)
    assert np.max(np.diff(STEPS)) < 0.101


def test_of_three_channels_the_one_that_drifts_is_told():
    random, good = np.random.default_rng(14), np.ones((FOLDS, 3, SAMPLES), dtype=bool)
    residual = np.concatenate([drawn((0.0, 0.9), random), drawn((0.0,), random)], axis=1)
    rho = learnt_drift(residual, random.normal(size=(1, FOLDS, 3, SAMPLES)), good, TURN).rho
    assert rho[1] == pytest.approx(0.9, abs=0.21)
    assert max(rho[0], rho[2]) < 0.35


def test_the_units_of_what_numbers_move_change_nothing(good):
    random = np.random.default_rng(15)
    free, residual = random.normal(size=(3, FOLDS, CHANNELS, SAMPLES)), drawn((0.9, 0.9), random)
    scaled = free * np.array([1e-7, 1.0, 1e7])[:, None, None, None]
    same = [learnt_drift(residual, one, good, TURN).gain for one in (free, scaled)]
    assert same[0] == pytest.approx(same[1], rel=1e-9)


def test_no_other_correlation_of_one_channel_is_likelier(good):
    """Columns that move both channels let the first's hang on the second's: it is looked for again."""
    random = np.random.default_rng(12)
    for _ in range(12):
        free = np.ones((1, *good.shape)) + 0.1 * random.normal(size=(1, *good.shape))
        residual = drawn((0.8, 0.8), random) + 3.0 * free[0]
        found = learnt_drift(residual, free, good, TURN)
        least = told(found.rho, good, residual, free)
        for step in STEPS:
            assert told((step, found.rho[1]), good, residual, free) > least - 1e-9
            assert told((found.rho[0], step), good, residual, free) > least - 1e-9


def test_least_reported_drift_gain_has_a_p_value_of_0_001(good):
    """chi2 of two numbers, -2 ln 0.001, met by bisection between white and drifting residuals."""
    random = np.random.default_rng(13)
    free = np.ones((1, FOLDS, CHANNELS, SAMPLES))
    white, drifting = drawn((0.0, 0.0), random), drawn((0.9, 0.9), random)
    low, high, least = 0.0, 1.0, learnt_drift(drifting, free, good, TURN)
    for _ in range(40):
        share = (low + high) / 2
        found = learnt_drift((1 - share) * white + share * drifting, free, good, TURN)
        low, high, least = (share, high, least) if found is None else (low, share, found)
    assert least.gain == pytest.approx(-2 * np.log(1e-3), rel=1e-6)


def test_columns_that_are_nearly_one_another_make_no_drift(good):
    """Were they two for one correlation and one for another, white noise would drift."""
    random = np.random.default_rng(11)
    steady = np.ones((1, FOLDS, CHANNELS, SAMPLES))
    for off in np.geomspace(2e-4, 5e-3, 15):
        nearly = np.concatenate([steady, steady + off * random.normal(size=steady.shape)])
        assert learnt_drift(drawn((0.0, 0.0), random), nearly, good, TURN) is None
