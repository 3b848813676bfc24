"""What a drive came to, on traces of constant speeds that lie just within and just beyond each limit of the words."""

import math
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


def test_a_rover_is_driven_by_one_wheel():
    assert told(duty=(0.5, 0.0), travel=0.06)[0] == "driving"
    assert told(duty=(0.0, np.where(LATE, 0.0, 0.5)), travel=0.06)[0] == "stopped"


def test_a_rover_that_has_not_turned_by_a_radius_drives():
    assert told(rate=0.0049 / R, travel=0.0)[0] == "driving"
    assert told(rate=0.0051 / R, travel=0.0)[0] == "stuck"


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


@pytest.mark.parametrize(
    ("gave", "rate", "stalls"), [(0.049, 0.049, True), (0.051, 0.049, False), (0.049, 0.051, False)]
)
def test_motors_stall_below_a_twentieth_of_speed(gave, rate, stalls):
    """In the last tenth of 20 s, 2 s: 0.05 rad/s are a tenth of a radius."""
    for sign in (1.0, -1.0):
        assert (told(rate=sign * rate, travel=0.0, gave=sign * gave)[0] == "stalled") is stalls


def test_creeping_motors_are_reported_by_their_no_load_share():
    kind, said = told(rate=0.049, travel=0.0, gave=0.032, duty=(0.2, 0.4))
    assert kind == "stalled"
    assert numbers(said)[:3] == ["4.9 mm/s", "3.2 %", "0.3"]
    assert numbers(told(rate=0.0049, travel=0.0, gave=0.01)[1])[0] == "0.5"
    assert "creep" in told(rate=0.0051, travel=0.0, gave=0.01)[1]


def test_motors_stall_since_they_turned_last():
    """Two seconds, a tenth of the drive, are looked at at once: they turn until 10 s."""
    later = T - 10.0
    motor = np.where(LATE, 10.0 + 0.01 * later, T)
    found = drive_outcome(trace(rate=np.where(LATE, 0.0, 1.0), travel=np.where(LATE, 0.0, 0.05), energy_motor=motor))
    assert found.kind == "stalled"
    assert found.since == pytest.approx(10.0)
    assert numbers(found.sentence)[0] == "10.0 s"
    motor = np.where(LATE, 10.0 + 0.03 * later, T)
    crept = told(rate=np.where(LATE, 0.02, 1.0), travel=np.where(LATE, 0.0, 0.05), energy_motor=motor)[1]
    assert numbers(crept)[:3] == ["10.0 s", "2 mm/s", "3 %"]


@pytest.mark.parametrize(("back", "words"), [(0.099, ""), (0.101, "101 mm"), (0.49, "490 mm"), (0.52, "0.52 m")])
def test_a_radius_back_is_told(back, words):
    found = drive_outcome(trace(travel=np.where(LATE, -back / 10.0, 0.05)))
    assert (found.kind == "slid back") is bool(words)
    if words:
        assert found.since == pytest.approx(10.0)
        assert numbers(found.sentence)[:2] == [words, "10.0 s"]


@pytest.mark.parametrize(("row", "words"), [(4, "start"), (5, "since 0.5 s")])
def test_a_fiftieth_of_the_drive_is_its_start(row, words):
    assert words in told(travel=np.where(np.arange(COUNT) > row, -0.05, 0.05))[1]


@pytest.mark.parametrize(("far", "kind"), [(0.0099, "held"), (0.0101, "slid")])
def test_undriven_rover_is_held_within_a_tenth_of_a_radius(far, kind):
    for sense, word in ((1.0, "forwards"), (-1.0, "back")):
        x, y = 3.2 + 0.6 * far * sense * T / 20.0, 0.8 * far * T / 20.0 - 1.1
        found, said = told(duty=0.0, rate=0.0, travel=0.001 * sense, body_x=x, body_y=y)
        assert found == kind
        place = [f"x = {3.2 + 0.006 * sense:.2f} m", "y = -1.09 m"]
        assert numbers(said) == (["9.9 mm"] if kind == "held" else ["10 mm", *place])
        assert (word in said) is (kind == "slid")
    found, said = told(duty=0.0, rate=0.0, travel=0.0, body_x=np.where((T > 4.0) & (T < 6.0), 0.05, 0.0))
    assert found == "slid", "there and back"


def swing(f=0.5, amplitude=0.1, offset=0.0):
    rates = amplitude * (np.sin(2 * math.pi * f * T + 0.3) + offset)
    return told(duty=0.0, rate=rates, travel=0.0, body_x=0.0)[1]


def test_swing_is_a_tenth_of_a_radius_in_the_later_half():
    """Amplitude a: 2 a / pi on average, for 10 s; an offset c is c / (sqrt(1 - c^2) + c asin c) pi / 2 of it as net."""
    assert [("swing" in said, "0.5 Hz" in said) for said in (swing(), swing(f=0.8))] == [(True, True), (True, False)]
    assert "swing" in swing(amplitude=1.05 * math.pi / 200.0)
    assert "swing" not in swing(amplitude=0.95 * math.pi / 200.0)
    assert "swing" in swing(offset=-0.3)
    assert "swing" not in swing(offset=-0.36)
    assert "swing" not in swing(offset=0.36)


