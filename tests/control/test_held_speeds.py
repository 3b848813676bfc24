"""Speeds that servos hold: kinematics of a rigid body, symmetry, limits, rest, and skid-steering on hard ground."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rover_pin import load_rover, scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.control.motion.kinematics import BodyMotion, rolling
from rover_pin.control.motion.servo import HeldSpeeds
from rover_pin.rover.wheel_base import base_of, effective_track, wheel_places
from rover_pin.simulation.command import Reading
from rover_pin.simulation.native.control import commands_of
from tests.rover.farm import ROCKERS, THREE_AXLES, TWO_AXLES, Farm, cart, rocker_bogie, write

HARD = {"patch.x_from": -100.0, "patch.x_to": 100.0}
UPHILL = {"terrain.start": -5.0}
ROVERS = ("cart", "nexus6")


def driven_yaw_rate(trace):
    late = trace.t > 0.5 * trace.t[-1]
    return float(np.polyfit(trace.t[late], np.unwrap(trace["body_yaw"][late]), 1)[0])


def command(rover, duration=6.0, **motion):
    settings = {f"control.{name}": value for name, value in motion.items()}
    return scenario("flat", rover=rover, control="cmd-vel", duration=duration, **settings)


@pytest.mark.parametrize("seed", range(20))
def test_wheels_that_steer_go_where_a_rigid_body_carries_them(seed):
    """v = V + Omega x r of each wheel's place: along its heading, nothing across; what does not steer rolls along x."""
    rng = np.random.default_rng(seed)
    places, steering = rng.uniform(-1.0, 1.0, (5, 2)), (True, False, True, True, False)
    motion = BodyMotion(*rng.uniform(-1.0, 1.0, 3))
    speeds, angles = rolling(places.tolist(), steering, motion)
    assert np.max(np.abs(angles)) <= math.pi / 2
    left = iter(angles)
    for (x, y), steered, speed in zip(places, steering, speeds, strict=True):
        velocity = np.array([motion.speed, motion.aside, 0.0]) + np.cross([0.0, 0.0, motion.yaw_rate], [x, y, 0.0])
        angle = next(left) if steered else 0.0
        assert speed == pytest.approx(velocity @ [math.cos(angle), math.sin(angle), 0.0])
        if steered:
            assert velocity @ [-math.sin(angle), math.cos(angle), 0.0] == pytest.approx(0.0, abs=1e-12)


def test_an_effective_track_widens_the_sides_difference_alone():
    rover, motor = load_rover("cart"), scenario("flat", rover="cart").model.motor
    narrow, wide = (HeldSpeeds.of(rover, motor, 0.05, 0.1, track=track) for track in (0.52, 1.04))
    assert np.mean(wide.rates) == pytest.approx(np.mean(narrow.rates))
    assert np.ptp(wide.rates) == pytest.approx(2.0 * np.ptp(narrow.rates))
    assert 0.11 * np.ptp(narrow.rates) == pytest.approx(0.1 * 0.52)


@pytest.mark.parametrize("resistance", [0.0, 0.3])
@pytest.mark.parametrize("make", [cart, rocker_bogie])
def test_the_effective_track_balances_friction(make, resistance, tmp_path):
    """Slide of each wheel on a turn on the spot: rim less what carries it; equal frictions against it, no moment.

    Resistance pushes back along the wheel, against what carries it.
    """
    rover = load_rover(write(tmp_path, make(), TWO_AXLES if make is cart else {**THREE_AXLES, **ROCKERS}))
    half, places = (
        0.5 * effective_track(rover, resistance),
        np.array([place[:2] for place in wheel_places(rover).values()]),
    )
    x, y = (places - places.mean(axis=0)).T
    slide = np.column_stack([-y + np.sign(y) * half, x])
    friction = -slide / np.linalg.norm(slide, axis=1)[:, None]
    along = friction[:, 0] + resistance * np.sign(y)
    assert np.sum(x * friction[:, 1] - y * along) == pytest.approx(0.0, abs=1e-9)
    assert half > np.max(np.abs(y))


def test_resistance_above_what_the_soil_holds_is_refused():
    with pytest.raises(ParameterError, match="its sides"):
        scenario("point-turn", rover="cart", **{"effect.MotionResistance.R": 0.9})
    case = scenario("point-turn", rover="cart", **{"effect.MotionResistance.R": 0.9, "control.track": 2.0})
    assert case.controller.track == 2.0


@pytest.mark.parametrize("rover", ROVERS)
def test_compiled_asked_and_plain_steps_hold_the_same_speeds(rover):
    speed_command = command(rover, yaw_rate=0.05)
    assert commands_of(speed_command.controller, len(speed_command.model.rover.wheels)) is not None
    compiled, called, plain = (
        simulate(speed_command.model, control, 0.5, measure_error=False, engine=engine)
        for engine, control in (
            ("compiled", speed_command.controller),
            ("compiled", lambda reading: speed_command.controller(reading)),
            ("pinocchio-crba", speed_command.controller),
        )
        if speed_command.controller.reset() is None
    )
    for channel in compiled.channels:
        assert compiled[channel].tobytes() == called[channel].tobytes(), channel
        assert compiled[channel] == pytest.approx(plain[channel], abs=1e-8, rel=1e-6, nan_ok=True), channel


