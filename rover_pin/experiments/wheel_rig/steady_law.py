"""Steady runs of a wheel on a rig as compiled functions: what carries the load, and what is then read and follows."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import casadi as ca

from rover_pin.base.quantity import quantities
from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.effects.effect import Effect
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.soil.sinkage import power_law_guess
from rover_pin.soil.slip import STANDS
from rover_pin.soil.wheel_forces import pressing_force

LAWS = 512
"""Structures whose functions are kept: some sets' worth, as a study of many sets asks for the same ones."""

SLOWEST = 1e-9
"""Speed [m/s] below which nothing moves."""

LEAP = 1.5
"""Longest Newton step in ln y."""

CONDITIONS = 5
"""Inputs of a steady run: load [N], slip [-], speed along the heading, rim speed, speed along the axle [m/s]."""

VALUES = 5
"""What is predicted at each run."""

FIELDS: tuple[str, ...] = (*quantities(Wheel), *quantities(Soil))
"""Constants of wheel and soil, in the order in which laws take them."""


def parameter_names(effects: tuple[Effect, ...]) -> tuple[str, ...]:
    """Return the names of all parameters: those of wheel and soil, `Effect.parameter`, `rig.error`."""
    effect_names = [f"{type(effect).__name__}.{name}" for effect in effects for name in quantities(effect)]
    return (*FIELDS, *effect_names, *(f"rig.{name}" for name in quantities(RigErrors)))


class Balance(NamedTuple):
    """A structure's equations: the values and the balance F at z, and what starts and steps Newton's method."""

    z: ca.SX
    condition: ca.SX
    p: ca.SX
    h: ca.SX
    values: ca.SX
    balance: ca.SX
    first: ca.Function
    newton: ca.Function


class Law(NamedTuple):
    """Functions of all runs: where Newton's method starts, one step of it and ln f_n - ln W before it, what is read."""

    first: ca.Function
    newton: ca.Function
    point: ca.Function


@lru_cache(maxsize=LAWS)
def steady_law(effects: tuple[Effect, ...], free: tuple[str, ...], runs: int) -> Law:
    """Return the law of a structure for several runs at once, all with the same parameters."""
    equations = _balance(effects)
    every = zip(("first", "newton", "point"), (equations.first, equations.newton, _point(effects, free)), strict=True)
    return Law(*(function.map(name, "serial", runs, [function.n_in() - 1], []) for name, function in every))


@lru_cache(maxsize=LAWS)
def _point(effects: tuple[Effect, ...], free: tuple[str, ...]) -> ca.Function:
    """Return (z, condition, parameters) -> one column: channels, the load's error, derivatives column by column.

    At the balance F = 0 the derivative dz/dp = -(dF/dz)^-1 dF/dp is exact. The error is infinite beyond the axle.
    """
    equations, names = _balance(effects), parameter_names(effects)
    wanted = ca.vertcat(*(equations.p[names.index(name)] for name in free)) if free else ca.SX(0, 1)
    # one sweep for all: four of them held each other's operations once more
    every = ca.jacobian(ca.vertcat(equations.values, equations.balance), ca.vertcat(equations.z, wanted))
    by_z, by_p = every[:, : equations.z.numel()], every[:, equations.z.numel() :]
    total = by_p[:VALUES, :] - ca.mtimes(by_z[:VALUES, :], _solve(by_z[VALUES:, :], by_p[VALUES:, :]))
    error = ca.if_else(equations.h > equations.p[names.index("r")], ca.inf, equations.balance[0])
    column = ca.densify(ca.vertcat(equations.values, error, ca.vec(ca.densify(total))))
    return ca.Function("point", [equations.z, equations.condition, equations.p], [column])


@lru_cache(maxsize=LAWS)
def _balance(effects: tuple[Effect, ...]) -> Balance:
    """Return what a structure is solved from: z = (ln y, states) makes F = (ln f_n - ln W, rates) vanish."""
    names = parameter_names(effects)
    condition, p = ca.SX.sym("condition", CONDITIONS), ca.SX.sym("p", len(names))
    z = ca.SX.sym("z", 1 + sum(len(effect.states) for effect in effects))
    errors = RigErrors().replace(
        **{error_name: p[names.index(f"rig.{error_name}")] for error_name in quantities(RigErrors)}
    )
    true = ca.vertcat(condition[0] * errors.load_scale, condition[1:])
    load, h, balance, start = _chain_loads(effects, true, p, z)
    read = ca.vertcat(*errors.read(load, h, true[0]))
    values, balance, h = ca.cse([read, balance, h])
    step = -_solve(ca.jacobian(balance, z), balance)
    first = ca.Function("first", [condition, p], [ca.vertcat(start, *_at_rest(z, balance, p))])
    newton = ca.Function("newton", [z, condition, p], [_limit_step(z, step, p[FIELDS.index("r")]), balance[0]])
    return Balance(z, condition, p, h, values, balance, first, newton)


