"""Static wheel loads: sums, moments, symmetry, known cases, and rovers that cannot stand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.rover.forward_dynamics import bias, forward_dynamics, wheel_jacobians
from rover_pin.rover.rover import load_rover
from rover_pin.rover.statics import wheel_loads

NEXUS6 = load_rover("nexus6")
WEIGHT = 5.8 * 9.81
angles = st.floats(-0.4, 0.4)


@settings(max_examples=25, deadline=None)
@given(angles, angles)
def test_loads_carry_the_weight_across_the_plane(slope, side):
    loads = wheel_loads(NEXUS6, slope, side)
    assert loads.sum() == pytest.approx(WEIGHT * math.cos(slope) * math.cos(side), rel=1e-9)


@settings(max_examples=25, deadline=None)
@given(angles, angles)
def test_the_moments_about_the_centre_of_mass_balance(slope, side):
    """By hand: vertical forces at the lowest points, the weight at the centre of mass; positions from the URDF."""
    loads = wheel_loads(NEXUS6, slope, side)
    places = np.array([[x, y, -0.13] for x in (0.15, 0.0, -0.15) for y in (0.16, -0.16)])
    gravity = rotation(slope, side).T @ [0.0, 0.0, -1.0]
    model = NEXUS6.model
    centre = pin.centerOfMass(model, model.createData(), pin.neutral(model))
    forces = -np.outer(loads / -gravity[2], gravity)
    moment = np.cross(places - centre, forces).sum(axis=0)
    assert np.allclose(moment, 0.0, atol=1e-9)


def rotation(slope, side):
    c, s, d, t = math.cos(slope), math.sin(slope), math.cos(side), math.sin(side)
    return np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) @ np.array([[1, 0, 0], [0, d, -t], [0, t, d]])


def test_each_bogie_balances_about_its_pivot():
    """On the flat: mid and rear loads less what hangs below the pivot, by hand from the numbers in the URDF."""
    loads = dict(zip([wheel.name for wheel in NEXUS6.wheels], wheel_loads(NEXUS6, 0.0) / 9.81, strict=True))
    # Wheel 0.25 kg on either arm of 0.075 m, knuckle 0.12 kg on the rear one, bogie 0.20 kg near the pivot.
    bogie = NEXUS6.model.inertias[NEXUS6.model.getJointId("bogie_l")]
    assert bogie.mass == pytest.approx(0.20)
    middle = loads["ml"] - 0.25
    rear = loads["rl"] - 0.25 - 0.12
    assert 0.075 * (middle - rear) == pytest.approx(0.20 * bogie.lever[0], abs=1e-9)


def test_loads_keep_the_rover_still(rover):
    """Quasi-static check through the dynamics: under these ground forces and holding torques nothing accelerates."""
    slope, side = 0.2, -0.1
    loads = wheel_loads(rover, slope, side)
    q = pin.neutral(rover.model)
    turn = rotation(slope, side)
    q[3:7] = pin.Quaternion(turn).coeffs()
    up = np.array([0.0, 0.0, 1.0])
    lifts = np.outer(loads / turn[2, 2], up)
    arms = np.array([-float(wheel.wheel.r) * turn[:, 2] for wheel in rover.wheels])
    wrenches = np.hstack([lifts, np.cross(arms, lifts)])
    push = sum(J.T @ wrench for J, wrench in zip(wheel_jacobians(rover, q), wrenches, strict=True))
    held = [place for w in rover.wheels for place in (w.dof, w.steer_dof) if place is not None]
    torques = np.zeros(rover.model.nv)
    torques[held] = (bias(rover, q, np.zeros(rover.model.nv)) - push)[held]
    a = forward_dynamics(rover, q, np.zeros(rover.model.nv), torques, wrenches)
    assert np.allclose(a.a, 0.0, atol=1e-8)


def test_left_and_right_swap_with_the_side_slope(rover):
    up, down = wheel_loads(rover, 0.1, 0.2), wheel_loads(rover, 0.1, -0.2)
    swap = [i + (1 if wheel.side == "l" else -1) for i, wheel in enumerate(rover.wheels)]
    assert np.allclose(up, down[swap], rtol=1e-9)
    assert up[1] > up[0]


def test_four_wheels_on_a_rigid_body_take_the_least_norm():
    """Statically indeterminate: twisting the load pattern (+ - - +) balances too, and the answer has none of it."""
    loads = wheel_loads(load_rover("cart"), 0.1, 0.15)
    assert abs(loads @ [1.0, -1.0, -1.0, 1.0]) < 1e-9 * loads.sum()


def test_a_steep_side_slope_tips_the_rover():
    assert wheel_loads(NEXUS6, 0.0, math.radians(75.0)).min() < 0.0


def test_without_its_differential_the_rover_cannot_stand():
    loose = dataclasses.replace(NEXUS6, differential=None)
    with pytest.raises(ParameterError, match="'nexus6'"):
        wheel_loads(loose, 0.1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((2.0,), r"slope = 114.592.*\[-80, 80\]"),
        ((0.0, float("nan")), "side_slope = nan"),
        ((0.0, 0.0, 0.0), "gravity = 0 m/s.2"),
        ((0.0, 0.0, 100.1), "gravity = 100.1 m/s.2"),
    ],
)
def test_refusals(arguments, words):
    with pytest.raises(ParameterError, match=words):
        wheel_loads(NEXUS6, *arguments)
