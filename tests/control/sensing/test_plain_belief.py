"""The compiled belief against a plain NumPy one, sample by sample, over drives that bend, stall, turn back and see."""

import math

import numpy as np
import pytest

from rover_pin import ConstantDuty, scenario, simulate
from rover_pin.control.sensing.laws import ReadingTrust, fold_law, still_law, torque_law
from rover_pin.control.sensing.odometry import Camera, VisualOdometry
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.control.sensing.soil_belief import ControllerBelief
from rover_pin.simulation.sensors import NoisyController, Sensors
from tests.oracle import onboard

WALL = {
    "soil.k": 0.003, "terrain.wall_angle_deg": 47.0, "effect.MotionResistance.R": 0.07,
    "add": ("PostPeak.fraction=0.3", "DiggingMemory.c_d=0.1"),
}  # fmt: skip
DRIVES = {"ditch": (14.0, WALL), "hills": (6.0, {"soil.k": 0.01}), "slope": (5.0, {"soil.k": 0.02})}


def readings_of(name):
    """The readings of a drive by noisy sensors, and its model."""
    duration, settings = DRIVES[name]
    scene, stored, inner = scenario(name, soil="table-1", duration=duration, **settings), [], ConstantDuty()

    def keep(reading):
        stored.append(reading)
        return inner(reading)

    simulate(scene.model, NoisyController(keep, Sensors(), 1), duration, scene.start)
    return scene.model, stored


def plain_of(estimate):
    """The plain belief of the same rover: torque factors and the ground are handed over, other tests check them."""
    law, wheels = estimate.expressions[0], len(estimate.rover.wheels)

    def ground(posture, rates, torque):
        return np.array(law(posture, rates, torque)).reshape(-1, wheels)

    lag, sd = (estimate.odometry.lag, float(estimate.odometry.camera.sd)) if estimate.odometry else (0, 1.0)
    soils = estimate.soils
    resistance = soils.resistance, float(soils.sd.resistance), float(soils.sd.torque)
    numbers = soils.factors, soils.softness, resistance, estimate.constant
    return onboard.PlainBelief(estimate.rover.radii, *numbers, ground, lag, sd)


def compare(estimate, readings, duty_of=lambda reading: reading.duty):
    """Both beliefs over the readings; the greatest weight that a wall, a standstill and a bend had meanwhile."""
    plain, belief, most = plain_of(estimate), estimate.belief.struct, np.zeros(3)
    camera = VisualOdometry(estimate.odometry.camera, 0.05, estimate.odometry.seed) if estimate.odometry else None
    estimate.reset()
    for reading in readings:
        reading = reading.replace(duty=duty_of(reading))
        estimate.slip(reading)
        late = camera.speed(reading) if camera else math.nan
        posture = np.concatenate([reading.attitude[:2], reading.suspension])
        plain.sense(posture, reading.wheel_rate, reading.current, bool(max(reading.duty) < -0.02), late)
        for name in ("wall", "bend", "speed", "pace", "stuck", "rolled"):
            assert getattr(belief, name) == pytest.approx(getattr(plain, name), rel=1e-6, abs=1e-8), (reading.t, name)
        assert estimate.belief.estimates == pytest.approx(plain.told, rel=1e-6, abs=1e-8), reading.t
        assert estimate.belief.keep["p_soil"] == pytest.approx(plain.p_soil, rel=1e-6, abs=1e-9), reading.t
        assert bool(belief.no_progress) == plain.no_progress
        most = np.maximum(most, [plain.wall, plain.stuck, plain.bend])
    return most


def test_a_ditch_s_wall_stops_both_beliefs_alike():
    model, readings = readings_of("ditch")
    wall, stuck, bend = compare(OnboardSlip.of(model), readings)
    assert wall > 0.2, "torques beyond the soil's, else the wall is not compared"
    assert stuck > 0.9
    assert bend > 0.1


@pytest.mark.parametrize("name", ["hills", "slope"])
def test_beliefs_are_alike_on_open_ground(name):
    model, readings = readings_of(name)
    compare(OnboardSlip.of(model), readings)


@pytest.mark.parametrize("name", ["ditch", "hills", "slope"])
def test_beliefs_that_know_no_soil_are_alike(name):
    model, readings = readings_of(name)
    compare(OnboardSlip.of(ControllerBelief.unknown_sand(model)), readings)


def test_beliefs_with_a_camera_are_alike():
    model, readings = readings_of("hills")
    compare(OnboardSlip.of(model, odometry=VisualOdometry(Camera(), 0.05, 3)), readings)


def test_a_rover_that_turns_back_may_do_anything_to_both():
    """The duties of the middle third are negative: torques then say nothing, and speeds are drawn anew."""
    model, readings = readings_of("slope")
    a_third = len(readings) // 3
    back = {reading.t for reading in readings[a_third : 2 * a_third]}
    compare(OnboardSlip.of(model), readings, lambda reading: -reading.duty if reading.t in back else reading.duty)


def test_a_rover_that_rolls_on_bent_ground_and_does_not_move_stands():
    """The posture stays bent, the wheels turn by more than 0.56 radii within 4 s: no progress, from there on."""
    model, readings = readings_of("hills")
    still = readings[40].replace(suspension=np.array([0.15, -0.1, 0.12, -0.08])[: len(readings[40].suspension)])
    estimate = OnboardSlip.of(model)
    for rate, stands in ((0.1, False), (0.2, True)):
        readings_at_rest = [still.replace(wheel_rate=np.full(6, rate), t=0.05 * k) for k in range(90)]
        compare(estimate, readings_at_rest)
        assert bool(estimate.belief.struct.no_progress) is stands, rate * 4.0


TRUST = ReadingTrust()


@pytest.mark.parametrize("bend", [0.0, 0.03, 0.3])
@pytest.mark.parametrize("wall", [0.0, 0.4, 1.0])
def test_the_density_of_a_rise_is_the_plain_one(bend, wall):
    law = fold_law(TRUST)
    for u, rise in ((0.0, 0.0005), (0.02, 0.001), (0.05, 0.009)):
        assert float(law(u, [rise, bend, wall])) == pytest.approx(onboard.fold_log_density(u, rise, bend, wall))


@pytest.mark.parametrize("bend", [0.0, 0.01, 0.3])
def test_the_density_of_a_change_of_posture_is_the_plain_one(bend):
    law = still_law(TRUST)
    for way, change in ((0.0, 0.0003), (-0.05, 0.002), (0.1, 0.004)):
        assert float(law(way, [change, bend])) == pytest.approx(float(onboard.still_log_density(way, change, bend)))


@pytest.mark.parametrize("share", [0.0025, 0.05])
def test_the_density_of_a_torque_is_the_plain_one(share):
    law = torque_law(TRUST)
    for F in (-0.1, 0.2, 0.5):
        for read in (-0.3, 0.2, 0.9):
            assert float(law(F, [read, share])) == pytest.approx(onboard.torque_density(F, read, share))
