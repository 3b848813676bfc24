"""Setting a rover down in Python, step by step: what native/settle.c does in one call."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from rover_pin.effects.slip import SIDEWAYS_SHARE
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.state import DriveState, roll_pitch_yaw

UNDECIDED = 1.0
"""Speed [m/s] below which no direction of travel is taken while a rover is set down: at rest there is none."""
AIM, AT_REST = 1e-8, 1e-5
"""Acceleration over gravity at which a rover is at rest: what is aimed at, and what is still taken."""
DRIVING, IN_HAND, ON_THE_SOIL = range(3)
"""What the compiled step does: the enum in native/drive.h."""
PITCH, NUDGE = 4, 1e-6
"""The base's pitch in v, and a turn that no rest notices [rad]."""
SLIDE = [0, 1, 5]
"""The base's own x, y and yaw in v: along the ground."""
MOST_STEPS = 300
FURTHEST = 0.1
"""Way of any wheel in one step over its radius: what was worked out where the step began hardly holds further on."""
PROBE = 1e-7
"""Step [s] that only looks: its speeds over its length are the accelerations."""
LOCKED = 1e15
"""Inertia [kg, kg m^2] of what is held still."""
SLOW, FAST = 0.25, 2.0
"""Factors of the step's length after one that did not come closer to rest, and after one that did."""
LONGEST = 100.0
"""Longest step over the first, in which a wheel falls by FURTHEST: Newton's, and what is held stays."""
MOST_SHEAR = (1.0, 1.0 / SIDEWAYS_SHARE)
"""|S| and |S_y| of a wheel that only slides."""


