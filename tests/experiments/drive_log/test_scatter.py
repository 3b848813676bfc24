"""The floor of a log's noise is what its samples scatter, not what the model leaves."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from rover_pin.experiments.drive_log.features import BLOCK
from rover_pin.experiments.drive_log.readings.scatter import scatter

PERIOD = 0.02
SAMPLES = 20_000


def run(row, usable=None):
    count = len(row) // round(BLOCK / PERIOD)
    return SimpleNamespace(
        commands=SimpleNamespace(period=PERIOD),
        usable=np.ones(count, dtype=bool) if usable is None else usable,
        measured_rows=lambda: {"one": row},
    )


def coloured(rho, sd=1.0, seed=0):
    steps = np.random.default_rng(seed).normal(size=SAMPLES) * np.sqrt(1 - rho**2)
    return sd * lfilter([1.0], [1.0, -rho], steps)


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.6])
def test_it_is_the_sd_of_a_blocks_mean(rho):
    """Against the means of blocks of the noise itself; a slow motion of any size adds nothing."""
    noise, length = coloured(rho), round(BLOCK / PERIOD)
    true = noise.reshape(-1, length).mean(axis=1).std()
    t = PERIOD * np.arange(SAMPLES)
    for slow in (0.0, 20 * t, 50 * np.sin(0.05 * t)):
        (found,) = scatter([run(noise + slow)], ["one"])
        assert found == pytest.approx(true, rel=0.2)


def test_a_misfit_is_not_noise():
    """What a model leaves in half-second means, a tilt of the ground say, is far above the floor."""
    t = PERIOD * np.arange(SAMPLES)
    bent, noise = 0.02 * np.sin(2 * np.pi * t / 12.0), 1e-3 * coloured(0.0)
    (found,) = scatter([run(bent + noise)], ["one"])
    assert found == pytest.approx(1e-3 / np.sqrt(BLOCK / PERIOD), rel=0.3)
    assert found < 0.02 * np.std(bent)
