"""What a sensor misreads can be undone."""

import numpy as np
import pytest

from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tracked_point import TrackedPoint
from rover_pin.effects.tracker_scale import TrackerScale
from rover_pin.effects.tracking_delay import TrackingDelay

# --- what hangs on the kind alone ------------------------------------------------------------------------------------


def test_what_a_sensor_misreads_can_be_undone():
    t = np.arange(0.0, 1.0, 0.1)
    channels = {"wheel_rate_fl": 1.0 + t, "wheel_rate_ml": 2.0 - t, "body_x": 3.0 + t, "body_yaw": t, "body_vx": t**2}
    late = {"body_x": 3.0 + t}
    back = TrackingDelay(d=0.2).undone(t, TrackingDelay(d=0.2).read(t, late))["body_x"]
    assert list(back[:-2]) == pytest.approx(late["body_x"][:-2])
    for sensor in (
        TachoScale(e=0.3),
        TachoScale(e=-0.2, wheel="ml"),
        TrackerScale(e=0.05),
        TrackedPoint(x=-0.2, y=0.1),
    ):
        read = channels | sensor.read(t, channels)
        assert {name: list(values) for name, values in sensor.undone(t, read).items()} == {
            name: pytest.approx(channels[name]) for name in sensor.read(t, channels)
        }
