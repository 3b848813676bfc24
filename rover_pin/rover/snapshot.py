"""Where everything is and how it moves at one (q, v): names, not indices; read-only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError, closest
from rover_pin.rover.forward_dynamics import checked_state
from rover_pin.rover.rover import Rover


class WheelMotion(NamedTuple):
    """A wheel in the world: centre [m], axle (unit, to the left), velocities [m/s, rad/s], and its own rate [rad/s]."""

    centre: np.ndarray
    axle: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    rate: float


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Kinematics of a rover in the world; arrays are read-only, rows of the wheels' are in the order of `names`."""

    position: np.ndarray
    "of the base's origin [3] m"
    rotation: np.ndarray
    "of the base [3, 3]"
    velocity: np.ndarray
    "of the base's origin [3] m/s"
    angular_velocity: np.ndarray
    "of the base [3] rad/s"
    names: tuple[str, ...]
    centres: np.ndarray
    "[n, 3] m"
    axles: np.ndarray
    "[n, 3] unit vectors along the axes of turning, to the left at zero angles"
    velocities: np.ndarray
    "of the wheel centres [n, 3] m/s"
    angular_velocities: np.ndarray
    "[n, 3] rad/s"
    rates: np.ndarray
    "of the wheels on their mounts [n] rad/s, positive drives forward"
    angles: Mapping[str, float]
    "suspension and steering [rad]"

    def wheel(self, name: str) -> WheelMotion:
        """Return what the wheel of this name does."""
        if name not in self.names:
            raise ParameterError(f"The snapshot has no wheel '{name}': {closest(name, self.names)}")
        i = self.names.index(name)
        return WheelMotion(
            self.centres[i], self.axles[i], self.velocities[i], self.angular_velocities[i], float(self.rates[i])
        )


def snapshot(rover: Rover, q: np.ndarray, v: np.ndarray) -> Snapshot:
    """Return the kinematics at a configuration [nq] and a velocity [nv].

    Raises
    ------
    ParameterError
        An array of another shape or with a number that is not finite, or a quaternion that is not of unit length.
    """
    q, v = checked_state(rover, q, v)
    model, data = rover.model, rover.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.forwardKinematics(model, data, q, v)
    joints = [wheel.joint for wheel in rover.wheels]
    motions = [pin.getVelocity(model, data, joint, pin.LOCAL_WORLD_ALIGNED) for joint in [1, *joints]]
    base = data.oMi[1]
    return Snapshot(
        position=_fixed(base.translation),
        rotation=_fixed(base.rotation),
        velocity=_fixed(motions[0].linear),
        angular_velocity=_fixed(motions[0].angular),
        names=tuple(wheel.name for wheel in rover.wheels),
        centres=_fixed([data.oMi[joint].translation for joint in joints]),
        axles=_fixed([data.J[3:, wheel.dof] for wheel in rover.wheels]),
        velocities=_fixed([motion.linear for motion in motions[1:]]),
        angular_velocities=_fixed([motion.angular for motion in motions[1:]]),
        rates=_fixed(v[[wheel.dof for wheel in rover.wheels]]),
        angles=MappingProxyType({name: float(q[place]) for name, place in rover.angles.items()}),
    )


def _fixed(values: object) -> np.ndarray:
    array = np.array(values, dtype=float)
    array.flags.writeable = False
    return array
