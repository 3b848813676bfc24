"""Steady runs of a wheel on a rig as compiled functions: what carries the load, and what is then read and follows."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca

from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.effects.effect import Effect
from rover_pin.effects.slip import sliding_speed
from rover_pin.measurements.channel import FIELDS
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.quantity import quantities
from rover_pin.soil.sinkage import power_law_guess

LAWS = 512
"""Structures whose functions are kept: some sets' worth, as a study of many sets asks for the same ones."""

SLOWEST = 1e-9
"""Speed [m/s] below which nothing moves."""

LEAP = 1.5
"""Longest Newton step in ln h."""

DEEPEST = 0.98
"""Greatest sinkage over radius that Newton's method tries."""

CONDITIONS = 5
"""Inputs of a steady run: load [N], slip [-], speed along the heading, rim speed, speed along the axle [m/s]."""

VALUES = 5
"""What is predicted at each run."""


def parameter_names(effects: tuple[Effect, ...]) -> tuple[str, ...]:
    """Return the names of all parameters: those of wheel and soil, `Effect.parameter`, `rig.error`."""
    own = [f"{type(effect).__name__}.{name}" for effect in effects for name in quantities(effect)]
    return (*FIELDS, *own, *(f"rig.{name}" for name in quantities(RigErrors)))


class Balance(NamedTuple):
    """A structure's equations: the values and the balance F at z, and what starts and steps Newton's method."""

    z: ca.SX
    condition: ca.SX
    p: ca.SX
    values: ca.SX
    balance: ca.SX
    first: ca.Function
    newton: ca.Function


class Law(NamedTuple):
    """Functions of all runs: where Newton's method starts, one step of it, and what is read where it ends."""

    first: ca.Function
    newton: ca.Function
    point: ca.Function


@lru_cache(maxsize=LAWS)
def steady_law(effects: tuple[Effect, ...], free: tuple[str, ...], runs: int) -> Law:
    """Return the law of a structure for so many runs at once, all with the same parameters."""
    own = _balance(effects)
    every = zip(("first", "newton", "point"), (own.first, own.newton, _point(effects, free)), strict=True)
    return Law(*(one.map(name, "serial", runs, [one.n_in() - 1], []) for name, one in every))


@lru_cache(maxsize=LAWS)
def _point(effects: tuple[Effect, ...], free: tuple[str, ...]) -> ca.Function:
    """Return (z, condition, parameters) -> one column: channels, the load's error, derivatives column by column.

    At the balance F = 0 the derivative dz/dp = -(dF/dz)^-1 dF/dp is exact.
    """
    own, names = _balance(effects), parameter_names(effects)
    wanted = ca.vertcat(*(own.p[names.index(name)] for name in free)) if free else ca.SX(0, 1)
    # one sweep for all: four of them held each other's operations once more
    every = ca.jacobian(ca.vertcat(own.values, own.balance), ca.vertcat(own.z, wanted))
    by_z, by_p = every[:, : own.z.numel()], every[:, own.z.numel() :]
    total = by_p[:VALUES, :] - ca.mtimes(by_z[:VALUES, :], _solve(by_z[VALUES:, :], by_p[VALUES:, :]))
    column = ca.densify(ca.vertcat(own.values, own.balance[0], ca.vec(ca.densify(total))))
    return ca.Function("point", [own.z, own.condition, own.p], [column])


@lru_cache(maxsize=LAWS)
def _balance(effects: tuple[Effect, ...]) -> Balance:
    """Return what a structure is solved from: z = (ln h, states) makes F = (ln f_n - ln W, rates) vanish."""
    names = parameter_names(effects)
    condition, p = ca.SX.sym("condition", CONDITIONS), ca.SX.sym("p", len(names))
    z = ca.SX.sym("z", 1 + sum(len(effect.states) for effect in effects))
    errors = RigErrors().replace(**{one: p[names.index(f"rig.{one}")] for one in quantities(RigErrors)})
    true = ca.vertcat(condition[0] * errors.load_scale, condition[1:])
    load, balance, start = _chained(effects, true, p, z)
    read = ca.vertcat(*errors.read(load, ca.exp(z[0]), true[0]))
    values, balance = ca.cse([read, balance])
    step = -_solve(ca.jacobian(balance, z), balance)
    first = ca.Function("first", [condition, p], [start])
    newton = ca.Function("newton", [z, condition, p], [_limited(z, step, p[FIELDS.index("r")])])
    return Balance(z, condition, p, values, balance, first, newton)


def _chained(effects: tuple[Effect, ...], condition: ca.SX, p: ca.SX, z: ca.SX) -> tuple[Load, ca.SX, ca.SX]:
    """Return the load of all effects in turn, what must vanish at the balance, and where Newton's method starts."""
    values = iter(ca.vertsplit(p))
    wheel = Wheel().replace(**{name: next(values) for name in quantities(Wheel)})
    soil = Soil().replace(**{name: next(values) for name in quantities(Soil)})
    own = [effect.replace(**{name: next(values) for name in quantities(effect)}) for effect in effects]
    states = iter(ca.vertsplit(z)[1:])
    x = [tuple(next(states) for _ in effect.states) for effect in effects]
    load, S, v_x, rim, v_y = ca.vertsplit(condition)
    contact = Contact(S, 0.0, ca.exp(z[0]), v_x, v_y, 0.0, rim, 0.0, 0.0, wheel, soil)
    contact = contact._replace(S_y=v_y / ca.fmax(sliding_speed(contact), SLOWEST))
    for effect, own_states in zip(own, x, strict=True):
        contact = effect.amend(contact, own_states)
    push = Load()
    for effect, own_states in zip(own, x, strict=True):
        push = push.plus(effect.load(contact, push, own_states))
    rates = [rate for effect, own_states in zip(own, x, strict=True) for rate in effect.rate(contact, push, own_states)]
    shallow = 2 * wheel.r * ca.sin(ca.exp(power_law_guess(ca.log(load), wheel, soil)) / 2) ** 2
    start = ca.vertcat(ca.log(shallow), *[0.0] * (z.numel() - 1))
    return push, ca.vertcat(ca.log(push.f_n / load), *rates), start


def _solve(matrix: ca.SX, right: ca.SX) -> ca.SX:
    return right / matrix if matrix.numel() == 1 else ca.solve(matrix, right)


def _limited(z: ca.SX, step: ca.SX, r: ca.SX) -> ca.SX:
    """Return z after the step, ln h within a leap and above the axle."""
    ln_h = ca.fmin(z[0] + ca.fmax(ca.fmin(step[0], LEAP), -LEAP), ca.log(DEEPEST * r))
    return ca.vertcat(ln_h, *(z[i] + step[i] for i in range(1, z.numel())))
