"""S_d by the depth of a wheel's own hole, against numbers worked out by hand, and what it is for."""

import numpy as np
import pytest

from rover_pin.control.slip_control import HOLE_GAINS, HoleLaw, SlipControl
from rover_pin.control.slip_estimate import TrueSlip
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.command import Reading, Truth


def reading(slip, rate):
    travel = 0.045 * rate * (1.0 - slip)
    truth = Truth(slip, 0.008 * np.ones(6), 9.5 * np.ones(6), travel, np.zeros(3), np.zeros(3))
    return Reading(0.0, 0.55 * np.ones(6), rate, 0.1 * np.ones(6), np.zeros(4), (0.0, 0.0, 0.0), truth)


@pytest.mark.parametrize(("depth", "wanted"), [(0.0, 0.6), (4.5, 0.6), (6.75, 0.35), (9.0, 0.1), (20.0, 0.1)])
def test_the_desired_slip_falls_with_the_hole(depth, wanted):
    assert float(HoleLaw().desired_slip(0.6, depth * 1e-3)) == pytest.approx(wanted)
    assert float(HoleLaw(r=0.09).desired_slip(0.6, 2.0 * depth * 1e-3)) == pytest.approx(wanted), "by the radius"


def test_every_wheel_has_its_own_hole():
    control = SlipControl(HOLE_GAINS, TrueSlip(), hole=HoleLaw())
    slip = np.array([0.0, 0.0, 0.3, 0.3, 0.9, 0.9])
    for _ in range(40):
        command = control(reading(slip, 1.3 * np.ones(6)))
    depth = np.asarray(control.depth)
    assert np.all(np.diff(depth[::2]) > 0.0)
    assert depth[::2] == pytest.approx(depth[1::2])
    assert np.all(np.diff(np.asarray(command.duty)[::2]) <= 0.0)
    control.reset()
    assert control.depth == 0.0


def test_an_estimate_of_slip_alone_digs_by_eq_1():
    class Told:
        def slip(self, reading):
            return reading.truth.slip

    slip = np.array([-1.0, -0.5, 0.0, 0.3, 0.9, 1.0])
    depths = []
    for estimate in (Told(), TrueSlip()):
        control = SlipControl(HOLE_GAINS, estimate, hole=HoleLaw())
        for _ in range(40):
            control(reading(slip, 1.3 * np.ones(6)))
        depths.append(np.asarray(control.depth))
    assert depths[0][2:] == pytest.approx(depths[1][2:])
    assert np.all(depths[0][:3] < 1e-9)


def test_it_drives_through_the_compiled_loop_and_digs_less():
    drive = {"soil.k": 0.04, "terrain.angle_deg": 9.0, "terrain.start": 0.5, "add": ("DiggingMemory.c_d=0.2",)}
    drive["duration"] = 20.0
    constant = scenario("incline", **drive).drive()
    case = scenario("incline", **drive, control="true", **{"control.aim": "hole"})
    trace = case.drive()
    assert str(constant.attrs["stop"]).startswith("buried")
    assert trace.attrs["stop"] == "duration"
    assert trace["body_x"][-1] > constant["body_x"][-1]
    assert case.controller.depth.max() > 0.1 * case.model.rover.wheel.r
