"""Every ready-made drive drives, other rovers and terrains from files included, and its log is a drive log."""

import numpy as np
import pytest

from rover_pin.errors import DataError, ParameterError
from rover_pin.motion.drive_log import read_drive_log
from rover_pin.scenarios import SCENES, scenario

FROM_FILES = ("polyline", "grid")


@pytest.mark.parametrize("name", [name for name in SCENES if name not in FROM_FILES])
def test_every_scenario_drives(name):
    trace = scenario(name, duration=2.0).drive()
    assert trace.attrs["stop"] == "duration"
    assert np.all(np.isfinite(trace.to_frame().to_numpy(dtype=float)))
    assert trace.energy_error() < 0.02


@pytest.mark.parametrize("slip", ["relaxed", "algebraic"])
@pytest.mark.parametrize("angles", ["fixed", "sinkage"])
@pytest.mark.parametrize("form", ["net", "torque", "gross"])
def test_every_form_drives_and_is_named(form, angles, slip):
    trace = scenario("flat", duration=1.0, form=form, angles=angles, slip=slip).drive()
    assert trace.attrs["traction_form"] == form
    assert trace.attrs["slip_law"].lower().startswith(slip)


@pytest.mark.parametrize("soil", ["literature-sand", "dry-sand", "fjs-1", "mars-sand"])
def test_the_other_soils_carry_the_rover(soil):
    assert scenario("flat", duration=2.0, soil=soil).drive().attrs["stop"] == "duration"


def test_a_rover_with_other_names_and_four_wheels_drives():
    trace = scenario("flat", duration=4.0, rover="cart").drive()
    assert len(trace.wheels) == 4
    assert trace["body_x"][-1] > 0.05


def test_a_terrain_from_a_file_with_a_hard_stretch(tmp_path):
    (tmp_path / "t.csv").write_text("x_m,z_m\n-5,0\n0.3,0\n5,0\n")
    path = {"terrain.path": str(tmp_path / "t.csv")}
    soft = scenario("polyline", duration=4.0, **path).drive()
    hard = scenario("polyline", duration=4.0, **path, **{"patch.x_from": -3.0}).drive()
    assert hard["sinkage_fl"][-1] < 0.3 * soft["sinkage_fl"][-1]
    with pytest.raises(DataError, match=r"nowhere.csv"):
        scenario("polyline", **{"terrain.path": "nowhere.csv"})


def test_the_log_of_a_drive_declares_what_made_it(tmp_path):
    drive = scenario("bump", duration=1.0, **{"soil.k": 0.02})
    trace = drive.drive()
    log = read_drive_log(drive.write_log(trace, tmp_path / "log"))
    assert log.about.soil["k"]["value"] == 0.02
    assert log.about.motor["supply"]["value"] == 7.2
    assert log.terrain() == drive.model.terrain
    assert np.array_equal(log.runs[0]["body_x"], trace["body_x"])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"control": "pid"}, "control = 'pid' is not known"),
        ({"form": "nett"}, "did you mean 'net'"),
        ({"terrain.wall_angel_deg": 30}, "There is no setting"),
        ({"effect.NormalDamping.d": -1.0}, r"NormalDamping.d = -1 s/m is not allowed"),
        ({"motor.supply": 0.0}, "Motor.supply = 0 V is not allowed"),
    ],
)
def test_wrong_settings_are_said(settings, words):
    with pytest.raises(ParameterError, match=words):
        scenario("ditch", **settings)


def test_a_motor_that_cannot_be_calibrated_is_said():
    from rover_pin.motion.motor import Motor

    with pytest.raises(ParameterError, match=r"cannot hold 0\.9 N m"):
        Motor().calibrated(0.55, 1.0, 0.9)
    made = Motor().calibrated(0.5, 1.2, 0.02)
    assert made.stall_torque == pytest.approx(Motor().stall_torque)
    assert made.armature == pytest.approx(Motor().armature)
    omega = made.no_load_rate * (0.5 - 0.02 / made.stall_torque)
    assert omega == pytest.approx(1.2)
