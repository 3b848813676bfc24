"""Every drive is driven again at another step, which measures its error, until that is within a tolerance."""

import contextlib
import copy
import dataclasses
import math

import numpy as np
import pytest

from rover_pin import ConstantDuty, RoverPinError, scenario, simulate
from rover_pin.control.torque_check import TorqueLimit, TorqueLimited
from rover_pin.scenarios.scenario import Scenario
from rover_pin.simulation.engines import COMPILED, ENGINES
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.sensors import NoisyController, Sensors
from rover_pin.simulation.simulate import Timing
from rover_pin.simulation.start import settled_state
from rover_pin.simulation.stepping.step_error import LOADS, StepChange, complete_steps, repeating, step_change
from rover_pin.simulation.stepping.timing import MAX_REFINEMENT, TOLERANCE
from rover_pin.simulation.stepping.tolerance import DriveJob, drive_from
from rover_pin.simulation.trace.record import row_type
from rover_pin.tuning.drives import drive_full
from rover_pin.tuning.study import DriveCase
from studies import step_error
from tests.simulation import random_drives as random_bounds

GROUNDS = ("flat", "ditch", "hills", "rocks", "slope", "turn")


def rows_at(x, model=None):
    """Rows that stand at these places."""
    rows = np.zeros(len(x), dtype=row_type(model or scenario("flat").model))
    rows["t"], rows["q"][:, 0] = 0.05 * (1 + np.arange(len(x))), x
    return rows


def test_errors_are_twice_those_of_first_order():
    """Rows by hand: 2 mm aside at the end, and a load that is 3 % more on one wheel."""
    rows, finer = rows_at(np.linspace(0.0, 1.0, 20)), rows_at(np.linspace(0.0, 1.0, 20))
    normal = RECORD.index("normal")
    for trace in (rows, finer):
        trace["record"][:, :, normal] = 10.0
    finer["q"][-1, 1], finer["record"][:, 2, normal] = 2e-3, 10.3
    half = step_change((rows, "duration"), (finer, "duration"), 0.5)
    assert half.errors == pytest.approx({"step_error_m": 8e-3, "step_error_load": 0.12})
    double = step_change((rows, "duration"), (finer, "duration"), 2.0)
    assert double.errors == pytest.approx({"step_error_m": 4e-3, "step_error_load": 0.06})
    assert half.excess(1e-3) == pytest.approx(8.0)
    assert double.excess(1e-3) == pytest.approx(4.0)
    assert half.excess(0.1) == pytest.approx(0.08)
    finer["q"][-1, 1] = 0.0
    assert step_change((rows, "duration"), (finer, "duration"), 0.5).excess(1e-3) == pytest.approx(1.2), "of the loads"
    early = step_change((rows, "duration"), (finer[:9], "buried: wheel FL"), 0.5)
    assert early.excess(1.0) == math.inf
    assert "buried: wheel FL" in early.warning(1.0)
    assert half.warning(8.1e-3) == "" != half.warning(7.9e-3)


def test_steps_that_were_not_taken_are_whole():
    begun = complete_steps(np.array([0.01, 0.005]), 0.01, 0.045)
    assert begun == pytest.approx([0.01, 0.005, 0.01, 0.01, 0.01])


def test_every_engine_measures_the_same_error():
    """A turn begins with steps that are divided."""
    case = scenario("turn", duration=0.2)
    compiled, *others = (
        simulate(case.model, case.controller, 0.2, case.start, engine=engine).attrs["step_error_m"]
        for engine in ENGINES
    )
    assert len(others) == 2
    assert others == pytest.approx([compiled] * 2, rel=1e-6)


@pytest.mark.parametrize(
    ("scene", "duration"),
    [("turn", 2.0), ("crab", 2.0), *(pytest.param(name, 8.0, marks=pytest.mark.slow) for name in GROUNDS)],
)
def test_the_error_is_that_of_a_drive_at_a_sixteenth(scene, duration):
    """Of steps that forces divide too: one at twice the step divides them as finely, and stated 0.2 of the true."""
    case = scenario(scene, duration=duration)
    trace = case.drive()
    assert apart(trace, finest(case, trace)) <= trace.attrs["step_error_m"] + (duration > 2.0) * 1e-6


