"""The body effects of a model as one CasADi function: the generalised force of these effects on the base and the
suspension, and its derivatives by the speeds.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca

from rover_pin.base.errors import ParameterError
from rover_pin.effects.effect import Body, BodyEffect, Push
from rover_pin.simulation.compiled.laws import law, symbolic
from rover_pin.simulation.native.rigid_body import rotation_of
from rover_pin.simulation.state import Joints


class _Symbols(NamedTuple):
    """CasADi symbols of the inputs of the body law, in the order of the function's arguments."""

    position: Any
    quaternion: Any
    base_speed: Any
    """velocity (3) and angular velocity (3) of the base in its own axes"""
    angles: Any
    rates: Any
    half_step: Any
    known_rates: Any
    """rates of the joints for formulas whose derivatives by these rates must not be taken"""


def body_law(effects: Sequence[BodyEffect], joints: Joints) -> ca.Function:
    """Return a CasADi function that computes the generalised force of all body effects and its derivatives by the
    speeds.

    The inputs of the function are the body vector, an empty vector of states, and the parameters of the effects. The
    body vector holds the configuration of the base (7), the velocity of the base (6), angles and rates of the
    suspension's joints, and half the time step. Let dt be the time step, u the speeds (base, then joints), q the
    configuration in the middle of the step, q' its rate, and F the generalised force at q. The output is one column:

        Q = F + dt/2 dF/dq q',   D = dF/du + dt/2 dF/dq dq'/du (column-major),   T,   dT/du,

    where T is the torque of the differential, also extrapolated to the end of the step. If the speeds change by du in
    the step, Q + D du is the force at the end of the step to first order. dF/dq contains the derivatives by the
    position of the base and by the joint angles, but not those by the attitude.

    Parameters
    ----------
    effects : sequence of BodyEffect
        Effects that push the body.
    joints : Joints
        The suspension's joints.

    Raises
    ------
    ParameterError
        An effect pushes another number of joints than the suspension has, or its formulas are not allowed (`law`).
    """
    # The body vector as symbols: half_step is half the time step, known_rates stand for rates that are not solved for.
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
    # The force of all effects, in the base's axes and on the joints, and the torque of the differential below it.
    rotation = rotation_of(s.quaternion)
    body = _body(s, rotation, joints)
    pushes = [effect.push(body) for effect in symbolic_effects]  # type: ignore[attr-defined]
    differential = sum((push.differential for push in pushes), ca.SX(0))
    force = ca.vertcat(_generalised_force(pushes, rotation, differential, joints), differential)
    speeds, places = ca.vertcat(s.base_speed, s.rates), ca.vertcat(s.position, s.angles)
    # dq'/du: the base moves along its own axes, which the rotation turns into the world's; joint angles by their rates.
    moves = ca.SX(3 + n, 6 + n)
    moves[:3, :3], moves[3:, 6:] = rotation, ca.SX.eye(n)
    drift = s.half_step * ca.mtimes(ca.jacobian(force, places), moves)
    slope = ca.jacobian(force, speeds) + drift
    at_end = force + ca.mtimes(drift, speeds)
    # The known rates take the values of the rates only after the derivatives are formed.
    m = 6 + n
    blocks = [at_end[:m], ca.vec(ca.densify(slope[:m, :])), at_end[m], ca.densify(slope[m, :]).T]
    out = ca.substitute(ca.densify(ca.vertcat(*blocks)), s.known_rates, s.rates)
    return law("body_law", [ca.vertcat(*s[:-1]), ca.SX(0, 1), parameters], out)


def elastic_energy(effects: Sequence[BodyEffect], joints: Joints) -> ca.Function:
    """Return a CasADi function that computes the energy [J] that is stored in the springs of the body effects.

    Its inputs are the configuration of the base (7) and the angles of the suspension joints.
    """
    # Energy that springs store depends on position and angles only, so that all speeds are set to zero.
    base, angles = ca.SX.sym("base", 7), ca.SX.sym("angles", joints.number)
    no_speed, zero_rates = ca.SX.zeros(6), ca.SX.zeros(joints.number)
    s = _Symbols(base[:3], base[3:], no_speed, angles, zero_rates, ca.SX(0), zero_rates)
    body = _body(s, rotation_of(s.quaternion), joints)
    energy = sum((effect.stored_energy(body) for effect in effects), ca.SX(0))
    return ca.Function("elastic_energy", [base, angles], [energy])


def _body(s: _Symbols, rotation: ca.SX, joints: Joints) -> Body:
    """Return the `Body`, the argument that body effects receive: position, attitude and speeds of the base in the
    world, and angles and rates of the suspension's joints. `rotation` is the rotation matrix of the base.
    """
    # Speeds of the base along the world's axes, and its roll, pitch and yaw as in `state.roll_pitch_yaw`.
    velocity, spin = ca.mtimes(rotation, s.base_speed[:3]), ca.mtimes(rotation, s.base_speed[3:])
    x, y, z, w = ca.vertsplit(s.quaternion)
    roll = ca.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = ca.asin(ca.fmax(-1.0, ca.fmin(1.0, 2 * (w * y - z * x))))
    yaw = ca.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    angles, rates, known_rates = (
        tuple(ca.vertsplit(column)) if joints.number else () for column in (s.angles, s.rates, s[-1])
    )
    base = [*ca.vertsplit(s.position), roll, pitch, yaw, *ca.vertsplit(velocity), *ca.vertsplit(spin)]
    # A differential holds the sum of the rockers' angles at zero; the twist is this sum.
    twist, twist_rate = (sum((values[i] for i in joints.rockers or ()), 0.0) for values in (angles, rates))
    return Body(*base, angles, rates, known_rates, twist, twist_rate, joints.names)  # type: ignore[call-arg]


def _generalised_force(pushes: Sequence[Push], rotation: ca.SX, differential: ca.SX, joints: Joints) -> ca.SX:
    """Return the sum of the forces of all body effects as one generalised force: force and moment on the base along its
    own axes, then the torques on the suspension's joints.

    Parameters
    ----------
    pushes : sequence of Push
        Forces, moments and torques of the effects.
    rotation : ca.SX (3, 3)
        Rotation matrix of the base.
    differential : ca.SX
        Torque that a compliant differential exerts on each rocker [N m].
    joints : Joints
        The suspension's joints.
    """
    force = sum((ca.vertcat(push.f_x, push.f_y, push.f_z) for push in pushes), ca.SX.zeros(3))
    moment = sum((ca.vertcat(push.m_x, push.m_y, push.m_z) for push in pushes), ca.SX.zeros(3))
    torques = ca.SX.zeros(joints.number)
    for push in pushes:
        if len(push.joints) not in (0, joints.number):
            raise ParameterError(
                f"A body effect returns torques for {len(push.joints)} joints, but the suspension has {joints.number}: "
                "return one torque for each joint in `Body.angles`, or no torques at all."
            )
        torques += ca.vertcat(*push.joints) if push.joints else 0.0
    # A differential acts on both rockers alike; its own torque is the one on the left.
    for rocker in joints.rockers or ():
        torques[rocker] += differential
    # The base's speeds are in its own axes, so that force and moment are turned into these.
    return ca.vertcat(ca.mtimes(rotation.T, force), ca.mtimes(rotation.T, moment), torques)
