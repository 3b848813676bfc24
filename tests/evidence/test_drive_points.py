"""Soil parameters from a drive log, as section 4 of the paper takes them, against the soil that made the log."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin.contact import Soil
from rover_pin.errors import DataError
from rover_pin.evidence.drive_points import Sampling, read_drive_points
from rover_pin.evidence.fit import identify
from rover_pin.evidence.reading import read_evidence
from rover_pin.motion.drive_log import read_drive_log
from rover_pin.scenarios import scenario


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("climb") / "log"
    drive = scenario("slope", **{"soil.k": 0.01})
    drive.write_log(drive.drive(), folder)
    return folder


def test_the_log_tells_the_soil_that_made_it(log):
    found = identify(read_drive_points(log), Soil())
    assert found["k"].low < 0.01 < found["k"].high
    assert found["phi"].low < math.radians(30.0) < found["phi"].high
    assert found["k"].high / found["k"].low < 3.0


def test_points_follow_the_torque_factor(log):
    from rover_pin.contact import Wheel
    from rover_pin.soil.traction import TorqueTraction, load_traction_factor

    points = read_evidence(log)
    assert points.form == TorqueTraction()
    truth = [float(load_traction_factor(S, Soil(k=0.01), Wheel(), TorqueTraction())) for S in points.slip]
    assert points.factor == pytest.approx(truth, rel=0.12)
    assert np.all(points.sd > 0.0)


def test_a_log_without_its_motor_is_refused(log, tmp_path):
    (tmp_path / "drive.toml").write_text(
        (log / "drive.toml").read_text().split("[motor]")[0] + '[[run]]\nfile = "run.csv"\n'
    )
    for name in ("run.csv", "terrain.csv"):
        (tmp_path / name).write_bytes((log / name).read_bytes())
    with pytest.raises(DataError, match=r"declares no \[motor\]"):
        read_drive_points(tmp_path)


def test_a_log_too_short_is_refused(log):
    with pytest.raises(DataError, match="no class of slip has 1000 steady"):
        read_drive_points(log, dataclasses.replace(Sampling(), least=1000))


def test_a_missing_channel_is_named(log, tmp_path):
    drive = read_drive_log(log)
    trace = drive.runs[0]
    kept = {name: values for name, values in trace.channels.items() if name != "body_vx"}
    from rover_pin.motion.drive_log import write_drive_log

    write_drive_log(tmp_path, {"run": dataclasses.replace(trace, channels=kept)}, drive.about)
    with pytest.raises(DataError, match="body_vx"):
        read_drive_points(tmp_path)


def test_a_path_that_is_no_data_is_refused(tmp_path):
    with pytest.raises(DataError, match=r"give a folder with rig.toml \(wheel rig\) or drive.toml"):
        read_evidence(tmp_path / "nothing")
