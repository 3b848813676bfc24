"""What a drive came to, on traces of constant speeds that lie just within and just beyond each limit of the words."""

import re

import numpy as np
import pytest

from rover_pin.simulation.outcome.outcome import drive_outcome
from rover_pin.simulation.trace.trace import Trace

R, COUNT = 0.1, 201
T = 0.1 * np.arange(COUNT)
LATE = T > 10.05


def trace(rate=1.0, travel=0.05, duty=0.5, gave=1.0, count=COUNT, attrs=None, **channels):
    """Two wheels of 10 cm radius for 20 s: rates [rad/s], travel [m/s], `gave` the mechanical of 1 W electric power."""
    t = T[:count]
    way = 0.1 * np.cumsum(np.resize(travel, count))
    usual = {"t_s": t, "body_x": way - way[0], "body_y": 0.0 * t, "body_yaw": 0.0 * t}
    usual |= {"energy_motor": gave * t, "energy_electric": t}
    for wheel, at in (("a", 0), ("b", -1)):
        for name, values in (("wheel_rate", rate), ("travel", travel), ("duty", duty)):
            own = values[at] if isinstance(values, tuple) else values
            usual[f"{name}_{wheel}"] = np.resize(np.asarray(own, dtype=float), count)
    given = {name: np.resize(np.asarray(values, dtype=float), count) for name, values in channels.items()}
    return Trace({**usual, **given}, attrs={"wheel_radii_m": [R, R], "wheels": ["a", "b"], **(attrs or {})})


def told(**given):
    found = drive_outcome(trace(**given))
    return found.kind, found.sentence


def numbers(sentence):
    """The numbers of a sentence, with their units and what they are of: "x = 1.00 m", "0.05 m/s"."""
    return re.findall(r"(?:[xyS] = )?-?\d[\d.]*(?: (?:mm/s|m/s|deg/s|deg|mm|m|s|%|Hz)(?![\w/]))?", sentence)


@pytest.mark.parametrize(
    ("travel", "kind"), [(0.0504, "driving"), (0.0495, "creeping"), (0.0101, "creeping"), (0.0099, "stuck")]
)
def test_half_of_rim_travel_is_driving_below_a_tenth_is_stuck(travel, kind):
    """The rims turn at 0.1 m/s, forwards or backwards as the duty asks."""
    for sign in (1.0, -1.0):
        found, said = told(rate=sign, travel=sign * travel, duty=0.5 * sign)
        assert found == kind
        place = f"x = {20.0 * sign * travel:.2f} m"
        assert numbers(said) == ([place] if kind == "stuck" else [f"{travel:.2g} m/s", place])


def test_stuck_begins_after_the_last_radius_with_some_travel():
    """At 5 mm/s of 100 mm/s since 10 s, at 50 mm/s before: 0.11 s before that a last radius begins with a tenth."""
    found = drive_outcome(trace(travel=np.where(LATE, 0.005, 0.05), slip_a=0.989, slip_b=0.962))
    assert found.kind == "stuck"
    assert found.since == pytest.approx(9.9), "one row at 50 mm/s and nine at 5 are 9.5 % of what the rims turn"
    assert numbers(found.sentence) == ["x = 0.55 m", "9.9 s", "S = 0.96"]
    assert drive_outcome(trace(travel=0.0)).since == 0.0, "from its first row on"
    halting = drive_outcome(trace(travel=np.where(T < 5.05, 0.0, np.where(LATE, 0.005, 0.05))))
    assert halting.since == found.since, "it was free in between"
    assert drive_outcome(trace(travel=0.0, slip_a=0.057, slip_b=0.9)).sentence.endswith("S = 0.05")
    assert "S =" not in drive_outcome(trace(travel=0.0, slip_a=-0.2, slip_b=0.9)).sentence


def test_pause_keeps_the_previous_direction_or_forwards():
    pause = np.where((T > 5.0) & (T < 7.0), 0.0, -0.5)
    kind, said = told(duty=pause, rate=-1.0, travel=-0.06)
    assert (kind, numbers(said)[0]) == ("driving", "0.06 m/s")
    pause = np.where((T > 15.0) & (T < 17.0), 0.0, -0.5)
    assert told(duty=pause, rate=-1.0, travel=np.where(pause == 0.0, 0.2, -0.06))[0] == "slid back"
    assert "199 mm" in told(duty=np.where(T > 0.05, 0.0, -0.5), rate=-1.0, travel=-0.01)[1]
    late = np.where(T < 5.0, 0.0, -0.5)
    assert told(duty=late, rate=-1.0, travel=np.where(late == 0.0, 0.03, -0.06))[0] == "driving"
    assert told(duty=late, rate=-1.0, travel=np.where(T < 2.5, 0.1, np.where(late == 0.0, -0.1, -0.06)))[0] == "driving"


def test_ended_drive_reports_its_place_and_a_single_row_nothing():
    found = drive_outcome(trace(attrs={"stop": "capsized: roll 61 deg"}))
    assert (found.kind, found.since) == ("ended", 20.0)
    assert numbers(found.sentence) == ["61 deg", "x = 1.00 m"]
    assert drive_outcome(trace(count=1)) is None
    assert drive_outcome(trace(count=2)).kind == "driving"
    assert drive_outcome(trace(attrs={"wheels": ["a", "c"]})) is None
    bare = trace()
    del bare.attrs["wheel_radii_m"]
    assert drive_outcome(bare) is None


@pytest.mark.parametrize("count", [3, 12, 30])
def test_a_short_drive_is_judged_by_two_rows_at_least(count):
    assert told(count=count, rate=0.0, travel=0.0, gave=0.0)[0] == "stalled"
    assert numbers(told(count=count, rate=1.0, travel=0.06)[1])[0] == "0.06 m/s"


def test_rims_that_turn_beyond_rounding_are_stuck():
    """A file's rates of 1e17 rad/s: a radius more is lost in what the rims have turned."""
    assert drive_outcome(trace(rate=1e17, gave=1.0)).kind == "stuck"


@pytest.mark.parametrize("radii", [None, "0.1", {"a": 0.1}, [0.1], [0.1, 0.0], [0.1, float("nan")]])
def test_a_trace_without_radii_comes_to_nothing(radii):
    assert drive_outcome(trace(attrs={"wheel_radii_m": radii})) is None
