"""Equation (8): the accelerations of the rover under joint torques and forces on its wheels.

    H a + C = tau + J^T F_e + G^T lambda,    G a = -gamma,    G = (... 1 at each rocker ...)

H is `mass_matrix`, C is `bias`, J is `wheel_jacobians`, lambda is the differential's torque on either rocker. A joint
that follows another, as in a parallel link, adds a row (... 1 ... -ratio ...) to G. Two traps of Eq (8) as printed:

* The rocker angles are relative to the base, so G^T lambda already holds the reaction on the base: relative coordinates
  make it internal. Putting lambda into N_0 once more, as the sentence below Eq (8) can be read, is wrong.
* F_0 = -m_0 g is the gravity of the base alone. That of the rockers, bogies and wheels must be in C; here all of it is.

Accelerations are Pinocchio's: the base's is spatial and in body axes. The classical acceleration of the base's origin
is R (a[:3] + omega x v[:3]).
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError
from rover_pin.rover.constraints import angle_rows, constraint_rows
from rover_pin.rover.rover import Rover

STABILISATION = 20.0
"""Rate w [1/s] at which a violated differential comes back: gamma = 2 w phi' + w^2 phi, zero where it is held."""

NEXT, AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])


class Acceleration(NamedTuple):
    """Acceleration [nv], and the torque of the differential on either rocker about its own axis [N m]."""

    a: np.ndarray
    differential_torque: float


class Dynamics:
    """Eq (8) with its work space, for loops: arrays of floats in, unchecked. One a thread.

    The rover's `model` is read at each call, so its armature and gravity count as they are then.
    """

    def __init__(self, rover: Rover):
        self.rover, self.model = rover, rover.model
        self.data = self.model.createData()
        self._centres = [self.data.oMi[wheel.joint].translation for wheel in rover.wheels]
        self._moves = np.zeros((len(rover.wheels), self.model.nv))
        for row, wheel in zip(self._moves, rover.wheels, strict=True):
            row[supporting_dofs(self.model, wheel.joint)] = 1.0
        self._rows = constraint_rows(rover)
        self._angle_rows = angle_rows(rover)
        self._no_force = [pin.Force.Zero() for _ in range(self.model.njoints)]

    def accelerate(self, q: np.ndarray, v: np.ndarray, torques: np.ndarray, wheel_forces: np.ndarray) -> Acceleration:
        """Return the acceleration by the mass matrix, its Cholesky factors and a low-rank correction; the fast route.

        With a_0 = H^-1 (tau + J^T F_e - C) and y = H^-1 G^T: lambda = -(G y)^-1 (G a_0 + gamma), a = a_0 + y lambda.
        """
        model, data = self.model, self.data
        pin.crba(model, data, q, pin.Convention.WORLD)
        bias = pin.nonLinearEffects(model, data, q, v)
        pin.cholesky.decompose(model, data)
        free = pin.cholesky.solve(model, data, torques + self.generalised_force(wheel_forces) - bias)
        return self._solve(free, [pin.cholesky.solve(model, data, row) for row in self._rows], q, v)

    def accelerate_aba(
        self, q: np.ndarray, v: np.ndarray, torques: np.ndarray, wheel_forces: np.ndarray
    ) -> Acceleration:
        """Return the same by the articulated-body algorithm, affine in tau: called with tau and tau + each row of G."""
        model, data, pushes = self.model, self.data, self._joint_forces(q, wheel_forces)
        free = pin.aba(model, data, q, v, torques, pushes).copy()
        return self._solve(free, [pin.aba(model, data, q, v, torques + row, pushes) - free for row in self._rows], q, v)

    def _solve(self, free: np.ndarray, answers: list[np.ndarray], q: np.ndarray, v: np.ndarray) -> Acceleration:
        """Return the acceleration with every constraint held, given what a unit of each one's torque answers."""
        if not answers:
            return Acceleration(free, 0.0)
        y, rows = np.column_stack(answers), self._rows
        gamma = 2.0 * STABILISATION * (rows @ v) + STABILISATION**2 * (self._angle_rows @ q)
        multipliers = np.linalg.solve(rows @ y, -(rows @ free + gamma))
        return Acceleration(free + y @ multipliers, 0.0 if self.rover.differential is None else float(multipliers[0]))

    def generalised_force(self, wheel_forces: np.ndarray) -> np.ndarray:
        """Return J^T F_e [nv] of world wrenches at the wheel centres [n, 6]; the Jacobians must be up to date."""
        centres, force = np.array(self._centres), wheel_forces[:, :3]
        at_origin = wheel_forces.copy()
        at_origin[:, 3:] += centres.take(NEXT, 1) * force.take(AFTER, 1) - centres.take(AFTER, 1) * force.take(NEXT, 1)
        return (at_origin @ self.data.J * self._moves).sum(0)

    def _joint_forces(self, q: np.ndarray, wheel_forces: np.ndarray) -> list[pin.Force]:
        """Return the wheels' wrenches in their own axes, as Pinocchio's algorithms take external forces."""
        pin.forwardKinematics(self.model, self.data, q)
        forces = list(self._no_force)
        for wheel, wrench in zip(self.rover.wheels, wheel_forces, strict=True):
            turn = self.data.oMi[wheel.joint].rotation.T
            forces[wheel.joint] = pin.Force(turn @ wrench[:3], turn @ wrench[3:])
        return forces


