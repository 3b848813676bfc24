"""Equation (8) of the paper (equation of motion): accelerations of the rover under joint torques and wheel forces.

    H a + C = tau + J^T F_e + G^T lambda,    G a = -gamma,    G = (... 1 at each rocker ...)

a is the acceleration, H the `mass_matrix`, C the `bias` (velocity terms and gravity), tau the joint torques, J the
`wheel_jacobians`, F_e the forces on the wheels, G the `constraint_rows`, lambda the torque of the differential on
either rocker, and gamma the term that restores a violated constraint (STABILISATION). A joint that follows another
joint, as in a parallel link, adds a row (... 1 ... -ratio ...) to G. Eq (8) as the paper prints it can be misread in
two places:

* The rocker angles are relative to the base, so that G^T lambda already includes the reaction on the base. The sentence
  below Eq (8) can be read as if lambda were added to the base's torque N_0 once more, which would be wrong.
* F_0 = -m_0 g in Eq (8) is the gravity of the base alone, so that the gravity of rockers, bogies and wheels must be
  part of C. Here C includes the gravity of every body, and of the base too.

Accelerations follow Pinocchio's definition: the acceleration of the base is spatial and in body axes. The classical
acceleration of the base's origin is R (a[:3] + omega x v[:3]), with the rotation R, the angular velocity omega and the
velocity v of the base.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError
from rover_pin.rover.rover import Rover

STABILISATION = 20.0
"""Rate w [1/s] at which a violated constraint phi = 0 is restored: gamma = 2 w phi' + w^2 phi (Baumgarte).

The term is zero while the constraint holds, so that a drive that starts with held constraints does not depend on w. A
much larger value would make the equations stiff."""

NEXT, AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])
"""Cyclic indices of the cross product: (a x b)[i] = a[NEXT[i]] b[AFTER[i]] - a[AFTER[i]] b[NEXT[i]]."""


class Acceleration(NamedTuple):
    """Result of the equation of motion: the acceleration a [nv] of a rover, and the torque of the differential on each
    rocker about the rocker's axis [N m].
    """

    a: np.ndarray
    differential_torque: float


class Dynamics:
    """Solver of the equation of motion (Eq (8) of the paper) for repeated calls in a loop: it keeps its work space
    between the calls.

    Arguments are not checked. Every thread needs its own object. The rover's `model` is read at each call, so that
    later changes of its armature or gravity have an effect. For a single call use `forward_dynamics`.
    """

    def __init__(self, rover: Rover):
        self.rover, self.model = rover, rover.model
        self.data = self.model.createData()
        # Pinocchio overwrites the arrays in `data` in place, so these references always hold the current centres.
        self._centres = [self.data.oMi[wheel.joint].translation for wheel in rover.wheels]
        # A wheel moves with the degrees of freedom of all joints that carry it.
        self._moves = np.zeros((len(rover.wheels), self.model.nv))
        for row, wheel in zip(self._moves, rover.wheels, strict=True):
            row[supporting_dofs(self.model, wheel.joint)] = 1.0
        self._rows = constraint_rows(rover)
        self._angle_rows = angle_rows(rover)
        self._no_force = [pin.Force.Zero() for _ in range(self.model.njoints)]

    def accelerate(self, q: np.ndarray, v: np.ndarray, torques: np.ndarray, wheel_forces: np.ndarray) -> Acceleration:
        """Return the acceleration of the rover, computed by Cholesky factors of the mass matrix and a correction for
        the constraints.

        This is the faster of the two methods. With a_0 = H^-1 (tau + J^T F_e - C) and y = H^-1 G^T the constraint
        torques are lambda = -(G y)^-1 (G a_0 + gamma), and the acceleration is a = a_0 + y lambda; the docstring of the
        module defines the symbols. For the arguments, see `forward_dynamics`.
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
        """Return the acceleration of the rover, computed by the articulated-body algorithm, as a check of `accelerate`.

        The algorithm does not know constraints, but its result is affine in the joint torques tau. It is therefore
        called with tau, and with tau plus each row of the constraint matrix G; the differences are the columns of H^-1
        G^T, where H is the mass matrix. For the arguments, see `forward_dynamics`.
        """
        model, data = self.model, self.data
        # Pinocchio's algorithm takes the wheels' wrenches in the axes of their own joints.
        pin.forwardKinematics(model, data, q)
        pushes = list(self._no_force)
        for wheel, wrench in zip(self.rover.wheels, wheel_forces, strict=True):
            turn = data.oMi[wheel.joint].rotation.T
            pushes[wheel.joint] = pin.Force(turn @ wrench[:3], turn @ wrench[3:])
        free = pin.aba(model, data, q, v, torques, pushes).copy()
        return self._solve(free, [pin.aba(model, data, q, v, torques + row, pushes) - free for row in self._rows], q, v)

    def _solve(self, free: np.ndarray, answers: list[np.ndarray], q: np.ndarray, v: np.ndarray) -> Acceleration:
        """Return the acceleration of the rover that satisfies all its constraints, and the torque of the differential.

        Parameters
        ----------
        free : array [nv]
            Acceleration a_0 without constraint torques.
        answers : list of arrays [nv]
            Change of the acceleration by a unit torque of each constraint: the columns of H^-1 G^T.
        q, v : array [nq], [nv]
            Configuration and velocity, which determine the violation of the constraints.
        """
        if not answers:
            return Acceleration(free, 0.0)
        y, rows = np.column_stack(answers), self._rows
        gamma = 2.0 * STABILISATION * (rows @ v) + STABILISATION**2 * (self._angle_rows @ q)
        multipliers = np.linalg.solve(rows @ y, -(rows @ free + gamma))
        return Acceleration(free + y @ multipliers, 0.0 if self.rover.differential is None else float(multipliers[0]))

    def generalised_force(self, wheel_forces: np.ndarray) -> np.ndarray:
        """Return the generalised force J^T F_e [nv] of wrenches at the wheels' centres [n, 6], in the world's axes.

        The joint Jacobians in `data` must be up to date; `accelerate` calls `pin.crba` first, which computes them.
        """
        # data.J refers to the world's origin, so that the wrenches are moved there: moment + centre x force.
        centres, force = np.array(self._centres), wheel_forces[:, :3]
        at_origin = wheel_forces.copy()
        at_origin[:, 3:] += centres.take(NEXT, 1) * force.take(AFTER, 1) - centres.take(AFTER, 1) * force.take(NEXT, 1)
        return (at_origin @ self.data.J * self._moves).sum(0)


