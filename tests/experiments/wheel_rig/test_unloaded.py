"""A reading of the unloaded wheel shows a zero error alone: it is proposed where a zero error may explain the data."""

import dataclasses

import numpy as np
import pytest

from rover_pin import close_the_loop
from rover_pin.base.files.paths import data_path
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.unloaded import unloaded_readings, zero_readings
from rover_pin.measurements.rig_reading import read_rig_set
from tests.oracle import rig_generator as hidden


def test_the_unloaded_wheel_reads_the_zero_errors_of_the_model():
    experiment = RigExperiment((read_rig_set(data_path("cmu-smooth-wheel-angles")),))
    model = experiment.base_model()
    errors = model.errors.replace(pull_tare=0.4, sinkage_zero=0.002, side_tare=-0.3, force_scale=1.1)
    offer = unloaded_readings(experiment)
    (predicted,) = offer.experiment.predict([dataclasses.replace(model, errors=errors)])
    assert predicted[offer.noise.good].tolist() == [0.4, 0.002, -0.3]
    assert offer.experiment.folds[0] != offer.experiment.folds[1]
    assert np.all(offer.noise.sd[offer.noise.good] < 1.0)


@pytest.mark.parametrize(
    ("named", "channels"),
    [((), []), (("SlipSoftening", "rig.load_scale"), []), (("a.rig.pull_tare", "Ploughing"), ["a.rig.pull_tare"])],
)
def test_only_a_named_zero_error_is_read(named, channels):
    assert [reading.channel for reading in zero_readings(named)] == channels


@pytest.mark.slow
def test_a_loop_that_finds_a_tare_asks_for_the_unloaded_cell(tmp_path):
    table = hidden.rig_set(rig := hidden.Rig("none"))
    table["torque_Nm"] = table["torque_Nm"] + 0.15
    verdict = close_the_loop(hidden.write(tmp_path / "off", rig, table))
    assert verdict.named == ("rig.torque_tare",)
    assert verdict.experiments[0].channel == "rig.torque_tare"
    assert "torque" in verdict.experiments[0].what
