"""Every drive is driven again at half the step, and says what that made of it; nothing, if that was nothing."""

import numpy as np
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.control.torque_check import TorqueLimit, TorqueLimited
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.outcome import audit
from rover_pin.simulation.outcome.half_step import repeating, step_warnings
from rover_pin.simulation.sensors import Sensed, Sensors
from rover_pin.simulation.simulate import Timing, simulate
from rover_pin.simulation.trace.rows import row_type
from rover_pin.tuning.drives import drive_full
from rover_pin.tuning.study import DriveCase

DOUBT = "the wheels were off the ground 35% of the time"


def rows_at(x, model=None):
    """Rows that stand at these places."""
    rows = np.zeros(len(x), dtype=row_type(model or scenario("flat").model))
    rows["t"], rows["q"][:, 0] = 0.05 * (1 + np.arange(len(x))), x
    return rows


def test_a_doubt_that_cannot_be_measured_stays_a_doubt():
    (told,) = step_warnings([DOUBT], None)
    assert told.startswith(DOUBT)
    assert "compare" in told


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
    once_more = simulate(model, repeating(held, rows, Timing()), 0.5, settle_doubts=False)
    assert once_more["body_x"].tobytes() == trace["body_x"].tobytes()
    assert len(asked) == calls


def test_a_false_doubt_is_not_told(monkeypatch):
    """Half the step moves the flat drive by less than a micrometre, whatever its steps are said to have misjudged."""
    monkeypatch.setattr(audit, "MOST_MISSED", -1.0)
    drive = scenario("flat", duration=2.0)
    assert drive.drive().attrs["warnings"] == []
    part = drive.drive().end
    assert part is not None
    (told,) = simulate(drive.model, drive.controller, 1.0, part, symmetric=part.symmetric).attrs["warnings"]
    assert "compare" in told, "what goes on has no start to drive again from"


def test_measuring_leaves_controller_and_drive_as_they_were(monkeypatch):
    made = scenario("ditch", duration=1.0, control="true")
    without = made.drive()
    integral = np.array(made.controller.integral)
    monkeypatch.setattr(audit, "MOST_MISSED", -1.0)
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


def test_where_nobody_reads_a_warning_nothing_is_driven_twice(monkeypatch):
    monkeypatch.setattr(audit, "MOST_MISSED", -1.0)
    made = scenario("ditch", duration=1.0)
    settled = made.drive()

    def refuse(*given):
        raise AssertionError("driven again")

    monkeypatch.setattr("rover_pin.simulation.simulate.halved", refuse)
    once = made.drive(settle_doubts=False)
    assert all(once[name].tobytes() == settled[name].tobytes() for name in settled.channels)
    assert any("compare" in said for said in once.attrs["warnings"]), "the doubt is told"
    drive_full(DriveCase("ditch", "ditch", (("duration", 1.0),)), ConstantDuty())
    with pytest.raises(AssertionError, match="driven again"):
        made.drive()