def _chain_loads(effects: tuple[Effect, ...], condition: ca.SX, p: ca.SX, z: ca.SX) -> tuple[Load, ca.SX, ca.SX, ca.SX]:
    """Return the load of all effects in turn, h, what must vanish at the balance, and where Newton's method starts.

    h = floor + y with y the sinkage into the ground that effects leave, as lugs do a trench: above its floor nothing
    carries, and f_n tells no way down. f_n of y is nearly a power, whatever the states are.
    """
    wheel, soil, valued_effects = with_values_of(effects, p)
    states = iter(ca.vertsplit(z)[1:])
    x = [tuple(next(states) for _ in effect.states) for effect in effects]
    load, S, v_x, rim, v_y = ca.vertsplit(condition)
    contact = Contact(S, 0.0, wheel.r, v_x, v_y, 0.0, rim, 0.0, 0.0, wheel, soil)
    passing = ca.fmax(ca.fmax(ca.fabs(rim), ca.fabs(v_x)), STANDS * ca.fabs(v_y))
    contact = contact._replace(S_y=v_y / ca.fmax(passing, SLOWEST))
    h = _floor(valued_effects, contact, x) + ca.exp(z[0])
    contact = _amend_contact(valued_effects, contact._replace(h=h), x)
    push = Load()
    for effect, own_states in zip(valued_effects, x, strict=True):
        push = push.plus(effect.load(contact, push, own_states))
    rates = [
        rate
        for effect, own_states in zip(valued_effects, x, strict=True)
        for rate in effect.rate(contact, push, own_states)
    ]
    shallow = 2 * wheel.r * ca.sin(ca.exp(power_law_guess(ca.log(load), wheel, soil)) / 2) ** 2
    return push, h, ca.vertcat(ca.log(push.f_n / load), *rates), ca.log(shallow)


def with_values_of(effects: tuple[Effect, ...], p: ca.SX) -> tuple[Wheel, Soil, list[Effect]]:
    """Return wheel, soil and effects with their parts of the vector of all parameters."""
    values = iter(ca.vertsplit(p))
    wheel = Wheel().replace(**{name: next(values) for name in quantities(Wheel)})
    soil = Soil().replace(**{name: next(values) for name in quantities(Soil)})
    return wheel, soil, [effect.replace(**{name: next(values) for name in quantities(effect)}) for effect in effects]


@lru_cache(maxsize=LAWS)
def pressed_law(effects: tuple[Effect, ...], free: tuple[str, ...], points: int) -> ca.Function:
    """Return (sinkages, parameters) -> columns of ln f_n of a wheel that is pressed in, and its slopes by `free`.

    Nothing turns or slides (`pressing_force`); effects amend the soil as at rest.
    """
    names = parameter_names(effects)
    h, p = ca.SX.sym("h"), ca.SX.sym("p", len(names))
    wheel, soil, valued_effects = with_values_of(effects, p)
    contact = Contact(0.0, 0.0, h, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, wheel, soil)
    contact = _amend_contact(valued_effects, contact, [(0.0,) * len(effect.states) for effect in effects])
    value = ca.log(p[names.index("rig.pressing_scale")] * pressing_force(contact.h, wheel, contact.soil))
    wanted = ca.vertcat(*(p[names.index(name)] for name in free)) if free else ca.SX(0, 1)
    column = ca.densify(ca.vertcat(value, ca.jacobian(value, wanted).T))
    return ca.Function("pressed", [h, p], [column]).map("every", "serial", points, [1], [])


def _at_rest(z: ca.SX, balance: ca.SX, p: ca.SX) -> list[ca.SX]:
    """Return the states where rates vanish, the wheel sunk to its axle: one step, as rates are linear in states."""
    if z.numel() == 1:
        return []
    step = -_solve(ca.jacobian(balance, z)[1:, 1:], balance[1:])
    sunk = ca.vertcat(ca.log(p[FIELDS.index("r")]), ca.SX.zeros(z.numel() - 1))
    return ca.vertsplit(*ca.substitute([step], [z], [sunk]))


def _amend_contact(effects: Sequence[Effect], contact: Contact, x: Sequence[tuple[ca.SX, ...]]) -> Contact:
    for effect, own_states in zip(effects, x, strict=True):
        contact = effect.amend(contact, own_states)
    return contact


def _floor(effects: Sequence[Effect], contact: Contact, x: Sequence[tuple[ca.SX, ...]]) -> ca.SX:
    """Return how deep the wheel stands before the ground that effects leave meets it: where the secant of h is 0."""
    r = contact.wheel.r
    once, twice = (_amend_contact(effects, contact._replace(h=times * r), x).h for times in (1.0, 2.0))
    return r * (1.0 - once / (twice - once))


def _solve(matrix: ca.SX, right: ca.SX) -> ca.SX:
    return right / matrix if matrix.numel() == 1 else ca.solve(matrix, right)


def _limit_step(z: ca.SX, step: ca.SX, r: ca.SX) -> ca.SX:
    """Return z after the step, ln y within a leap and to the axle."""
    ln_y = ca.fmin(z[0] + ca.fmax(ca.fmin(step[0], LEAP), -LEAP), ca.log(r))
    return ca.vertcat(ln_y, *(z[i] + step[i] for i in range(1, z.numel())))
