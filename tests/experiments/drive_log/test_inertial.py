"""An inertial unit in a log: its readings against kinematics by other formulas, and its own error, named."""

import math

import numpy as np
import pandas as pd
import pytest

from rover_pin.base.errors import DataError
from rover_pin.discrepancy.answer import Answer
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.experiments.drive_log.model import base_model, with_spread
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import close_the_loop
from rover_pin.simulation.sensors import ACCELEROMETER, GYRO, inertial
from tests.experiments.drive_log import drive_sets

G = 9.81


def pose(t, **value):
    """Channels of a body at rest but for what is given."""
    still = {f"body_{name}": np.zeros(len(t)) for name in ("roll", "pitch", "yaw", "vx", "vy", "vz")}
    down = {"gravity_x": np.zeros(len(t)), "gravity_y": np.zeros(len(t)), "gravity_z": np.full(len(t), -G)}
    return still | down | {name: values * np.ones(len(t)) for name, values in value.items()}


@pytest.mark.parametrize("nose_up", [-0.3, 0.0, 0.2])
@pytest.mark.parametrize("left_up", [-0.2, 0.0, 0.4])
def test_at_rest_it_reads_the_reaction_to_gravity(nose_up, left_up):
    t = 0.1 * np.arange(10)
    read = inertial(pose(t, body_pitch=-nose_up, body_roll=left_up, body_yaw=1.1), 0.1)
    up = math.cos(nose_up) * np.array([math.sin(left_up), math.cos(left_up)])
    expected = G * np.array([math.sin(nose_up), *up])
    assert np.allclose([read[name] for name in ACCELEROMETER], expected[:, None], rtol=1e-12)
    assert np.allclose([read[name] for name in GYRO], 0.0)


def test_a_level_turn_reads_its_rate_and_the_pull_to_its_centre():
    t = 0.01 * np.arange(300)
    rate, speed = 0.4, 0.5
    motion = pose(t, body_yaw=rate * t, body_vx=speed * np.cos(rate * t), body_vy=speed * np.sin(rate * t))
    read = inertial(motion, 0.01)
    assert np.allclose(read["gyro_z"], rate)
    assert np.allclose(read["accelerometer_y"][1:-1], rate * speed, rtol=1e-5)
    assert np.allclose(read["accelerometer_x"][1:-1], 0.0, atol=1e-9)


def of_angles(trace):
    """Return turn rates and specific force of a trace by the rates of its angles: other formulas than the package's."""
    t = trace.t
    roll, pitch, yaw = (trace[f"body_{name}"] for name in ("roll", "pitch", "yaw"))
    droll, dpitch, dyaw = (np.gradient(angle, t) for angle in (roll, pitch, yaw))
    gyro = (
        droll - dyaw * np.sin(pitch),
        dpitch * np.cos(roll) + dyaw * np.sin(roll) * np.cos(pitch),
        -dpitch * np.sin(roll) + dyaw * np.cos(roll) * np.cos(pitch),
    )
    ax, ay, az = (np.gradient(trace[f"body_v{axis}"], t) for axis in "xyz")
    ahead, left, az = ax * np.cos(yaw) + ay * np.sin(yaw), ay * np.cos(yaw) - ax * np.sin(yaw), az + G
    nose, below = ahead * np.cos(pitch) - az * np.sin(pitch), ahead * np.sin(pitch) + az * np.cos(pitch)
    force = nose, left * np.cos(roll) + below * np.sin(roll), below * np.cos(roll) - left * np.sin(roll)
    return dict(zip((*GYRO, *ACCELEROMETER), (*gyro, *force), strict=True))


SD = {"gyro": 0.005, "accelerometer": 0.05}
BIAS = 0.02


def unit(bias=0.0):
    """Return how a unit with white noise, and a zero of its turn rate that is off, reads a drive."""
    random = np.random.default_rng(5)

    def read(trace):
        sds = [(name, SD[name.partition("_")[0]]) for name in (*GYRO, *ACCELEROMETER)]
        noisy = {name: of_angles(trace)[name] + sd * random.standard_normal(len(trace.t)) for name, sd in sds}
        return noisy | {"gyro_z": noisy["gyro_z"] + bias}

    return read


def test_replays_of_a_log_read_as_its_unit_does(tmp_path):
    folder = drive_sets.write(tmp_path, runs=2, duration=8.0, extra=unit())
    log = read_drive_log(folder)
    fit = drive_sets.calibrated_on(log, with_spread(base_model(log)))
    experiment = fit.task.experiment
    missed = experiment.observed - experiment.predict([fit.model])[0]
    for name in (*GYRO, *ACCELEROMETER):
        floor = SD[name.partition("_")[0]] / math.sqrt(0.5 / 0.05)
        assert np.sqrt(np.nanmean(missed[:, experiment.channels.index(name)] ** 2)) < 1.35 * floor, name


def test_a_gyro_off_its_zero_is_found_with_its_bias(tmp_path):
    log = read_drive_log(drive_sets.write(tmp_path, runs=2, duration=8.0, extra=unit(BIAS)))
    fit = drive_sets.calibrated_on(log, with_spread(base_model(log)))
    sd = 0.01 * fit.spread[[parameter.name for parameter in fit.parameters].index("SensorBias[gyro_z].bias")]
    assert abs(fit.value("SensorBias[gyro_z].bias") - BIAS) < 2.5 * sd
    assert sd < 0.004


@pytest.mark.nightly
def test_with_a_gyro_off_its_zero_nothing_else_is_named(tmp_path):
    folder = drive_sets.write(tmp_path / "log", extra=unit(BIAS))
    verdict = close_the_loop(folder, out=tmp_path / "out", jobs=2)
    assert verdict.answer is Answer.NONE_NEEDED
    bias = next(number for number in verdict.after.numbers if number.name == "SensorBias[gyro_z].bias")
    assert bias.low < BIAS < bias.high


def odometry(folder, rover="nexus6"):
    """Turn the poses of a log into what its wheels alone say, which know no slip."""
    r = 0.045
    for file in folder.glob("run-*.csv"):
        table = pd.read_csv(file)
        rim = r * table.filter(like="wheel_rate_").mean(axis=1).to_numpy()
        yaw, dt = table["body_yaw"].iloc[0] + 0.0 * rim, np.diff(table["t_s"], prepend=table["t_s"].iloc[0])
        table["body_x"] = table["body_x"].iloc[0] + np.cumsum(rim * np.cos(yaw) * dt)
        table["body_y"] = table["body_y"].iloc[0] + np.cumsum(rim * np.sin(yaw) * dt)
        table["body_yaw"] = yaw
        table.drop(columns=["body_z", "body_vx", "body_vy", "body_vz"]).to_csv(file, index=False)


@pytest.mark.nightly
def test_wheel_odometry_alone_compares_currents_and_tilts(tmp_path):
    folder = drive_sets.write(tmp_path / "log", [GearFriction(tau_c=0.08)], extra=unit(), waves=0.0)
    odometry(folder)
    with pytest.raises(DataError, match=r"they are the wheels' odometry; .* write place = 'odometry' in drive.toml"):
        close_the_loop(folder, out=tmp_path / "out", jobs=2)
    file = folder / "drive.toml"
    file.write_text(file.read_text(encoding="utf-8").replace("\n[", '\nplace = "odometry"\n[', 1), encoding="utf-8")
    verdict = close_the_loop(folder, out=tmp_path / "out", jobs=2)
    assert verdict.named == ("GearFriction",)
    assert not {"path", "drift", "heading", "speed", "body_z"} & {score.name for score in verdict.scores}
    assert any("slip is not" in str(finding) for finding in verdict.findings)
