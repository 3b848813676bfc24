"""Noise of half-second blocks: rows whitened by the exact covariance, and numbers learnt from small tables by hand."""

import numpy as np
import pytest

from rover_pin.estimation.noise import AbsorbedNoise, Noise, noise_of
from rover_pin.estimation.residual import huber, huber_losses, huber_weights

SHRINK, SPREAD = 0.2, 1.4826
SD, RHO, MIX = np.array([2.0, 0.5]), np.array([0.6, 0.0]), np.array([[1.0, 0.0], [0.6, 0.8]])


def covariance(good):
    """Cov(r_ca, r_db) of blocks that follow each other: sd sd (L L^T)_cd times the memory of an AR(1) law, by hand.

    r_b = rho r_(b-1) + e_b starts from its stationary spread; e has the covariance sd sd sqrt(1 - rho^2) ... L L^T.
    """
    blocks = good.shape[1]
    shared = MIX @ MIX.T
    grown = np.zeros((2, blocks, 2, blocks))
    pushed = SD * np.sqrt(1 - RHO**2)
    for c in range(2):
        for d in range(2):
            variance = pushed[c] * pushed[d] * shared[c, d]
            for a in range(blocks):
                for b in range(blocks):
                    first = SD[c] * SD[d] * shared[c, d] * RHO[c] ** a * RHO[d] ** b
                    later = [RHO[c] ** (a - k) * RHO[d] ** (b - k) for k in range(1, min(a, b) + 1)]
                    grown[c, a, d, b] = first + variance * sum(later)
    return grown.reshape(2 * blocks, 2 * blocks)


def test_whitened_rows_have_the_covariance_one():
    blocks = 5
    good = np.ones((1, 2, blocks), dtype=bool)
    noise = Noise(SD, RHO, np.linalg.inv(MIX), good)
    whitener = noise.white(np.eye(2 * blocks).reshape(2 * blocks, 1, 2, blocks)).T
    np.testing.assert_allclose(whitener @ covariance(good[0]) @ whitener.T, np.eye(2 * blocks), atol=1e-12)
    assert noise.count == 2 * blocks


def test_a_block_after_a_gap_begins_anew():
    good = np.ones((1, 1, 4), dtype=bool)
    good[0, 0, 1] = False
    noise = Noise(np.array([2.0]), np.array([0.6]), np.eye(1), good)
    rows = noise.white(np.array([[[2.0, 99.0, 2.0, 2.0]]]))
    assert rows == pytest.approx([1.0, 1.0, (2.0 - 0.6 * 2.0) / (2.0 * 0.8)])


def test_size_and_memory_are_learnt():
    """Of +-1 in pairs: the SD is 1.4826, half of the neighbours agree and half do not."""
    row = np.tile([1.0, 1.0, -1.0, -1.0], 8)
    residual = np.stack([row, 0.1 * row])[None]
    noise = noise_of(residual, np.ones_like(residual, dtype=bool), np.array([1e-9, 1.0]))
    assert noise.sd == pytest.approx([SPREAD, 1.0]), "no less than the least"
    pairs = row[1:] * row[:-1]
    assert noise.rho == pytest.approx([max(pairs.mean(), 0.0)] * 2)


def test_strays_do_not_make_the_memory():
    row = np.tile([1.0, 1.0, -1.0, -1.0], 8)
    bent = row.copy()
    bent[[5, 6]] = 1e6
    good = np.ones((1, 1, 32), dtype=bool)
    (clean,), (stray,) = (noise_of(series[None, None], good, np.full(1, 1e-9)).rho for series in (row, bent))
    clipped = np.clip(bent, -3 * SPREAD, 3 * SPREAD)
    assert stray == pytest.approx((clipped[1:] * clipped[:-1]).mean() / (clipped**2).mean())
    assert abs(stray - clean) < 0.5


def test_what_channels_share_is_taken_out_but_for_a_fifth():
    """Rows of two channels with the correlation 0.5: the correlation is drawn to 0 by SHRINK."""
    random = np.random.default_rng(0)
    n = 20000
    first_signs, second_signs = random.choice([-1.0, 1.0], (2, n))
    second = np.where(random.random(n) < 0.5, first_signs, second_signs)
    residual = np.stack([first_signs, second])[None]
    noise = noise_of(residual, np.ones_like(residual, dtype=bool), np.full(2, 1e-9))
    measured = np.corrcoef(first_signs, second)[0, 1]
    covariance_learnt = np.linalg.inv(noise.mixing.T @ noise.mixing)
    correlation = covariance_learnt[0, 1] / np.sqrt(covariance_learnt[0, 0] * covariance_learnt[1, 1])
    assert correlation == pytest.approx((1 - SHRINK) * measured, rel=1e-3)
    left = (1 - 2 * correlation * measured + correlation**2) / (1 - correlation**2)
    assert np.mean(noise.white(residual) ** 2) == pytest.approx((1 + left) / 2, rel=1e-3)


def test_rows_beyond_4_sd_count_linearly():
    assert huber_losses(np.array([1.0, -4.0, 4.0, 10.0, -10.0])) == pytest.approx([1.0, 16.0, 16.0, 64.0, 64.0])
    assert huber(np.array([1.0, 10.0])) == pytest.approx(65.0)
    assert huber_weights(np.array([0.0, 1.0, 4.0, 8.0, -40.0])) == pytest.approx([1.0, 1.0, 1.0, 0.5, 0.1])
    for x in (3.0, 4.0, 7.0):
        step = 1e-6
        slope = (huber(np.array([x + step])) - huber(np.array([x - step]))) / (2 * step)
        assert slope == pytest.approx(2 * x * huber_weights(np.array([x]))[0], rel=1e-5)


def test_what_a_fit_took_of_the_noise_is_given_back():
    """A hundred smooth columns on 300 white rows leave an SD of 0.8 and a memory of their own making."""
    random, n, p = np.random.default_rng(5), 300, 100
    good = np.ones((1, 1, n), dtype=bool)
    smooth = np.array([np.convolve(random.standard_normal(n), np.ones(5), "same") for _ in range(p)]).T
    hat = smooth @ np.linalg.solve(smooth.T @ smooth, smooth.T)
    absorbed = AbsorbedNoise(np.diag(hat)[None, None], np.append(0.0, np.diag(hat, -1))[None, None])
    alone, full, rows = [], [], []
    for _ in range(40):
        noise = random.standard_normal(n)
        left = (noise - hat @ noise)[None, None]
        alone.append(noise_of(left, good, np.full(1, 1e-9)))
        full.append(noise_of(left, good, np.full(1, 1e-9), absorbed))
        rows.append(np.std(full[-1].white(noise[None, None])))
    assert np.mean([learnt.sd for learnt in alone]) < 0.85
    assert np.mean([learnt.sd for learnt in full]) == pytest.approx(1.0, abs=0.03)
    assert np.mean([noise.rho for noise in full]) < 0.06
    assert np.mean(rows) == pytest.approx(1.0, abs=0.03), "in rows too"
