"""What an inertial unit at the body's origin reads, of poses and speeds: turn rates and specific force."""

from collections.abc import Iterable, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

GYRO = tuple(f"gyro_{axis}" for axis in "xyz")
ACCELEROMETER = tuple(f"accelerometer_{axis}" for axis in "xyz")
GRAVITY = tuple(f"gravity_{axis}" for axis in "xyz")
"""Gravity in the world [m/s^2], which the readings need beside the motion."""


def has_inertial(names: Iterable[str]) -> bool:
    """Return whether an inertial unit's reading is among these channels."""
    return not {*GYRO, *ACCELEROMETER}.isdisjoint(names)


def inertial(channels: Mapping[str, np.ndarray], period: float) -> dict[str, np.ndarray]:
    """Return turn rates [rad/s] and specific force [m/s^2] along the body's axes: ahead, left, up; (T,) each.

    omega_k = log(R_{k-1}^T R_{k+1}) / (2 dt) and f = R^T (dv/dt - g), so that at rest on the level f = (0, 0, 9.81).
    R is of world z-y-x angles (nose down is positive), v the world's velocity, both of the body's origin: how far off
    it a unit is mounted is neglected, omega^2 d. Source: strapdown kinematics (Titterton and Weston, 2004, ch. 3).

    Parameters
    ----------
    channels : mapping
        `body_roll`, `body_pitch`, `body_yaw` [rad], `body_vx`, `_vy`, `_vz` [m/s] and `gravity_x`, `_y`, `_z`.
    period : float
        Time between rows [s].
    """
    angles, velocity, gravity = (
        np.column_stack([channels[name] for name in names])
        for names in (("body_yaw", "body_pitch", "body_roll"), ("body_vx", "body_vy", "body_vz"), GRAVITY)
    )
    if len(angles) < 2:
        return {name: np.full(len(angles), np.nan) for name in (*GYRO, *ACCELEROMETER)}
    attitude = Rotation.from_euler("ZYX", angles)
    at = np.arange(len(angles))
    before, after = np.maximum(at - 1, 0), np.minimum(at + 1, len(at) - 1)
    turned = (attitude[before].inv() * attitude[after]).as_rotvec() / ((after - before)[:, None] * period)
    force = attitude.inv().apply(np.gradient(velocity, period, axis=0) - gravity)
    return dict(zip((*GYRO, *ACCELEROMETER), (*turned.T, *force.T), strict=True))
