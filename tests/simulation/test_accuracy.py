"""The times of a drive are whole multiples of the step, and the default tolerance is kept."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rover_pin.base.errors import SimulationError
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.stepping.timing import DT, TOLERANCE, Timing


@given(
    dt=st.floats(1e-5, 0.1),
    shared=st.sampled_from([0.001, 0.01, 1 / 30, 0.05, 0.0625]),
    control=st.integers(1, 12),
    sample=st.integers(1, 12),
)
@example(dt=0.1, shared=0.05, control=2, sample=6)
@example(dt=0.001, shared=1e-5, control=1, sample=5000)
@example(dt=0.01, shared=0.05, control=5000, sample=1)
def test_the_step_is_the_longest_that_divides_both_periods(dt, shared, control, sample):
    timing = Timing(dt=dt, control=control * shared, sample=sample * shared)
    common = math.gcd(control, sample) * shared
    steps = common / timing.dt
    assert timing.dt <= dt * (1.0 + 1e-6)
    assert steps == pytest.approx(round(steps), rel=1e-9)
    assert round(steps) == 1 or common / (round(steps) - 1) > dt
    assert dataclasses.replace(timing).dt == timing.dt


@pytest.mark.parametrize("name", ["control", "sample"])
@pytest.mark.parametrize("period", [0.0, 1e-7, -0.01, math.nan, math.inf])
def test_a_period_is_a_positive_time(name, period):
    with pytest.raises(SimulationError, match=f"The {name} period.*1e-06 s or more"):
        Timing(**{name: period})


def test_periods_without_a_common_step_are_refused():
    with pytest.raises(SimulationError, match="no step"):
        Timing(control=0.05, sample=0.05 * math.sqrt(2.0))


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
    """A slip law without lag needs a finer step, which the measured error finds."""
    case, lags = DITCHES[name], name != "without a lag of slip"
    exact, driven = x_at(case, DT / 32), case.drive()
    assert driven["body_x"] == pytest.approx(exact, abs=driven.attrs["step_error_m"])
    assert driven.attrs["step_error_m"] < TOLERANCE
    assert x_at(case, DT) == pytest.approx(exact, abs=0.6 * TOLERANCE if lags else 1.1 * TOLERANCE)


def test_rows_and_readings_are_of_their_instant():
    """Under slip control, a delay by one step would change x by 0.14 mm, and the loads by a relative 6e-5."""
    case = scenario("ditch", control="true", duration=8.0, dt=0.005)
    finer = dataclasses.replace(case, timing=dataclasses.replace(case.timing, divided=16))
    coarse, fine = (trace.drive(measure_error=False) for trace in (case, finer))
    assert coarse["body_x"] == pytest.approx(fine["body_x"], abs=1e-5)
    for name, share in {"normal": 1e-3, "tangential": 1e-2, "slip": 1e-2, "current": 1e-2, "travel": 1e-2}.items():
        assert coarse.stack(name) == pytest.approx(fine.stack(name), abs=share * np.ptp(fine.stack(name))), name
    torque = fine["differential_torque"]
    assert coarse["differential_torque"] == pytest.approx(torque, abs=1e-2 * np.ptp(torque))
