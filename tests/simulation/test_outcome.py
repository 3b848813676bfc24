"""The outcome of a drive is right for rovers of any size and speed."""

import dataclasses
import re

import numpy as np
import pytest

from rover_pin import Trace, scenario
from rover_pin.simulation.outcome.outcome import drive_outcome

STEEP = {"terrain.angle_deg": 30.0, "terrain.start": -3.0}
CASES = {
    "flat": ("flat", {}, "driving", "drives on at 0.05 m/s, at x = 0.50 m"),
    "backwards": ("flat", {"control.delta": -0.55}, "driving", "drives on at 0.05 m/s, at x = -0.50 m"),
    "a moment": ("flat", {"duration": 0.4}, "driving", "drives on"),
    "a crawl": ("flat", {"control.delta": 0.05}, "driving", "drives on at 0.00"),
    "cart": ("flat", {"rover": "cart"}, "driving", "drives on"),
    "ditch": ("ditch", {}, "stuck", "stuck at x = 0.48 m since 8.2 s: all wheels above S = 0.9"),
    "ditch, passed": ("ditch", {"soil.k": 0.01, "duration": 30.0}, "driving", "drives on"),
    "hills": ("hills", {}, "creeping", "creeps on at 0.01"),
    "net": ("flat", {"form": "net"}, "slid back", "slid back by 7"),
    "steep": ("incline", STEEP, "slid back", "slid back by 0.9"),
    "steep, parked": ("incline", {**STEEP, "control.delta": 0.0}, "slid", "slid back by"),
    "park": ("park", {}, "held", "held: not driven, and moved by only 1"),
    "park, the soil drives": (
        "flat",
        {"control.delta": 0.0, "effect.MotionResistance.R": 0.0, "soil.k": 0.005, "duration": 10.0},
        "held",
        "mm; its wheels swing to and fro at 2.1 Hz, which the soil drives: F(0) > R",
    ),
    "zero duty": ("flat", {"control.delta": 0.0}, "held", "held: not driven"),
    "weak": (
        "flat",
        {"control.delta": 0.02, "gear_friction": 0.2},
        "stalled",
        "stalled from the start: no wheel turns",
    ),
    "slip control": ("ditch", {"control": "true"}, "stalled", "no wheel turns at a duty of 0.0"),
    "skid-steer on the spot": (
        "point-turn",
        {
            "rover": "cart",
            "duration": 33.0,
            "side": "shear",
            "soil.k": 0.00733,
            "soil.k_1": 4.68e4,
            "motor.resistance": 45.0,
        },
        "stalled",
        "nearly stalled since 3.4 s: the wheels creep at 2.9 mm/s, 1.6 % of their speed without a load",
    ),
    "on the spot": (
        "point-turn",
        {"duration": 10.0, "soil.k": 0.003},
        "driving",
        "turns left on the spot at 9.9 deg/s, at x = 0.00 m, turned by 9",
    ),
    "a wide turn": ("turn", {"duration": 8.0, "soil.k": 0.003}, "driving", "drives on at 0.03"),
    "buried": ("flat", {"soil.k_1": 8e3}, "ended", "buried: "),
}


@pytest.fixture(scope="module")
def traces():
    return {
        name: scenario(scene, soil="table-1", **settings).drive() for name, (scene, settings, _, _) in CASES.items()
    }


@pytest.mark.parametrize("name", CASES)
def test_a_drive_states_its_outcome(traces, name):
    kind, words = CASES[name][2:]
    assert drive_outcome(traces[name]).kind == kind
    assert words in traces[name].attrs["outcome"]
    assert traces[name].summary()["outcome"] == traces[name].attrs["outcome"]


def scaled(trace, length, time):
    """Return the drive of a rover that is `length` times as large and takes `time` times as long."""
    by = {"m": length, "m/s": length / time, "rad/s": 1.0 / time, "s": time}
    channels = {name: values * by.get(trace.units[name], 1.0) for name, values in trace.channels.items()}
    radii = [length * r for r in trace.attrs["wheel_radii_m"]]
    return Trace(channels, trace.units, {**trace.attrs, "wheel_radii_m": radii})


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(("length", "time"), [(0.02, 0.1), (20.0, 100.0), (1.0, 1e3)])
def test_it_is_the_same_for_a_rover_of_another_size_and_pace(traces, name, length, time):
    outcome, there = drive_outcome(traces[name]), drive_outcome(scaled(traces[name], length, time))
    assert there.kind == outcome.kind
    assert there.since == pytest.approx(time * outcome.since, nan_ok=True)


