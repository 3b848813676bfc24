"""Locked wheels, and wheels pushed along their axle, are runs like others: they are read and predicted."""

import dataclasses

import numpy as np
import pytest

from rover_pin.effects.flank_pressure import FlankPressure
from rover_pin.effects.ploughing import Ploughing
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.experiments.wheel_rig.declared import as_declared
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.measurements.rig_reading import read_rig_set

POINTS = """slip,rim_speed_mps,travel_speed_mps,slip_angle_rad,load_N,drawbar_pull_N,lateral_N,sinkage_m
-1,0,0.01,0,22,-30,0,0.04
-1,0,0.01,0.7853981634,22,-30,30,0.05
-1,0,0.01,1.5707963267948966,22,0,40,0.05
1,0.01,0.01,1.5707963267948966,22,5,20,0.03
-0.7,0.003,0.01,0,22,-24,0,0.032
"""
TOML = """kind = "wheel-rig"
name = "locked"
files = { points = "points.csv" }
[wheel]
r = { value = 0.0625, unit = "m" }
b = { value = 0.060, unit = "m" }
surface = "smooth"
[noise]
drawbar_pull_over_load = 0.02
sinkage = { value = 0.001, unit = "m" }
lateral_over_load = 0.02
"""
LAW = (SlipSoftening(1.2), FlankPressure(), Ploughing(0.8))


@pytest.fixture
def predicted(tmp_path):
    (tmp_path / "points.csv").write_text(POINTS)
    (tmp_path / "rig.toml").write_text(TOML)
    data = read_rig_set(tmp_path)
    model = as_declared(data)
    sand = model.soil.replace(k_1=1.3e5, n=1.5, phi=0.33, k=0.0063, c=0.0, exit_ratio=0.05)
    model = dataclasses.replace(model, soil=sand, effects=(*model.effects, *LAW))
    assert not RigExperiment((data,)).unpredicted(model)
    return model.predict(data.load, data.slip, data.speeds, data.slip_angle)


def test_a_locked_wheel_is_dragged_as_one_braked_to_the_end(predicted):
    """It holds back more than at S = -0.7 and stands deeper, on the sand that is left as on a plate."""
    assert predicted.drawbar_pull[0] < 1.2 * predicted.drawbar_pull[4]
    assert predicted.sinkage[4] < predicted.sinkage[0] < 0.8 * 0.0625
    assert predicted.torque[0] < 0.0


def test_pushed_along_its_axle_it_is_held_by_its_flank_alone(predicted):
    assert abs(predicted.drawbar_pull[2]) < 0.05
    assert predicted.side_force[2] > 22.0, "passive pressure bears more than friction could"
    assert predicted.drawbar_pull[3] > 0.0, "a rim that turns drives, as on the spot"
    assert 0.0 < predicted.side_force[3] < predicted.side_force[2]


def test_locked_askew_it_is_held_against_its_travel(predicted):
    assert predicted.side_force[1] / -predicted.drawbar_pull[1] == pytest.approx(1.0, abs=0.25)
    assert np.isfinite(predicted.moment).all()
