"""A model goes everywhere: a wheel's drives a rover, bounds, tunes and starts a log's loop; a rover's goes to a rig."""

import logging
from pathlib import Path

import numpy as np
import pytest

from rover_pin import Soil, Wheel, scenario
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.experiments.wheel_rig.model import PAPER, RigModel
from rover_pin.experiments.wheel_rig.model import write_model as write_rig_model
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import read_data, start_on
from rover_pin.simulation.model.toml_file import write_model

DATA = Path(__file__).parents[2] / "studies" / "data"
LOG, RIG = DATA / "steepening-slope", DATA / "cmu-smooth-wheel"
SAND = Soil(k=0.012, k_1=80e3, k_2=0.0)


@pytest.fixture
def wheels(tmp_path):
    return write_rig_model(RigModel(Wheel(0.08, 0.07), SAND, (*PAPER, SlipSinkage(n_1=0.7))), tmp_path / "rig.toml")


def test_a_wheels_model_starts_the_loop_of_a_log(wheels):
    model, log = start_on(read_data(LOG), wheels), read_drive_log(LOG)
    assert model.soils[0] == SAND
    assert model.effect(SlipSinkage).n_1 == 0.7
    assert model.effect(SoilTraction) == PAPER[0]
    assert [wheel.name for wheel in model.rover.wheels] == [wheel.name for wheel in log.load_rover().wheels]
    assert model.rover.wheel == log.load_rover().wheel


def test_a_rovers_model_goes_to_a_rig_without_what_a_rig_has_not(tmp_path, caplog):
    model = scenario("flat", soil="table-1").model
    path = write_model(model.having(ExitAngle(e_1=0.2)).having(WeakMotor(g=0.3, wheel=0)), tmp_path / "model.toml")
    with caplog.at_level(logging.WARNING):
        start = start_on(read_data(RIG), path)
    assert start.wheel == Wheel(0.0625, 0.06)
    assert start.soil == model.soils[0]
    assert [type(effect) for effect in start.effects] == [SoilTraction, MotionResistance, ExitAngle]
    assert "model.toml: WeakMotor" in caplog.text
    assert np.isfinite(start.predict([20.0, 20.0], [0.1, 0.4]).drawbar_pull).all()