def test_stuck_since_is_when_the_body_stopped(traces):
    trace = traces["ditch"]
    since = drive_outcome(trace).since
    before, after = np.interp([since - 1.0, since], trace.t, trace["body_x"])
    assert after - before > 0.01
    assert abs(trace["body_x"][-1] - after) < 0.01


def test_creeping_wheels_are_reported_by_speed_and_duty_share(traces):
    trace = traces["skid-steer on the spot"]
    late, r = trace.t >= drive_outcome(trace).since, float(np.mean(trace.attrs["wheel_radii_m"]))
    rate = np.mean(np.abs(trace.stack("wheel_rate")[late]))
    outcome = trace.attrs["outcome"]
    creep, percent = (float(number) for number in re.search(r"creep at (\S+) mm/s, (\S+) %", outcome).groups())
    assert 1e3 * r * rate == pytest.approx(creep, abs=0.06)
    share = rate / float(scenario("flat", rover="cart").model.motor.no_load_rate)
    assert 100.0 * share == pytest.approx(percent, abs=0.5), "by energies, which the faster side weighs more"
    turn = np.degrees(trace["body_yaw"][-1] - trace["body_yaw"][0])
    assert outcome.endswith(f"turned by {turn:.0f} deg")
    assert "wheel turns" not in outcome


def test_a_measured_trace_without_the_truth_has_no_outcome(traces):
    bare = {name: traces["flat"][name] for name in ("t_s", "body_x", "body_y", "wheel_rate_fl", "duty_fl")}
    assert drive_outcome(Trace(bare)) is None
    assert "outcome" not in Trace(bare).summary()


