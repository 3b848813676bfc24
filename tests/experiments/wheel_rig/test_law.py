"""A rig's compiled law, solved to the end; locked wheels and wheels pushed along their axle are runs like others."""

import dataclasses

import numpy as np
import pytest

from rover_pin.contact import Soil, Wheel
from rover_pin.effects.digging_memory import TOUCH, DiggingMemory
from rover_pin.effects.flank_pressure import FlankPressure
from rover_pin.effects.ploughing import Ploughing
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.experiments.wheel_rig import model as rig
from rover_pin.experiments.wheel_rig.candidates import rig_kinds
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import PAPER, RigModel, conditions, predictor
from rover_pin.measurements.rig_reading import read_rig_set

KINDS = {kind.__name__: kind for kind in rig_kinds()}
SOIL = Soil(n=1.0, c=200.0, phi=0.6, k=0.012, k_1=6e4, exit_ratio=0.1)
RUNS = conditions(np.repeat([12.0, 40.0], 5), np.tile([-0.3, 0.0, 0.2, 0.5, 0.85], 2), None)
WHEEL = Wheel()


@pytest.mark.parametrize("name", ["", *KINDS])
def test_newtons_method_ends_where_more_steps_end(name, monkeypatch):
    """It stops once a step is small: no run is less well balanced for that, neither its load nor its states."""
    model = RigModel(WHEEL, SOIL, (*PAPER, *([KINDS[name]()] if name else [])))
    short = predictor(model, ("phi", "k", "k_1"), RUNS)(model.vector())
    monkeypatch.setattr(rig, "STEP_TOLERANCE", 0.0)
    converged = predictor(model, ("phi", "k", "k_1"), RUNS)(model.vector())
    assert np.abs(short.error).max() < 1e-10
    for short_step, full in ((short.values, converged.values), (short.jacobian, converged.jacobian)):
        assert short_step == pytest.approx(full, rel=1e-8, abs=1e-9 * np.abs(full).max())


@pytest.mark.parametrize("k_1", np.logspace(5.0, 9.0, 9))
def test_hole_lowers_a_wheel_by_its_depth_on_any_ground(k_1):
    """On firm ground the wheel stands deep in its hole and hardly in its floor, as one without a hole does."""
    soil, hole = SOIL.replace(k_1=k_1), DiggingMemory(c_d=0.18, length=1.0, deepest=0.4)
    without, dug = (
        RigModel(WHEEL, soil, (*PAPER, *effects)).predict(*RUNS[:, :2].T).sinkage for effects in ((), (hole,))
    )
    slip, rim = np.fmax(RUNS[:, 1], 0.0), hole.deepest * WHEEL.r
    q = hole.c_d * hole.length * slip / (1 - slip) * np.fmin(without / TOUCH, 1.0)
    assert dug == pytest.approx(without + rim * q / (rim + q), rel=2e-6)


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
    model = RigExperiment((data,)).base_model()
    sand = model.soil.replace(k_1=1.3e5, n=1.5, phi=0.33, k=0.0063, c=0.0, exit_ratio=0.05)
    model = dataclasses.replace(model, soil=sand, effects=(*model.effects, *LAW))
    assert not RigExperiment((data,)).unpredicted_part(model)
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
