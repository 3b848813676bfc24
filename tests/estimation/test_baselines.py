"""Curves through points: a quadratic is found again, a Gaussian process passes smooth points, a mean is a mean."""

import numpy as np
import pytest

from rover_pin.estimation.baselines import gaussian_process, mean, quadratic


def test_baselines():
    """A quadratic is found again; a Gaussian process comes back to smooth points and to the mean far from them."""
    rng = np.random.default_rng(0)
    x, at = rng.uniform(-1, 1, (12, 2)), rng.uniform(-1, 1, (5, 2))

    def curve(z):
        return 1.0 + 2.0 * z[:, 0] - z[:, 1] + z[:, 0] * z[:, 1] + 0.5 * z[:, 1] ** 2

    assert quadratic(x, curve(x), at) == pytest.approx(curve(at), abs=1e-9)
    line = np.linspace(0.0, 1.0, 9)[:, None]
    wave = np.sin(3.0 * line[:, 0])
    assert gaussian_process(line, wave, np.array([[0.44]])) == pytest.approx(np.sin(1.32), abs=0.03)
    assert mean(line, wave, at) == pytest.approx(np.full(5, wave.mean()))
