"""What is compared of a logged run, and the experiment of many, on hand-made logs: no rover drives."""

import math

import numpy as np
import pytest

from rover_pin import Trace, load_rover
from rover_pin.base.formula import evaluate
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import blocks, logged_run

CART, WHEELS = load_rover("cart"), ("fl", "fr", "bl", "br")
T = 0.05 * np.arange(120)
COUNT = 12


def trace(t=T, is_held=False, attrs=None, **channels):
    """A cart along the heading 0.3 at 50 mm/s, its wheels at 1 rad/s under a duty of 0.5."""
    x, y = 0.05 * (t - t[0]) * math.cos(0.3), 0.05 * (t - t[0]) * math.sin(0.3)
    default = {"t_s": t, "body_x": x, "body_y": y, "body_yaw": 0.3 + 0.0 * t, "body_pitch": 0.01 * t, "body_z": 1.0 + t}
    default |= {f"wheel_rate_{wheel}": 1.0 + 0.0 * t for wheel in WHEELS} | {"battery_V": 12.0 + 0.0 * t}
    default |= {} if is_held else {f"duty_{wheel}": 0.5 + 0.0 * t for wheel in WHEELS}
    return Trace({**default, **channels}, attrs={"start": {"x": 0.0, "y": 0.0, "yaw": 0.3}, **(attrs or {})})


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
    gapless = trace(**speeds)
    run = logged_run(trace(**{**speeds, channel: gap(gapless[channel], 5, 6)}), CART)
    for name, row in zip(run.channels, run.observed, strict=True):
        missing = [0, 1, 5, 6] if name in blind else [0, 1]
        assert np.flatnonzero(np.isnan(row)).tolist() == missing, name


def test_what_a_replay_is_given_is_not_compared():
    """Held wheels are given their rates, and nothing draws on a battery; ways and speeds go by what is made of them."""
    speeds = {"body_vx": 0.05 + 0.0 * T, "body_vy": 0.0 * T, "body_vz": 0.0 * T, "rocker_l": 0.0 * T}
    features = ("path", "drift", "heading", "speed", "body_pitch", "body_z", "rocker_l")
    assert set(logged_run(trace(is_held=True, **speeds), CART).channels) == set(features)
    rates = (f"wheel_rate_{wheel}" for wheel in WHEELS)
    assert set(logged_run(trace(**speeds), CART).channels) == {*features, *rates, "battery_V"}
    nothing = logged_run(trace(**speeds, bogie_l=np.nan * T), CART)
    assert "bogie_l" not in nothing.channels


def test_the_heading_is_smoothed_over_half_a_second():
    turned = 0.3 + np.where(T > 3.02, 1.0, 0.0)
    run = logged_run(trace(body_yaw=turned), CART)
    inside = [np.mean(turned[at - 5 : at + 5]) for at in range(10, 110)]
    np.testing.assert_allclose(run.heading[10:110], inside)
    slow = 1.5 * np.arange(30)
    second = logged_run(trace(slow, body_yaw=0.3 + 0.2 * np.sin(slow)), CART)
    np.testing.assert_allclose(second.heading, 0.3 + 0.2 * np.sin(slow), err_msg="rows of 1.5 s are their own mean")
    np.testing.assert_allclose(blocks(slow, 1.5), slow)


def test_blocks_are_means_of_readings_and_height_has_no_zero():
    pitch, height = (seen(trace(), name) for name in ("body_pitch", "body_z"))
    middle = 0.225 + 0.5 * np.arange(COUNT)
    np.testing.assert_allclose(pitch[2:], 0.01 * middle[2:])
    np.testing.assert_allclose(height[2:], middle[2:] - middle[2:].mean())


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
