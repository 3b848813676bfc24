"""Set a rover down on its terrain, at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rover_pin.errors import SimulationError
from rover_pin.motion.kernel import Kernel
from rover_pin.motion.model import Model
from rover_pin.motion.state import DriveState

SETTLE_DT, SETTLE_STEPS, SETTLE_KEEP = 2e-3, 3000, 0.9
AT_REST = 1e-7
"""Largest velocity [m/s, rad/s] of a settled rover."""


@dataclass(frozen=True)
class Start:
    """Where the base starts: x, y [m] and yaw [rad] in the world."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


def settled(model: Model, start: Start, symmetric: bool = False) -> DriveState:
    """Return the state at rest at `start`: wheels held and heading kept, the rest let sink until nothing moves.

    Raises
    ------
    SimulationError
        The rover does not come to rest there.
    """
    state = hovering(model, start)
    kernel = Kernel(model, state, SETTLE_DT, symmetric)
    held = [wheel.dof for wheel in model.rover.wheels]
    for _ in range(SETTLE_STEPS):
        if kernel.step():
            break
        state.v *= SETTLE_KEEP
        state.v[held] = 0.0
        state.v[[0, 1, 5]] = 0.0
        state.contact[:] = 0.0
        if np.max(np.abs(state.v)) < AT_REST:
            break
    if not np.all(np.isfinite(state.q)) or np.max(np.abs(state.v)) > 1e-3:
        raise SimulationError(
            f"The rover does not settle at x = {start.x:g} m, y = {start.y:g} m: it slides, tips or sinks there; "
            "start on gentler ground or on stiffer soil."
        )
    state.v[:] = 0.0
    state.contact[:], state.motor[:] = 0.0, 0.0
    return state


def hovering(model: Model, start: Start) -> DriveState:
    """Return the state with the wheels just touching, pitched and rolled as the terrain is at `start`."""
    rover, terrain = model.rover, model.terrain
    heading = np.array([math.cos(start.yaw), math.sin(start.yaw), 0.0])
    normal = np.asarray(terrain.normal(start.x, start.y))
    left = np.cross(normal, heading)
    left /= np.linalg.norm(left)
    rotation = np.column_stack([np.cross(left, normal), left, normal])
    q = pin.neutral(rover.model)
    q[3:7] = pin.Quaternion(rotation).coeffs()
    q[:3] = start.x, start.y, 0.0
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, q)
    lift = []
    for wheel in rover.wheels:
        x, y, z = data.oMi[wheel.joint].translation
        lift.append(float(terrain.height(x, y)) + float(wheel.wheel.r) - z)
    q[2] = max(lift)
    n = len(rover.wheels)
    contact = sum(len(effect.states) for effect in model.contact_effects)
    motor = sum(len(effect.states) for effect in model.motor_effects)
    return DriveState(0.0, q, np.zeros(rover.model.nv), np.zeros((n, contact)), np.zeros((n, motor)))
