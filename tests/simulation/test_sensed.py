"""What a controller reads through sensors: each kind of channel with its own noise and step."""

import dataclasses

import numpy as np
import pytest

from rover_pin.base.quantity import quantities
from rover_pin.simulation.command import Reading
from rover_pin.simulation.sensors import Sensed, Sensors

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
    """A reading of many wheels and joints, all at rest."""
    given = {each.name: 0.0 for each in dataclasses.fields(Reading)}
    rooms = dict.fromkeys(("wheel_rate", "current", "suspension"), np.full(count, 0.1))
    return Reading(**{**given, **rooms, "attitude": (0.1, 0.2, 0.3)})


def test_rates_currents_joints_and_attitude_have_noise_and_steps():
    read = []
    sensed = Sensed(lambda asked: read.append(asked) or 0.5, SENSORS, 3)
    assert sensed(reading(40000)) == 0.5
    (one,) = read
    assert np.std(one.current) == pytest.approx(float(SENSORS.current_sd), rel=0.02)
    assert np.mean(one.current) == pytest.approx(0.1, abs=1e-3)
    for values, step in ((one.wheel_rate, 0.5), (one.suspension, 0.25)):
        assert values / step == pytest.approx(np.round(values / step), abs=1e-12)
    rough = Sensed(lambda asked: read.append(asked) or 0.5, SENSORS.replace(rate_sd=0.6, angle_sd=0.3), 3)
    rough(reading(40000))
    for values, sd, step in ((read[1].wheel_rate, 0.6, 0.5), (read[1].suspension, 0.3, 0.25)):
        assert np.std(values) == pytest.approx(np.hypot(sd, step / 12**0.5), rel=0.02)
        assert np.mean(values) == pytest.approx(0.1, abs=0.01)
    assert one.attitude != (0.1, 0.2, 0.3)
    assert one.attitude == pytest.approx((0.1, 0.2, 0.3), abs=5.0 * float(SENSORS.attitude_sd))


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
    sensed = Sensed(counts, Sensors(), 5)
    for _ in range(2):
        sensed(reading(4))
        sensed(reading(4))
        sensed.reset()
    first, second, again, _ = counts.read
    assert np.array_equal(first, again)
    assert not np.array_equal(first, second)
    assert counts.resets == 3, "as it is made, and each time"
    assert Sensed(lambda asked: 0.25, Sensors(), 5)(reading(4)) == 0.25, "one without a reset"