def test_an_on_board_estimate_is_called_again_in_each_drive():
    """Its commands follow from what it believes: a drive under those that it gave would know no error of theirs."""
    case = scenario("hills", control="onboard", duration=3.0)
    case.drive(measure_error=False)
    again = repeating(case.controller, rows_at([0.0], case.model), case.timing)
    assert type(again) is type(case.controller)
    assert again.controller.estimate is again.estimate is not case.controller.estimate
    once_more = dataclasses.replace(case, controller=again).drive(measure_error=False)
    first = case.drive(measure_error=False)
    assert once_more["body_x"].tobytes() == first["body_x"].tobytes()
    twin = copy.deepcopy(case.controller)
    on = [
        simulate(case.model, controller, 1.0, first.end, case.timing)["body_x"]
        for controller in (twin, case.controller)
    ]
    assert on[0].tobytes() == on[1].tobytes(), "a copy believes what the first does, and each goes its own way"


def finest(chosen, settings):
    """Return x and y at a sixteenth of the step that a drive took."""
    divided = 16 * round(chosen.timing.dt / settings.attrs["dt_s"])
    timing = dataclasses.replace(chosen.timing, divided=divided)
    return dataclasses.replace(chosen, timing=timing).drive(measure_error=False)


def apart(first, second):
    return float(np.hypot(first["body_x"] - second["body_x"], first["body_y"] - second["body_y"]).max())


@pytest.mark.slow
def test_a_finer_tolerance_takes_a_finer_step_and_is_kept():
    """The edge of a step of the ground; the usual step is within 0.01 mm there."""
    chosen = scenario("step", form="net", duration=8.0)
    errors_found = []
    for tolerance in (1e-5, 1e-6, 3e-7):
        trace = dataclasses.replace(chosen, timing=Timing(tolerance=tolerance)).drive()
        assert trace.attrs["step_error_m"] <= tolerance
        assert trace.attrs["warnings"] == []
        assert apart(trace, finest(chosen, trace)) <= tolerance
        errors_found.append((trace.attrs["dt_s"], trace.attrs["step_error_m"]))
    assert errors_found == sorted(errors_found, reverse=True)
    assert errors_found[0][0] > errors_found[-1][0]


def test_a_refined_drive_takes_its_usual_steps_in_parts():
    """To the bit, its controller's memory included; it can go on."""
    case = scenario("ditch", control="true", duration=1.0)
    strict = dataclasses.replace(case, timing=Timing(tolerance=1e-9)).drive()
    memory = np.array(case.controller.integral)
    fine = Timing(divided=MAX_REFINEMENT)
    state = settled_state(case.model, case.start, case.symmetric)
    job = DriveJob(ENGINES[COMPILED], case.model, case.controller, 1.0, Timing(), case.symmetric, None, False)
    lengths = np.repeat(drive_from(job, state).run.lengths / MAX_REFINEMENT, MAX_REFINEMENT)
    plain = drive_from(job._replace(timing=fine), state, lengths)
    assert strict.attrs["dt_s"] == pytest.approx(Timing().dt / MAX_REFINEMENT)
    assert np.array_equal(strict["body_x"], plain.rows["q"][:, 0])
    assert np.array_equal(memory, case.controller.integral)
    assert any("exceeds the tolerance" in warning for warning in strict.attrs["warnings"])
    by_itself = dataclasses.replace(case, timing=fine).drive(measure_error=False)
    ends = [
        simulate(case.model, case.controller, 0.5, end, timing, symmetric=case.symmetric)["body_x"][-1]
        for end, timing in ((strict.end, Timing(tolerance=1e-9)), (by_itself.end, fine))
    ]
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_a_user_controller_is_called_once_and_the_note_states_this():
    call_times = []
    user_law = lambda reading: call_times.append(reading.t) or 0.3 + 0.1 * np.sin(8.0 * reading.t)  # noqa: E731
    trace = simulate(scenario("flat").model, user_law, 1.0, timing=Timing(tolerance=1e-9))
    assert (trace.attrs["dt_s"], len(call_times)) == (Timing().dt, 20)
    assert any("exceeds the tolerance" in warning for warning in trace.attrs["warnings"])


