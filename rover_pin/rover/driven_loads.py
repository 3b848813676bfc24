"""How a slowly driven rover on uneven ground shares its weight: statics with measured angles and driving torques."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError, closest
from rover_pin.rover.constraints import constraint_rows
from rover_pin.rover.forward_dynamics import wheel_jacobians
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_mounts

SLIDING = (0, 1, 5)
"""Base velocities along which the ground resists besides: their balance tells no load."""
UNTOLD = 1e-6
"""Singular value over the greatest below which a combination of loads moves no balance."""
SHARED = 0.1
"""Share of any such combination of unit length up to which a load, or the sum of an axle, counts as known."""
SHARES = 4
"""Rounds in which the shares of resistance and side force are found; each is some ten times nearer."""


class Footing(NamedTuple):
    """The ground under each wheel: unit vectors in the world, rows of wheels."""

    forward: np.ndarray
    "along the ground in the wheel's plane [n, 3]"
    left: np.ndarray
    "along the axle [n, 3]"
    normal: np.ndarray
    "out of the ground in the wheel's plane [n, 3]"

    @property
    def slope(self) -> np.ndarray:
        """Inclination of the ground along each wheel, nose-up positive [rad] (n,)."""
        return np.asarray(np.arcsin(np.clip(self.forward[:, 2], -1.0, 1.0)))


def configuration(rover: Rover, attitude: tuple[float, float, float], angles: Mapping[str, float]) -> np.ndarray:
    """Return q of the rover at the origin with this roll, pitch, yaw [rad] and these suspension and steering angles.

    Joints that follow others are where these put them.

    Raises ParameterError: an angle that the rover has not.
    """
    q = pin.neutral(rover.model)
    roll, pitch, yaw = attitude
    rotation = pin.rpy.rpyToMatrix(float(roll), float(pitch), float(yaw))
    q[3:7] = pin.Quaternion(rotation).coeffs()
    for name, angle in angles.items():
        if name not in rover.angles:
            raise ParameterError(f"Rover '{rover.name}' has no angle '{name}': {closest(name, rover.angles)}")
        q[rover.angles[name]] = angle
    for joint in rover.couplings:
        if joint.q_follower is not None:
            q[joint.q_follower] = joint.ratio * q[joint.q_leader]
    return q


def turning(rotations: Sequence[np.ndarray], axles: np.ndarray) -> np.ndarray:
    """Return by how far the mounts have turned about their wheels' axles since the first row [rad] (T, n).

    A tachometer measures the wheel against its mount; over the ground it turns with the mount besides. The logarithm
    of a rotation by less than a half turn: its angle over its sine, times half of what is not symmetric of it.
    """
    turned = np.asarray(rotations) @ np.swapaxes(rotations[0], -1, -2)
    sines = 0.5 * np.stack([turned[..., i, j] - turned[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=-1)
    sine = np.linalg.norm(sines, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(turned, axis1=-2, axis2=-1) - 1.0))
    share = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 1e-9)
    return np.asarray(share * np.sum(axles * sines, axis=-1))


def footing(rover: Rover, q: np.ndarray) -> tuple[Footing, np.ndarray]:
    """Return the ground under each wheel, and the wheels' Jacobians [n, 6, nv].

    No sensor tells the ground's slope under a wheel: it is taken along the line from the centre of the wheel behind to
    that of the wheel before, on the same side; the first and last wheel have one neighbour. Ground that bends within a
    wheelbase is smoothed by this: on rocks loads are off by 8 to 15 % (mean), as much as by the pitch alone.
    """
    jacobians, (_, centres) = wheel_jacobians(rover, q), wheel_mounts(rover, q)
    along = np.empty_like(centres)
    for side in "lr":
        rows = [i for i, wheel in enumerate(rover.wheels) if wheel.side == side]
        along[rows] = centres[rows[:1] + rows[:-1]] - centres[rows[1:] + rows[-1:]]
    left = np.array([J[3:, wheel.dof] for J, wheel in zip(jacobians, rover.wheels, strict=True)])
    left /= np.linalg.norm(left, axis=1)[:, None]
    along -= np.sum(along * left, axis=1)[:, None] * left
    along /= np.linalg.norm(along, axis=1)[:, None]
    return Footing(along, left, np.cross(along, left)), jacobians


def driven_loads(rover: Rover, q: np.ndarray, torque: np.ndarray, foot: Footing, jacobians: np.ndarray) -> np.ndarray:
    """Return the normal load of each wheel [n] (N) of a slowly driven rover, from its posture and driving torques.

    Balance of forces and moments on the base, and of moments on every free pivot, with the force of wheel i

        f_n (n - rho t - eta y) + (T / r) t,    and the moment -T y of the soil about the axle,

    t forward and n normal to the ground, y the axle, T the measured torque. rho, the share of the load that resists
    the motion, and eta, the side force's share, are those of all wheels: the balance along and across tells them. Of
    loads that statics leave open, the least.

    Parameters
    ----------
    rover : Rover
        Under the gravity in which it drives.
    q : array [nq]
        Attitude, suspension and steering angles; see `configuration`.
    torque : array [n]
        Driving torques at the wheels [N m].
    foot, jacobians : Footing, array [n, 6, nv]
        The ground under each wheel and the wheels' Jacobians, as `footing` has them.

    Source: section 4, "evaluated from the body attitude and the suspension link angles considering static balance among
    forces and moments". Differs from the paper: driving torques are in the balance, since they load the pivots; the
    ground's slope under a wheel is that between its neighbours (`footing`).
    """
    r, free = rover.radii, rover.free_dofs
    weight = pin.computeGeneralizedGravity(rover.model, rover.model.createData(), q)
    pull = (torque / r)[:, None] * foot.forward
    applied_force = np.einsum("nij,ni->j", jacobians, np.hstack([pull, -torque[:, None] * foot.left]))
    hold = rover.mass * rover.gravity * rover.up - pull.sum(axis=0)
    # The side force acts at the rim: (-r n) x (-eta y) = -r eta t.
    pushes = ((foot.normal, 0.0 * foot.normal), (-foot.forward, 0.0 * foot.normal),
              (-foot.left, -r[:, None] * foot.forward))  # fmt: skip
    lifts = [np.einsum("nij,ni->jn", jacobians, np.hstack(push))[free] for push in pushes]
    held_rows, wanted = constraint_rows(rover).T[free], (weight - applied_force)[free]
    rho, eta = 0.0, 0.0
    for _ in range(SHARES):
        unknown = np.column_stack([lifts[0] + rho * lifts[1] + eta * lifts[2], held_rows])
        solution, *_ = np.linalg.lstsq(unknown, wanted, rcond=1e-10)
        load = solution[: len(rover.wheels)]
        lacking = hold - load @ foot.normal
        rho, eta = (-float(lacking @ _mean(axes, load)) / max(float(np.sum(load)), 1e-9)
                    for axes in (foot.forward, foot.left))  # fmt: skip
    return np.array(load)


def determinate_groups(rover: Rover, foot: Footing, jacobians: np.ndarray) -> list[tuple[int, ...]]:
    """Return the wheels whose loads statics tell one by one, else axles whose sum they tell, else all the others.

    A rigid chassis on four wheels shares its weight over the diagonals as the ground's warp has it, which no balance
    knows: (+, -, -, +) over its wheels changes neither the sum of an axle nor a moment.
    """
    upright = [place for place in rover.free_dofs if place not in SLIDING]
    lifts = np.einsum("nij,ni->jn", jacobians[:, :3], foot.normal)[upright]
    _, singular_values, directions = np.linalg.svd(np.column_stack([lifts, constraint_rows(rover).T[upright]]))
    open_ = directions[int(np.sum(singular_values > UNTOLD * singular_values[0])) :, : len(rover.wheels)].T
    groups: list[tuple[int, ...]] = []
    others: list[int] = []
    for axle in dict.fromkeys(wheel.axle for wheel in rover.wheels):
        wheels = tuple(i for i, wheel in enumerate(rover.wheels) if wheel.axle == axle)
        if np.all(np.linalg.norm(open_[list(wheels)], axis=1) < SHARED):
            groups += [(i,) for i in wheels]
        elif np.linalg.norm(open_[list(wheels)].sum(axis=0)) < SHARED:
            groups.append(wheels)
        else:
            others += wheels
    return [*groups, tuple(others)] if others else groups


def _mean(axes: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Return the loaded wheels' mean direction, of length 1."""
    mean = np.maximum(load, 0.0) @ axes
    return np.asarray(mean / max(float(np.linalg.norm(mean)), math.ulp(1.0)))
