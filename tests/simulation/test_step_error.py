"""Every drive is driven again at twice or half the step, which measures the error of its step."""

import dataclasses

import numpy as np
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.control.torque_check import TorqueLimit, TorqueLimited
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.outcome.step_error import repeating, step_change
from rover_pin.simulation.resolution import parts
from rover_pin.simulation.sensors import Sensed, Sensors
from rover_pin.simulation.simulate import Timing, simulate
from rover_pin.simulation.start.place import settled
from rover_pin.simulation.trace.rows import row_type
from rover_pin.tuning.drives import drive_full
from rover_pin.tuning.study import DriveCase


def rows_at(x, model=None):
    """Rows that stand at these places."""
    rows = np.zeros(len(x), dtype=row_type(model or scenario("flat").model))
    rows["t"], rows["q"][:, 0] = 0.05 * (1 + np.arange(len(x))), x
    return rows


def test_errors_are_twice_those_of_first_order():
    """Rows by hand: 2 mm aside at the end, and a load that is 3 % more on one wheel."""
    rows, finer = rows_at(np.linspace(0.0, 1.0, 20)), rows_at(np.linspace(0.0, 1.0, 20))
    normal = RECORD.index("normal")
    for each in (rows, finer):
        each["record"][:, :, normal] = 10.0
    finer["q"][-1, 1], finer["record"][:, 2, normal] = 2e-3, 10.3
    half = step_change(rows, "duration", finer, "duration", 0.5)
    assert half.errors == pytest.approx({"step_error_m": 8e-3, "step_error_load": 0.12})
    double = step_change(rows, "duration", finer, "duration", 2.0)
    assert double.errors == pytest.approx({"step_error_m": 4e-3, "step_error_load": 0.06})
    assert half.warning == "", "2 mm of 1 m"
    assert "buried" in step_change(rows, "duration", finer[:9], "buried: wheel FL", 0.5).warning


def test_ground_too_stiff_for_twice_the_step_halves_it():
    """It asks for 153 parts of 25 ms, and 200 are the most."""
    drive = scenario("flat", duration=0.05, **{"soil.k_1": 1e9, "soil.n": 0.6})
    coarse = dataclasses.replace(drive, timing=Timing(dt=0.025))
    assert 100 < parts(drive.model, settled(drive.model, drive.start), 0.025) < 200
    assert coarse.drive().attrs["step_error_m"] < 1e-6


@pytest.mark.slow
def test_the_error_is_that_of_a_drive_at_a_sixteenth():
    """On ready-made grounds the true error is no more than what is said, and a micrometre."""
    for name in ("flat", "ditch", "hills", "rocks", "slope", "turn"):
        chosen = scenario(name, duration=8.0)
        said = chosen.drive().attrs["step_error_m"]
        fine = dataclasses.replace(chosen, timing=dataclasses.replace(chosen.timing, divided=16))
        exact, own = (each.drive(measure_error=False) for each in (fine, chosen))
        off = np.hypot(exact["body_x"] - own["body_x"], exact["body_y"] - own["body_y"]).max()
        assert off <= said + 1e-6


@pytest.mark.parametrize(("control", "same"), [(0.05, True), (0.1, True), (0.025, False)])
def test_commands_are_repeated_where_the_rows_hold_them(control, same):
    """Where the controller is slower than the rows."""
    asked = []

    def own(reading):
        asked.append(reading.t)
        return 0.3 + 0.1 * np.sin(8.0 * reading.t)

    timing = Timing(control=control)
    drive = scenario("flat", duration=1.0)
    trace = simulate(drive.model, own, 1.0, timing=timing)
    rows = rows_at(trace["body_x"], drive.model)
    rows["t"], rows["duty"] = trace.t, trace.stack("duty")
    calls = len(asked)
    again = repeating(own, rows, timing)
    assert (again is not None) is same
    if again:
        once_more = simulate(drive.model, again, 1.0, timing=timing)
        assert once_more["body_x"].tobytes() == trace["body_x"].tobytes()
    assert len(asked) == calls, "a controller of one's own is not asked twice"


@pytest.mark.parametrize("within", ["sensors", "limit"])
def test_what_holds_ones_own_controller_does_not_ask_it_again(within):
    model, asked = scenario("flat").model, []
    own = lambda reading: asked.append(reading.t) or 0.3  # noqa: E731
    held = Sensed(own, Sensors(), 1) if within == "sensors" else TorqueLimited(own, TorqueLimit.at_slip(model))
    trace = simulate(model, held, 0.5)
    rows = rows_at(trace["body_x"], model)
    rows["t"], rows["duty"] = trace.t, trace.stack("duty")
    calls = len(asked)
    once_more = simulate(model, repeating(held, rows, Timing()), 0.5, measure_error=False)
    assert once_more["body_x"].tobytes() == trace["body_x"].tobytes()
    assert len(asked) == calls


def test_a_part_that_goes_on_has_no_start_to_drive_again_from():
    drive = scenario("flat", duration=2.0)
    part = drive.drive().end
    assert part is not None
    assert "step_error_m" not in simulate(drive.model, drive.controller, 1.0, part, symmetric=part.symmetric).attrs


def test_measuring_leaves_controller_and_drive_as_they_were():
    made = scenario("ditch", duration=1.0, control="true")
    without = made.drive(measure_error=False)
    integral = np.array(made.controller.integral)
    doubted = made.drive()
    assert np.array_equal(made.controller.integral, integral)
    assert all(doubted[name].tobytes() == without[name].tobytes() for name in without.channels)


def test_the_package_s_controllers_start_anew():
    made = scenario("ditch", duration=0.5, control="true")
    trace = made.drive()
    again = repeating(made.controller, rows_at(trace["body_x"], made.model), Timing())
    assert again is not made.controller
    assert np.all(np.asarray(again.integral) == 0.0)
    assert isinstance(repeating(ConstantDuty(0.3), rows_at([0.0]), Timing(control=0.025)), ConstantDuty)


def test_where_nobody_reads_the_error_nothing_is_driven_twice(monkeypatch):
    made = scenario("ditch", duration=1.0)
    settled = made.drive()

    def refuse(*given):
        raise AssertionError("driven again")

    monkeypatch.setattr("rover_pin.simulation.simulate.step_change", refuse)
    once = made.drive(measure_error=False)
    assert all(once[name].tobytes() == settled[name].tobytes() for name in settled.channels)
    assert "step_error_m" not in once.attrs
    drive_full(DriveCase("ditch", "ditch", (("duration", 1.0),)), ConstantDuty())
    with pytest.raises(AssertionError, match="driven again"):
        made.drive()