@pytest.mark.parametrize(("changes", "swings"), [(3, False), (4, True)])
def test_four_changes_of_sense_are_a_swing(changes, swings):
    """At 10, 12, ... s, of both wheels; those of the first half do not count."""
    sense = np.where(T < 10.5, np.sign(np.sin(30.0 * T)), (-1.0) ** np.minimum((T - 10.5) // 2.0, changes))
    sense = np.where(T < 10.0, sense, np.where(T < 10.5, 1.0, sense))
    assert ("swing" in told(duty=0.0, rate=0.1 * sense, travel=0.0, body_x=0.0)[1]) is swings


def test_the_later_half_begins_with_its_middle_row():
    """Of 201 rows the 101st: a change of sense that follows it counts."""
    sense = (-1.0) ** np.searchsorted([101, 121, 141, 161], np.arange(COUNT), side="right")
    assert "swing" in told(duty=0.0, rate=0.1 * sense, travel=0.0, body_x=0.0)[1]
    before = (-1.0) ** np.searchsorted([100, 121, 141, 161], np.arange(COUNT), side="right")
    assert "swing" not in told(duty=0.0, rate=0.1 * before, travel=0.0, body_x=0.0)[1]


def test_a_rover_that_is_no_longer_driven_has_stopped_since():
    found = drive_outcome(trace(duty=np.where(LATE, 0.0, 0.5), travel=np.where(LATE, 0.002, 0.05)))
    assert found.kind == "stopped"
    assert found.since == pytest.approx(10.1)
    assert numbers(found.sentence) == ["10.1 s", "20 mm", "x = 0.52 m"]


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


@pytest.mark.parametrize(("share", "spot"), [(0.19, True), (0.21, False)])
def test_rover_turns_on_the_spot_if_its_body_moves_a_fifth(share, spot):
    turn = {"duty": (-0.5, 0.5), "rate": (-1.0, 1.0), "travel": (-0.06, 0.06)}
    place = {"body_x": 0.8 * 0.06 * share * T, "body_y": -0.6 * 0.06 * share * T}
    for sense, word in ((0.1, "left"), (-0.1, "right")):
        kind, said = told(**turn, **place, body_yaw=sense * T)
        assert kind == "driving"
        assert said.startswith(
            f"turns {word} on the spot at 5.7 deg/s, at x" if spot else "drives on at 0.013 m/s, at x"
        )
        assert said.endswith(f", turned by {math.degrees(20.0 * sense):.0f} deg")


@pytest.mark.parametrize(("turned", "words"), [(4.9, False), (5.1, True), (-5.1, True)])
def test_five_degrees_are_a_turn(turned, words):
    said = told(rate=1.0, travel=0.06, body_x=0.0, body_yaw=2.0 + math.radians(turned) * T / 20.0)[1]
    assert (f"turned by {turned:.0f} deg" in said) is words
    assert ("spot" in said) is words


def test_wheels_that_turn_on_the_spot_and_slip_much_say_so():
    said = told(rate=1.0, travel=0.04, body_x=0.0, body_yaw=0.1 * T)[1]
    assert numbers(said)[:2] == ["5.7 deg/s", "x = 0.00 m"]
    assert "slip" in said


def test_the_pace_is_that_of_the_last_twentieth():
    """Of 201 rows the last ten steps, a second: of which it went half at 60 mm/s, half at 80."""
    assert numbers(told(travel=np.where(T > 19.55, 0.08, 0.06))[1])[0] == "0.07 m/s"
    yaw = 0.1 * T + np.where(T > 19.55, 0.05 * (T - 19.5), 0.0)
    assert "at 7.2 deg/s" in told(rate=1.0, travel=0.06, body_x=0.0, body_yaw=yaw)[1]


def test_lateral_position_is_reported_from_half_a_centimetre():
    assert told(body_x=1.0, body_y=0.004)[1].endswith("at x = 1.00 m")
    assert told(body_x=1.0, body_y=-0.006)[1].endswith("at x = 1.00 m, y = -0.01 m")


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


def test_a_drive_whose_heading_nobody_saw_is_told_without_it():
    whole = trace(travel=0.06)
    bare = Trace({name: whole[name] for name in whole if name != "body_yaw"}, attrs=whole.attrs)
    assert numbers(drive_outcome(bare).sentence) == ["0.06 m/s", "x = 1.20 m"]


def test_rates_are_over_the_time_that_they_took():
    """Rows twice as far apart."""
    assert told(t_s=2.0 * T, rate=1.0, travel=0.06, body_x=-0.001, body_yaw=0.1 * T)[1].startswith(
        "turns left on the spot at 2.9 deg/s, at x = 0.00 m"
    )
    slow = told(t_s=200.0 * T, rate=0.01, travel=6e-4, body_x=0.0, body_yaw=0.1 * T)[1]
    assert slow.startswith("turns left on the spot at 0.029 deg/s")
    assert told(t_s=2.0 * T, rate=1.0, travel=0.06, body_x=0.12 * T)[1].startswith("drives on at 0.06 m/s")
    assert "creep at 2.4 mm/s" in told(t_s=2.0 * T, rate=0.024, travel=0.0, gave=0.01)[1]
