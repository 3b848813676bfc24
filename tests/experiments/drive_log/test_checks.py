"""The check of drive logs and of what they declare: every fault in one sentence, and a good log without one."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.experiments.drive_log.checks.log import faults, findings, refuse_unfit, too_poor
from rover_pin.experiments.drive_log.model import base_model, nuisances
from rover_pin.logs.drive_log import LogMetadata, read_drive_log, write_drive_log
from rover_pin.simulation.replay import commands
from tests.experiments.drive_log import drive_channels as channels

GOOD, changed, drive, gap = channels.GOOD, channels.changed, channels.drive, channels.gap
held, log_of, starting = channels.held, channels.log_of, channels.starting


def test_a_good_log_has_no_fault_and_lacks_nothing():
    log = log_of(*GOOD)
    refuse_unfit(log)
    assert [str(finding) for finding in findings(log)] == []
    assert too_poor(log) == ""


def test_a_run_that_stands_for_its_whole_length_is_told():
    still = {name: np.zeros_like(row) if name.startswith(MOVING) else row for name, row in GOOD[1].items()}
    still |= {name: np.full_like(row, row[0]) for name, row in GOOD[1].items() if name.startswith("body_")}
    finding_texts = [
        str(finding) for finding in findings(log_of(GOOD[0], still, *GOOD[2:])) if "nothing of this run" in finding.what
    ]
    assert finding_texts == [
        "run-2.csv: the rover stands or turns on the spot, so nothing of this run is compared, and holding it out "
        "of a fit tests nothing; remove the run from drive.toml, or drive ahead or back for 5 s or more in it."
    ]


def test_a_run_whose_begin_is_not_tracked_needs_a_declared_start():
    log = changed(body_x=gap(GOOD[0]["body_x"], 0, 100))
    with_start = dataclasses.replace(
        log.runs[0], attrs={**log.runs[0].attrs, "start": {"x": 0.1, "y": 0.0, "yaw": 0.0}}
    )
    assert commands(with_start, WHEELS, ()).start.x == 0.1
    nowhere = dataclasses.replace(with_start, attrs={"file": "run-1.csv"})
    with pytest.raises(DataError, match=r"run-1.csv.*0\.25 s.*start"):
        commands(nowhere, WHEELS, ())


WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")
MOVING = ("duty_", "wheel_rate_", "current_")
X, T = GOOD[0]["body_x"], GOOD[0]["t_s"]
Y = GOOD[0]["body_y"]
VX, VY = np.gradient(X, T), np.gradient(Y, T)


def starting_at(x=0.0, y=0.0, yaw=0.0):
    log = log_of(*GOOD)
    first = dataclasses.replace(log.runs[0], attrs={**log.runs[0].attrs, "start": {"x": x, "y": y, "yaw": yaw}})
    return dataclasses.replace(log, runs=(first, *log.runs[1:]))


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (changed(wheel_rate_ml=None, wheelrate_ml=X), "column 'wheel_rate_ml'"),
        (changed(body_yaw=None), "column 'body_yaw'"),
        (changed(body_x=gap(X, 0, None)), "run-1.csv: body_x has no"),
        (changed(body_z=held("body_z", 9, 12, np.inf)), "body_z is inf at t = 0.36 s (row 10)"),
        (changed(body_x=gap(X, 100, 1000)), "body_x is missing in 60 %"),
        (changed(**starting("wheel_rate", lambda w: w * 30 / math.pi)), "rpm; give rad/s"),
        (changed(**starting("wheel_rate", np.degrees)), "deg/s; give rad/s"),
        (changed(**starting("wheel_rate", lambda w: w / 2 / math.pi)), "turns per second"),
        (changed(body_x=1e3 * X, body_y=1e3 * GOOD[0]["body_y"]), "millimetres"),
        (changed(body_x=1e2 * X, body_y=1e2 * GOOD[0]["body_y"]), "centimetres"),
        (changed(**starting("wheel_rate", lambda w: 30.0 * w)), "wheel_rate_*, body_x and body_y"),
        (changed(t_s=1e3 * T), "t_s is in milliseconds"),
        (changed(body_pitch=np.degrees(GOOD[0]["body_pitch"])), "7.58 rad at t = 6.16 s (row 155)"),
        (changed(body_pitch=np.degrees(GOOD[0]["body_pitch"]) / 5.0), "body_pitch changes 11 times"),
        (changed(rocker_l=np.degrees(3 * GOOD[0]["rocker_l"])), "rocker_l reaches"),
        (changed(body_yaw=np.degrees(GOOD[0]["body_yaw"] + 1.5)), "body_yaw"),
        (changed(battery_V=1e3 * GOOD[0]["battery_V"]), "battery_V is 7.2e+03 V"),
        (changed(**starting("current", lambda i: 1e3 * i)), "current_fl_A is 48.2 A"),
        (changed(wheel_rate_fl=-GOOD[0]["wheel_rate_fl"]), "wheel_rate_fl runs against duty_fl"),
        (changed(duty_rr=-GOOD[0]["duty_rr"]), "duty_rr runs against wheel_rate_rr"),
        (changed(current_rr_A=-GOOD[0]["current_rr_A"]), "current_rr_A runs against duty_rr"),
        (changed(body_yaw=GOOD[0]["body_yaw"] + math.pi), "body_yaw; add pi"),
        (changed(body_x=GOOD[0]["body_y"], body_y=X), "travels 90.2 deg off"),
        (changed(body_pitch=-GOOD[0]["body_pitch"]), "body_pitch rises"),
        (changed(wheel_rate_fr=np.full(len(T), 1.1)), "wheel_rate_fr is 1.1 rad/s"),
        (changed(body_x=0 * X, body_y=0 * X), "body_x and body_y stand still"),
        (changed(body_vx=3.6 * VX, body_vy=3.6 * VY), "km/h; give m/s"),
        (changed(body_vx=1e3 * VX, body_vy=1e3 * VY), "mm/s; give m/s"),
        (changed(body_vx=0 * VX, body_vy=0 * VY), "body_vx and body_vy are 0 times"),
        (changed(body_vx=-VX, body_vy=-VY), "body_vx and body_vy point"),
        (changed(body_z=1e3 * GOOD[0]["body_z"]), "give metres"),
        (
            log_of(*({n: v / 100 if n.startswith("duty") else v for n, v in run.items()} for run in GOOD)),
            "give duties from -1 to 1",
        ),
        (changed(wheel_rate_ml=-GOOD[0]["wheel_rate_ml"]), "wheel_rate_ml runs against duty_ml"),
        (log_of(*GOOD, rover="cart"), "'cart' are fl, fr, bl, br"),
        (log_of(*GOOD, wheel={"r": {"value": 90.0, "unit": "mm"}}), "[wheel] has r = 90 mm"),
        (starting_at(x=1.0), "run-1.csv: the declared start is "),
        (starting_at(yaw=math.pi), "180 deg off from"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_sentence(log, says):
    with pytest.raises(DataError) as refused:
        refuse_unfit(log)
    assert says in str(refused.value)
    assert str(refused.value).count("\n") == 0


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (changed(body_x=gap(X, 100, 200)), "4 s from t = 4 s on (row 101)"),
        (changed(wheelrate_fl=X), "did you mean wheel_rate_fl"),
        (changed(humidity=X), "column 'humidity'"),
        (changed(body_z=None), "body_z is not recorded"),
        (changed(wheel_rate_fl=held("wheel_rate_fl", 100, 250)), "wheel_rate_fl stays at 1"),
        (changed(wheel_rate_fl=np.minimum(GOOD[0]["wheel_rate_fl"], 1.1)), "its extreme, 1.1,"),
        (changed(rocker_l=0.01 * np.ones(len(T)), rocker_r=-0.01 * np.ones(len(T))), "rocker_l is 0.01 rad"),
        (changed(body_x=held("body_x", 300, 303, 0.9)), "body_x jumps by"),
        (changed(body_yaw=held("body_yaw", 300, 303, 0.5)), "body_yaw jumps by 28"),
        (changed(wheel_rate_ml=held("wheel_rate_ml", 300, 302, 40.0)), "wheel_rate_ml spikes to 40 rad/s"),
        (changed(rocker_l=GOOD[0]["rocker_l"] + 0.05), "rocker_l + rocker_r is 0.050 rad"),
        (changed(battery_V=0.5 * GOOD[0]["battery_V"]), "battery_V is 3.6 V"),
        (changed(current_ml_A=8 * GOOD[0]["current_ml_A"]), "stall current"),
        (changed(body_x=1.4 * X), "travels faster"),
        (changed(t_s=T + 0.5 * (T > 20.0)), "0.54 s after t = 20 s (row 501)"),
        (starting_at(x=0.06), "first tracked pose"),
        (log_of(*GOOD, soil={}), "phi, k, k_1, so 0.5236 rad, 0.005 m, "),
        (log_of(*GOOD, motor={}), "supply, resistance, k_t, gear, so 7.2 V, 23.85 ohm,"),
        (
            log_of(*GOOD, noise={"wheel_rate": 0.003, "angle": {"value": 0.2, "unit": "deg"}}),
            "wheel_rate = 0.003 rad/s, but wheel_rate_",
        ),
        (changed(body_yaw=np.zeros(len(T))), "body_yaw is 0 rad"),
        (changed(body_pitch=np.zeros(len(T))), "body_pitch is 0 rad"),
    ],
)
def test_what_can_be_used_with_care_is_one_finding(log, says):
    refuse_unfit(log)
    finding_texts = [str(finding) for finding in findings(log)]
    assert any(says in finding_text for finding_text in finding_texts), finding_texts
    assert all(finding_text.endswith(".") and "\n" not in finding_text for finding_text in finding_texts)


def test_a_tracker_that_lags_travels_against_the_wheels():
    log = changed(body_x=np.interp(T - 6.0, T, X), body_y=GOOD[0]["body_y"], body_z=None, body_pitch=None)
    assert any("travels against its wheels" in str(finding) for finding in findings(log))


def without(run, *starts):
    return {name: values for name, values in run.items() if not name.startswith(starts)}


def test_current_missing_in_one_run_is_named_and_others_are_kept():
    wheel = next(name for name in GOOD[0] if name.startswith("current_"))
    notes = [finding.what for finding in findings(log_of(without(GOOD[0], wheel), *GOOD[1:]))]
    assert any(line.startswith(f"{wheel} of ") and " is not recorded, so friction" in line for line in notes)
    assert not any("motor currents are" in line for line in notes)


FLAT = {"constant": 0.55, "hill": 0.0}


@pytest.mark.parametrize(
    ("runs", "says"),
    [
        ([drive(0, **FLAT), drive(1, **FLAT), drive(2, **FLAT)], "the duty has 1 level, so friction of the gear"),
        ([drive(0, constant=0.55), drive(1, constant=0.7)], "no low duty, so friction of the gear and a dead band"),
        ([drive(0, hill=0.0), drive(1, hill=0.0)], "slips span 0.0"),
        ([drive(0, hill=0.01), drive(1, hill=0.01)], "so multi-pass, a shifted centre of mass and effects of the load"),
        ([drive(0, constant=0.6), drive(1, constant=0.6)], "all runs go in one direction, so a wrong slope, the drag"),
        ([drive(0, constant=0.6), drive(1, constant=0.6)], "no stop between two drives, so heating"),
        ([drive(0, constant=0.6), drive(1, constant=0.6)], "no reversal, so multi-pass, tachometer scales"),
        ([drive(0, constant=0.6), drive(1, constant=0.6)], "all wheels get one duty, so one weak motor"),
        ([without(run, "current") for run in GOOD], "motor currents are not recorded, so friction of the gear"),
        ([without(run, "battery") for run in GOOD], "battery_V is not recorded"),
        (GOOD[:2], "2 runs: results of so few held-out runs mean little"),
        (GOOD[:2], "no run is repeated, so a scatter"),
    ],
)
def test_missing_excitation_names_confusion_and_remedy(runs, says):
    matching = [finding for finding in findings(log_of(*runs)) if says in finding.what]
    assert len(matching) == 1
    assert matching[0].todo.startswith(("add", "repeat", "record"))


@pytest.mark.parametrize(
    ("runs", "says"),
    [
        (GOOD[:1], "there is only 1 run, so no run can be held out"),
        ([drive(i, duration=6.0) for i in range(3)], "s in all runs together; drive for 20 s at least"),
        ([drive(i, **FLAT) for i in range(3)], "one duty, no slope and no change of slip, so every effect looks like"),
    ],
)
def test_a_log_that_is_too_poor_says_so(runs, says):
    assert says in too_poor(log_of(*runs))


@pytest.mark.parametrize("name", ["bump", "point-turn"])
def test_a_simulated_log_passes(name):
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.simulation.sensors import Sensors, measure

    ready = scenario(name, duration=12.0)
    trace = measure(ready.drive(), Sensors(), 1)
    log = log_of(*({name: trace[name] for name in trace.channels} for _ in range(2)), motor={})
    assert faults(log) == ()
    notes = [note.what for note in findings(log)]
    assert not any(
        word in note for note in notes for word in ("jumps", "stays", "late", "against", "missing", "travels faster")
    )


def test_a_drive_beyond_the_declared_ground_is_told(tmp_path):
    (tmp_path / "ground.csv").write_text("x_m,z_m\n-10,0\n0.5,0\n")
    log = dataclasses.replace(log_of(*GOOD, terrain={"polyline": "ground.csv"}), folder=tmp_path)
    finding_texts = [str(finding) for finding in findings(log)]
    assert any(
        "m beyond the declared ground, which spans -10 to 0.5 m; the ground there is guessed" in s
        for s in finding_texts
    )


@pytest.mark.parametrize("sd", ["2 deg", -1.0, 0.0, float("nan"), True])
def test_an_uncertainty_that_is_none_is_refused(sd, tmp_path):
    (tmp_path / "ground.csv").write_text("x_m,z_m\n-10,0\n10,0\n")
    soil = {"phi": {"value": 30.0, "unit": "deg", "sd": sd}}
    log = dataclasses.replace(log_of(*GOOD, soil=soil, motor={}, terrain={"polyline": "ground.csv"}), folder=tmp_path)
    with pytest.raises(DataError, match=r"sd of 'phi'"):
        nuisances(log, base_model(log))


def test_ground_that_a_log_cannot_declare_is_refused(tmp_path):
    (tmp_path / "ground.csv").write_text("x_m,z_m,ground\n-10,0,3\n10,0,3\n")
    log = dataclasses.replace(log_of(*GOOD, motor={}, terrain={"polyline": "ground.csv"}), folder=tmp_path)
    with pytest.raises(
        DataError, match=r"\[terrain\] has ground 3, but a log allows only ground 0, which is the \[soil\]"
    ):
        base_model(log)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"b.csv"', '"a.csv"', "run 2 names the file 'a.csv', as run 1 does: leave one of them out."),
        ("yaw = 0.0", "yaw = 180.0", "give yaw in rad, not in degrees."),
        ('file = "a.csv"', 'file = "a.csv"\nunits = { bodyx = "mm" }', "a unit is given for the column 'bodyx'"),
    ],
)
def test_a_drive_toml_that_contradicts_itself_is_refused(old, new, says, tmp_path):
    run = log_of(*GOOD).runs[0]
    traces = {name: dataclasses.replace(run, attrs={"start": {"x": 0.0, "y": 0.0, "yaw": 0.0}}) for name in "ab"}
    write_drive_log(tmp_path, traces, LogMetadata("field"))
    file = tmp_path / "drive.toml"
    file.write_text(file.read_text().replace(old, new, 1))
    with pytest.raises(DataError, match=r"drive.toml|a.csv") as refused:
        read_drive_log(tmp_path)
    assert says in str(refused.value)
