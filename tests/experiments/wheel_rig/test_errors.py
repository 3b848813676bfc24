"""What a rig adds to its readings: stated in rig.toml, taken off, or a nuisance with its prior in every fit."""

import numpy as np
import pytest

from rover_pin import Soil, Wheel, close_the_loop
from rover_pin.base.errors import DataError
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import ASKEW, RigModel
from rover_pin.measurements.channel import RigErrors
from rover_pin.measurements.rig_reading import read_rig_set
from studies.shared.rig_fits import calibrated
from tests.oracle import rig_generator as hidden

SD = np.asarray(hidden.SD)
TARE, ZERO = 0.15, 0.0015
STATED = """
[rig]
torque_tare = { value = 0.0, sd = 200.0, unit = "mN m" }
sinkage_zero = { value = 0.0, sd = 2.0, unit = "mm" }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A set without a hidden effect, by a generator that shares no code, whose torque and sinkage are off."""
    rig = hidden.Rig("none")
    table = hidden.rig_set(rig, loads=(15.0, 40.0))
    table["torque_Nm"], table["sinkage_m"] = table["torque_Nm"] + TARE, table["sinkage_m"] + ZERO
    return hidden.write(tmp_path_factory.mktemp("rig") / "off", rig, table)


def fitted(folder):
    data = read_rig_set(folder)
    experiment, soil = RigExperiment((data,)), data.soil()
    model = RigModel(data.wheel, soil.replace(c=0.0), errors=data.errors)
    return calibrated(experiment, model, experiment.uncertain(model))


def test_a_tare_and_a_zero_are_found_beside_the_soil(folder, tmp_path):
    rig_folder = tmp_path / "told"
    rig_folder.mkdir()
    (rig_folder / "points.csv").write_text((folder / "points.csv").read_text())
    (rig_folder / "rig.toml").write_text((folder / "rig.toml").read_text() + STATED)
    without, with_errors = fitted(folder), fitted(rig_folder)
    assert with_errors.value("rig.torque_tare") == pytest.approx(TARE, abs=0.01)
    assert with_errors.value("rig.sinkage_zero") == pytest.approx(ZERO, abs=2e-4)
    left, before = (np.sqrt(np.nanmean(fit.residual**2, axis=(0, 2))) / SD for fit in (with_errors, without))
    assert np.all(left < 1.2), "the noise alone, in SDs of pull, torque and sinkage"
    assert before.max() > 1.5
    assert np.abs(without.u).max() > 3.0, "a constant of the soil pays for the rig"
    assert np.abs(with_errors.u).max() < 1.0
    assert with_errors.value("soil.phi") == pytest.approx(hidden.Rig("none").soil["phi"], abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("factor", "seed"),
    [(1.12, 0), *(pytest.param(*case, marks=pytest.mark.nightly) for case in [(1.15, 1), (0.88, 2)])],
)
def test_a_hidden_scale_of_torque_is_told_as_such(tmp_path, factor, seed):
    """Nobody states it; the effects of soil that could stand for it are less probable."""
    rig = hidden.Rig("none")
    table = hidden.rig_set(rig, seed=seed)
    table["torque_Nm"] = factor * table["torque_Nm"]
    verdict = close_the_loop(hidden.write(tmp_path / "set", rig, table))
    included = verdict.beliefs.included
    assert verdict.indistinguishable[0] == "rig.torque_scale"
    assert max(included, key=included.get) == "rig.torque_scale"
    assert verdict.effects == ()


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.1, pytest.param(1.2, marks=pytest.mark.nightly)])
def test_a_scale_of_sinkage_that_the_soil_could_pay_is_doubted(tmp_path, factor):
    """Its probability says so, and no effect of the soil is sure."""
    rig = hidden.Rig("none")
    table = hidden.rig_set(rig)
    table["sinkage_m"] = factor * table["sinkage_m"]
    verdict = close_the_loop(hidden.write(tmp_path / "set", rig, table))
    included = verdict.beliefs.included
    assert max(included, key=included.get) == "rig.sinkage_scale"
    assert included["rig.sinkage_scale"] < 0.95


def test_a_radius_that_is_not_sure_is_fitted_within_its_range(tmp_path):
    """Told over the lugs, 3 mm too much: it moves towards the true one, and not beyond what is allowed."""
    rig = hidden.Rig("none")
    rig_folder = hidden.write(tmp_path / "radius", rig, hidden.rig_set(rig, loads=(15.0, 40.0)))
    text = (rig_folder / "rig.toml").read_text()
    assert f"r = {{ value = {rig.r}" in text
    low, high = rig.r + 0.001, rig.r + 0.004
    radius_line = f"r = {{ value = {rig.r + 0.003}, sd = 0.003, low = {low}, high = {high}"
    (rig_folder / "rig.toml").write_text(text.replace(f"r = {{ value = {rig.r}", radius_line))
    radius_fit = fitted(rig_folder)
    assert low - 1e-12 <= radius_fit.value("wheel.r") < rig.r + 0.003
    assert [parameter.name for parameter in radius_fit.parameters if parameter.name.startswith("wheel.")] == ["wheel.r"]


def test_readings_are_those_of_the_true_load_scaled_and_shifted():
    soil = Soil(k=0.01)
    errors = RigErrors(0.1, 0.2, 0.3, 0.001, 0.02, 1.1, force_scale=0.9, moment_tare=0.004, moment_arm=0.02)
    errors = errors.replace(torque_scale=1.05, sinkage_scale=0.97, side_scale=1.2, moment_scale=0.8)
    true = RigModel(Wheel(), soil, ASKEW).predict([11.0, 11.0], [0.1, 0.4], slip_angle=0.3)
    read = RigModel(Wheel(), soil, ASKEW, errors).predict([10.0, 10.0], [0.1, 0.4], slip_angle=0.3)
    assert read.drawbar_pull == pytest.approx(0.9 * true.drawbar_pull + 0.2 + 0.02 * 11.0)
    assert read.torque == pytest.approx(1.05 * true.torque + 0.1)
    assert read.sinkage == pytest.approx(0.97 * true.sinkage + 0.001)
    assert read.side_force == pytest.approx(0.9 * 1.2 * true.side_force + 0.3)
    assert read.moment == pytest.approx(0.8 * (true.moment - 0.02 * true.side_force) + 0.004)
    assert true.moment.min() > 0.0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("torque_taer = { value = 0.1 }", "'torque_taer' in .rig.: .* 'torque_tare'"),
        ("torque_tare = { value = 0.1, unit = 'mm' }", "unit 'mm'"),
        ("load_scale = { value = 3.0 }", "load_scale"),
        ("pull_tare = { value = 0.0, sd = -1.0 }", "sd of 'pull_tare' is -1.0"),
    ],
)
def test_what_cannot_be_an_error_of_a_rig_is_refused(folder, tmp_path, line, message):
    (tmp_path / "points.csv").write_text((folder / "points.csv").read_text())
    (tmp_path / "rig.toml").write_text((folder / "rig.toml").read_text() + f"\n[rig]\n{line}\n")
    with pytest.raises(DataError, match=message):
        read_rig_set(tmp_path)
