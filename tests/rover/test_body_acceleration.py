"""Equation (8): two routes, the mass matrix, the differential, momentum, and refusals."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.rover.forward_dynamics import (
    bias,
    constraint_rows,
    forward_dynamics,
    forward_dynamics_aba,
    mass_matrix,
    wheel_jacobians,
)

SEEDS = range(5)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_two_routes_agree(rover, random_state, seed):
    state = random_state(rover, seed)
    fast, slow = forward_dynamics(rover, *state), forward_dynamics_aba(rover, *state)
    assert np.allclose(fast.a, slow.a, rtol=0.0, atol=1e-11 * np.max(np.abs(fast.a)))
    assert fast.differential_torque == pytest.approx(slow.differential_torque, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_equation_8_balances(rover, random_state, seed):
    q, v, torques, forces = random_state(rover, seed)
    a, torque = forward_dynamics(rover, q, v, torques, forces)
    push = sum(J.T @ wrench for J, wrench in zip(wheel_jacobians(rover, q), forces, strict=True))
    left = mass_matrix(rover, q) @ a + bias(rover, q, v)
    right = torques + push + torque * constraint_rows(rover)[0] if rover.differential else torques + push
    assert np.allclose(left, right, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_differential_is_held_exactly_where_it_holds(nexus6, random_state, seed):
    state = random_state(nexus6, seed)
    left, right, q_left, q_right = nexus6.differential
    for route in (forward_dynamics, forward_dynamics_aba):
        acceleration = route(nexus6, *state)
        assert abs(acceleration.a[left] + acceleration.a[right]) < 1e-9
        assert acceleration.differential_torque != 0.0
    assert state.q[q_left] + state.q[q_right] == 0.0


def test_wheel_jacobians_are_derivatives(rover, random_state):
    q, v, _, _ = random_state(rover, 9)
    step = 1e-6

    def centres(at):
        data = rover.model.createData()
        pin.forwardKinematics(rover.model, data, at)
        return [(data.oMi[w.joint].translation.copy(), data.oMi[w.joint].rotation.copy()) for w in rover.wheels]

    ahead = centres(pin.integrate(rover.model, q, step * v))
    behind = centres(pin.integrate(rover.model, q, -step * v))
    for J, (p1, R1), (p0, R0) in zip(wheel_jacobians(rover, q), ahead, behind, strict=True):
        assert np.allclose(J[:3] @ v, (p1 - p0) / (2 * step), atol=1e-7)
        assert np.allclose(J[3:] @ v, pin.log3(R1 @ R0.T) / (2 * step), atol=1e-7)


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (0, np.zeros(3), r"q.*\(3,\).*\(27,\)"),
        (0, np.zeros(27), "quaternion .x,.*1"),
        (1, np.zeros(27), r"v.*shape \(27,\)"),
        (1, np.full(20, np.nan), "v.*number"),
        (1, np.r_[np.zeros(19), np.inf], "v.*number"),
        (2, np.zeros(6), r"torques.*\(6,\)"),
        (3, np.zeros((4, 6)), r"wheel_forces has shape \(4, 6\), but this rover needs \(6, 6\)"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(nexus6, random_state, place, value, words):
    state = list(random_state(nexus6, 0))
    state[place] = value
    for route in (forward_dynamics, forward_dynamics_aba):
        with pytest.raises(ParameterError, match=words):
            route(nexus6, *state)
