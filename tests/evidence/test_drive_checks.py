"""The check of drive logs: every fault of a log in one sentence, and a good log without one."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from rover_pin.errors import DataError
from rover_pin.evidence.drive_checks import check, faults, findings, refuse_unfit, too_poor
from rover_pin.evidence.driven import Driven
from rover_pin.motion.channels import WHEELS
from rover_pin.motion.drive_log import About, DriveLog, read_drive_log, write_drive_log
from rover_pin.motion.trace import Trace

R = 0.045
MOTOR = {
    "supply": {"value": 7.2, "unit": "V"},
    "resistance": {"value": 24.0, "unit": "ohm"},
    "note": "bench",
}


def commands(seed, duration, dt=0.04, constant=None):
    """Duties (T, 6): holds of 3 s with a little for every wheel, a pause, a reversal, a staircase down at the end."""
    random, t = np.random.default_rng(seed), np.arange(0.0, duration, dt)
    if constant is not None:
        return t, np.full((len(t), 6), constant)
    hold = (t // 3.0).astype(int)
    duty = random.uniform(0.45, 0.85, hold.max() + 1)[hold][:, None] + random.uniform(-0.09, 0.09, 6)
    late = t > 0.6 * duration
    duty[(t > 0.4 * duration) & (t < 0.4 * duration + 7.0)] = 0.0
    duty[late & (t < 0.75 * duration)] *= -1.0
    low = t > 0.9 * duration
    duty[low] = (0.3 - 0.24 * (t[low] - 0.9 * duration) / (0.1 * duration))[:, None].round(2)
    return t, duty


def drive(seed=0, duration=60.0, yaw=0.0, noise=1.0, constant=None, hill=0.12):
    """A plain kinematic rover: rates follow duties, slip grows with the slope, sensors are noisy."""
    t, duty = commands(seed, duration, constant=constant)
    random, dt = np.random.default_rng(seed + 100), t[1] - t[0]
    rate = 2.2 * duty
    s, z, pitch = np.zeros(len(t)), np.zeros(len(t)), np.zeros(len(t))
    for i in range(1, len(t)):
        slope = hill * math.sin(4.0 * s[i - 1] + 0.3)
        slip = 0.04 + 2.0 * max(slope, 0.0)
        s[i] = s[i - 1] + dt * R * rate[i].mean() * (1.0 - slip) * math.cos(slope)
        z[i], pitch[i] = z[i - 1] + (s[i] - s[i - 1]) * math.tan(slope), -slope
    sees = lambda sd: noise * sd * random.standard_normal(len(t))  # noqa: E731
    channels = {"t_s": t}
    for i, wheel in enumerate(WHEELS):
        channels[f"duty_{wheel}"] = duty[:, i]
        channels[f"wheel_rate_{wheel}"] = rate[:, i] + sees(0.01)
        channels[f"current_{wheel}_A"] = 0.1 * duty[:, i] + sees(0.002)
    channels |= {"body_x": s * math.cos(yaw) + sees(0.0015), "body_y": s * math.sin(yaw) + sees(0.0015)}
    channels |= {"body_z": z + sees(0.0015), "body_yaw": yaw + sees(0.005), "body_roll": sees(0.005)}
    channels |= {"body_pitch": pitch + sees(0.005), "battery_V": 7.2 + sees(0.01)}
    rocker = 0.02 * np.sin(t)
    channels |= {"rocker_l": rocker + sees(0.003), "rocker_r": -rocker + sees(0.003)}
    return channels


def log_of(*runs, **about):
    about = {"motor": MOTOR, **about}
    traces = tuple(Trace(run, {}, {"file": f"run-{i}.csv", "wheels": list(WHEELS)}) for i, run in enumerate(runs, 1))
    return DriveLog(Path("field"), About("field", **about), traces)


GOOD = [drive(0), drive(1, yaw=math.pi), drive(0)]
"""Both headings, a repeat, a pause, a reversal, a staircase."""


def changed(**changes):
    """The good log with channels of its first run changed; None takes one out."""
    first = {name: values for name, values in {**GOOD[0], **changes}.items() if values is not None}
    return log_of(first, *GOOD[1:])


def starting(prefix, change):
    return {name: change(values) for name, values in GOOD[0].items() if name.startswith(prefix)}


def gap(values, begin, end):
    values = np.array(values)
    values[begin:end] = np.nan
    return values


def held(name, begin, end, value=None):
    values = np.array(GOOD[0][name])
    values[begin:end] = values[begin] if value is None else value
    return values


def test_a_good_log_has_no_fault_and_lacks_nothing():
    found = check(log_of(*GOOD))
    assert [str(each) for each in found.found] == []
    assert found.too_poor == ""


X, T = GOOD[0]["body_x"], GOOD[0]["t_s"]


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (
            changed(wheel_rate_ml=None, wheelrate_ml=X),
            "field/run-1.csv: there is no column 'wheel_rate_ml'; did you mean 'wheelrate_ml'? rename it, or record "
            "it: duties, wheel rates and body_x, body_y, body_yaw are needed.",
        ),
        (changed(body_yaw=None), "there is no column 'body_yaw'; record it"),
        (changed(body_x=gap(X, 0, None)), "field/run-1.csv: body_x has no value; record it, or leave the run out."),
        (changed(body_z=held("body_z", 9, 12, np.inf)), "body_z is inf at t = 0.36 s (row 10); leave cells without a"),
        (changed(body_x=gap(X, 100, 1000)), "body_x is missing in 60 % of the run; a run needs 50 % of it"),
        (changed(**starting("wheel_rate", lambda w: w * 30 / math.pi)), "the wheel rates look like rpm; give rad/s"),
        (changed(**starting("wheel_rate", np.degrees)), "the wheel rates look like deg/s; give rad/s"),
        (changed(**starting("wheel_rate", lambda w: w / 2 / math.pi)), "look like turns per second"),
        (
            changed(body_x=1e3 * X, body_y=1e3 * GOOD[0]["body_y"]),
            "body_x and body_y look like millimetres; give metres",
        ),
        (changed(body_x=1e2 * X, body_y=1e2 * GOOD[0]["body_y"]), "look like centimetres"),
        (changed(**starting("wheel_rate", lambda w: 30.0 * w)), "check the units of wheel_rate_*, body_x and body_y"),
        (changed(t_s=1e3 * T), "samples lie 40 s apart; if t_s is in milliseconds divide it by 1000"),
        (changed(body_pitch=np.degrees(GOOD[0]["body_pitch"])), "body_pitch reaches 7.58 rad at t = 6.16 s (row 155)"),
        (
            changed(body_pitch=np.degrees(GOOD[0]["body_pitch"]) / 5.0),
            "body_pitch changes 11 times as much as the climb",
        ),
        (changed(rocker_l=np.degrees(3 * GOOD[0]["rocker_l"])), "rocker_l reaches"),
        (changed(body_yaw=np.degrees(GOOD[0]["body_yaw"] + 1.5)), "body_yaw"),
        (changed(battery_V=1e3 * GOOD[0]["battery_V"]), "battery_V is 7.2e+03 V in the middle; if it is in mV"),
        (changed(**starting("current", lambda i: 1e3 * i)), "current_fl_A is 48.2 A in the middle; if it is in mA"),
        (
            changed(wheel_rate_fl=-GOOD[0]["wheel_rate_fl"]),
            "wheel_rate_fl runs against duty_fl; multiply wheel_rate_fl",
        ),
        (changed(duty_rr=-GOOD[0]["duty_rr"]), "duty_rr runs against wheel_rate_rr; multiply duty_rr by -1"),
        (changed(current_rr_A=-GOOD[0]["current_rr_A"]), "current_rr_A runs against duty_rr; multiply it by -1"),
        (changed(body_yaw=GOOD[0]["body_yaw"] + math.pi), "travels 180 deg off its heading, body_yaw; add pi"),
        (changed(body_x=GOOD[0]["body_y"], body_y=X), "travels 90.2 deg off its heading, body_yaw; check the axes"),
        (changed(body_pitch=-GOOD[0]["body_pitch"]), "body_pitch rises where the rover climbs; multiply it by -1"),
        (changed(wheel_rate_fr=np.full(len(T), 1.1)), "wheel_rate_fr is 1.1 rad/s all along while the rover drives"),
        (changed(body_x=0 * X, body_y=0 * X), "body_x and body_y stand still while the rims roll"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_sentence(log, says):
    with pytest.raises(DataError) as refused:
        refuse_unfit(log)
    assert says in str(refused.value)
    assert str(refused.value).count("\n") == 0


def test_a_yaw_in_degrees_is_told_from_the_course():
    run = drive(3, yaw=math.radians(20.0))
    assert "body_yaw looks like degrees" in str(faults(log_of(run | {"body_yaw": np.degrees(run["body_yaw"])}))[0])


def test_the_same_fault_in_every_run_is_one_sentence():
    log = log_of(*({**run, "wheel_rate_fl": -run["wheel_rate_fl"]} for run in GOOD))
    (fault,) = faults(log)
    assert fault.where == "run-1.csv, run-2.csv, run-3.csv"
    two = changed(wheel_rate_fl=-GOOD[0]["wheel_rate_fl"], duty_rr=-GOOD[0]["duty_rr"])
    with pytest.raises(DataError, match=r"\(1 more such faults\.\)"):
        check(two)


def test_without_height_the_declared_terrain_tells_the_pitchs_sign(tmp_path):
    (tmp_path / "ground.csv").write_text("x_m,z_m\n-10,-2\n0,0\n0.4,0.03\n0.8,0.0\n10,0.0\n")
    run = {**GOOD[0], "body_z": None}
    run = {name: values for name, values in run.items() if values is not None}
    slope = np.interp(run["body_x"], [0.0, 0.4, 0.4001, 0.8, 0.8001], [0.075, 0.075, -0.075, -0.075, 0.0])
    run["body_pitch"] = np.where(run["body_x"] < 0.0, 0.2, slope)
    log = dataclasses.replace(log_of(run, terrain={"polyline": "ground.csv"}), folder=tmp_path)
    assert "body_pitch rises where the rover climbs" in str(faults(log)[0])
    log = dataclasses.replace(
        log_of(run | {"body_pitch": -run["body_pitch"]}, terrain=log.about.terrain), folder=tmp_path
    )
    assert faults(log) == ()


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (
            changed(body_x=gap(X, 100, 200)),
            "run-1.csv: body_x is missing for 4 s from t = 4 s on (row 101); the 7 % of the run that it lacks are "
            "passed over.",
        ),
        (changed(wheelrate_fl=X), "run-1.csv: column 'wheelrate_fl' is not read; did you mean wheel_rate_fl"),
        (changed(humidity=X), "run-1.csv: column 'humidity' is not read; leave it out, if it matters."),
        (changed(body_z=None), "body_z not recorded; effects that only the sinkage shows"),
        (changed(wheel_rate_fl=held("wheel_rate_fl", 100, 250)), "wheel_rate_fl stays at 1"),
        (changed(wheel_rate_fl=np.minimum(GOOD[0]["wheel_rate_fl"], 1.1)), "wheel_rate_fl stays at its extreme, 1.1,"),
        (changed(rocker_l=0.01 * np.ones(len(T)), rocker_r=-0.01 * np.ones(len(T))), "rocker_l is 0.01 rad all along"),
        (changed(body_x=held("body_x", 300, 303, 0.9)), "body_x jumps by"),
        (changed(body_yaw=held("body_yaw", 300, 303, 0.5)), "body_yaw jumps by 28"),
        (changed(wheel_rate_ml=held("wheel_rate_ml", 300, 302, 40.0)), "wheel_rate_ml spikes to 40 rad/s"),
        (changed(rocker_l=GOOD[0]["rocker_l"] + 0.05), "rocker_l + rocker_r is 0.050 rad in the mean (SD 0.004)"),
        (changed(battery_V=0.5 * GOOD[0]["battery_V"]), "battery_V is 3.6 V in the median, the motor's supply 7.2 V"),
        (changed(current_ml_A=8 * GOOD[0]["current_ml_A"]), "times the declared motor's stall current"),
        (changed(body_x=1.4 * X), "the rover outruns its rims"),
        (changed(t_s=T + 0.5 * (T > 20.0)), "1 of 1499 samples come late, the latest 0.54 s after t = 20 s (row 501)"),
    ],
)
def test_what_can_be_used_with_care_is_one_finding(log, says):
    refuse_unfit(log)
    found = [str(each) for each in findings(log)]
    assert any(says in each for each in found), found
    assert all(each.endswith(".") and "\n" not in each for each in found)


def test_a_tracker_that_lags_travels_against_the_wheels():
    log = changed(body_x=np.interp(T - 6.0, T, X), body_y=GOOD[0]["body_y"], body_z=None, body_pitch=None)
    assert any("travels against its wheels" in str(each) for each in findings(log))


def without(run, *starts):
    return {name: values for name, values in run.items() if not name.startswith(starts)}


FLAT = {"constant": 0.55, "hill": 0.0}


@pytest.mark.parametrize(
    ("runs", "says"),
    [
        ([drive(0, **FLAT), drive(1, **FLAT), drive(2, **FLAT)], "the duty has 1 level, so friction of the gear"),
        ([drive(0, constant=0.55), drive(1, constant=0.7)], "no low duty, so friction of the gear and a dead band"),
        ([drive(0, hill=0.0), drive(1, hill=0.0)], "slips span 0.0"),
        ([drive(0, hill=0.01), drive(1, hill=0.01)], "so multi-pass, a shifted centre of mass and effects of the load"),
        (
            [drive(0, constant=0.6), drive(1, constant=0.6)],
            "all runs go one way, so a wrong slope, the drag of a tether",
        ),
        ([drive(0, constant=0.6), drive(1, constant=0.6)], "no stop between two drives, so heating"),
        ([drive(0, constant=0.6), drive(1, constant=0.6)], "no reversal, so multi-pass, tachometer scales"),
        ([drive(0, constant=0.6), drive(1, constant=0.6)], "all wheels get one duty, so one weak motor"),
        (
            [without(run, "current") for run in GOOD],
            "motor currents are not recorded, so friction of the gear and dead",
        ),
        ([without(run, "battery") for run in GOOD], "battery_V is not recorded"),
        (GOOD[:2], "2 runs: results of so few held-out runs mean little"),
        (GOOD[:2], "no run is repeated, so the noise is as stated"),
    ],
)
def test_each_missing_excitation_says_what_looks_alike_and_what_to_drive(runs, says):
    found = [each for each in findings(log_of(*runs)) if says in each.what]
    assert len(found) == 1
    assert found[0].todo.startswith(("add", "repeat", "record"))


@pytest.mark.parametrize(
    ("runs", "says"),
    [
        (GOOD[:1], "1 run: none can be held out"),
        ([drive(i, duration=6.0) for i in range(3)], "s in all; drive for 20 s at least"),
        ([drive(i, **FLAT) for i in range(3)], "one duty, no slope and no change of slip: every effect looks like"),
    ],
)
def test_a_log_that_is_too_poor_says_so(runs, says):
    assert says in too_poor(log_of(*runs))


@pytest.mark.parametrize("name", ["bump", "point-turn"])
def test_a_simulated_log_passes(name):
    from rover_pin.motion.sensors import Sensors, measured
    from rover_pin.scenarios import scenario

    ready = scenario(name, duration=12.0)
    trace = measured(ready.drive(), Sensors(), 1)
    log = log_of(*({name: trace[name] for name in trace.channels} for _ in range(2)), motor={})
    assert faults(log) == ()
    told = [each.what for each in findings(log)]
    assert not any(
        word in each for each in told for word in ("jumps", "stays", "late", "against", "missing", "outruns")
    )


def test_a_log_on_disk_is_checked(tmp_path):
    traces = {f"run-{i}": Trace(run) for i, run in enumerate(GOOD)}
    folder = write_drive_log(tmp_path / "log", traces, About("field", wheel={"r": {"value": 45.0, "unit": "mm"}}))
    assert check(read_drive_log(folder)) == ((), "")


def test_blocks_of_a_run():
    t = np.arange(0.0, 3.0, 0.1)
    run = Driven(Trace({"t_s": t, "body_x": 0.2 * t, "body_y": np.where(t < 1.5, np.nan, 1.0 - 0.1 * t)}), R)
    assert run.slope(run.trace["body_x"]) == pytest.approx([0.2, 0.2, 0.2])
    assert run.slope(run.trace["body_y"])[2] == pytest.approx(-0.1)
    assert run.mean(run.trace["body_y"])[:2] == pytest.approx([np.nan, 0.83], nan_ok=True)
