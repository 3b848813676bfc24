"""What a camera and a tracker add to the truth: declared noise, scale, delay and losses."""

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.control.sensing.odometry import Camera, TrackedSlip, Tracker, VisualOdometry
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.command import Reading, Truth

PERIOD, RADII = 0.05, np.full(6, 0.045)


def reading(speed, yaw=0.0, rate=1.2, sideways=0.0):
    six = np.ones(6)
    velocity = np.array([speed * np.cos(yaw), speed * np.sin(yaw), 0.0]) + sideways * np.array(
        [-np.sin(yaw), np.cos(yaw), 0.0]
    )
    truth = Truth(0.0 * six, 0.008 * six, 9.5 * six, speed * six, np.zeros(3), velocity)
    return Reading(0.0, 0.55 * six, rate * six, 0.1 * six, np.zeros(4), (0.0, 0.0, yaw), truth)


def test_odometry_is_late_scaled_noisy_and_lost_as_declared():
    camera = Camera(sd=0.004, scale=1.1, latency=0.5, period=0.1, dropouts=0.2)
    odometry, true = VisualOdometry(camera, PERIOD, 3), np.random.default_rng(1).uniform(0.0, 0.05, 4000)
    told = np.array([odometry.speed(reading(speed, yaw=0.7, sideways=0.02)) for speed in true])
    assert np.all(np.isnan(told[:10]))
    late, seen = true[: len(told) - 10], np.isfinite(told[10:])
    assert np.mean(seen) == pytest.approx(0.5 * 0.8, abs=0.03)
    error = told[10:][seen] - 1.1 * late[seen]
    assert np.std(error) == pytest.approx(0.004, rel=0.1)
    assert abs(np.mean(error)) < 5e-4
    odometry.reset()
    again = [odometry.speed(reading(speed, yaw=0.7, sideways=0.02)) for speed in true[:50]]
    assert np.array_equal(again, told[:50], equal_nan=True)


def test_a_tracker_is_late_and_errs_alike_for_all_wheels():
    tracked = TrackedSlip(RADII, Tracker(sd=0.0, delay=0.1), PERIOD, 1)
    told = [tracked.slip(reading(speed))[0] for speed in (0.054, 0.027, 0.0, 0.0)]
    assert told == pytest.approx([0.0, 0.0, 0.0, 0.5])
    noisy = TrackedSlip(RADII, Tracker(sd=0.004, delay=0.0), PERIOD, 1)
    slips = np.array([noisy.slip(reading(0.027)) for _ in range(2000)])
    assert np.std(slips[:, 0]) == pytest.approx(0.004 / 0.054, rel=0.1)
    assert np.all(slips == slips[:, :1])


def test_tracker_and_camera_are_settings_of_a_scenario():
    tracked = scenario("flat", control="tracked", **{"control.tracker.delay": 0.2}).controller
    assert tracked.estimate.lag == 4
    seeing = scenario("flat", control="camera", **{"control.camera.scale": 1.05, "control.stop": "never"}).controller
    assert seeing.estimate.odometry.camera.scale == 1.05
    with pytest.raises(ParameterError, match=r"control\.camera\.scale"):
        scenario("flat", control="onboard", **{"control.camera.scale": 1.05})
