"""Both named motors drive as the paper says at its one point; one far faster than the step does not ring."""

import dataclasses
import importlib.util
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rover_pin import ConstantDuty, Motor, scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.simulation.compiled.rover_numbers import armed, rim_inertia
from rover_pin.simulation.model.motor import unringing
from rover_pin.simulation.model.motors import MOTORS, motor_named
from rover_pin.simulation.timing import DT, Timing

STUDY = Path(__file__).parents[2] / "studies" / "motors.py"


@pytest.fixture(scope="module")
def study():
    spec = importlib.util.spec_from_file_location("motors_study", STUDY)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", MOTORS)
def test_duty_055_runs_at_5_cm_a_second(name):
    trace = scenario("flat", soil="table-1", motor=name).drive()
    assert trace["body_vx"][-1] == pytest.approx(0.05, rel=0.01)
    assert np.mean(trace.stack("slip")[-1]) == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("name", MOTORS)
def test_held_still_the_torque_is_in_proportion_to_the_duty(name):
    motor = motor_named(name)
    for delta in (0.1, 0.55, 1.0):
        drive = motor.drive(delta, 0.0)
        assert float(drive.constant * drive.current) == pytest.approx(MOTORS[name] * delta)


@pytest.mark.parametrize(("name", "share"), [("speed-like", 0.98), ("torque-like", 0.91)])
def test_what_back_emf_takes_of_the_cruising_duty(name, share):
    motor = motor_named(name)
    assert 0.05 / 0.95 / 0.045 / float(motor.no_load_rate) / 0.55 == pytest.approx(share, abs=0.005)


@pytest.mark.parametrize("name", MOTORS)
def test_what_eq_9_reads_is_what_a_drive_shows(study, name):
    """The study's table is statics; here the wheels of a rover that climbs steadily, each under its own load."""
    drive = scenario(
        "incline", soil="table-1", motor=name, duration=8.0, **{"terrain.angle_deg": 4.0, "terrain.start": -2.0}
    )
    trace, rows = drive.drive(), study.readings()
    rows = rows[(rows["motor"] == name) & (rows["k_mm"] == 50.0)]
    S, rim = (np.mean(values[-40:]) for values in (trace.stack("slip"), 0.045 * trace.stack("wheel_rate")))
    assert 0.3 < S < 0.6
    assert 1e3 * rim == pytest.approx(np.interp(S, rows["S"], rows["rim_mmps"]), rel=0.03)


def test_no_motor_lets_eq_9_see_a_slip_that_the_soil_resists(study):
    """S_hat falls as S rises, for every stall torque that carries the flat."""
    for _, table in study.readings().groupby(["motor", "k_mm"]):
        assert np.all(np.diff(table["S_hat"].dropna()) <= 0.0)


@pytest.mark.parametrize(("name", "at"), [("speed-like", 55.7), ("torque-like", 67.5)])
def test_when_12_degrees_are_reached(study, name, at):
    assert study.slope(name, 1.0)["Fig 8: 11.5 deg reached at [s]"] == pytest.approx(at, abs=0.5)


def left_after_a_step(z):
    """What an implicit step of the exact slope -z/dt leaves of a wheel's own rate, half of `unringing` taken."""
    dt, inertia = 0.004, 0.3
    slope = -z * inertia / dt
    theta = 0.5 * unringing(slope, dt, inertia) / slope
    return 1.0 - z / (1.0 + theta * z)


@given(z=st.floats(1e-6, 1e9))
@example(z=5.7)
@example(z=6.3)
def test_no_step_turns_back_more_than_half_of_a_rate(z):
    left = left_after_a_step(z)
    assert -0.5 - 1e-9 <= left <= 1.0
    midpoint = (1.0 - z / 2.0) / (1.0 + z / 2.0)
    assert left == pytest.approx(midpoint if z <= 6.0 else -0.5, abs=1e-9)


@pytest.mark.parametrize(("delta", "omega", "torque"), [(0.55, 1.2, 0.02), (0.3, 0.05, 0.25), (1.0, 30.0, 0.97)])
def test_a_calibrated_motor_turns_so_fast_under_so_much(delta, omega, torque):
    motor = Motor()
    made = motor.calibrated(delta, omega, torque)
    drive = made.drive(delta, omega)
    assert float(drive.constant * drive.current) == pytest.approx(torque)
    for name in ("supply", "stall_torque", "armature"):
        assert float(getattr(made, name)) == pytest.approx(float(getattr(motor, name)))


@pytest.mark.parametrize(("delta", "omega"), [(0.25, 1.0), (0.2, 1.0), (0.5, 0.0), (0.5, -1.0)])
def test_no_motor_holds_more_than_its_duty_gives_or_turns_back(delta, omega):
    motor = Motor()
    with pytest.raises(ParameterError, match=r"torque.*positive"):
        motor.calibrated(delta, omega, 0.25 * float(motor.stall_torque))


def test_the_inertia_of_a_rim_is_that_of_wheel_and_rotor():
    model = dataclasses.replace(scenario("flat").model, motor=Motor(rotor_inertia=0.0))
    bare = rim_inertia(armed(model.built, float(model.motor.armature)), model.built)
    geared = dataclasses.replace(model, motor=Motor(gear=100.0, rotor_inertia=2e-8))
    assert rim_inertia(armed(geared.built, float(geared.motor.armature)), geared.built) == pytest.approx(
        bare + 2e-4, rel=1e-12
    )
    joint = [model.built.model.inertias[mount.joint] for mount in model.built.wheels]
    assert bare == pytest.approx([each.inertia[1, 1] for each in joint], rel=1e-9)


def test_a_stiff_motor_follows_its_duty_without_ringing():
    """K^2 / R = 40 N m s on 1e-3 kg m^2 is 0.025 ms; the midpoint rule kept 98 % of a ring from step to step."""
    drive = scenario("flat", duration=1.0)
    model = dataclasses.replace(drive.model, motor=Motor(supply=5.8, resistance=0.0025, k_t=0.0369, gear=8.58))
    timing = Timing(sample=DT)
    trace = simulate(model, ConstantDuty(0.05), 1.0, timing=timing)
    rates = trace.stack("wheel_rate")
    asked = 0.05 * float(model.motor.no_load_rate)
    assert rates[8:] == pytest.approx(asked, rel=0.02)
    finer = simulate(model, ConstantDuty(0.05), 1.0, timing=timing.halved())
    assert trace["body_x"] == pytest.approx(finer["body_x"], abs=3e-4)
    assert trace.energy_error() < 1e-5
