"""Wheel loads of a rover that drives slowly on uneven ground, computed from measured joint angles and driving torques.

`configuration` converts the measured angles to the configuration q, `footing` estimates the ground under the wheels,
and `driven_loads` solves the static balance.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError, closest
from rover_pin.rover.forward_dynamics import constraint_rows, wheel_jacobians
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_mounts

SLIDING = (0, 1, 5)
"""Indices in the velocity v of the base's motions along x and y and about z (yaw). Friction also resists these motions,
so that their balance does not determine the normal loads."""
RANK_TOLERANCE = 1e-6
"""Smallest singular value of the static balance that counts as different from zero, as a fraction of the largest one. A
combination of wheel loads with a smaller singular value leaves every balance of forces and moments unchanged, so that
statics do not determine it."""
MAX_OPEN_SHARE = 0.1
"""Maximum share of a wheel (or of the sum of an axle) in a combination of loads that statics do not determine.

A combination of wheel loads is not determined by statics if it leaves every balance of forces and moments unchanged, so
that any multiple of it could be added to the loads. The combination is scaled to unit length, and the share of a wheel
is its component. Up to this share, the load of the wheel counts as determined. Above this value, the load counts only
as a part of a sum (`determinate_groups`). The value is assumed: with a share of 0.1, the unknown multiple changes the
load of the wheel by a tenth of its amount."""
SHARE_ROUNDS = 4
"""Number of iterations for the two ratios rho (motion resistance to load) and eta (side force to load) in
`driven_loads`. Each iteration makes about one more digit correct."""


class Footing(NamedTuple):
    """The directions of the ground under each of the n wheels, as unit vectors in the world."""

    forward: np.ndarray
    """unit vectors along the ground, in the plane of each wheel [n, 3]"""
    left: np.ndarray
    """unit vectors along the axle of each wheel [n, 3]"""
    normal: np.ndarray
    """unit vectors out of the ground, in the plane of each wheel [n, 3]"""

    @property
    def slope(self) -> np.ndarray:
        """Return the inclination of the ground along each wheel [n] (rad), positive if the ground rises ahead."""
        return np.asarray(np.arcsin(np.clip(self.forward[:, 2], -1.0, 1.0)))


def configuration(rover: Rover, attitude: tuple[float, float, float], angles: Mapping[str, float]) -> np.ndarray:
    """Return the configuration q [nq] of a rover with the given attitude and joint angles, at the origin of the world.

    Parameters
    ----------
    rover : Rover
        The rover.
    attitude : (roll, pitch, yaw)
        Attitude of the base [rad]; pitch is positive nose down.
    angles : mapping
        Name of a suspension or steering angle, as in a trace -> its value [rad]. All other angles are 0, and joints
        that follow another joint get the angle of this joint times their ratio.

    Raises
    ------
    ParameterError
        The rover does not have one of the angles.
    """
    # The base is at the origin; its attitude is stored as a quaternion.
    q = pin.neutral(rover.model)
    roll, pitch, yaw = attitude
    rotation = pin.rpy.rpyToMatrix(float(roll), float(pitch), float(yaw))
    q[3:7] = pin.Quaternion(rotation).coeffs()
    for name, angle in angles.items():
        if name not in rover.angles:
            raise ParameterError(f"Rover '{rover.name}' has no angle '{name}': {closest(name, rover.angles)}")
        q[rover.angles[name]] = angle
    # Joints that follow other joints get their angles from the leading joints.
    for joint in rover.couplings:
        if joint.q_follower is not None:
            q[joint.q_follower] = joint.ratio * q[joint.q_leader]
    return q


def turning(rotations: Sequence[np.ndarray], axles: np.ndarray) -> np.ndarray:
    """Return the angle [T, n] (rad) by which the mount of each wheel has turned about its axle since the first row.

    A tachometer measures the rate of a wheel relative to its mount, but the motion of the rim over the ground also
    includes the rotation of the mount. If a matrix R rotates by less than half a turn, its rotation vector is (angle /
    sin angle) times the axial vector of (R - R^T) / 2.

    Parameters
    ----------
    rotations : sequence of arrays [n, 3, 3]
        Rotations of the mounts, one array for each row.
    axles : array [n, 3]
        Unit vectors along the axles in the world.
    """
    # Rotation of each mount since the first row; its rotation vector is projected on the axle.
    turned = np.asarray(rotations) @ np.swapaxes(rotations[0], -1, -2)
    sines = 0.5 * np.stack([turned[..., i, j] - turned[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=-1)
    sine = np.linalg.norm(sines, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(turned, axis1=-2, axis2=-1) - 1.0))
    factor = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 1e-9)
    return np.asarray(factor * np.sum(axles * sines, axis=-1))


def footing(rover: Rover, q: np.ndarray) -> tuple[Footing, np.ndarray]:
    """Return the directions of the ground under each wheel, and the Jacobians of the wheels [n, 6, nv], at a
    configuration q [nq].

    No sensor measures the slope of the ground under a wheel. The slope is therefore taken along the line from the
    centre of the wheel behind to the centre of the wheel ahead on its side; for the first and the last wheel, the line
    begins or ends at the wheel itself. This smooths ground that bends within a wheel base, so that loads on rocks are
    less accurate.
    """
    jacobians, (_, centres) = wheel_jacobians(rover, q), wheel_mounts(rover, q)
    # On each side, the direction runs from the wheel behind to the wheel ahead. At an end of the side, the wheel itself
    # takes the place of the missing neighbour.
    along = np.empty_like(centres)
    for side in "lr":
        rows = [i for i, wheel in enumerate(rover.wheels) if wheel.side == side]
        along[rows] = centres[rows[:1] + rows[:-1]] - centres[rows[1:] + rows[-1:]]
    # The axle is the axis of the wheel's own rate. The direction of the ground is made perpendicular to the axle.
    left = np.array([J[3:, wheel.dof] for J, wheel in zip(jacobians, rover.wheels, strict=True)])
    left /= np.linalg.norm(left, axis=1)[:, None]
    along -= np.sum(along * left, axis=1)[:, None] * left
    along /= np.linalg.norm(along, axis=1)[:, None]
    return Footing(along, left, np.cross(along, left)), jacobians


def driven_loads(rover: Rover, q: np.ndarray, torque: np.ndarray, foot: Footing, jacobians: np.ndarray) -> np.ndarray:
    """Return the normal load of each wheel [n] (N) of a slowly driven rover, from its posture and driving torques.

    The loads solve the balance of forces and moments on the base, and of moments on every free pivot. The soil acts on
    a wheel of load f_n and radius r by

        the force f_n (n - rho t - eta y) + (T / r) t and the moment -T y about the axle,

    where the unit vectors t, n and y point forward along the ground, out of the ground and along the axle, and T is the
    measured driving torque. The ratios rho (motion resistance to load) and eta (side force to load) are common to all
    wheels and follow from the balance along and across the rover. If statics do not determine all loads, the solution
    of least norm is returned; `determinate_groups` shows which loads are determined.

    Parameters
    ----------
    rover : Rover
        The rover under the gravity of the drive.
    q : array [nq]
        Attitude and angles of suspension and steering; see `configuration`.
    torque : array [n]
        Driving torques at the wheels [N m].
    foot, jacobians : Footing, array [n, 6, nv]
        The ground under each wheel and the wheels' Jacobians, as `footing` returns them.

    Source: section 4 of the paper, "evaluated from the body attitude and the suspension link angles considering static
    balance among forces and moments". Differs from the paper: the balance includes the driving torques, because they
    load the pivots; the slope of the ground under a wheel is taken between its neighbours (`footing`).
    """
    r, free = rover.radii, rover.free_dofs
    weight = pin.computeGeneralizedGravity(rover.model, rover.model.createData(), q)
    pull = (torque / r)[:, None] * foot.forward
    applied_force = np.einsum("nij,ni->j", jacobians, np.hstack([pull, -torque[:, None] * foot.left]))
    hold = rover.mass * rover.gravity * rover.up - pull.sum(axis=0)
    # Generalised forces of a unit load: normal force, resistance, side force. The side force acts at the rim, so that
    # its moment about the wheel's centre is (-r n) x (-eta y) = -r eta t.
    pushes = ((foot.normal, 0.0 * foot.normal), (-foot.forward, 0.0 * foot.normal),
              (-foot.left, -r[:, None] * foot.forward))  # fmt: skip
    lifts = [np.einsum("nij,ni->jn", jacobians, np.hstack(push))[free] for push in pushes]
    held_rows, target = constraint_rows(rover).T[free], (weight - applied_force)[free]
    # The loads depend on the ratios rho and eta, and the ratios on the loads: a fixed-point iteration from zero ratios.
    rho, eta = 0.0, 0.0
    for _ in range(SHARE_ROUNDS):
        unknown = np.column_stack([lifts[0] + rho * lifts[1] + eta * lifts[2], held_rows])
        solution, *_ = np.linalg.lstsq(unknown, target, rcond=1e-10)
        load = solution[: len(rover.wheels)]
        # The unbalanced force along and across the rover, over the total load, gives the ratios of the next iteration.
        # The directions of the wheels count by their loads.
        lacking = hold - load @ foot.normal
        means = [np.maximum(load, 0.0) @ axes for axes in (foot.forward, foot.left)]
        rho, eta = (
            -float(lacking @ (mean / max(float(np.linalg.norm(mean)), math.ulp(1.0)))) / max(float(np.sum(load)), 1e-9)
            for mean in means
        )
    return np.array(load)


def determinate_groups(rover: Rover, foot: Footing, jacobians: np.ndarray) -> list[tuple[int, ...]]:
    """Return groups of wheels (tuples of indices) whose summed loads are determined by statics.

    A group is a single wheel if statics determine its load, otherwise the wheels of an axle if statics determine their
    sum. All other wheels form the last group. A comparison with measured loads may use only the sums of these groups.

    A rigid chassis on four wheels, for example, can shift load between its diagonals without any effect on the balance:
    adding (+, -, -, +) to its loads changes neither the sum of an axle nor a moment. The warp of the ground decides
    this part, and no sensor measures the warp.
    """
    upright = [dof for dof in rover.free_dofs if dof not in SLIDING]
    lifts = np.einsum("nij,ni->jn", jacobians[:, :3], foot.normal)[upright]
    _, singular_values, directions = np.linalg.svd(np.column_stack([lifts, constraint_rows(rover).T[upright]]))
    # The directions without a singular value span all combinations of loads that leave the balance unchanged.
    open_ = directions[int(np.sum(singular_values > RANK_TOLERANCE * singular_values[0])) :, : len(rover.wheels)].T
    groups: list[tuple[int, ...]] = []
    others: list[int] = []
    for axle in dict.fromkeys(wheel.axle for wheel in rover.wheels):
        wheels = tuple(i for i, wheel in enumerate(rover.wheels) if wheel.axle == axle)
        # All wheels of an axle are determined, or only their sum, or neither.
        if np.all(np.linalg.norm(open_[list(wheels)], axis=1) < MAX_OPEN_SHARE):
            groups += [(i,) for i in wheels]
        elif np.linalg.norm(open_[list(wheels)].sum(axis=0)) < MAX_OPEN_SHARE:
            groups.append(wheels)
        else:
            others += wheels
    return [*groups, tuple(others)] if others else groups
