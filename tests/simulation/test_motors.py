"""Both named motors drive the rover as the paper states for its operating point, and a motor that is much faster than
the step does not oscillate.
"""

import dataclasses
import importlib.util
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rover_pin import ConstantDuty, Motor, scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import quantity
from rover_pin.effects.viscous_friction import ViscousFriction
from rover_pin.rover.forward_dynamics import constraint_rows
from rover_pin.simulation.compiled.drive_fields import model_with_armature
from rover_pin.simulation.engines import ENGINES
from rover_pin.simulation.model.motor import MOTORS, motor_named
from rover_pin.simulation.native.shared import GAMMA
from rover_pin.simulation.start import Start, settled_state
from rover_pin.simulation.stepping.pace import GROWS
from rover_pin.simulation.stepping.timing import DT, Timing

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
def test_share_of_back_emf_in_the_cruising_duty(name, share):
    motor = motor_named(name)
    assert 0.05 / 0.95 / 0.045 / float(motor.no_load_rate) / 0.55 == pytest.approx(share, abs=0.005)


@pytest.mark.parametrize("name", MOTORS)
def test_the_estimate_of_eq_9_agrees_with_a_drive(study, name):
    """The study's table comes from statics. Here it is compared with the wheels of a rover that climbs steadily, each
    under its own load.
    """
    drive = scenario(
        "incline", soil="table-1", motor=name, duration=8.0, **{"terrain.angle_deg": 4.0, "terrain.start": -2.0}
    )
    trace, rows = drive.drive(), study.readings()
    rows = rows[(rows["motor"] == name) & (rows["k_mm"] == 50.0)]
    S, rim = (np.mean(values[-40:]) for values in (trace.stack("slip"), 0.045 * trace.stack("wheel_rate")))
    assert 0.3 < S < 0.6
    assert 1e3 * rim == pytest.approx(np.interp(S, rows["S"], rows["rim_mmps"]), rel=0.03)


def test_no_motor_lets_eq_9_see_a_slip_that_the_soil_resists(study):
    """The estimate S_hat falls as S rises, for every stall torque that drives the rover on level ground."""
    for _, table in study.readings().groupby(["motor", "k_mm"]):
        assert np.all(np.diff(table["S_hat"].dropna()) <= 0.0)


@pytest.mark.parametrize(("name", "at"), [("speed-like", 55.7), ("torque-like", 67.5)])
def test_when_12_degrees_are_reached(study, name, at):
    assert study.slope(name, 1.0)["Fig 8: 11.5 deg reached at [s]"] == pytest.approx(at, abs=0.5)


@pytest.mark.parametrize("kind", [engine.stepper for engine in ENGINES.values()], ids=ENGINES)
@pytest.mark.parametrize("z", [0.05, 0.5, 1.0, 3.0, 8.0, 1000.0])
def test_a_step_damps_a_motors_own_rate_by_the_rule(kind, z):
    """A wheel in the air takes one step of z time constants of its motor. The remaining fraction is exp(-z) to second
    order, and never negative.
    """
    model = scenario("flat").model
    wheel, motor = model.built.wheels[0], model.motor
    inertia = float(model.built.model.inertias[wheel.joint].inertia[1, 1] + motor.armature)
    constant = inertia * float(motor.resistance) / float(motor.constant) ** 2
    state = settled_state(model, Start())
    state.q[2] += 500.0
    stepper = kind(model, state, z * constant, False)
    stepper.duty[:] = 0.5
    assert stepper.step() == 0
    left = 1.0 - state.v[wheel.dof] / (0.5 * float(motor.no_load_rate))
    by_rule = (1.0 - (math.sqrt(2.0) - 1.0) * z) / (1.0 + (1.0 - 1.0 / math.sqrt(2.0)) * z) ** 2
    assert left == pytest.approx(by_rule, abs=1e-3), "its torque moves the rover, too"
    assert abs(left - math.exp(-z)) < max(0.05 * z**3, 1e-3) if z < 1.0 else -0.21 < left < 0.36


