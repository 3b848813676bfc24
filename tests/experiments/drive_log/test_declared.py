"""What a drive log declares, and its speeds, against what its runs show: one sentence for each contradiction."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.experiments.drive_log.checks.log import findings, refuse_unfit
from rover_pin.experiments.drive_log.model import base_model, nuisances
from rover_pin.logs.drive_log import LogMetadata, read_drive_log, write_drive_log
from tests.experiments.drive_log import drive_channels as channels

GOOD, changed, log_of = channels.GOOD, channels.changed, channels.log_of
X, Y, T = (GOOD[0][name] for name in ("body_x", "body_y", "t_s"))
VX, VY = np.gradient(X, T), np.gradient(Y, T)


def starting_at(x=0.0, y=0.0, yaw=0.0):
    log = log_of(*GOOD)
    first = dataclasses.replace(log.runs[0], attrs={**log.runs[0].attrs, "start": {"x": x, "y": y, "yaw": yaw}})
    return dataclasses.replace(log, runs=(first, *log.runs[1:]))


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (changed(body_vx=3.6 * VX, body_vy=3.6 * VY), "they look like km/h; give m/s: divide them by 3.6"),
        (changed(body_vx=1e3 * VX, body_vy=1e3 * VY), "they look like mm/s; give m/s: divide them by 1000"),
        (changed(body_vx=0 * VX, body_vy=0 * VY), "run-1.csv: body_vx and body_vy are 0 times the speed of body_x"),
        (changed(body_vx=-VX, body_vy=-VY), "body_vx and body_vy point elsewhere than body_x and body_y move; give"),
        (changed(body_z=1e3 * GOOD[0]["body_z"]), "give metres: if it is in mm divide it by 1000"),
        (
            log_of(*({n: v / 100 if n.startswith("duty") else v for n, v in run.items()} for run in GOOD)),
            "as fast as [motor] would at their duty without load; give duties from -1 to 1, and mend [motor].",
        ),
        (changed(wheel_rate_ml=-GOOD[0]["wheel_rate_ml"]), "wheel_rate_ml runs against duty_ml"),
        (log_of(*GOOD, rover="cart"), "but those of the rover 'cart' fl, fr, bl, br; give the rover that was driven"),
        (log_of(*GOOD, wheel={"r": {"value": 90.0, "unit": "mm"}}), "[wheel] has r = 90 mm, but the rover 'nexus6' 45"),
        (starting_at(x=1.0), "run-1.csv: the declared start is "),
        (starting_at(yaw=math.pi), "180 deg off from the first tracked pose; give start in the axes and units of"),
    ],
)
def test_what_contradicts_itself_is_refused(log, says):
    with pytest.raises(DataError) as refused:
        refuse_unfit(log)
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (starting_at(x=0.06), "deg off from the first tracked pose; the first seconds suffer: mend start"),
        (log_of(*GOOD, soil={}), "drive.toml: [soil] does not declare phi, k, k_1, so 0.5236 rad, 0.005 m, "),
        (log_of(*GOOD, motor={}), "[motor] does not declare supply, resistance, k_t, gear, so 7.2 V, 23.85 ohm,"),
        (
            log_of(*GOOD, noise={"wheel_rate": 0.003, "angle": {"value": 0.2, "unit": "deg"}}),
            "[noise] declares wheel_rate = 0.003 rad/s, but wheel_rate_",
        ),
        (changed(body_yaw=np.zeros(len(T))), "run-1.csv: body_yaw is 0 rad all along; see whether it is measured"),
        (changed(body_pitch=np.zeros(len(T))), "run-1.csv: body_pitch is 0 rad all along; see whether it is measured"),
    ],
)
def test_what_is_left_to_assumptions_is_told(log, says):
    assert any(says in str(found) for found in findings(log))


def test_a_drive_beyond_the_declared_ground_is_told(tmp_path):
    (tmp_path / "ground.csv").write_text("x_m,z_m\n-10,0\n0.5,0\n")
    log = dataclasses.replace(log_of(*GOOD, terrain={"polyline": "ground.csv"}), folder=tmp_path)
    said = [str(found) for found in findings(log)]
    assert any("m beyond the declared ground, which spans -10 to 0.5 m; what lies there is guessed" in s for s in said)


@pytest.mark.parametrize("sd", ["2 deg", -1.0, 0.0, float("nan"), True])
def test_an_uncertainty_that_is_none_is_refused(sd, tmp_path):
    (tmp_path / "ground.csv").write_text("x_m,z_m\n-10,0\n10,0\n")
    soil = {"phi": {"value": 30.0, "unit": "deg", "sd": sd}}
    log = dataclasses.replace(log_of(*GOOD, soil=soil, motor={}, terrain={"polyline": "ground.csv"}), folder=tmp_path)
    with pytest.raises(DataError, match=r"the sd of 'phi' is .*: give a positive number in the unit of its value"):
        nuisances(log, base_model(log))


def test_ground_that_a_log_cannot_declare_is_refused(tmp_path):
    (tmp_path / "ground.csv").write_text("x_m,z_m,ground\n-10,0,3\n10,0,3\n")
    log = dataclasses.replace(log_of(*GOOD, motor={}, terrain={"polyline": "ground.csv"}), folder=tmp_path)
    with pytest.raises(DataError, match=r"\[terrain\] has ground 3: a log knows 0, the \[soil\], and 1, hard ground"):
        base_model(log)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"b.csv"', '"a.csv"', "run 2 names the file 'a.csv', as run 1 does: leave one of them out."),
        ("yaw = 0.0", "yaw = 180.0", "give finite x, y [m], and yaw in rad, not degrees."),
        ('file = "a.csv"', 'file = "a.csv"\nunits = { bodyx = "mm" }', "units name a column 'bodyx' that is not there"),
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
