"""Set a rover down on its terrain, at rest."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rover_pin.effects.effect import BodyEffect
from rover_pin.errors import SimulationError
from rover_pin.motion.kernel import Kernel
from rover_pin.motion.model import Model
from rover_pin.motion.state import DriveState

SETTLE_STEPS, SETTLE_KEEP = 1500, 0.9
AT_REST = 3e-6
"""Velocity [m/s, rad/s] at which a rover counts as settled at once."""
UNDECIDED = 1.0
"""Speed [m/s] below which no direction of travel is taken while a rover is set down: at rest there is none."""
NEARLY_AT_REST = 1e-3
"""Velocity that is still taken when it is held by hand: the hold itself shakes it by dt times gravity's share."""


@dataclass(frozen=True)
class Start:
    """Where the base starts: x, y [m] and yaw [rad] in the world."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


def settled(model: Model, start: Start, symmetric: bool = False) -> DriveState:
    """Return the state at rest at `start`, wheels held: first straight down, then until the shear of the soil holds it.

    On ground too steep to hold it (or with a slip law that cannot), the rover starts unsheared and slides. Friction in
    its pivots is left out: it is set down where it would come to rest without.

    Raises
    ------
    SimulationError
        The rover does not come to rest there even when it is held against sliding.
    """
    model = dataclasses.replace(model, body_effects=tuple(map(_at_rest, model.body_effects)))
    state = hovering(model, start)
    wheels = [wheel.dof for wheel in model.rover.wheels]
    down = Kernel(model, state, 2e-3, symmetric, UNDECIDED)
    if relax(down, [0, 1, 5, *wheels], shearing=False) > NEARLY_AT_REST:
        raise SimulationError(
            f"The rover does not settle at x = {start.x:g} m, y = {start.y:g} m: it tips or sinks there; "
            "start on gentler ground or on stiffer soil."
        )
    sheared = state.copy()
    held = bool(model.slip.states) and relax(Kernel(model, sheared, 2e-2, symmetric), wheels, shearing=True) < AT_REST
    chosen = sheared if held else state
    chosen.v[:], chosen.motor[:] = 0.0, 0.0
    return chosen


def _at_rest(effect: BodyEffect) -> BodyEffect:
    return effect.replace(**effect.neutral) if effect.only_resists else effect


LOCKED = 1e6
"""Rotor inertia [kg m^2] that keeps a wheel from turning within a step."""


def relax(kernel: Kernel, held: list[int], *, shearing: bool) -> float:
    """Let the kernel's state come to rest in place, its speed cut after every step; return the fastest speed left.

    The rates of `held` are zeroed after every step; the wheels are locked within it too.
    """
    state, fastest = kernel.state, math.inf
    armature = np.array(kernel.pin_model.armature)
    armature[[wheel.dof for wheel in kernel.model.rover.wheels]] = LOCKED
    kernel.pin_model.armature = armature
    for _ in range(SETTLE_STEPS):
        if kernel.step():
            return math.inf
        state.v *= SETTLE_KEEP
        state.v[held] = 0.0
        if not shearing:
            state.contact[:] = 0.0
        fastest = float(np.abs(state.v).max())
        if fastest < AT_REST:
            break
    return fastest


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