def forward_dynamics(
    rover: Rover, q: np.ndarray, v: np.ndarray, torques: np.ndarray, wheel_forces: np.ndarray
) -> Acceleration:
    """Return the acceleration of a rover and the torque of its differential: Eq (8) of the paper (equation of motion).

    Parameters
    ----------
    rover : Rover
        The rover.
    q, v : array
        Configuration [nq] and velocity [nv].
    torques : array
        Joint torques [nv] (N m); the first six are a wrench on the base in the base's axes (N, N m).
    wheel_forces : array
        Wrench (force, moment) at the centre of each wheel in the world's axes [n, 6] (N, N m), in the order of
        `rover.wheels`.

    Raises
    ------
    ParameterError
        An array has another shape or a number that is not finite, or the quaternion is not of unit length.

    Differs from the paper: a state that violates theta_s1 = -theta_s2 is brought back at the rate STABILISATION; this
    term is zero while the differential holds.

    Examples
    --------
    A rover in free fall:

    >>> from rover_pin import load_rover
    >>> rover = load_rover("cart")
    >>> q, v = pin.neutral(rover.model), np.zeros(rover.model.nv)
    >>> result = forward_dynamics(rover, q, v, np.zeros(rover.model.nv), np.zeros((len(rover.wheels), 6)))
    >>> round(float(result.a[2]), 2)
    -9.81
    """
    return Dynamics(rover).accelerate(*checked_state(rover, q, v), *_checked_forces(rover, torques, wheel_forces))


def forward_dynamics_aba(
    rover: Rover, q: np.ndarray, v: np.ndarray, torques: np.ndarray, wheel_forces: np.ndarray
) -> Acceleration:
    """Return the acceleration of a rover by the articulated-body algorithm, as an independent check.

    For arguments and result, see `forward_dynamics`.
    """
    return Dynamics(rover).accelerate_aba(*checked_state(rover, q, v), *_checked_forces(rover, torques, wheel_forces))


def mass_matrix(rover: Rover, q: np.ndarray) -> np.ndarray:
    """Return the mass matrix H of a rover [nv, nv] at q [nq], including the armature (inertia of the motors' rotors).

    H is a term of Eq (8) of the paper (equation of motion).
    """
    q = checked_configuration(rover, q)
    upper = np.triu(pin.crba(rover.model, rover.model.createData(), q, pin.Convention.WORLD))
    return np.array(upper + np.triu(upper, 1).T)