def test_an_error_that_halving_does_not_reduce_is_reported():
    change = StepChange(1e-3, 0.0, "", 2.0)
    assert "give a smaller dt" in change.warning(1e-4)
    assert "no step" in change._replace(lessens=False).warning(1e-4)


def test_a_fall_by_more_than_second_order_counts_as_chance():
    """Two drives that pass the same side of what divides them: the one at half the step is no surer for it."""
    change = StepChange(8e-3, 0.04, "buried: wheel FL", 2.0)
    assert change.half_step_change() == StepChange(2e-3, 0.01, "", 2.0)


def test_the_worse_of_two_changes_is_the_greater_error():
    """Between 3 mm at half the step and 2 mm at twice, both of first order, the first is the greater error."""
    half, double = StepChange(3e-3, 0.01, "", 0.5), StepChange(2e-3, 0.09, "", 2.0)
    wanted = {"step_error_m": 0.012, "step_error_load": 0.18}
    assert half.or_worse(double).errors == pytest.approx(wanted) == double.or_worse(half).errors


@pytest.mark.parametrize(("control", "is_same"), [(0.05, True), (0.1, True), (0.02, False)])
def test_commands_are_repeated_where_the_rows_hold_them(control, is_same):
    """Where the controller is slower than the rows."""
    call_times = []

    def own(reading):
        call_times.append(reading.t)
        return 0.3 + 0.1 * np.sin(8.0 * reading.t)

    timing = Timing(control=control)
    drive = scenario("flat", duration=1.0)
    trace = simulate(drive.model, own, 1.0, timing=timing)
    rows = rows_at(trace["body_x"], drive.model)
    rows["t"], rows["duty"] = trace.t, trace.stack("duty")
    calls = len(call_times)
    again = repeating(own, rows, timing)
    assert (again is not None) is is_same
    if again:
        once_more = simulate(drive.model, again, 1.0, timing=timing)
        assert once_more["body_x"].tobytes() == trace["body_x"].tobytes()
    assert len(call_times) == calls, "a controller of one's own is not asked twice"


@pytest.mark.parametrize("within", ["sensors", "limit"])
def test_a_wrapper_does_not_call_a_users_controller_again(within):
    model, call_times = scenario("flat").model, []
    user_law = lambda reading: call_times.append(reading.t) or 0.3  # noqa: E731
    wrapped = (
        NoisyController(user_law, Sensors(), 1)
        if within == "sensors"
        else TorqueLimited(user_law, TorqueLimit.at_slip(model))
    )
    trace = simulate(model, wrapped, 0.5)
    rows = rows_at(trace["body_x"], model)
    rows["t"], rows["duty"] = trace.t, trace.stack("duty")
    calls = len(call_times)
    once_more = simulate(model, repeating(wrapped, rows, Timing()), 0.5, measure_error=False)
    assert once_more["body_x"].tobytes() == trace["body_x"].tobytes()
    assert len(call_times) == calls


def test_a_part_that_goes_on_has_no_start_to_drive_again_from():
    drive = scenario("flat", duration=2.0)
    part = drive.drive().end
    assert part is not None
    assert "step_error_m" not in simulate(drive.model, drive.controller, 1.0, part, symmetric=part.symmetric).attrs


def test_measuring_leaves_controller_and_drive_as_they_were():
    """On ground that bears twice the step; elsewhere the drive that is measured is the one in halves."""
    case = scenario("ditch", duration=1.0, control="true", dt=0.005)
    without = case.drive(measure_error=False)
    integral = np.array(case.controller.integral)
    doubted = case.drive()
    assert np.array_equal(case.controller.integral, integral)
    assert all(doubted[name].tobytes() == without[name].tobytes() for name in without.channels)