@pytest.mark.parametrize("scene", [("flat", {}), ("incline", UPHILL)])
def test_rates_are_held_up_a_slope_too(scene):
    """Constant duties droop by the load; the integral takes it."""
    name, terrain = scene
    case = scenario(
        name, rover="cart", control="rates", duration=6.0, **terrain, **{"control.rates": "0.3,0.4,0.5,0.6"}
    )
    trace = case.drive()
    assert trace.stack("wheel_rate")[-1] == pytest.approx([0.3, 0.4, 0.5, 0.6], rel=0.01)
    assert np.ptp(trace.stack("duty")[-1] - trace.stack("wheel_rate")[-1] / case.controller.omega_0) > 0.1


def reading(rates, duty=0.0):
    n = len(rates)
    return Reading(0.0, np.full(n, duty), np.array(rates), np.zeros(n), np.zeros(0), (0.0, 0.0, 0.0), None)


def test_the_servo_settles_in_samples_on_a_motor_without_lag():
    """The rate a sample later is omega_0 (delta - load), the motors' own line of torque and speed."""
    control = HeldSpeeds((0.6,), (), 2.0)
    rates, load = [0.0], 0.3
    for _ in range(12):
        rates.append(2.0 * (float(control(reading(rates[-1:])).duty[0]) - load))
    assert rates[-1] == pytest.approx(0.6, rel=0.01)
    assert max(rates) < 1.1 * 0.6


def test_the_integral_does_not_wind_up_at_the_supply():
    control = HeldSpeeds((1.0,), (), 2.0)
    duties = [float(control(reading([0.0])).duty[0]) for _ in range(400)]
    assert max(duties) == duties[-1] == 1.0
    assert float(control(reading([1.05])).duty[0]) < 0.95


def test_torque_limits_and_the_servos_own_hold_the_duty():
    case = scenario(
        "incline", rover="cart", control="cmd-vel", duration=3.0, **UPHILL, **{"control.servo.delta_max": 0.5}
    )
    assert case.drive().stack("duty").max() == 0.5
    limit = {"control.limit": "at-slip", "control.slip_limit": 0.05}
    free, limited = (
        scenario("incline", rover="cart", control="cmd-vel", duration=3.0, **UPHILL, **settings).drive()
        for settings in ({}, limit)
    )
    assert limited.stack("duty").max() < free.stack("duty").max() - 0.01


@pytest.mark.parametrize(("length", "track", "makers"), [(0.512, 0.5708, 1.875), (0.262, 0.37559, 1.5)])
def test_the_effective_track_is_near_the_makers(length, track, makers, tmp_path):
    """`wheel_separation_multiplier` of husky_control and jackal_control, and the sizes of their descriptions."""
    farm = Farm()
    for name, x, y in (("fl", 1, 1), ("fr", 1, -1), ("rl", -1, 1), ("rr", -1, -1)):
        farm.wheel(name, "body", f"{0.5 * length * x} {0.5 * track * y} 0", r=0.1)
    rover = load_rover(write(tmp_path, farm, {**TWO_AXLES, "wheel": {"r": 0.1, "b": 0.05}}))
    assert effective_track(rover) / track == pytest.approx(makers, rel=0.04)
    table = pd.read_csv(Path(__file__).parents[2] / "studies" / "results" / "public_turns.csv")
    (value,) = table[table["makers"] == makers]["track_over_B"].round(2).unique()
    assert value == round(effective_track(rover) / track, 2), "the page's table"


def test_hard_ground_turns_it_little_less_than_commanded():
    """Four wheels of equal load and friction: little above the effective track B (1 + (L / B)^2); shear builds up."""
    easy = {"effect.MotionResistance.R": 0.02, "form": "gross", "control.delta": 0.3}
    case = scenario("point-turn", rover="cart", duration=10.0, **HARD, **easy)
    length, track = base_of(case.model.rover)
    balanced = effective_track(case.model.rover, 0.02 / np.tan(case.model.soils[0].phi))
    assert case.controller.track == pytest.approx(balanced)
    assert 1.0 < case.controller.track / (track * (1.0 + (length / track) ** 2)) < 1.02
    assert 0.75 < driven_yaw_rate(case.drive()) / case.controller.motion.yaw_rate < 1.0


@pytest.mark.parametrize(("scene", "share"), [("turn", 0.87), ("point-turn", 0.78)])
def test_sand_turns_it_less_than_hard_ground_does(scene, share):
    soft, hard = (scenario(scene, rover="cart", **ground) for ground in ({}, HARD))
    on_sand, on_hard = (driven_yaw_rate(case.drive(measure_error=False)) for case in (soft, hard))
    commanded = soft.controller.motion.yaw_rate
    assert share * commanded < on_sand < on_hard < commanded


def test_what_cannot_be_held_is_refused():
    case = scenario("flat", rover="cart")
    with pytest.raises(ParameterError, match="rad/s"):
        command("cart", speed=3.0)
    with pytest.raises(ParameterError, match="cannot crab"):
        HeldSpeeds.of(case.model.rover, case.model.motor, 0.05, crab=0.2)
    with pytest.raises(ParameterError, match="the limit is 75"):
        command("nexus6", speed=0.01, yaw_rate=0.06)


def test_a_rover_that_does_not_follow_says_so(run):
    code, out, _ = run("drive", "point-turn", "--set", "rover=cart", "--set", "duration=4", "--set",
                       "control.track=0.52m", "--json")  # fmt: skip
    report = json.loads(out)
    assert code == 0
    assert any("commanded" in line and "control.track" in line for line in report["warnings"])
    code, out, _ = run("drive", "flat", "--control", "cmd-vel", "--set", "control.yaw_rate=2deg/s", "--json")
    assert code == 0
    report = json.loads(out)
    assert "warnings" not in report
    assert re.search(r"\b[12]\.?\d* deg/s\b.*\b2 deg/s", report["turned"]), report["turned"]