@dataclasses.dataclass(frozen=True)
class Push(ViscousFriction):
    """Friction of the wrong sign, which accelerates a wheel."""

    b_v: float = quantity(0.0, "N m s", "made up", -10.0, 10.0, "b_v")


@pytest.mark.parametrize("kind", [engine.stepper for engine in ENGINES.values()], ids=ENGINES)
@pytest.mark.parametrize("z", [-3.0, 0.5, 1.2, 1.9, 3.0, 4.5, 6.0])
def test_growth_is_that_of_an_unstable_rate(kind, z):
    """The rate of a wheel in the air has the growth rate z per step. Each stage of the step multiplies it by 1 / (1 -
    gamma z).
    """
    model = scenario("flat").model
    state, motor = settled_state(model, Start()), model.motor
    state.q[2] += 500.0
    free = 1.0 / max(np.linalg.eigvalsh(wheels_mobility(model, state.q)))
    push = z * free / DT + float(motor.constant) ** 2 / float(motor.resistance)
    stepper = kind(model.having(Push(b_v=-push)), state, DT, False)
    stepper.duty[:] = np.linspace(-0.5, 0.9, 6)
    assert stepper.step() == 0
    ratio = abs(1.0 / (1.0 - GAMMA * z))
    assert stepper.growth == (pytest.approx(ratio, rel=0.25) if ratio > GROWS else 0.0), "modes mix in a wheel's rate"


def wheels_mobility(model, q):
    """Return (M^-1)_G of the wheel rates [1/(kg m^2)]."""
    pin_model = model_with_armature(model.built, float(model.motor.armature))
    M = np.array(pin.crba(pin_model, pin_model.createData(), q))
    inverse, G = np.linalg.inv(np.triu(M) + np.triu(M, 1).T), constraint_rows(model.built, differential=True)
    inverse -= inverse @ G.T @ np.linalg.solve(G @ inverse @ G.T, G @ inverse)
    at = [wheel.dof for wheel in model.built.wheels]
    return inverse[np.ix_(at, at)]


@pytest.mark.parametrize(("delta", "omega", "torque"), [(0.55, 1.2, 0.02), (0.3, 0.05, 0.25), (1.0, 30.0, 0.97)])
def test_a_calibrated_motor_turns_so_fast_under_so_much(delta, omega, torque):
    motor = Motor()
    point = motor.with_operating_point(delta, omega, torque)
    drive = point.drive(delta, omega)
    assert float(drive.constant * drive.current) == pytest.approx(torque)
    for name in ("supply", "stall_torque", "armature"):
        assert float(getattr(point, name)) == pytest.approx(float(getattr(motor, name)))


@pytest.mark.parametrize(("delta", "omega"), [(0.25, 1.0), (0.2, 1.0), (0.5, 0.0), (0.5, -1.0)])
def test_no_motor_holds_more_than_its_duty_gives_or_turns_back(delta, omega):
    motor = Motor()
    with pytest.raises(ParameterError, match=r"torque.*positive"):
        motor.with_operating_point(delta, omega, 0.25 * float(motor.stall_torque))


def test_a_stiff_motor_follows_its_duty_without_ringing():
    """K^2 / R = 40 N m s with an inertia of 1e-3 kg m^2 has the time constant 0.025 ms. The midpoint rule would keep 98
    % of an oscillation from step to step.
    """
    drive = scenario("flat", duration=1.0)
    model = dataclasses.replace(drive.model, motor=Motor(supply=5.8, resistance=0.0025, k_t=0.0369, gear=8.58))
    timing = Timing(sample=DT)
    trace = simulate(model, ConstantDuty(0.05), 1.0, timing=timing)
    rates = trace.stack("wheel_rate")
    wanted_rate = 0.05 * float(model.motor.no_load_rate)
    assert rates[8:] == pytest.approx(wanted_rate, rel=0.02)
    finer = simulate(model, ConstantDuty(0.05), 1.0, timing=timing.with_half_step())
    assert trace["body_x"] == pytest.approx(finer["body_x"], abs=3e-4)
    assert trace.energy_error() < 1e-5
