"""Servos and end stops push as they are said to: in the air, a moment's acceleration through inverse dynamics."""

import pinocchio as pin
import pytest

from rover_pin.rover.rover import load_rover
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled.rover_numbers import armed
from rover_pin.simulation.compiled.suspension import joint_strength
from rover_pin.simulation.start.place import Start, hovering

MOMENT = 1e-7
"""Step [s] in which nothing moves."""
MODEL = scenario("flat").model


def torque_of(dof, state, target=0.0):
    """What accelerates this joint [N m], over what gravity and inertia ask for."""
    kernel = Kernel(MODEL, state, MOMENT, symmetric=False)
    kernel.servo_target[:] = target
    q, v = state.q.copy(), state.v.copy()
    assert kernel.step() == 0
    armoured = armed(MODEL.built, float(MODEL.motor.armature))
    return pin.rnea(armoured, armoured.createData(), q, v, (state.v - v) / MOMENT)[dof]


def lifted():
    state = hovering(MODEL, Start())
    state.q[2] += 1.0
    return state


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("over", "rate", "wanted"), [(0.02, 0.0, -1.0), (0.02, 0.3, -1.3), (0.02, -0.3, -0.7)])
def test_stop_has_50_nm_per_rad_and_1_nm_per_rad_per_s(side, over, rate, wanted):
    state, place = lifted(), MODEL.rover.angles["bogie_l"]
    dof = next(each.idx_v for each in list(MODEL.rover.model.joints)[2:] if each.idx_q == place)
    limits = MODEL.rover.model.lowerPositionLimit, MODEL.rover.model.upperPositionLimit
    state.q[place] = limits[int(side > 0.0)][place] + side * over
    state.v[dof] = side * rate
    assert torque_of(dof, state) == pytest.approx(side * wanted, rel=1e-4)
    state.v[dof] = -side * 1.1
    assert torque_of(dof, state) == pytest.approx(0.0, abs=1e-4), "it does not pull"


@pytest.mark.parametrize(("angle", "rate", "wanted"), [(0.02, 0.0, -0.4), (-0.01, 0.5, 0.1), (0.03, -1.0, -0.4)])
def test_servo_has_20_nm_per_rad_and_a_fifth_per_rad_per_s(angle, rate, wanted):
    state, wheel = lifted(), next(each for each in MODEL.rover.wheels if each.steer_dof is not None)
    joint = next(each for each in list(MODEL.rover.model.joints)[2:] if each.idx_v == wheel.steer_dof)
    state.q[joint.idx_q], state.v[joint.idx_v] = 0.1 + angle, rate
    assert torque_of(joint.idx_v, state, target=0.1) == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("name", ["nexus6", "cart"])
def test_gains_scale_with_mass_and_wheel_from_5_8_kg_on_45_mm(name):
    rover = load_rover(name)
    wanted = rover.mass * float(rover.wheels[0].wheel.r) / (5.8 * 0.045)
    assert joint_strength(rover) == pytest.approx(wanted, rel=1e-5)
