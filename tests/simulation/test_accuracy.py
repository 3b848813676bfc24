"""The times of a drive: whole multiples of the step, and a default that keeps what its docstring says."""

import dataclasses

import numpy as np
import pytest

from rover_pin.base.errors import SimulationError
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.timing import DT, TOLERANCE, Timing


@pytest.mark.parametrize("name", ["control", "sample"])
@pytest.mark.parametrize("period", [0.0, 0.005, 0.015, 0.025, -0.01])
def test_a_period_is_a_whole_number_of_steps_and_one_at_least(name, period):
    with pytest.raises(SimulationError, match=f"The {name} period {period:g}.*dt = 0.01"):
        Timing(**{name: period})
    assert getattr(Timing(**{name: 0.01}), name) == 0.01
    assert getattr(Timing(**{name: 0.03}), name) == 0.03


@pytest.mark.parametrize(("allowed", "refused"), [(1e-6, 0.99e-6), (0.1, 0.101)])
def test_a_step_lies_between_a_microsecond_and_a_tenth(allowed, refused):
    assert Timing(dt=allowed, control=1.0, sample=1.0).dt == allowed
    with pytest.raises(SimulationError, match=r"it.*\[1e-06, 0.1\]"):
        Timing(dt=refused, control=1.0, sample=1.0)


@pytest.mark.parametrize("tolerance", [0.0, -1e-4, float("nan")])
def test_a_tolerance_is_a_distance(tolerance):
    with pytest.raises(SimulationError, match=r"tolerance.*positive distance"):
        Timing(tolerance=tolerance)


DITCHES = {
    "stopped by the wall": scenario("ditch", soil="table-1"),
    "gets out": scenario("ditch", soil="table-1", **{"soil.k": 0.010, "cruise_slip": 0.05}),
    "without a lag of slip": scenario(
        "ditch", soil="table-1", slip="algebraic", **{"soil.k": 0.010, "cruise_slip": 0.05}
    ),
}


def x_at(case, dt):
    return dataclasses.replace(case, timing=dataclasses.replace(case.timing, dt=dt)).drive(measure_error=False)[
        "body_x"
    ]


@pytest.mark.parametrize("name", DITCHES)
def test_x_is_within_the_stated_distance_of_finer_steps(name):
    case = DITCHES[name]
    assert x_at(case, DT) == pytest.approx(x_at(case, DT / 32), abs=0.1 * TOLERANCE)


def test_rows_and_readings_are_of_their_instant():
    """Under slip control a lag by a step moves x by 0.14 mm, and the loads by 6e-5."""
    made = scenario("ditch", control="true", duration=8.0, dt=0.005)
    finer = dataclasses.replace(made, timing=dataclasses.replace(made.timing, divided=16))
    coarse, fine = (each.drive(measure_error=False) for each in (made, finer))
    assert coarse["body_x"] == pytest.approx(fine["body_x"], abs=1e-5)
    for name, share in {"normal": 1e-3, "tangential": 1e-2, "slip": 1e-2, "current": 1e-2, "travel": 1e-2}.items():
        assert coarse.stack(name) == pytest.approx(fine.stack(name), abs=share * np.ptp(fine.stack(name))), name
    torque = fine["differential_torque"]
    assert coarse["differential_torque"] == pytest.approx(torque, abs=1e-2 * np.ptp(torque))
