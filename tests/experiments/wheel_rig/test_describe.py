"""What a channel of a rig leaves, and what a rig is offered to measure next."""

import itertools

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.wheel_rig.describe import channel_residuals
from rover_pin.experiments.wheel_rig.experiment import read_joint
from rover_pin.experiments.wheel_rig.loop_data import RigData
from rover_pin.loop.close import close_the_loop
from rover_pin.measurements.rig_reading import read_rig_set
from tests.loop.test_first_steps import written
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
    assert "smooth fit +3 -9 S +12 S^2 +6 (W / mean W - 1) N" in pull.sentence
    assert "smooth fit +6 -18 S +24 S^2 +12 (W / mean W - 1) mm" in sinkage.sentence


def test_noise_is_no_curve_of_slip_and_load(tmp_path):
    random = np.random.default_rng(8)
    curved = [of(tmp_path, lambda S, w, at: random.normal(size=len(S)))[0].is_curved for _ in range(60)]
    assert sum(curved) <= 2
    scattered = [of(tmp_path, lambda S, w, at: 5.0 * random.normal(size=len(S)))[0].is_curved for _ in range(60)]
    assert sum(scattered) <= 2, "chance is counted in what is left, not in a stated noise that is too small"


PLAIN = "slip,load_N,drawbar_pull_N,sinkage_m"


@pytest.mark.slow
def test_loop_proposes_a_run_where_several_sets_are_left():
    verdict = close_the_loop("cmu-smooth-wheel")
    assert verdict.answer in (Answer.SET, Answer.CANNOT_TELL)
    (proposed,) = verdict.experiments
    assert set(proposed.sets) >= set(verdict.indistinguishable[:1])
    assert 0.0 < proposed.nats <= proposed.open_nats
    assert proposed.sentence in verdict.summary()


def test_several_sets_offer_the_runs_of_each(tmp_path):
    first = written(tmp_path / "first", f"{PLAIN},slip_angle_rad", ("0.1,25,1,0.01,0", "0.4,25,2,0.02,0.2"))
    second = written(tmp_path / "second", "slip,load_N,drawbar_pull_N", ("0.1,40,1", "0.4,40,2"))
    for folder in (first, second):
        (folder / "rig.toml").write_text(f'name = "{folder.name}"\n' + (folder / "rig.toml").read_text())
    joint = read_joint((first, second))
    offer, unloaded = RigData(joint).question(()).offers(())
    assert len(unloaded.experiment.folds) == sum(len(rig.channels) for rig in joint.sets)
    assert len(offer.experiment.folds) == 2 * 33 + 33 - 4, "two of each were made"
    assert "second: one run at S = 0.4 under 80 N" in offer.experiment.folds
    assert np.isfinite(offer.experiment.predict([joint.base_model()])[0][offer.noise.good]).any()
    assert offer.noise.count == (2 * 33 - 2) * 2 + 33 - 2
