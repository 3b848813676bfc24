"""The snapshot and the energies."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.rover.energy import kinetic_energy, potential_energy
from rover_pin.rover.forward_dynamics import Dynamics, mass_matrix
from rover_pin.rover.snapshot import snapshot


def test_a_rover_at_rest_stands_where_its_urdf_says(nexus6):
    q = pin.neutral(nexus6.model)
    q[:3] = 1.0, 2.0, 0.13
    at = snapshot(nexus6, q, np.zeros(20))
    assert at.names == ("fl", "fr", "ml", "mr", "rl", "rr")
    assert np.allclose(at.wheel("fl").centre, [1.15, 2.16, 0.045])
    assert np.allclose(at.centres[:, 2], nexus6.wheel.r)
    assert np.allclose(at.axles, [0.0, 1.0, 0.0])
    assert set(at.angles) == {
        "rocker_l", "rocker_r", "bogie_l", "bogie_r", "steer_fl", "steer_fr", "steer_rl", "steer_rr",
    }  # fmt: skip


def test_velocities_are_derivatives(rover, random_state):
    q, v, _, _ = random_state(rover, 2)
    at, step = snapshot(rover, q, v), 1e-6
    ahead = snapshot(rover, pin.integrate(rover.model, q, step * v), v)
    behind = snapshot(rover, pin.integrate(rover.model, q, -step * v), v)
    assert np.allclose(at.velocities, (ahead.centres - behind.centres) / (2 * step), atol=1e-7)
    assert np.allclose(at.velocity, (ahead.position - behind.position) / (2 * step), atol=1e-7)
    turning = (ahead.rotation - behind.rotation) / (2 * step) @ at.rotation.T
    assert np.allclose(np.cross(at.angular_velocity, np.eye(3)), -turning, atol=1e-6)
    swing = (ahead.axles - behind.axles) / (2 * step)
    assert np.allclose(np.cross(at.angular_velocities, at.axles), swing, atol=1e-6)
    assert np.allclose(np.linalg.norm(at.axles, axis=1), 1.0)


def test_a_positive_rate_rolls_forward(nexus6):
    v = np.zeros(20)
    v[[wheel.dof for wheel in nexus6.wheels]] = 2.0
    at = snapshot(nexus6, pin.neutral(nexus6.model), v)
    bottoms = np.cross(at.angular_velocities, [0.0, 0.0, -0.045])
    assert np.allclose(bottoms, [-0.09, 0.0, 0.0])
    assert np.allclose(at.rates, 2.0)


def test_a_positive_steering_angle_turns_left(nexus6):
    q = pin.neutral(nexus6.model)
    q[nexus6.angles["steer_fl"]] = 0.3
    at = snapshot(nexus6, q, np.zeros(20))
    assert np.allclose(at.wheel("fl").axle, [-np.sin(0.3), np.cos(0.3), 0.0])
    assert at.angles["steer_fl"] == 0.3


def test_a_snapshot_is_read_only_and_names_what_it_lacks(nexus6):
    at = snapshot(nexus6, pin.neutral(nexus6.model), np.zeros(20))
    with pytest.raises(ValueError, match="read-only"):
        at.centres[0, 0] = 1.0
    with pytest.raises(TypeError):
        at.angles["rocker_l"] = 1.0
    with pytest.raises(ParameterError, match=r"no wheel 'lf': .*fl"):
        at.wheel("lf")
    with pytest.raises(ParameterError, match=r"q.*shape"):
        snapshot(nexus6, np.zeros(3), np.zeros(20))


def test_kinetic_energy_is_that_of_the_mass_matrix(rover, random_state):
    q, v, _, _ = random_state(rover, 3)
    assert kinetic_energy(rover, q, v) == pytest.approx(0.5 * v @ mass_matrix(rover, q) @ v, rel=1e-12)


def test_potential_energy_is_weight_times_height(rover, random_state):
    q, _, _, _ = random_state(rover, 4)
    height = pin.centerOfMass(rover.model, rover.model.createData(), q)[2]
    assert potential_energy(rover, q) == pytest.approx(rover.mass * 9.81 * height, rel=1e-12)


@pytest.mark.parametrize("route", ["accelerate", "accelerate_aba"])
def test_free_motion_keeps_its_energy(rover, random_state, route):
    """Heun's second order: the drift over a tenth of a second falls by four to eight as the step is halved."""

    def drift(dt: float) -> float:
        q, v, _, _ = random_state(rover, 5)
        dynamics, zero = Dynamics(rover), np.zeros(rover.model.nv)
        still = np.zeros((len(rover.wheels), 6))
        first = kinetic_energy(rover, q, v) + potential_energy(rover, q)
        for _ in range(round(0.1 / dt)):
            a = getattr(dynamics, route)(q, v, zero, still).a
            ahead, then = pin.integrate(rover.model, q, dt * v), v + dt * a
            later = getattr(dynamics, route)(ahead, then, zero, still).a
            q, v = pin.integrate(rover.model, q, dt * v + 0.5 * dt * dt * a), v + 0.5 * dt * (a + later)
        return abs(kinetic_energy(rover, q, v) + potential_energy(rover, q) - first) / abs(first)

    coarse, fine = drift(1e-3), drift(5e-4)
    assert fine < 1e-4
    assert fine < coarse / 3.0
