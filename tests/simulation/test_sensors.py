"""Sensors: their noise is as declared, they reveal no true values, and equal seeds give equal logs. A controller reads
through them.
"""

import dataclasses

import numpy as np
import pytest

from rover_pin.base.quantity import quantities
from rover_pin.effects.sensor_bias import SensorBias
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tracked_point import TrackedPoint
from rover_pin.effects.tracking_delay import TrackingDelay
from rover_pin.logs.drive_log import read_drive_log, save_trace
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.command import Reading
from rover_pin.simulation.sensors import NoisyController, Sensors, measure

EXACT = Sensors(**dict.fromkeys(quantities(Sensors), 0.0))


@pytest.fixture(scope="module")
def trace():
    return scenario("bump", duration=20.0, **{"terrain.ground": 1}).drive()


def test_no_truth_is_left_and_commands_are_exact(trace):
    log = measure(trace, Sensors(), 1)
    assert not [name for name in log.channels if name.startswith(("slip", "normal", "energy", "torque", "sinkage"))]
    assert np.array_equal(log["duty_fl"], trace["duty_fl"])
    assert np.array_equal(log["t_s"], trace["t_s"])
    assert not [name for name in measure(trace, Sensors(), 1, with_current=False).channels if "current" in name]


def test_the_noise_is_as_large_as_declared(trace):
    log = measure(trace, Sensors(), 2)
    for name, sd in (("body_x", 0.0015), ("body_pitch", 0.005), ("body_vx", 0.004)):
        assert np.std(log[name] - trace[name]) == pytest.approx(sd, rel=0.2)
    assert np.std(log["wheel_rate_ml"] - trace["wheel_rate_ml"]) == pytest.approx(
        np.hypot(0.01, 0.005 / 12**0.5), rel=0.2
    )
    assert log["rocker_l"] / 0.005 == pytest.approx(np.round(log["rocker_l"] / 0.005))


def test_effects_do_as_they_say(trace):
    scaled = measure(trace, EXACT, 0, [TachoScale(e=0.03, wheel="ml")])
    assert scaled["wheel_rate_ml"] == pytest.approx(1.03 * trace["wheel_rate_ml"])
    assert np.array_equal(scaled["wheel_rate_fl"], trace["wheel_rate_fl"])
    late = measure(trace, EXACT, 0, [TrackingDelay(d=0.1)])
    assert late["body_x"][2:] == pytest.approx(trace["body_x"][:-2])
    assert np.array_equal(late["wheel_rate_fl"], trace["wheel_rate_fl"])
    shifted = measure(trace, EXACT, 0, [SensorBias(bias=0.02, channel="body_pitch")])
    assert shifted["body_pitch"] == pytest.approx(trace["body_pitch"] + 0.02)


def test_a_tracked_point_moves_with_the_body_it_is_on():
    """The expected motion follows from a rotation matrix. If a replay was pulled to another heading, the pulled heading
    counts.
    """
    t = np.arange(0.0, 10.0, 0.01)
    yaw = 0.3 + 0.2 * np.sin(t)
    body = {"body_x": t, "body_y": t**2, "body_vx": 1.0 + 0.0 * t, "body_vy": 2.0 * t}
    for pointing, channels in ((yaw, {"body_yaw": yaw}), (yaw + 0.5, {"body_yaw": yaw, "drawn_yaw": 0.5 + 0.0 * t})):
        rotation = np.array([[np.cos(pointing), -np.sin(pointing)], [np.sin(pointing), np.cos(pointing)]])
        arm = np.einsum("ijk,j->ik", rotation, [0.4, -0.1])
        omega = 0.2 * np.cos(t)
        read = TrackedPoint(x=0.4, y=-0.1).read(t, {**body, **channels})
        for at, axis in enumerate("xy"):
            assert read[f"body_{axis}"] - body[f"body_{axis}"] == pytest.approx(arm[at])
        inside = slice(1, -1)
        assert (read["body_vx"] - 1.0)[inside] == pytest.approx((-omega * arm[1])[inside], abs=1e-5)
        assert (read["body_vy"] - 2.0 * t)[inside] == pytest.approx((omega * arm[0])[inside], abs=1e-5)
    assert set(TrackedPoint().read(t, {"body_x": t, "body_yaw": yaw})) == {"body_x"}