def forward_dynamics(
    rover: Rover, q: np.ndarray, v: np.ndarray, torques: np.ndarray, wheel_forces: np.ndarray
) -> Acceleration:
    """Return the acceleration of Eq (8) and the differential's torque.

    Parameters
    ----------
    q, v : array
        Configuration [nq] and velocity [nv].
    torques : array
        Joint efforts [nv] (N m); the first six are a wrench on the base in its axes (N, N m).
    wheel_forces : array
        World wrench (force, moment) at the centre of each wheel [n, 6] (N, N m), a row a wheel of `rover.wheels`.

    Raises
    ------
    ParameterError
        An array of another shape or with a number that is not finite, or a quaternion that is not of unit length.

    Differs from the paper: a start that violates theta_s1 = -theta_s2 is brought back at STABILISATION; the term
    vanishes where the differential is held.
    """
    return Dynamics(rover).accelerate(*checked_state(rover, q, v), *_checked_forces(rover, torques, wheel_forces))


def forward_dynamics_aba(
    rover: Rover, q: np.ndarray, v: np.ndarray, torques: np.ndarray, wheel_forces: np.ndarray
) -> Acceleration:
    """Return the same as `forward_dynamics` by the articulated-body algorithm, its independent check."""
    return Dynamics(rover).accelerate_aba(*checked_state(rover, q, v), *_checked_forces(rover, torques, wheel_forces))


def mass_matrix(rover: Rover, q: np.ndarray) -> np.ndarray:
    """Return H of Eq (8) [nv, nv], the rotors' armature included."""
    q = checked_configuration(rover, q)
    upper = np.triu(pin.crba(rover.model, rover.model.createData(), q, pin.Convention.WORLD))
    return np.array(upper + np.triu(upper, 1).T)


def bias(rover: Rover, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return C of Eq (8) [nv]: velocity terms and the gravity of every body."""
    q, v = checked_state(rover, q, v)
    return np.array(pin.nonLinearEffects(rover.model, rover.model.createData(), q, v))


def wheel_jacobians(rover: Rover, q: np.ndarray) -> np.ndarray:
    """Return J of Eq (8) [n, 6, nv]: world velocity of each wheel's centre and its angular velocity, from v."""
    q = checked_configuration(rover, q)
    data = rover.model.createData()
    pin.computeJointJacobians(rover.model, data, q)
    return np.array(
        [pin.getJointJacobian(rover.model, data, wheel.joint, pin.LOCAL_WORLD_ALIGNED) for wheel in rover.wheels]
    )


def supporting_dofs(model: pin.Model, joint: int) -> list[int]:
    """Return the places in v that move a joint, from the base outwards."""
    return [
        place
        for support in list(model.supports[joint])[1:]
        for place in range(model.joints[support].idx_v, model.joints[support].idx_v + model.joints[support].nv)
    ]


def checked_configuration(rover: Rover, q: np.ndarray) -> np.ndarray:
    """Return q as floats; refuse another shape, numbers that are not finite, a quaternion not of unit length."""
    q = checked_array("q", q, (rover.model.nq,))
    length = float(np.linalg.norm(q[3:7]))
    if abs(length - 1.0) > 1e-6:
        raise ParameterError(f"q[3:7] = {q[3:7]} has length {length:g}: a quaternion (x, y, z, w) must have length 1.")
    return q


def checked_state(rover: Rover, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return q and v as floats, checked."""
    return checked_configuration(rover, q), checked_array("v", v, (rover.model.nv,))


def checked_array(name: str, value: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return `value` as floats; refuse another shape and numbers that are not finite."""
    array = np.asarray(value, dtype=float)
    if array.shape != shape:
        raise ParameterError(f"{name} has shape {array.shape}; this rover's must be {shape}.")
    if not np.all(np.isfinite(array)):
        raise ParameterError(f"{name} holds a number that is not finite; look for where it was divided by zero.")
    return array


def _checked_forces(rover: Rover, torques: np.ndarray, wheel_forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    torques = checked_array("torques", torques, (rover.model.nv,))
    return torques, checked_array("wheel_forces", wheel_forces, (len(rover.wheels), 6))
