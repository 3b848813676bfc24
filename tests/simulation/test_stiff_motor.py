"""A motor far faster than the step does not ring, and leaves the default ones as they were."""

import dataclasses

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.control.constant import ConstantDuty
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.rover_numbers import armed, rim_inertia
from rover_pin.simulation.model.motor import Motor, unringing
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.timing import DT, Timing


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