def test_a_simulated_log_is_read_like_a_measured_one(trace, tmp_path):
    log = measure(trace, Sensors(), 5)
    again = read_drive_log(save_trace(log, tmp_path / "log")).runs[0]
    assert all(np.array_equal(again[name], log[name]) for name in log.channels)


STEPS = {"rate_step": 0.5, "angle_step": 0.25}
SENSORS = Sensors(**{name: 0.01 * at for at, name in enumerate(quantities(Sensors), start=1)} | STEPS)
KINDS = {
    "wheel_rate_fl": ("rate_sd", "rate_step"),
    "rocker_l": ("angle_sd", "angle_step"),
    "bogie_r": ("angle_sd", "angle_step"),
    "steer_fl": ("angle_sd", "angle_step"),
    "current_fl_A": ("current_sd", None),
    "body_vx": ("velocity_sd", None),
    "body_roll": ("attitude_sd", None),
    "body_pitch": ("attitude_sd", None),
    "body_yaw": ("attitude_sd", None),
    "body_z": ("position_sd", None),
    "battery_V": ("voltage_sd", None),
    "duty_fl": (None, None),
    "t_s": (None, None),
}


@pytest.mark.parametrize("channel", KINDS)
def test_each_channel_has_the_noise_and_the_step_of_its_kind(channel):
    wanted = [0.0 if name is None else getattr(SENSORS, name) for name in KINDS[channel]]
    assert list(SENSORS.kind(channel)) == wanted


def reading(count):
    """Return a reading of many wheels and joints, all at rest."""
    fields = {field.name: 0.0 for field in dataclasses.fields(Reading)}
    rooms = dict.fromkeys(("wheel_rate", "current", "suspension"), np.full(count, 0.1))
    return Reading(**{**fields, **rooms, "attitude": (0.1, 0.2, 0.3)})


def test_rates_currents_joints_and_attitude_have_noise_and_steps():
    read = []
    sensed = NoisyController(lambda reading_now: read.append(reading_now) or 0.5, SENSORS, 3)
    assert sensed(reading(40000)) == 0.5
    (sensed_reading,) = read
    assert np.std(sensed_reading.current) == pytest.approx(float(SENSORS.current_sd), rel=0.02)
    assert np.mean(sensed_reading.current) == pytest.approx(0.1, abs=1e-3)
    for values, step in ((sensed_reading.wheel_rate, 0.5), (sensed_reading.suspension, 0.25)):
        assert values / step == pytest.approx(np.round(values / step), abs=1e-12)
    rough = NoisyController(
        lambda reading_now: read.append(reading_now) or 0.5, SENSORS.replace(rate_sd=0.6, angle_sd=0.3), 3
    )
    rough(reading(40000))
    for values, sd, step in ((read[1].wheel_rate, 0.6, 0.5), (read[1].suspension, 0.3, 0.25)):
        assert np.std(values) == pytest.approx(np.hypot(sd, step / 12**0.5), rel=0.02)
        assert np.mean(values) == pytest.approx(0.1, abs=0.01)
    assert sensed_reading.attitude != (0.1, 0.2, 0.3)
    assert sensed_reading.attitude == pytest.approx((0.1, 0.2, 0.3), abs=5.0 * float(SENSORS.attitude_sd))


def test_a_reset_begins_the_noise_and_the_controller_again():
    class Counts:
        def __init__(self):
            self.read, self.resets = [], 0

        def reset(self):
            self.resets += 1

        def __call__(self, asked):
            self.read.append(asked.current)
            return 0.0

    counts = Counts()
    sensed = NoisyController(counts, Sensors(), 5)
    for _ in range(2):
        sensed(reading(4))
        sensed(reading(4))
        sensed.reset()
    first, second, again, _ = counts.read
    assert np.array_equal(first, again)
    assert not np.array_equal(first, second)
    assert counts.resets == 3, "as it is made, and each time"
    assert NoisyController(lambda reading_now: 0.25, Sensors(), 5)(reading(4)) == 0.25, "one without a reset"