def bias(rover: Rover, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the bias force C of a rover [nv] at q [nq] and v [nv]: velocity terms and the gravity of every body.

    C is a term of Eq (8) of the paper (equation of motion).
    """
    q, v = checked_state(rover, q, v)
    return np.array(pin.nonLinearEffects(rover.model, rover.model.createData(), q, v))


def wheel_jacobians(rover: Rover, q: np.ndarray) -> np.ndarray:
    """Return the Jacobians J of a rover's wheels [n, 6, nv] at q [nq], in the order of `rover.wheels`.

    The Jacobian of a wheel maps v to the velocity of the wheel's centre and its angular velocity, both in the world's
    axes.
    """
    q = checked_configuration(rover, q)
    data = rover.model.createData()
    pin.computeJointJacobians(rover.model, data, q)
    return np.array(
        [pin.getJointJacobian(rover.model, data, wheel.joint, pin.LOCAL_WORLD_ALIGNED) for wheel in rover.wheels]
    )


def constraint_rows(rover: Rover, *, differential: bool = True) -> np.ndarray:
    """Return the constraint matrix G of a rover [m, nv], with one row for each of the m constraints.

    A velocity v satisfies all constraints if G v = 0. If the rover has a differential and `differential` is true, the
    first row states v[left] + v[right] = 0. For each joint that follows another joint, a row states v[follower] - ratio
    v[leader] = 0.
    """
    pairs: list[tuple[int | None, int | None, float]]
    pairs = [(coupling.follower, coupling.leader, coupling.ratio) for coupling in rover.couplings]
    if rover.differential is not None and differential:
        pairs.insert(0, (rover.differential.left, rover.differential.right, -1.0))
    return _rows(pairs, rover.model.nv)


def angle_rows(rover: Rover) -> np.ndarray:
    """Return the constraint matrix for angles [m, nq]. Its product with q is the violation of each constraint [rad].

    The rows are in the order of `constraint_rows`. The row of wheels that are tied together is zero, because such
    wheels have one common rate, but different angles.
    """
    pairs = [(coupling.q_follower, coupling.q_leader, coupling.ratio) for coupling in rover.couplings]
    if rover.differential is not None:
        pairs.insert(0, (rover.differential.q_left, rover.differential.q_right, -1.0))
    return _rows(pairs, rover.model.nq)


def _rows(pairs: list[tuple[int | None, int | None, float]], size: int) -> np.ndarray:
    """Return the rows of a constraint matrix, one row [size] for each (follower, leader, ratio) in `pairs`: 1 at the
    index of the follower and -ratio at the index of the leader.
    """
    rows = np.zeros((len(pairs), size))
    for row, (follower, leader, ratio) in zip(rows, pairs, strict=True):
        if follower is not None:
            row[follower], row[leader] = 1.0, -ratio
    return rows


def supporting_dofs(model: pin.Model, joint: int) -> list[int]:
    """Return the indices in v of the degrees of freedom that move a joint: its own, and the degrees of freedom of all
    joints that carry it, from the base outwards.
    """
    return [
        dof
        for support in list(model.supports[joint])[1:]
        for dof in range(model.joints[support].idx_v, model.joints[support].idx_v + model.joints[support].nv)
    ]


def checked_configuration(rover: Rover, q: np.ndarray) -> np.ndarray:
    """Return a configuration q as an array of floats [nq].

    Raises ParameterError: q has another shape, a number that is not finite, or a quaternion that is not of unit length.
    """
    q = checked_array("q", q, (rover.model.nq,))
    length = float(np.linalg.norm(q[3:7]))
    if abs(length - 1.0) > 1e-6:
        raise ParameterError(f"q[3:7] = {q[3:7]} has length {length:g}: a quaternion (x, y, z, w) must have length 1.")
    return q


def checked_state(rover: Rover, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return configuration q [nq] and velocity v [nv] as arrays of floats.

    Raises ParameterError: an array has another shape or a number that is not finite, or the quaternion in q is not of
    unit length.
    """
    return checked_configuration(rover, q), checked_array("v", v, (rover.model.nv,))


def checked_array(name: str, value: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return a value as an array of floats; `name` is the name of the argument in the error.

    Raises ParameterError: the array has another shape than `shape`, or a number that is not finite.
    """
    array = np.asarray(value, dtype=float)
    if array.shape != shape:
        raise ParameterError(f"{name} has shape {array.shape}, but this rover needs {shape}.")
    if not np.all(np.isfinite(array)):
        raise ParameterError(
            f"{name} contains a number that is not finite. Look for a division by zero in the computation of {name}."
        )
    return array


def _checked_forces(rover: Rover, torques: np.ndarray, wheel_forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return joint torques [nv] and wheel forces [n, 6] as arrays of floats.

    Raises ParameterError: an array has another shape or a number that is not finite (`checked_array`).
    """
    torques = checked_array("torques", torques, (rover.model.nv,))
    return torques, checked_array("wheel_forces", wheel_forces, (len(rover.wheels), 6))