class Relaxation:
    """A rover that is set down by implicit steps, each from no speed: q <- q + dt^2/2 (M - dt D - dt^2/2 K)^-1 Q.

    D and K are the slopes of the generalised force Q with speed and with the wheels' depth. Short steps follow the
    force, long ones are Newton's for Q = 0: the step grows while the rest comes nearer, so that neither a stiff shear
    (small k), a stiff or a soft ground nor the rover's weight needs a step of its own. After every step the base is put
    back along the ground to its x, y and heading; the shear that the way has built up stays.

    Source: pseudo-transient continuation (Kelley and Keyes, SIAM J. Numer. Anal. 35 (1998) 508).
    """

    def __init__(self, model: Model, state: DriveState, yaw: float, symmetric: bool):
        self.model, self.state, self.yaw = model, state, yaw
        self.kernel = Kernel(model, state, PROBE, symmetric, UNDECIDED)
        self.place = state.q[:2].copy()
        self.rise = np.array(model.terrain.gradient(*self.place))
        self.radius = min(float(wheel.wheel.r) for wheel in model.rover.wheels)
        self.weights = _lengths(model)
        self.most_slid = 10.0 * min(float(soil.k) for soil in model.soils) / self.radius
        self.slip = _slip_columns(model)
        self.rotors = self.kernel.armature.copy()
        self._lock([wheel.dof for wheel in model.rover.wheels])

    def in_hand(self) -> float:
        """Come to rest held against sliding and turning, the soil unsheared; return what `unbalanced` does then.

        Twice: the second time from a slightly other pitch, so that it does not rest where it would tip over.
        """
        self._lock(SLIDE)
        self._relax(IN_HAND)
        self.state.v[PITCH] = NUDGE
        self.state.q[:] = pin.integrate(self.kernel.pin_model, self.state.q, self.state.v)
        self.state.v[PITCH] = 0.0
        return self._relax(IN_HAND)

    def let_go(self) -> None:
        """Hold the rover no more: only its wheels stay locked."""
        self.kernel.armature[SLIDE] = self.rotors[SLIDE]
        self.weights[SLIDE] = _lengths(self.model)[SLIDE]

    def on_the_soil(self) -> float:
        """Come to rest on sheared soil alone; return what `unbalanced` does then."""
        return self._relax(ON_THE_SOIL)

    def unbalanced(self) -> float:
        """Return the greatest acceleration of what is free to move, over gravity, with lengths for angles."""
        before = self.state.copy()
        self.kernel.struct.dt, self.kernel.struct.settling = PROBE, DRIVING
        failed = self.kernel.step()
        speed = float(np.max(np.abs(self.weights * self.state.v)))
        _copy(before, self.state)
        return math.inf if failed else speed / PROBE / self.model.gravity

    def _relax(self, how: int) -> float:
        dt = math.sqrt(FURTHEST * self.radius / self.model.gravity)
        longest = LONGEST * dt
        left = self.unbalanced()
        for _ in range(MOST_STEPS):
            if left <= AIM:
                break
            before = self.state.copy()
            whole = self._step(dt, how)
            now = self.unbalanced()
            if not math.isfinite(now):
                _copy(before, self.state)
                dt *= SLOW
                continue
            dt = min(longest, dt * (FAST if whole and now < left else SLOW if now > FAST * left else 1.0))
            left = now
        return left

    def _step(self, dt: float, how: int) -> bool:
        """Step once, at most as far as FURTHEST allows; return whether that was the whole step."""
        state, before = self.state, self.state.copy()
        self.kernel.struct.dt, self.kernel.struct.settling = dt, how
        if self.kernel.step():
            state.q[:] = np.nan
            return False
        state.v[SLIDE] = 0.0
        change = (state.contact - before.contact)[:, self.slip]
        way = float(np.max(np.abs(self.weights * state.v))) * 0.5 * dt / (FURTHEST * self.radius)
        slid = float(np.max(np.abs(change), initial=0.0)) / self.most_slid if how == ON_THE_SOIL else 0.0
        share = 1.0 / max(1.0, way, slid)
        state.q[:] = pin.integrate(self.kernel.pin_model, before.q, 0.5 * dt * share * state.v)
        sheared = before.contact[:, self.slip] + share * change
        _copy(before, state, q=False)
        if how == ON_THE_SOIL:
            state.contact[:, self.slip] = np.clip(sheared, -np.array(MOST_SHEAR), MOST_SHEAR)
        self._put_back()
        return share == 1.0

    def _put_back(self) -> None:
        q = self.state.q
        turn = math.remainder(self.yaw - roll_pitch_yaw(q)[2], 2 * math.pi)
        about_z = pin.Quaternion(math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2))
        q[3:7] = (about_z * pin.Quaternion(q[6], q[3], q[4], q[5])).coeffs()
        q[2] += self.rise @ (self.place - q[:2])
        q[:2] = self.place

    def _lock(self, dofs: list[int]) -> None:
        self.kernel.armature[dofs] = LOCKED
        self.weights[dofs] = 0.0


def _copy(source: DriveState, target: DriveState, q: bool = True) -> None:
    if q:
        target.q[:] = source.q
    target.v[:], target.contact[:], target.motor[:] = source.v, source.contact, source.motor


def _lengths(model: Model) -> np.ndarray:
    """Return what makes each speed one of a wheel [m/s]: 1, or for an angle how far the furthest wheel is away."""
    rover = model.rover
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, pin.neutral(rover.model))
    reach = max(float(np.linalg.norm(data.oMi[wheel.joint].translation)) for wheel in rover.wheels)
    return np.array([1.0] * 3 + [reach] * (rover.model.nv - 3))


def _slip_columns(model: Model) -> list[int]:
    first = 0
    for effect in model.contact_effects:
        if effect is model.slip:
            break
        first += len(effect.states)
    return list(range(first, first + len(model.slip.states)))


def set_down(model: Model, state: DriveState, yaw: float, symmetric: bool) -> str:
    """Do as `relaxation.relaxed` does; return the name of how it stands."""
    held = Relaxation(model, state, yaw, symmetric)
    if held.in_hand() > AT_REST:
        return "NEVER"
    in_hand = state.copy()
    held.let_go()
    if held.unbalanced() <= AT_REST or (model.slip.states and held.on_the_soil() <= AT_REST):
        return "RESTS"
    _copy(in_hand, state)
    return "SLIDES"
