"""What is sensed and what is made of it: ground by Pinocchio's statics, densities of particles, odometry's noise."""

import numpy as np
import pytest
from scipy.integrate import quad

from rover_pin.base.errors import ParameterError
from rover_pin.control.sensing.ground import UnderWheels, ground_law
from rover_pin.control.sensing.laws import FACTOR_RANGE, ReadingTrust, fold_law, still_law, torque_law, wheel_law
from rover_pin.control.sensing.odometry import Camera, TrackedSlip, Tracker, VisualOdometry
from rover_pin.control.slip_control import HoleLaw
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.rover.driven_loads import configuration, driven_loads, footing, turning
from rover_pin.rover.wheel_base import wheel_mounts
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.command import Reading, Truth
from rover_pin.simulation.state import suspension_places

PERIOD = 0.05


def wheel(u, s, D, ahead=0.0, level=1.0, rim=0.05, r=0.045):
    law = wheel_law(HoleLaw(), RelaxedSlip(), PERIOD)
    return np.array(law([u, s, D], [ahead, level, rim, r])).ravel()


def test_a_particle_s_slip_settles_at_eq_1():
    s, D = 0.0, 0.0
    for _ in range(200):
        s, D = wheel(0.03, s, D)
    assert s == pytest.approx(0.4, abs=1e-6)
    assert pytest.approx(0.15 * 0.02 / (0.03 / 0.04 + 0.15 * 0.02 / 0.0225), rel=0.02) == D, "thrown in, climbed out"


@pytest.mark.parametrize("share", [0.0025, 0.04])
def test_a_torque_s_density_is_one_but_for_strays(share):
    law = torque_law(ReadingTrust())
    total, _ = quad(lambda factor: float(law(0.3, [factor, share])), -3.0, 3.0, points=[0.3])
    assert total == pytest.approx(0.9 + 0.1 * 6.0 / FACTOR_RANGE, rel=1e-6)
    assert float(law(0.3, [1.5, share])) == pytest.approx(0.05, rel=1e-6), "a wall may read anything"


def fold_and_still(wall=0.0):
    """Both laws as functions of (speed or way, (rise or change, bend))."""
    fold, still = fold_law(ReadingTrust()), still_law(ReadingTrust())
    return (lambda u, read: fold(u, [*read, wall])), still


def test_a_wheel_at_a_wall_climbs_or_the_rover_stands():
    away, at_wall = (fold_and_still(wall)[0] for wall in (0.0, 1.0))
    for law in (away, at_wall):
        assert float(law(0.025, [0.009, 0.05])) > float(law(0.0, [0.009, 0.05])) + 2.0, "what rises so is no noise"
    odds = [float(law(0.0, [0.001, 0.1])) - float(law(0.025, [0.001, 0.1])) for law in (away, at_wall)]
    assert odds[1] > odds[0] > 0.0, "at a wall, to rise by nothing is to stand"


@pytest.mark.parametrize("bend", [0.0, 0.05, 0.3])
def test_densities_of_what_is_read_are_one(bend):
    fold, still = fold_and_still(0.3)
    assert quad(lambda rise: np.exp(float(fold(0.05, [rise, bend]))), 0.0, 1.0, points=[0.01])[0] == pytest.approx(1.0)
    total = quad(lambda change: np.exp(float(still(0.08, [change, bend]))), 0.0, 0.5, points=[0.001, 0.02])[0]
    assert total == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("u", "bend"), [(0.0, 0.1), (0.01, 0.0), (0.05, 0.2), (-0.08, 0.4)])
def test_wheels_that_climb_rise_as_the_slope_of_their_way(u, bend):
    """At a wall all wheels climb `lift` beyond the bend, so the mean rise is u times that slope, and at least noise."""
    trust = ReadingTrust()
    law, _ = fold_and_still(1.0)
    mean = quad(lambda rise: rise * np.exp(float(law(u, [rise, bend]))), 0.0, 2.0, points=[0.005, 0.05], limit=200)[0]
    assert mean == pytest.approx(abs(complex(trust.settling, u * (bend + trust.lift))), rel=1e-6)


STEP = 1e-5


@pytest.mark.parametrize(("rover", "off"), [("nexus6", 1e-6), ("cart", 2e-4)])
def test_slopes_loads_and_rates_are_those_of_the_posture(rover, off):
    """On four wheels statics leave a load open: there the least of the solutions is approached to 0.1 mN."""
    model = scenario("flat", rover=rover).model
    places, wheels, rng = suspension_places(model.rover), len(model.rover.wheels), np.random.default_rng(3)
    law = ground_law(model.built, places)

    def configured(posture):
        q = configuration(model.built, (posture[0], posture[1], 0.0), {})
        q[places] = posture[2:]
        return q

    for _ in range(5):
        posture = rng.uniform(-0.2, 0.2, 2 + len(places))
        rates, torque = rng.uniform(-0.1, 0.1, posture.size), rng.uniform(0.0, 0.15, wheels)
        under = UnderWheels(*np.array(law(posture, rates, torque)).reshape(-1, wheels))
        foot, jacobians = footing(model.built, configured(posture))
        level = np.hypot(foot.forward[:, 0], foot.forward[:, 1])
        assert under.level == pytest.approx(level)
        assert under.slope == pytest.approx(foot.forward[:, 2] / level)
        assert under.load == pytest.approx(
            driven_loads(model.built, configured(posture), torque, foot, jacobians), abs=off
        )
        (before, there), (after, at_point) = (
            wheel_mounts(model.built, configured(posture + sign * STEP * rates)) for sign in (-1.0, 1.0)
        )
        speed = (at_point - there) / (2.0 * STEP)
        assert under.ahead == pytest.approx(speed[:, 0], abs=1e-8)
        assert under.rise == pytest.approx(speed[:, 2], abs=1e-8)
        assert under.swing == pytest.approx(turning([before, after], foot.left)[1] / (2.0 * STEP), abs=1e-8)
        assert under.height == pytest.approx(wheel_mounts(model.built, configured(posture))[1][:, 2])


RADII = np.full(6, 0.045)


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
    speeds = np.array([odometry.speed(reading(speed, yaw=0.7, sideways=0.02)) for speed in true])
    assert np.all(np.isnan(speeds[:10]))
    late, is_measured = true[: len(speeds) - 10], np.isfinite(speeds[10:])
    assert np.mean(is_measured) == pytest.approx(0.5 * 0.8, abs=0.03)
    error = speeds[10:][is_measured] - 1.1 * late[is_measured]
    assert np.std(error) == pytest.approx(0.004, rel=0.1)
    assert abs(np.mean(error)) < 5e-4
    odometry.reset()
    again = [odometry.speed(reading(speed, yaw=0.7, sideways=0.02)) for speed in true[:50]]
    assert np.array_equal(again, speeds[:50], equal_nan=True)


def test_a_tracker_is_late_and_errs_alike_for_all_wheels():
    tracked = TrackedSlip(RADII, Tracker(sd=0.0, delay=0.1), PERIOD, 1)
    slip_readings = [tracked.slip(reading(speed))[0] for speed in (0.054, 0.027, 0.0, 0.0)]
    assert slip_readings == pytest.approx([0.0, 0.0, 0.0, 0.5])
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
