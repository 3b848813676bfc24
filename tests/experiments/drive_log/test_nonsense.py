"""Drive logs with a pose of the wheels, a yaw in degrees, currents in another scale: named only where it is certain."""

import math
import re

import numpy as np
import pytest

from rover_pin.experiments.drive_log.checks.log import faults, findings
from rover_pin.experiments.drive_log.checks.pose import pose_like_the_wheels, pose_of_the_wheels
from rover_pin.experiments.drive_log.checks.run_blocks import RunBlocks
from rover_pin.simulation.model.motor import Motor
from tests.experiments.drive_log import drive_channels as channels

GOOD, R, drive, log_of = channels.GOOD, channels.R, channels.drive, channels.log_of
WHEELS = channels.WHEELS


def said(log):
    return " ".join(str(fault) for fault in faults(log))


def odometry(run, scale=1.0, noise=0.0, wheels=WHEELS, rounded=12, late=0):
    """The run with a pose that dead reckoning of some wheels gives, with the noise of its yaw."""
    rim = scale * R * np.mean([run[f"wheel_rate_{wheel}"] for wheel in wheels], axis=0)
    step = np.roll(rim, late)[:-1] * np.diff(run["t_s"])
    yaw = 0.5 * (run["body_yaw"][1:] + run["body_yaw"][:-1])
    sees = np.random.default_rng(5)
    place = {}
    for name, turn in (("body_x", np.cos), ("body_y", np.sin)):
        exact = np.concatenate([[0.0], np.cumsum(step * turn(yaw))])
        place[name] = (exact + noise * sees.standard_normal(len(exact))).round(rounded)
    return {**run, **place, "body_z": run["body_z"]}


@pytest.mark.parametrize(
    "options",
    [{}, {"late": -1}, {"rounded": 5}, {"wheels": ("ml", "mr")}],
    ids=["exact", "next sample", "in 10 um", "one axle"],
)
def test_a_pose_that_is_the_wheels_odometry_is_refused(options):
    run = odometry(drive(0, hill=0.0), **options)
    assert "odometry" in said(log_of(run))


@pytest.mark.parametrize(
    "options", [{"rounded": 3}, {"noise": 5e-4}, {"noise": 1.5e-3}], ids=["in mm", "0.5 mm", "1.5 mm"]
)
def test_odometry_under_noise_is_named(options):
    """It could be a rover that hardly slips: nothing tells them apart, so it is no fault."""
    log = log_of(odometry(drive(0, hill=0.0), **options))
    assert faults(log) == ()
    assert any(re.search("body_x.*body_y.*slip", str(finding)) for finding in findings(log))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("hill", [0.02, 0.05, 0.12])
def test_a_tracked_pose_on_slopes_is_never_taken_for_odometry(seed, hill):
    for noise in (0.02, 0.3, 1.0):
        run = RunBlocks(log_of(drive(seed, hill=hill, noise=noise)).runs[0], R)
        assert not [*pose_of_the_wheels(run, 0.005), *pose_like_the_wheels(run, 0.05)]


def circling(seed=0, noise=0.02):
    """A rover that goes round three times as its yaw says."""
    run, random = drive(seed, hill=0.0), np.random.default_rng(seed)
    rate = np.mean([run[f"wheel_rate_{wheel}"] for wheel in WHEELS], axis=0)
    yaw = np.linspace(0.0, 6.0 * math.pi, len(rate))
    step = 0.04 * R * 0.95 * rate * np.exp(1j * yaw)
    place = np.cumsum(step)
    sees = lambda sd: sd * random.standard_normal(len(yaw))  # noqa: E731
    return {
        **run,
        "body_x": place.real + sees(1.5e-3),
        "body_y": place.imag + sees(1.5e-3),
        "body_yaw": yaw + sees(noise),
    }


def in_degrees(run):
    return {**run, "body_yaw": np.degrees(run["body_yaw"])}


def wrapped(run):
    return {**run, "body_yaw": (run["body_yaw"] + math.pi) % (2.0 * math.pi) - math.pi}


@pytest.mark.parametrize(
    "run",
    [circling(), wrapped(circling()), drive(1, yaw=0.5), drive(1, yaw=-2.0), drive(2, yaw=math.pi)],
    ids=["circles", "wrapped circles", "at 29 deg", "at -115 deg", "back"],
)
def test_a_yaw_in_degrees_is_named_and_in_radians_not(run):
    assert re.search("body_yaw.*degrees.*pi / 180", said(log_of(in_degrees(run))))
    assert "degrees" not in said(log_of(run))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("sd", "slow"), [(0.3, False), (0.8, False), (0.5, True), (1.0, True)])
def test_noise_of_the_yaw_about_a_straight_course_is_no_degrees(seed, sd, slow):
    """Divided by 57 any noise is small, and the course straight: that follows in degrees, and proves nothing."""
    run, random = drive(seed, hill=0.0), np.random.default_rng(seed)
    noise = sd * random.standard_normal(len(run["t_s"]))
    if slow:
        noise = np.convolve(noise, np.ones(50) / math.sqrt(50.0), "same")
    assert "degrees" not in said(log_of({**run, "body_yaw": noise}))


def test_a_rover_far_from_its_ground_is_refused():
    for name in ("body_x", "body_y", "body_z"):
        what = f"{name} is 1e+06 m in the median; give metres from an origin on the declared ground"
        run = {**GOOD[0], name: GOOD[0][name] + 1e6}
        assert pytest.approx(1e6, rel=1e-3) == np.median(run[name])
        assert what in said(log_of(run))
    assert faults(log_of({**GOOD[0], "body_y": GOOD[0]["body_y"] + 900.0})) == ()


def with_currents(scale, seed=0):
    """A run whose wheels turn slowly under load, with the currents that the motor's equation gives, scaled."""
    run, motor = drive(seed), Motor(supply=7.2, resistance=24.0, k_t=0.0125, gear=268.0)
    for wheel in WHEELS:
        run[f"wheel_rate_{wheel}"] = 0.5 * run[f"wheel_rate_{wheel}"]
        drawn = motor.drive(run[f"duty_{wheel}"], run[f"wheel_rate_{wheel}"]).current
        run[f"current_{wheel}_A"] = scale * np.asarray(drawn)
    return {**run, "body_x": 0.5 * run["body_x"], "body_y": 0.5 * run["body_y"], "body_z": 0.0 * run["body_z"]}


@pytest.mark.parametrize(("scale", "word"), [(0.01, "0.01 times"), (1.0, ""), (0.5, ""), (2.0, "")])
def test_currents_in_another_scale_are_refused(scale, word):
    faults_text = said(log_of(with_currents(scale)))
    assert ("that [motor] draws at these duties" in faults_text) is bool(word)
    assert word in faults_text


def test_currents_that_are_hardly_the_motors_are_named():
    log = log_of(with_currents(0.2))
    assert faults(log) == ()
    (finding_text,) = [str(finding) for finding in findings(log) if "that [motor] draws" in str(finding)]
    assert "0.2 times" in finding_text
    assert re.search(r"resistance.*k_t.*gear.*\[motor\]", finding_text)
    unknown = log_of(with_currents(0.01), motor={"supply": 7.2, "resistance": 24.0})
    assert "that [motor] draws" not in said(unknown)
