"""Failures that end a drive: each limit is tested just below and just above its value, in Python and in the compiled
loop.
"""

import math
import re
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from rover_pin import load_rover, scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.failure import failure
from rover_pin.simulation.model.model import BURIED
from rover_pin.simulation.native.loop import Loop, LoopStatus
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.start import Start, hovering
from rover_pin.simulation.state import suspension_places

ROVER = load_rover("nexus6")
MODEL = SimpleNamespace(rover=ROVER, buried=BURIED)
STOPS = ROVER.model.lowerPositionLimit, ROVER.model.upperPositionLimit


AT_ONCE = 1e-12
"""A step [s] in which nothing moves."""


def compiled(q, v, height=50.0):
    """Return the status of the compiled loop for a state at a height [m], after a step in which nothing moves."""
    model = scenario("flat").model
    state = hovering(model, Start())
    state.q[3:], state.v[:] = q[3:], v
    state.q[2] = height
    loop = Loop(Kernel(model, state, AT_ONCE, symmetric=False), AT_ONCE, 1, 1)
    return loop.run(1), loop.rows[0]


def asked(roll=0.0, pitch=0.0, yaw=0.0, speed=0.0, depth=0.0, joint=0.0, way=1):
    """Return the failure of a rover with this attitude, this speed [m/s] backwards, and a third wheel that has sunk by
    this multiple of its radius.
    """
    q, v = pin.neutral(ROVER.model), np.zeros(ROVER.model.nv)
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(*np.radians([roll, pitch, yaw]))).coeffs()
    v[way] = -speed
    place = suspension_places(ROVER)[1]
    q[place] = STOPS[1 if joint >= 0 else 0][place] + joint
    record = np.zeros((6, len(RECORD)))
    record[2, RECORD.index("sinkage")] = depth * float(ROVER.wheels[2].wheel.r)
    reason = failure(MODEL, SimpleNamespace(q=q, v=v), record)
    if depth == 0.0 and math.isfinite(speed):
        assert compiled(q, v)[0] is (LoopStatus.FAILS if reason else LoopStatus.DONE)
    return reason


@pytest.mark.parametrize("axis", ["roll", "pitch"])
@pytest.mark.parametrize("side", [1, -1])
def test_it_has_capsized_beyond_60_deg(axis, side):
    assert asked(**{axis: 59.5 * side}) is None
    assert asked(**{axis: 60.5 * side}).startswith("capsized: ")
    assert f"{axis} {60.5 * side:.0f} deg" in asked(**{axis: 60.5 * side})


@pytest.mark.parametrize("depth", [0.49, 0.51])
def test_compiled_loop_measures_burial_by_the_wheel_radius(depth):
    q, v, r = pin.neutral(ROVER.model), np.zeros(ROVER.model.nv), float(ROVER.wheels[0].wheel.r)
    at = RECORD.index("sinkage")
    touching = 0.1
    sunk = compiled(q, v, touching)[1]["record"][:, at].max()
    outcome, row = compiled(q, v, touching + sunk - depth * r)
    assert row["record"][:, at].max() == pytest.approx(depth * r, rel=1e-6)
    assert outcome is (LoopStatus.FAILS if depth > 0.5 else LoopStatus.DONE)


@pytest.mark.parametrize("roll", [8.0, -8.0])
@pytest.mark.parametrize("pitch", [5.0, -5.0])
def test_the_compiled_loop_looks_at_every_wheel(roll, pitch):
    """The rover is rolled and pitched so that only one of its corner wheels is deep in the soil."""
    q, v, at = pin.neutral(ROVER.model), np.zeros(ROVER.model.nv), RECORD.index("sinkage")
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(*np.radians([roll, pitch, 0.0]))).coeffs()
    height = 0.2
    while (sunk := compiled(q, v, height)[1]["record"][:, at]).max() == 0.0:
        height -= 0.003
    deepest, r = int(np.argmax(sunk)), float(ROVER.wheels[0].wheel.r)
    for depth, outcome in ((0.49, LoopStatus.DONE), (0.51, LoopStatus.FAILS)):
        has_failed, row = compiled(q, v, height + sunk[deepest] - depth * r)
        assert row["record"][deepest, at] == pytest.approx(depth * r, rel=0.01)
        assert np.delete(row["record"][:, at], deepest).max() < 0.45 * r
        assert has_failed is outcome


def test_a_joint_may_go_10_deg_past_its_stop():
    for side in (1, -1):
        assert asked(joint=side * math.radians(9.5)) is None
        assert re.match("folded: .*11 deg", asked(joint=side * math.radians(10.6)))


@pytest.mark.parametrize("way", [0, 1, 2])
def test_a_rover_faster_than_10_m_s_has_diverged(way):
    assert asked(speed=9.9, way=way) is None
    assert asked(speed=-9.9, way=way) is None
    assert asked(speed=-10.1, way=way).startswith("diverged")
    assert asked(speed=10.1, way=way).startswith("diverged")
    assert asked(speed=math.nan).startswith("diverged")
