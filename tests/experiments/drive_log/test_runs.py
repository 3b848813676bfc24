"""What is compared of a logged run, and the experiment of many, on hand-made logs: no rover drives."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.base.formula import evaluate
from rover_pin.experiments.drive_log.experiment import DriveExperiment, logged
from rover_pin.experiments.drive_log.features import blocks, comparable_rows, course_of, driven, logged_run, logged_runs
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.trace.trace import Trace

CART, WHEELS = load_rover("cart"), ("fl", "fr", "bl", "br")
T = 0.05 * np.arange(120)
COUNT = 12


def trace(t=T, held=False, attrs=None, **channels):
    """A cart along the heading 0.3 at 50 mm/s, its wheels at 1 rad/s under a duty of 0.5."""
    x, y = 0.05 * (t - t[0]) * math.cos(0.3), 0.05 * (t - t[0]) * math.sin(0.3)
    usual = {"t_s": t, "body_x": x, "body_y": y, "body_yaw": 0.3 + 0.0 * t, "body_pitch": 0.01 * t, "body_z": 1.0 + t}
    usual |= {f"wheel_rate_{wheel}": 1.0 + 0.0 * t for wheel in WHEELS} | {"battery_V": 12.0 + 0.0 * t}
    usual |= {} if held else {f"duty_{wheel}": 0.5 + 0.0 * t for wheel in WHEELS}
    return Trace({**usual, **channels}, attrs={"start": {"x": 0.0, "y": 0.0, "yaw": 0.3}, **(attrs or {})})


def gap(values, first, last):
    """The values with a gap in the rows from block `first` to block `last`."""
    return np.where((np.arange(len(values)) // 10 >= first) & (np.arange(len(values)) // 10 <= last), np.nan, values)


def seen(log, name):
    run = logged_run(log, CART)
    return run.observed[run.channels.index(name)]


# --- one run ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("channel", "blind"),
    [("body_x", ("path", "drift")), ("body_y", ("path", "drift")), ("body_yaw", ("heading",)),
     ("body_pitch", ("body_pitch",)), ("body_vx", ("speed",)), ("wheel_rate_bl", ("wheel_rate_bl",))],
)  # fmt: skip
def test_derived_value_is_not_compared_in_a_gap_of_its_channel(channel, blind):
    speeds = {"body_vx": 0.05 + 0.0 * T, "body_vy": 0.0 * T}
    whole = trace(**speeds)
    run = logged_run(trace(**{**speeds, channel: gap(whole[channel], 5, 6)}), CART)
    for name, row in zip(run.channels, run.observed, strict=True):
        missing = [0, 1, 5, 6] if name in blind else [0, 1]
        assert np.flatnonzero(np.isnan(row)).tolist() == missing, name


def test_what_a_replay_is_given_is_not_compared():
    """Held wheels are given their rates, and nothing draws on a battery; ways and speeds go by what is made of them."""
    speeds = {"body_vx": 0.05 + 0.0 * T, "body_vy": 0.0 * T, "body_vz": 0.0 * T, "rocker_l": 0.0 * T}
    made = ("path", "drift", "heading", "speed", "body_pitch", "body_z", "rocker_l")
    assert set(logged_run(trace(held=True, **speeds), CART).channels) == set(made)
    rates = (f"wheel_rate_{wheel}" for wheel in WHEELS)
    assert set(logged_run(trace(**speeds), CART).channels) == {*made, *rates, "battery_V"}
    nothing = logged_run(trace(**speeds, bogie_l=np.nan * T), CART)
    assert "bogie_l" not in nothing.channels


def test_the_heading_is_smoothed_over_half_a_second():
    turned = 0.3 + np.where(T > 3.02, 1.0, 0.0)
    run = logged_run(trace(body_yaw=turned), CART)
    inside = [np.mean(turned[at - 5 : at + 5]) for at in range(10, 110)]
    np.testing.assert_allclose(run.heading[10:110], inside)
    slow = 1.5 * np.arange(30)
    other = logged_run(trace(slow, body_yaw=0.3 + 0.2 * np.sin(slow)), CART)
    np.testing.assert_allclose(other.heading, 0.3 + 0.2 * np.sin(slow), err_msg="rows of 1.5 s are their own mean")
    np.testing.assert_allclose(blocks(slow, 1.5), slow)


def test_blocks_are_means_of_readings_and_height_has_no_zero():
    pitch, height = (seen(trace(), name) for name in ("body_pitch", "body_z"))
    middle = 0.225 + 0.5 * np.arange(COUNT)
    np.testing.assert_allclose(pitch[2:], 0.01 * middle[2:])
    np.testing.assert_allclose(height[2:], middle[2:] - middle[2:].mean())


@pytest.mark.parametrize("estimated", [True, False])
def test_channels_that_told_the_ground_are_not_compared_again(estimated):
    log = SimpleNamespace(
        runs=(trace(rocker_l=0.0 * T),),
        is_estimated=lambda one: estimated,
        terrain_of=id,
        terrain=lambda: None,
        metadata=SimpleNamespace(columns={}),
    )
    (run,) = logged_runs(log, CART)
    assert {"body_pitch", "body_z"}.isdisjoint(run.channels) == estimated
    assert {"path", "rocker_l", "wheel_rate_fl"} <= set(run.channels)
    assert len(run.observed) == len(run.channels)
    assert run.observed[run.channels.index("wheel_rate_fl")][2:] == pytest.approx(np.ones(COUNT - 2))
    assert run.commands.terrain == id(log.runs[0])


def test_a_place_of_which_only_one_axis_is_known_makes_no_way():
    for one in ("body_x", "body_y", "body_vx", "body_vy"):
        assert driven({one: T}, 0.0 * T, 0.05, np.ones(len(T))) == {}


def times_compared(rates, duty=0.5, held=False):
    rows = [np.broadcast_to(each, T.shape).astype(float) for each in rates]
    run = SimpleNamespace(t=T, duty=np.broadcast_to(np.c_[duty, duty], (len(T), 2)), rate_driven=held)
    return T[comparable_rows(run, rows)]


def test_a_rover_that_coasts_without_a_duty_is_compared():
    assert times_compared([1.0, 1.0], duty=0.0)[0] == pytest.approx(1.0)
    assert len(times_compared([1.0, 1.0], duty=0.0)) == 100


def test_held_wheels_reverse_between_one_row_and_the_next():
    """Not from the last row of a run to its first; and by the sum over the wheels, so that one of two is a turn."""
    back = np.where(T < 4.025, 1.0, -1.0)
    found = times_compared([back, back], held=True)
    assert found[0] == pytest.approx(1.0)
    assert not ((found > 4.04) & (found < 5.54)).any()
    assert (found > 5.56).sum() == (T > 5.56).sum()
    on_the_spot = times_compared([back, 1.0], held=True)
    assert len(on_the_spot) == 100, "half of the wheels goes on"
    faster = [np.where(T < 4.025, 1.0, -0.5), np.where(T < 4.025, 0.5, 0.6)]
    assert len(times_compared(faster, held=True)) < 100, "the rates of all as one vector turn by more than 90 deg"
    steady = times_compared([0.3 + 0.01 * np.sin(9.0 * T), -0.3], held=True)
    assert len(steady) == 100


# --- many runs -------------------------------------------------------------------------------------------------------


def experiment(*logs):
    runs = tuple(logged_run(log, CART) for log in logs)
    return DriveExperiment(runs, tuple(f"rest {at}" for at in range(len(runs))))


def test_what_all_runs_have_is_compared_over_the_longest():
    short = trace(T[:60], attrs={"file": "b.csv"}, rocker_l=0.0 * T[:60])
    both = experiment(trace(attrs={"file": "a.csv"}, bogie_l=0.0 * T), short)
    assert {"bogie_l", "rocker_l"}.isdisjoint(both.channels)
    assert "path" in both.channels
    assert both.length == COUNT
    assert both.folds == ("a", "b")
    assert both.observed.shape == (2, len(both.channels), COUNT)
    assert np.isnan(both.observed[1, :, 6:]).all()
    assert np.isfinite(both.observed[0, :, 2:]).all()
    assert both.alone("b").rests == ("rest 1",)
    assert both.is_timed, "blocks of a run hang together"


def test_wheels_are_held_where_they_are_in_any_run():
    assert experiment(trace(held=True), trace()).rate_driven
    assert not experiment(trace(), trace()).rate_driven


def test_units_of_what_is_made_of_channels_are_theirs():
    one = experiment(trace())
    units = {name: one.unit(name) for name in ("path", "drift", "heading", "speed", "wheel_rate_fl", "current_fl_A")}
    assert units == {
        "path": "m", "drift": "m", "heading": "rad", "speed": "m/s", "wheel_rate_fl": "rad/s", "current_fl_A": "A",
    }  # fmt: skip


def test_a_free_experiment_is_drawn_to_no_place():
    one = experiment(trace())
    assert np.isfinite(one.runs[0].commands.place).all()
    assert np.isnan(one.free.runs[0].commands.place).all()
    assert logged(SimpleNamespace(task=SimpleNamespace(experiment=one))) is one


# --- a heading that was made of the place ----------------------------------------------------------------------------

COURSE = "course(body_x, body_y, t_s)"


def turning(t, arm=0.0):
    """Place and heading of a point `arm` ahead of a cart that turns at 0.2 rad/s and goes 60 mm/s."""
    yaw = 0.2 * t
    place = -0.3j * (np.exp(1j * yaw) - 1.0) + arm * np.exp(1j * yaw)
    return {"body_x": place.real, "body_y": place.imag, "body_yaw": yaw}


@pytest.mark.parametrize("arm", [0.0, 0.2])
def test_a_course_is_held_against_the_course_of_a_replay(arm):
    """Of a point ahead of the centre of turning the course runs ahead of the heading, of both alike."""
    pose = turning(T, arm)
    run = logged_run(trace(**{**pose, "body_yaw": evaluate(COURSE, {"t_s": T, **pose}, "")}), CART, course=COURSE)
    assert "drift" not in run.channels
    use = np.isfinite(run.observed[run.channels.index("heading")])
    replayed = run.features(pose)
    for name in ("heading", "path"):
        at = run.channels.index(name)
        assert replayed[at][use] == pytest.approx(run.observed[at][use], abs=1e-3)


def test_the_course_of_a_replay_is_that_of_its_own_turn():
    """What drew it to the logged heading is taken out again: it turns at 0.2 rad/s, was drawn at 0.1 rad/s."""
    run = logged_run(trace(**turning(T)), CART, course=COURSE)
    drawn = {"body_yaw": 0.2 * T, "drawn_yaw": 0.1 * T}
    place = np.cumsum(0.06 * 0.05 * np.exp(0.3j * T))
    heading = run.channels.index("heading")
    own = run.features({"body_x": place.real, "body_y": place.imag, **drawn})[heading]
    assert own == pytest.approx(run.features(turning(T))[heading], abs=2e-3)


def test_columns_tell_whether_the_heading_is_the_course():
    assert course_of({"body_yaw": {"formula": COURSE}}) == COURSE
    for other in ({}, {"body_yaw": {"column": "yaw"}}, {"body_yaw": "yaw"}, {"body_yaw": {"formula": "radians(yaw)"}}):
        assert course_of(other) == ""
