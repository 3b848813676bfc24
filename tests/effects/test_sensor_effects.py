"""What sensors misread: counts by a line, and what can be undone."""

import numpy as np
import pytest

from rover_pin.effects.raw_current import RawCurrent
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tracked_point import TrackedPoint
from rover_pin.effects.tracker_scale import TrackerScale
from rover_pin.effects.tracking_delay import TrackingDelay

TIMES, CURRENT = np.array([0.0, 0.1, 0.2]), np.array([0.0, 0.5, -2.0])


def test_counts_are_the_current_times_a_scale_and_a_zero():
    effect = RawCurrent(scale=200.0, offset=512.0, motor="rr", channel="adc_4")
    found = effect.read(TIMES, {"current_rr_A": CURRENT, "current_fl_A": 7.0 * CURRENT})
    assert list(found) == ["adc_4"]
    assert found["adc_4"] == pytest.approx([512.0, 612.0, 112.0])


def test_what_a_sensor_misreads_can_be_undone():
    t = np.arange(0.0, 1.0, 0.1)
    channels = {"wheel_rate_fl": 1.0 + t, "wheel_rate_ml": 2.0 - t, "body_x": 3.0 + t, "body_yaw": t, "body_vx": t**2}
    late = {"body_x": 3.0 + t}
    back = TrackingDelay(d=0.2).undone(t, TrackingDelay(d=0.2).read(t, late))["body_x"]
    assert list(back[:-2]) == pytest.approx(late["body_x"][:-2])
    for sensor in (TachoScale(e=0.3), TachoScale(e=-0.2, wheel="ml"), TrackerScale(e=0.05), TrackedPoint(-0.2, 0.1)):
        read = channels | sensor.read(t, channels)
        assert {name: list(values) for name, values in sensor.undone(t, read).items()} == {
            name: pytest.approx(channels[name]) for name in sensor.read(t, channels)
        }
