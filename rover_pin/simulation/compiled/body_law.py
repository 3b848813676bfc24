"""A model's effects on its body as one CasADi function: generalised force on base and suspension, and its slope."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca

from rover_pin.base.errors import ParameterError
from rover_pin.effects.effect import Body, BodyEffect, Push
from rover_pin.simulation.compiled.laws import law, symbolic
from rover_pin.simulation.native.rigid_body import rotation_of


class Joints(NamedTuple):
    """The suspension as the law counts it: its joints' number, the differential's two, and the names."""

    number: int
    rockers: tuple[int, int] | None
    names: tuple[str, ...] = ()


class _Symbols(NamedTuple):
    position: Any
    quaternion: Any
    base_speed: Any
    angles: Any
    rates: Any
    half_step: Any
    known_rates: Any


def body_law(effects: Sequence[BodyEffect], joints: Joints) -> ca.Function:
    """Return the function (body, no states, parameters) -> generalised force and its slope.

    The body vector is q of the base (7), v of the base (6), angles and rates of the suspension's joints, and half the
    time step. With u the speeds (base, then joints), F the force at the half-step configuration q, one output column:

        Q = F + dt/2 dF/dq q', D = dF/du + dt/2 dF/dq dq'/du (column-major), the differential's torque T, dT/du (a row),

    so that Q + D du is the force at the end of the step, to first order; dF/dq leaves the attitude out.
    """
    symbolic_effects, parameters = symbolic(effects)
    n = joints.number
    dimensions = {
        "position": 3,
        "quaternion": 4,
        "base_speed": 6,
        "angles": n,
        "rates": n,
        "half_step": 1,
        "known_rates": n,
    }
    s = _Symbols(**{name: ca.SX.sym(name, size) for name, size in dimensions.items()})
    rotation = rotation_of(s.quaternion)
    body = _body(s, rotation, joints)
    pushes = [effect.push(body) for effect in symbolic_effects]  # type: ignore[attr-defined]
    differential = sum((push.differential for push in pushes), ca.SX(0))
    force = ca.vertcat(_generalised_force(pushes, rotation, differential, joints), differential)
    speeds, places = ca.vertcat(s.base_speed, s.rates), ca.vertcat(s.position, s.angles)
    moves = ca.SX(3 + n, 6 + n)
    moves[:3, :3], moves[3:, 6:] = rotation, ca.SX.eye(n)
    drift = s.half_step * ca.mtimes(ca.jacobian(force, places), moves)
    slope = ca.jacobian(force, speeds) + drift
    at_end = force + ca.mtimes(drift, speeds)
    m = 6 + n
    blocks = [at_end[:m], ca.vec(ca.densify(slope[:m, :])), at_end[m], ca.densify(slope[m, :]).T]
    out = ca.substitute(ca.densify(ca.vertcat(*blocks)), s.known_rates, s.rates)
    return law("body_law", [ca.vertcat(*s[:-1]), ca.SX(0, 1), parameters], out)


def elastic_energy(effects: Sequence[BodyEffect], joints: Joints) -> ca.Function:
    """Return the function (q of the base (7), suspension angles) -> energy that the effects hold [J]."""
    base, angles = ca.SX.sym("base", 7), ca.SX.sym("angles", joints.number)
    still, zero_rates = ca.SX.zeros(6), ca.SX.zeros(joints.number)
    s = _Symbols(base[:3], base[3:], still, angles, zero_rates, ca.SX(0), zero_rates)
    body = _body(s, rotation_of(s.quaternion), joints)
    energy = sum((effect.stored_energy(body) for effect in effects), ca.SX(0))
    return ca.Function("elastic_energy", [base, angles], [energy])


def _body(s: _Symbols, rotation: ca.SX, joints: Joints) -> Body:
    velocity, spin = ca.mtimes(rotation, s.base_speed[:3]), ca.mtimes(rotation, s.base_speed[3:])
    x, y, z, w = ca.vertsplit(s.quaternion)
    roll = ca.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = ca.asin(ca.fmax(-1.0, ca.fmin(1.0, 2 * (w * y - z * x))))
    yaw = ca.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    angles, rates, known_rates = (
        tuple(ca.vertsplit(column)) if joints.number else () for column in (s.angles, s.rates, s[-1])
    )
    base = [*ca.vertsplit(s.position), roll, pitch, yaw, *ca.vertsplit(velocity), *ca.vertsplit(spin)]
    twist, twist_rate = (sum((values[i] for i in joints.rockers or ()), 0.0) for values in (angles, rates))
    return Body(*base, angles, rates, known_rates, twist, twist_rate, joints.names)  # type: ignore[call-arg]


def _generalised_force(pushes: Sequence[Push], rotation: ca.SX, differential: ca.SX, joints: Joints) -> ca.SX:
    """Return the sum of the pushes, on the speeds of the base in its own axes and on the joints."""
    force = sum((ca.vertcat(push.f_x, push.f_y, push.f_z) for push in pushes), ca.SX.zeros(3))
    moment = sum((ca.vertcat(push.m_x, push.m_y, push.m_z) for push in pushes), ca.SX.zeros(3))
    torques = ca.SX.zeros(joints.number)
    for push in pushes:
        if len(push.joints) not in (0, joints.number):
            raise ParameterError(
                f"A body effect pushes {len(push.joints)} joints, but the suspension has {joints.number}: "
                "give one torque a joint of `Body.angles`, or none."
            )
        torques += ca.vertcat(*push.joints) if push.joints else 0.0
    for rocker in joints.rockers or ():
        torques[rocker] += differential
    return ca.vertcat(ca.mtimes(rotation.T, force), ca.mtimes(rotation.T, moment), torques)
