"""What a channel of a rig leaves: a polynomial that was put there is found, chance is not, units are told."""

import itertools

import numpy as np
import pytest

from rover_pin.experiments.wheel_rig.residual import channel_residuals
from rover_pin.measurements.rig_reading import read_rig_set
from tests.oracle.rig_generator import TWO_CHANNELS

SD = {"drawbar pull": 0.3, "sinkage": 0.6e-3}
SLIPS = np.linspace(-0.2, 0.8, 11)


def of(folder, residual, loads=(20.0, 25.0, 30.0), repeats=1):
    """What is left where pull and sinkage leave residual(S, load / mean load - 1, run) [SD]."""
    runs = list(itertools.product(SLIPS, loads, range(repeats)))
    rows = [f"{slip:.3f},{load},{1.0 + slip},{0.01 + 0.01 * slip}" for slip, load, _ in runs]
    (folder / "rig.toml").write_text(TWO_CHANNELS)
    (folder / "points.csv").write_text("\n".join(["slip,load_N,drawbar_pull_N,sinkage_m", *rows]) + "\n")
    slip, load, at = np.array(runs).T
    left = residual(slip, load / load.mean() - 1.0, at)
    return channel_residuals(read_rig_set(folder), np.array([left, left]))


def test_planted_curve_is_found_with_its_coefficients(tmp_path):
    pull, sinkage = of(tmp_path, lambda S, w, at: 10.0 - 30.0 * S + 40.0 * S**2 + 20.0 * w)
    for left, sd in ((pull, SD["drawbar pull"]), (sinkage, SD["sinkage"])):
        assert left.powers == pytest.approx([10.0 * sd, -30.0 * sd, 40.0 * sd], rel=1e-6)
        assert left.of_load == pytest.approx([20.0 * sd], rel=1e-6)
        assert left.explained == pytest.approx(1.0)
        assert left.is_curved
        assert not left.is_noise
    assert "smooth fit +3 -9 S +12 S^2 +6 (W / mean W - 1) N, which takes 100% of it" in pull.sentence
    assert "smooth fit +6 -18 S +24 S^2 +12 (W / mean W - 1) mm, which takes 100% of it" in sinkage.sentence


def test_noise_is_no_curve_of_slip_and_load(tmp_path):
    random = np.random.default_rng(8)
    curved = [of(tmp_path, lambda S, w, at: random.normal(size=len(S)))[0].is_curved for _ in range(60)]
    assert sum(curved) <= 2
    scattered = [of(tmp_path, lambda S, w, at: 5.0 * random.normal(size=len(S)))[0].is_curved for _ in range(60)]
    assert sum(scattered) <= 2, "chance is counted in what is left, not in a stated noise that is too small"