def test_the_packages_controllers_are_reset():
    case = scenario("ditch", duration=0.5, control="true")
    trace = case.drive()
    again = repeating(case.controller, rows_at(trace["body_x"], case.model), Timing())
    assert again is not case.controller
    assert np.all(np.asarray(again.integral) == 0.0)
    assert isinstance(repeating(ConstantDuty(0.3), rows_at([0.0]), Timing(control=0.02)), ConstantDuty)


def test_where_nobody_reads_the_error_nothing_is_driven_twice(monkeypatch):
    case = scenario("ditch", duration=1.0, dt=0.005)
    settled = case.drive()

    def refuse(*value):
        raise AssertionError("driven again")

    monkeypatch.setattr("rover_pin.simulation.stepping.tolerance.step_change", refuse)
    once = case.drive(measure_error=False)
    assert all(once[name].tobytes() == settled[name].tobytes() for name in settled.channels)
    assert "step_error_m" not in once.attrs
    drive_full(DriveCase("ditch", "ditch", (("duration", 1.0),)), ConstantDuty())
    with pytest.raises(AssertionError, match="driven again"):
        case.drive()


def usual_drives():
    """Of other seeds than those of the study's table."""
    for seed in range(5000, 5100):
        with contextlib.suppress(RoverPinError):
            scene, settings = step_error.drawn(seed)
            yield scenario(scene, **settings)


def drives_at_the_bounds():
    for seed in range(6000, 6100):
        with contextlib.suppress(RoverPinError):
            drawn = random_bounds.drive(seed)
            yield Scenario(str(seed), drawn.model, drawn.controller, random_bounds.DURATION, drawn.start)


def judged(chosen):
    """Return the errors of x and y and of loads against a sixteenth of the step, those stated, and if it is kept."""
    driven = chosen.drive()
    if "step_error_m" not in driven.attrs:
        return None
    base = chosen.drive(measure_error=False).attrs["dt_s"]
    divided = max(16, 4 * round(base / driven.attrs["dt_s"]))
    exact = dataclasses.replace(chosen, timing=dataclasses.replace(chosen.timing, divided=divided))
    exact = exact.drive(measure_error=False)
    n = min(len(driven.t), len(exact.t))
    off = np.hypot(*(driven[name][:n] - exact[name][:n] for name in ("body_x", "body_y"))).max()
    load, exact_load = (trace.stack("normal")[:n].mean(axis=0) for trace in (driven, exact))
    keeps = not any("exceeds the tolerance" in warning for warning in driven.attrs["warnings"])
    share = np.abs(load - exact_load).max() / exact_load.mean()
    return off, driven.attrs["step_error_m"], share, driven.attrs["step_error_load"], keeps


@pytest.mark.nightly
@pytest.mark.parametrize("drives", [usual_drives, drives_at_the_bounds])
def test_drives_keep_their_tolerance_and_state_their_error(drives, capsys):
    table = []
    for chosen in drives():
        with contextlib.suppress(RoverPinError):
            table += filter(None, [judged(chosen)])
    off, stated_error, load, stated_load, keeps = np.array(table, dtype=float).T
    keeps, low = keeps > 0.0, off > stated_error + 1e-6
    ratio, load_ratio = np.median(stated_error / off), np.median(stated_load / load)
    with capsys.disabled():
        print(f"\n{drives.__name__}: {len(off)}, {keeps.sum()} within their tolerance")
        print(
            f"  these off by at most {1e3 * off[keeps].max():.2g} mm and {100 * load[keeps].max():.2g} % of the loads"
        )
        print(f"  stated over true, in the median: {ratio:.2g} in place, {load_ratio:.2g} of the loads")
        print(f"  stated too low by more than 1 um: {low.sum()}, {(low & keeps).sum()} of them within their tolerance")
    assert (off[keeps] <= TOLERANCE).all()
    assert (load[keeps] <= LOADS * TOLERANCE).all()
    assert keeps.mean() > (0.9 if drives is usual_drives else 0.6)
    assert low.mean() < 0.05
    assert 1.0 < ratio < 10.0, "the aim is 5"
