"""What levels of a wheel rig share by chance: beds that differ, noise that drifts; what is more is no chance."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rover_pin.experiments.wheel_rig.stiffness_scatter import STIFFNESS, learnt_random_effects

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.calibration import calibrated
from rover_pin.discrepancy.screen import signatures
from rover_pin.discrepancy.search import search
from rover_pin.estimation.random_effects.beyond_declared import beyond_declared
from rover_pin.experiments.wheel_rig.data import read_rig_set
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.rig import question_of
from tests.oracle import rig_generator as generator

SLIPS = (-0.3, -0.15, 0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85)

STRAYING_TWICE = {
    "n": 1.217358,
    "K": 181502.9,
    "phi": 0.477577,
    "k": 0.0110373,
    "c": 3.783795,
    "exit_ratio": 0.09391289,
}


def written(folder, seed, noise, stiffer=None, **soil):
    """A set with nothing hidden; `stiffer` scales the stiffness of each level in place of what the noise draws."""
    rig = generator.Rig(**soil)
    if stiffer is not None:
        plain, levels = rig.run, iter(np.repeat(stiffer, 6))
        rig.run = lambda W, S, v, day, _: plain(W, S, v, day, next(levels))
    runs = generator.rig_set(rig, slips=SLIPS, speeds=(0.02, 0.04), seed=seed, mixed=True, noise=noise)
    return generator.write(folder, rig, runs)


def asked(folder):
    data = read_rig_set(folder)
    return question_of(RigExperiment(data), RigModel(data.rig.wheel, data.soil()))


def base_of(folder):
    question = asked(folder)
    base = calibrated(question.experiment, question.model, question.numbers)
    return base, lambda: [each.shift for each in signatures(base, question.candidates(base))]


def test_a_bed_moves_its_own_level_as_a_stiffer_soil_would(tmp_path):
    base, _ = base_of(written(tmp_path, 1, "white"))
    experiment, field = base.task.experiment, base.task.experiment.random_field(base.model)
    k_1 = experiment.value(base.model, "soil.k_1")
    soft, stiff = (experiment.with_values(base.model, {"soil.k_1": k_1 * np.exp(s)}) for s in (-0.01, 0.01))
    slope = np.subtract(*experiment.predict([stiff, soft])) / 0.02 * STIFFNESS.size
    for at, moved in enumerate(field.moved):
        for row, wanted in zip(moved[at], slope[at], strict=True):
            np.testing.assert_allclose(row, wanted, atol=1e-3 * np.abs(wanted).max())
        assert not np.delete(moved, at, axis=0).any()


@pytest.mark.parametrize("seed", [1, 2])
def test_differing_stiffness_gets_its_sd_and_equal_gets_none(tmp_path, seed):
    stiffer = np.exp(0.06 * np.random.default_rng(seed).normal(size=len(SLIPS)))
    noise = beyond_declared(*base_of(written(tmp_path / "differ", seed, "white", stiffer)))
    assert noise.drift is None
    assert 0.03 < noise.random_effects.learnt[0].sd < 0.1
    assert beyond_declared(*base_of(written(tmp_path / "white", seed, "white"))) is None


def test_levels_that_differ_by_more_than_beds_do_lack_a_law(tmp_path):
    stiffer = np.exp(0.4 * np.array([1, -1, 1, -1, 1, -1, 1, -1, 1]))
    assert beyond_declared(*base_of(written(tmp_path, 1, "white", stiffer))) is None


def test_noise_that_drifts_is_told_by_the_order_of_the_rows(tmp_path):
    base, known = base_of(written(tmp_path, 1, "drifting"))
    noise = beyond_declared(base, known)
    assert noise.random_effects is None
    assert noise.drift.rho == pytest.approx(np.full(3, 0.8), abs=0.25)
    turns = base.task.experiment.turns()
    rows = base.task.experiment.rows(np.repeat(turns[:, None], 3, axis=1))[0]
    np.testing.assert_array_equal(rows, np.arange(54))


@pytest.mark.parametrize("seed", [1, 2])
def test_missing_law_does_not_make_other_channels_noise_drift(tmp_path, seed):
    """A sinkage sensor that waves by 2 mm, five SDs, bends the fit of the pull as if its noise wandered."""
    rig = generator.Rig(sizes={"sensor_wave": 0.002})
    runs = generator.rig_set(rig, slips=SLIPS, speeds=(0.02, 0.04), seed=seed, mixed=True)
    base, known = base_of(generator.write(tmp_path, rig, runs))
    assert base.misfit > 4.0
    noise = beyond_declared(base, known)
    assert noise is None or noise.drift is None


def test_values_that_stray_do_not_drift(tmp_path):
    """Of this set, two in the torque of successive runs, they would."""
    assert beyond_declared(*base_of(written(tmp_path, 62010, "spiked", **STRAYING_TWICE))) is None


def test_of_levels_one_after_the_other_no_drift_is_looked_for(tmp_path):
    runs = generator.rig_set(generator.Rig(), slips=SLIPS, seed=1)
    generator.write(tmp_path, generator.Rig(), runs)
    assert asked(tmp_path).experiment.turns() is None


def test_what_a_fold_left_out_shows_changes_no_noise(tmp_path):
    base, known = base_of(written(tmp_path, 1, "raked"))
    good = base.task.noise.good.copy()
    good[2] = False
    without = replace(base, task=replace(base.task, noise=replace(base.task.noise, good=good)))
    assert beyond_declared(without, known) is None


BEDS_LIKE_A_LAW = {"n": 1.113684, "K": 58221.27, "phi": 0.57115, "k": 0.009986, "c": 358.5532, "exit_ratio": 0.115263}
"""In this soil, by the draws of seed 60002, beds that differ by 4 % look like a law of skid."""


@pytest.mark.slow
def test_what_beds_share_is_no_law_of_slip(tmp_path, monkeypatch):
    """The same set is a false alarm where beds are taken for alike."""
    folder = written(tmp_path, 60002, "raked", **BEDS_LIKE_A_LAW)
    verdict = close_the_loop(folder)
    assert verdict.answer is Answer.NONE_NEEDED
    told = verdict.as_dict()["extra"]["by_chance"]
    assert told["beds"] == pytest.approx(0.04, rel=0.5)
    assert any(f"differ by {told['beds']:.1%} in stiffness" in one for one in verdict.cautions)
    assert told["gain"] > 2.71
    assert told["drift"] == {}
    monkeypatch.setattr(RigExperiment, "random_field", lambda self, model: None)
    question = asked(folder)
    base = calibrated(question.experiment, question.model, question.numbers)
    assert search(base, question.candidates(base), lambda said: None).names


@pytest.mark.slow
def test_a_verdict_tells_that_the_noise_drifts(tmp_path):
    verdict = close_the_loop(written(tmp_path, 1, "drifting"))
    (said,) = (one for one in verdict.cautions if "drifts" in one)
    assert said.startswith("the noise drifts: a run hangs together with the one measured before it (r: drawbar pull 0.")
    shared = learnt_random_effects(verdict.before.fit)
    assert verdict.as_dict()["extra"]["by_chance"] == {"beds": 0.0, "drift": dict(shared.drift), "gain": shared.gain}
    assert set(shared.drift) == {"drawbar pull", "torque", "sinkage"}


def test_noise_that_drifts_is_not_told_as_beds_that_differ():
    drift = SimpleNamespace(rho=np.array([0.5, 0.2]), gain=9.0)
    task = SimpleNamespace(noise=SimpleNamespace(drift=drift), experiment=SimpleNamespace(channels=("pull", "torque")))
    told = learnt_random_effects(SimpleNamespace(task=task))
    assert told.as_dict() == {"beds": 0.0, "drift": {"pull": 0.5, "torque": 0.2}, "gain": 9.0}
    (caution,) = told.cautions
    assert "the noise drifts" in caution
    assert "(r: pull 0.5, torque 0.2)" in caution
