"""Compiled CasADi functions for steady runs of a wheel on a rig: sinkage that carries the load, readings, derivatives.

The unknowns z of a run are ln y and the states of the effects, where y is the sinkage below the soil surface that the
effects leave. The unknowns are the solution of F(z) = 0 with F(z) = (ln f_n - ln W, rates of the states), where f_n is
the normal force of all effects and W the load. `model.RigPredictor` solves F = 0 by Newton's method with these
functions.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import casadi as ca

from rover_pin.base.quantity import quantities
from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.effects.effect import Effect
from rover_pin.measurements.channel import RigErrors
from rover_pin.soil.sinkage import power_law_guess
from rover_pin.soil.slip import STANDS
from rover_pin.soil.wheel_forces import plate_force, pressing_force

MAX_CACHED_LAWS = 512
"""Maximum number of models whose compiled functions are kept in memory. A study of many data sets needs them again."""

MIN_SPEED = 1e-9
"""Minimum value of the speed in the denominator of the sideways slip [m/s]. It avoids a division by zero."""

MAX_STEP = 1.5
"""Maximum Newton step in ln y. A longer step can leave the range where the balance is nearly linear in ln y."""

CONDITIONS = 5
"""Number of inputs of a steady run: load [N], slip [-], speed along the heading, rim speed, speed along the axle
[m/s]."""

VALUES = 6
"""Number of predicted channels of each run."""

FIELDS: tuple[str, ...] = (*quantities(Wheel), *quantities(Soil))
"""Names of the constants of wheel and soil. The vector of all parameters begins with these constants in this order."""


def parameter_names(effects: tuple[Effect, ...]) -> tuple[str, ...]:
    """Return the names of all parameters of a model with these effects.

    The constants of wheel and soil come first, then "Effect.parameter" for each effect, then "rig.error" for each
    reading error.
    """
    effect_names = [f"{type(effect).__name__}.{name}" for effect in effects for name in quantities(effect)]
    return (*FIELDS, *effect_names, *(f"rig.{name}" for name in quantities(RigErrors)))


class Balance(NamedTuple):
    """Equations of a steady run of a wheel, as CasADi expressions of its unknowns, inputs and parameters."""

    z: ca.SX
    """unknowns: ln y, where y is the sinkage below the soil surface that the effects leave, and the states of the
    effects"""
    condition: ca.SX
    "inputs of a run (5,)"
    p: ca.SX
    "all parameters, in the order of `parameter_names`"
    h: ca.SX
    "sinkage [m]"
    values: ca.SX
    """readings of the rig (6,)"""
    balance: ca.SX
    """F(z) = (ln f_n - ln W, rates of the states) with the normal force f_n and the load W; 0 in a steady run"""
    first: ca.Function
    "(condition, p) -> initial guess of z"
    newton: ca.Function
    "(z, condition, p) -> z after one Newton step, and ln(carried load / load) before the step"


class Law(NamedTuple):
    """Compiled functions for the steady runs of a wheel. Each treats several runs at once, with one column for each
    run.
    """

    first: ca.Function
    "(conditions, p) -> initial guesses of the unknowns"
    newton: ca.Function
    "(unknowns, conditions, p) -> unknowns after one Newton step, and ln(carried load / load) before the step"
    point: ca.Function
    "(unknowns, conditions, p) -> readings, ln(carried load / load), and derivatives of the readings"


@lru_cache(maxsize=MAX_CACHED_LAWS)
def steady_law(effects: tuple[Effect, ...], free: tuple[str, ...], runs: int) -> Law:
    """Return the compiled functions for several steady runs of a wheel. All runs have common parameters.

    Parameters
    ----------
    effects : tuple of Effect
        The effects with default numbers (`RigModel.structure`).
    free : tuple of str
        Names of the parameters for the derivatives of the readings.
    runs : int
        Number of runs with different inputs.
    """
    equations = _balance(effects)
    functions = (equations.first, equations.newton, _point(effects, free))
    # The last argument of each function is the vector of parameters, which all runs share.
    named = zip(("first", "newton", "point"), functions, strict=True)
    return Law(*(function.map(name, "serial", runs, [function.n_in() - 1], []) for name, function in named))


@lru_cache(maxsize=MAX_CACHED_LAWS)
def _point(effects: tuple[Effect, ...], free: tuple[str, ...]) -> ca.Function:
    """Return the compiled function from the unknowns of a run to the readings and their derivatives by `free`.

    The function (z, condition, parameters) gives one column: readings, load error ln(carried load / load), and
    derivatives. The unknowns z are a solution of F(z) = 0, so that the wheel carries its load and the states of the
    effects are steady. For such z, the derivative of the unknowns by the parameters p is exactly dz/dp = -(dF/dz)^-1
    dF/dp (theorem on implicit functions). The load error is infinite if the wheel has sunk below its axle, so that the
    run counts as not predicted.
    """
    equations, names = _balance(effects), parameter_names(effects)
    wanted = ca.vertcat(*(equations.p[names.index(name)] for name in free)) if free else ca.SX(0, 1)
    # One Jacobian of readings and balance, because separate Jacobians would repeat the operations that they share.
    jacobian = ca.jacobian(ca.vertcat(equations.values, equations.balance), ca.vertcat(equations.z, wanted))
    by_z, by_p = jacobian[:, : equations.z.numel()], jacobian[:, equations.z.numel() :]
    total = by_p[:VALUES, :] - ca.mtimes(by_z[:VALUES, :], _solve(by_z[VALUES:, :], by_p[VALUES:, :]))
    error = ca.if_else(equations.h > equations.p[names.index("r")], ca.inf, equations.balance[0])
    column = ca.densify(ca.vertcat(equations.values, error, ca.vec(ca.densify(total))))
    return ca.Function("point", [equations.z, equations.condition, equations.p], [column])


@lru_cache(maxsize=MAX_CACHED_LAWS)
def _balance(effects: tuple[Effect, ...]) -> Balance:
    """Return the equations F(z) = 0 of a steady run of a wheel with these effects.

    The unknowns z are ln y, where y is the sinkage below the soil surface that the effects leave, and the states of the
    effects. F consists of ln(carried load / load) and the rates of the states.
    """
    names = parameter_names(effects)
    condition, p = ca.SX.sym("condition", CONDITIONS), ca.SX.sym("p", len(names))
    z = ca.SX.sym("z", 1 + sum(len(effect.states) for effect in effects))
    errors = RigErrors().replace(
        **{error_name: p[names.index(f"rig.{error_name}")] for error_name in quantities(RigErrors)}
    )
    # The rig states the load with a scale error, so the true load is load_scale times the stated load.
    true = ca.vertcat(condition[0] * errors.load_scale, condition[1:])
    wheel, soil, valued_effects = with_values_of(effects, p)
    states = iter(ca.vertsplit(z)[1:])
    x = [tuple(next(states) for _ in effect.states) for effect in effects]
    load, S, v_x, rim, v_y = ca.vertsplit(true)
    contact = Contact(S, 0.0, wheel.r, v_x, v_y, 0.0, rim, 0.0, 0.0, wheel, soil)
    # The sideways slip is the sideways speed divided by the faster of rim speed and travel speed.
    passing = ca.fmax(ca.fmax(ca.fabs(rim), ca.fabs(v_x)), STANDS * ca.fabs(v_y))
    contact = contact._replace(S_y=v_y / ca.fmax(passing, MIN_SPEED))
    # The sinkage is h = floor + y, where the floor is the sinkage at which the wheel first touches the soil: there the
    # changed sinkage of the contact is 0. The floor can differ from 0, because effects such as the trench that lugs dig
    # may remove soil. At a smaller sinkage nothing carries the wheel, and f_n would not depend on h. As a function of
    # y, f_n is nearly a power law for any states, so that Newton's method for ln y converges quickly. The floor is
    # found by a secant through h = r and h = 2 r, which is exact if the changed sinkage is linear in h.
    r = contact.wheel.r
    once, twice = (_amend_contact(valued_effects, contact._replace(h=times * r), x).h for times in (1.0, 2.0))
    h = r * (1.0 - once / (twice - once)) + ca.exp(z[0])
    contact = _amend_contact(valued_effects, contact._replace(h=h), x)
    # Forces of all effects on the wheel, and the balance F of their normal force f_n with the load W: ln f_n - ln W and
    # the rates of the states.
    push = Load()
    for effect, own_states in zip(valued_effects, x, strict=True):
        push = push.plus(effect.load(contact, push, own_states))
    rates = [
        rate
        for effect, own_states in zip(valued_effects, x, strict=True)
        for rate in effect.rate(contact, push, own_states)
    ]
    balance = ca.vertcat(ca.log(push.f_n / load), *rates)
    # The initial guess of ln y follows from the entry angle theta at which a power law carries the load: the sinkage is
    # then h = r (1 - cos theta).
    shallow = 2 * wheel.r * ca.sin(ca.exp(power_law_guess(ca.log(load), wheel, soil)) / 2) ** 2
    read = ca.vertcat(*errors.read(push, h, load))
    values, balance, h = ca.cse([read, balance, h])
    step = -_solve(ca.jacobian(balance, z), balance)
    # The initial guess of the effects' states are their steady values for a wheel that has sunk to its axle. The rates
    # of the states are linear in the states, so one Newton step gives the steady values.
    guess = [ca.log(shallow)]
    if z.numel() > 1:
        to_rest = -_solve(ca.jacobian(balance, z)[1:, 1:], balance[1:])
        sunk = ca.vertcat(ca.log(p[FIELDS.index("r")]), ca.SX.zeros(z.numel() - 1))
        guess += ca.vertsplit(*ca.substitute([to_rest], [z], [sunk]))
    first = ca.Function("first", [condition, p], [ca.vertcat(*guess)])
    # A Newton step changes ln y by at most MAX_STEP, and never to a sinkage below the axle.
    limited = ca.fmax(ca.fmin(step[0], MAX_STEP), -MAX_STEP)
    ln_y = ca.fmin(z[0] + limited, ca.log(p[FIELDS.index("r")]))
    others = [z[i] + step[i] for i in range(1, z.numel())]
    newton = ca.Function("newton", [z, condition, p], [ca.vertcat(ln_y, *others), balance[0]])
    return Balance(z, condition, p, h, values, balance, first, newton)


def with_values_of(effects: tuple[Effect, ...], p: ca.SX) -> tuple[Wheel, Soil, list[Effect]]:
    """Return wheel, soil and effects whose numbers are the entries of the vector `p` of all parameters."""
    # The order is that of `parameter_names`.
    values = iter(ca.vertsplit(p))
    wheel = Wheel().replace(**{name: next(values) for name in quantities(Wheel)})
    soil = Soil().replace(**{name: next(values) for name in quantities(Soil)})
    return wheel, soil, [effect.replace(**{name: next(values) for name in quantities(effect)}) for effect in effects]


@lru_cache(maxsize=MAX_CACHED_LAWS)
def pressed_law(effects: tuple[Effect, ...], free: tuple[str, ...], points: int) -> ca.Function:
    """Return the compiled function from sinkages to the logarithm of the force that presses a wheel or a plate into the
    soil.

    The function (indenters, parameters) also gives the derivatives of ln f_n by the parameters `free`, where f_n is the
    force. `indenters` has one column for each of the `points` sinkages, with the sinkage [m], 1 for a plate or 0 for
    the wheel, and the plate's b [m] and area [m^2] (`plate_force`; 1 for the wheel). The wheel neither turns nor slides
    (see `pressing_force`), and the effects change the contact as at rest. The result has one column for each sinkage.
    """
    names = parameter_names(effects)
    # A pressed wheel has neither slip nor speed, and its effects have not built up any states.
    indenter, p = ca.SX.sym("indenter", 4), ca.SX.sym("p", len(names))
    h, is_plate, b, area = ca.vertsplit(indenter)
    wheel, soil, valued_effects = with_values_of(effects, p)
    contact = Contact(0.0, 0.0, h, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, wheel, soil)
    contact = _amend_contact(valued_effects, contact, [(0.0,) * len(effect.states) for effect in effects])
    # Both forces are finite for every column, so that the derivative of the other force does no harm.
    by_wheel = p[names.index("rig.pressing_scale")] * pressing_force(contact.h, wheel, contact.soil)
    by_plate = p[names.index("rig.plate_scale")] * plate_force(h, b, area, contact.soil)
    value = ca.if_else(is_plate > 0.0, ca.log(by_plate), ca.log(by_wheel))
    wanted = ca.vertcat(*(p[names.index(name)] for name in free)) if free else ca.SX(0, 1)
    column = ca.densify(ca.vertcat(value, ca.jacobian(value, wanted).T))
    return ca.Function("pressed", [indenter, p], [column]).map("every", "serial", points, [1], [])


def _amend_contact(effects: Sequence[Effect], contact: Contact, x: Sequence[tuple[ca.SX, ...]]) -> Contact:
    """Return the contact after all effects have changed it one after the other. `x` holds the states of each effect."""
    for effect, own_states in zip(effects, x, strict=True):
        contact = effect.amend(contact, own_states)
    return contact


def _solve(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Return the solution x of the linear equations `matrix` x = `right`.

    A single equation is solved by a division, which compiles to less code.
    """
    return right / matrix if matrix.numel() == 1 else ca.solve(matrix, right)