@pytest.mark.parametrize(
    ("slope", "kind"), [(1.0, "drives on"), (5.0, "drives on"), (15.0, "slides sideways"), (25.0, "slides sideways")]
)
def test_a_rover_that_slides_sideways_does_not_just_drive_on(slope, kind):
    """The rover drives across a slope of the paper's sand. The stated speeds are those of the body along and across its
    heading.
    """
    trace = scenario("cross-slope", duration=8.0, **{"terrain.angle_deg": slope, "soil": "table-1"}).drive()
    outcome = trace.attrs["outcome"]
    rows = max(1, len(trace.t) // 20)
    aside = abs(trace["body_y"][-1] - trace["body_y"][-1 - rows]) / (trace.t[-1] - trace.t[-1 - rows])
    match = re.search(r"(?:slides|sliding) sideways at ([\d.]+) m/s", outcome)
    assert outcome.startswith(kind)
    assert (match is None) is (slope == 1.0)
    assert match is None or float(match[1]) == pytest.approx(aside, rel=0.12)


@pytest.mark.parametrize(("rover", "at_full_duty"), [("cart", 0.153), ("nexus6", 0.106)])
@pytest.mark.parametrize("duty", [1e-5, 0.01, 0.03, 0.1])
def test_a_rocking_rover_is_described_by_its_mean_motion(rover, at_full_duty, duty):
    """A cart without resistance, at a duty of 1e-5, swings with a speed of 0.019 m/s. Only its mean motion counts,
    which has the sign of its duty.
    """
    settings = {"control.delta": duty, "effect.MotionResistance.R": 0.0, "soil.k": 0.005}
    trace = scenario("flat", rover=rover, duration=10.0, soil="table-1", **settings).drive()
    outcome = trace.attrs["outcome"]
    match = re.search(r"(?:drives on|moves) at (-?[\d.e-]+) m/s", outcome)
    assert float(match[1]) == pytest.approx(duty * at_full_duty, rel=0.2, abs=3e-4)
    rocks = duty == 1e-5 or (rover, duty) == ("cart", 0.01)
    assert drive_outcome(trace).kind == ("rocking" if rocks else "driving")


@pytest.mark.parametrize("duty", [1e-5, 0.01])
def test_a_rover_that_rolls_back_does_not_drive_on(duty):
    trace = scenario("park", rover="cart", duration=10.0, **{"control.delta": duty}).drive()
    assert re.search(r" at 0\.001\d m/s, at x = -0\.0", trace.attrs["outcome"])
    assert drive_outcome(trace).kind == "slid back"


def test_a_pause_at_the_end_is_no_stall():
    drive = scenario("flat", soil="table-1", duration=8.0)
    stopped = dataclasses.replace(drive, controller=lambda reading: 0.55 if reading.t < 4.0 else 0.0).drive()
    assert drive_outcome(stopped).kind == "stopped"
    assert drive_outcome(stopped).since == pytest.approx(4.0, abs=0.1)
    assert "driven since 4" in stopped.attrs["outcome"]


R, COUNT = 0.1, 201
T = 0.1 * np.arange(COUNT)
LATE = T > 10.05


def trace(rate=1.0, travel=0.05, duty=0.5, gave=1.0, count=COUNT, attrs=None, **channels):
    """Return the trace of two wheels of radius 10 cm for 20 s, with rates [rad/s] and travel speed [m/s]. `gave` is the
    mechanical power for 1 W of electric power.
    """
    t = T[:count]
    way = 0.1 * np.cumsum(np.resize(travel, count))
    default = {"t_s": t, "body_x": way - way[0], "body_y": 0.0 * t, "body_yaw": 0.0 * t}
    default |= {"energy_motor": gave * t, "energy_electric": t}
    for wheel, at in (("a", 0), ("b", -1)):
        for name, values in (("wheel_rate", rate), ("travel", travel), ("duty", duty)):
            wheel_values = values[at] if isinstance(values, tuple) else values
            default[f"{name}_{wheel}"] = np.resize(np.asarray(wheel_values, dtype=float), count)
    resized = {name: np.resize(np.asarray(values, dtype=float), count) for name, values in channels.items()}
    return Trace({**default, **resized}, attrs={"wheel_radii_m": [R, R], "wheels": ["a", "b"], **(attrs or {})})


def told(**channels):
    outcome = drive_outcome(trace(**channels))
    return outcome.kind, outcome.sentence


def numbers(sentence):
    """Return the numbers of a sentence with their names and units: "x = 1.00 m", "0.05 m/s"."""
    return re.findall(r"(?:[xyS] = )?-?\d[\d.]*(?: (?:mm/s|m/s|deg/s|deg|mm|m|s|%|Hz)(?![\w/]))?", sentence)


@pytest.mark.parametrize(
    ("travel", "kind"), [(0.0504, "driving"), (0.0495, "creeping"), (0.0101, "creeping"), (0.0099, "stuck")]
)
def test_half_of_rim_travel_is_driving_below_a_tenth_is_stuck(travel, kind):
    """The rims turn at 0.1 m/s, forwards or backwards, in the direction of the duty."""
    for sign in (1.0, -1.0):
        outcome, sentence = told(rate=sign, travel=sign * travel, duty=0.5 * sign)
        assert outcome == kind
        place = f"x = {20.0 * sign * travel:.2f} m"
        assert numbers(sentence) == ([place] if kind == "stuck" else [f"{travel:.2g} m/s", place])


def test_stuck_begins_after_the_last_radius_with_some_travel():
    """From 10 s on, the rover moves at 5 mm/s while its rims turn at 100 mm/s; before, it moves at 50 mm/s. The last
    wheel radius with a tenth of travel begins 0.11 s before 10 s.
    """
    outcome = drive_outcome(trace(travel=np.where(LATE, 0.005, 0.05), slip_a=0.989, slip_b=0.962))
    assert outcome.kind == "stuck"
    assert outcome.since == pytest.approx(9.9), "one row at 50 mm/s and nine at 5 are 9.5 % of what the rims turn"
    assert numbers(outcome.sentence) == ["x = 0.55 m", "9.9 s", "S = 0.96"]
    assert drive_outcome(trace(travel=0.0)).since == 0.0, "from its first row on"
    halting = drive_outcome(trace(travel=np.where(T < 5.05, 0.0, np.where(LATE, 0.005, 0.05))))
    assert halting.since == outcome.since, "it was free in between"
    assert drive_outcome(trace(travel=0.0, slip_a=0.057, slip_b=0.9)).sentence.endswith("S = 0.05")
    assert "S =" not in drive_outcome(trace(travel=0.0, slip_a=-0.2, slip_b=0.9)).sentence
