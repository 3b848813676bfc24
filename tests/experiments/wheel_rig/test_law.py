"""A rig's compiled law: solved to the end, its derivatives those of differences."""

import numpy as np
import pytest

from rover_pin.contact import Soil, Wheel
from rover_pin.effects.digging_memory import TOUCH, DiggingMemory
from rover_pin.experiments.wheel_rig import model as rig
from rover_pin.experiments.wheel_rig.candidates import rig_kinds
from rover_pin.experiments.wheel_rig.model import PAPER, RigModel, conditions, predictor

KINDS = {kind.__name__: kind for kind in rig_kinds()}
SOIL = Soil(n=1.0, c=200.0, phi=0.6, k=0.012, k_1=6e4, exit_ratio=0.1)
RUNS = conditions(np.repeat([12.0, 40.0], 5), np.tile([-0.3, 0.0, 0.2, 0.5, 0.85], 2), None)
WHEEL = Wheel()


@pytest.mark.parametrize("name", ["", *KINDS])
def test_newtons_method_ends_where_more_steps_end(name, monkeypatch):
    """It stops once a step is small: no run is less well balanced for that, neither its load nor its states."""
    model = RigModel(WHEEL, SOIL, (*PAPER, *([KINDS[name]()] if name else [])))
    short = predictor(model, ("phi", "k", "k_1"), RUNS)(model.vector())
    monkeypatch.setattr(rig, "SETTLED", 0.0)
    whole = predictor(model, ("phi", "k", "k_1"), RUNS)(model.vector())
    assert np.abs(short.error).max() < 1e-10
    for own, full in ((short.values, whole.values), (short.jacobian, whole.jacobian)):
        assert own == pytest.approx(full, rel=1e-8, abs=1e-9 * np.abs(full).max())


@pytest.mark.parametrize("k_1", np.logspace(5.0, 9.0, 9))
def test_hole_lowers_a_wheel_by_its_depth_on_any_ground(k_1):
    """On firm ground the wheel stands deep in its hole and hardly in its floor, as one without a hole does."""
    soil, hole = SOIL.replace(k_1=k_1), DiggingMemory(c_d=0.18, length=1.0, deepest=0.4)
    without, dug = (RigModel(WHEEL, soil, (*PAPER, *own)).predict(*RUNS[:, :2].T).sinkage for own in ((), (hole,)))
    slip, rim = np.fmax(RUNS[:, 1], 0.0), hole.deepest * WHEEL.r
    q = hole.c_d * hole.length * slip / (1 - slip) * np.fmin(without / TOUCH, 1.0)
    assert dug == pytest.approx(without + rim * q / (rim + q), rel=2e-6)
