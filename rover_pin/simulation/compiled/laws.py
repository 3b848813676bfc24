"""A model's effects as two CasADi functions: what a contact patch pushes, and what a motor gives."""

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Record, quantities
from rover_pin.contact import Contact, Load, Scalar, Soil, Wheel
from rover_pin.effects.effect import Drive, Effect, MotorEffect
from rover_pin.simulation.model.motor import Motor

GEOMETRY = ("h", "v_x", "v_y", "v_n", "rim", "x", "axle")
"""What the geometry knows of a patch; wheel and soil constants follow in the contact vector."""
SPEEDS = slice(1, 5)
DRIVEN = 4
"""Entries of a `Load` that a drive takes: not the moment about the normal, which a rig alone reads."""
MAX_STATES = 8


def symbolic(records: Sequence[Record]) -> tuple[list[Record], ca.SX]:
    """Return the records with every quantity a symbol, and the symbols in order."""
    copies, symbols = [], []
    for i, record in enumerate(records):
        named = {name: ca.SX.sym(f"{name}_{i}") for name in quantities(record)}
        copies.append(record.replace(**named))
        symbols += list(named.values())
    return copies, ca.vertcat(*symbols) if symbols else ca.SX(0, 1)


def numbers(records: Sequence[Record]) -> np.ndarray:
    """Return the values of all quantities, in the order of `symbolic`."""
    return np.array([float(value) for record in records for value in record.values().values()])


Seen = TypeVar("Seen", Contact, Drive)
States = Sequence[tuple[Scalar, ...]]


def amend_subject(effects: Sequence[Any], subject: Seen, states: States) -> Seen:
    """Return a contact, or a motor's drive, as all effects amend it in turn, each with its own states."""
    for effect, x in zip(effects, states, strict=True):
        subject = effect.amend(subject, x)
    return subject


def load_and_rates(effects: Sequence[Any], contact: Contact, states: States) -> tuple[Load, list[tuple[Scalar, ...]]]:
    """Return what all effects push at an amended contact, each knowing what those before it do, and their rates."""
    load = Load()
    for effect, x in zip(effects, states, strict=True):
        load = load.plus(effect.load(contact, load, x))
    return load, [_each(effect, effect.rate(contact, load, x), x) for effect, x in zip(effects, states, strict=True)]


def torque_and_rates(
    effects: Sequence[Any], drive: Drive, torque: Scalar, states: States
) -> tuple[Scalar, list[tuple[Scalar, ...]]]:
    """Return what all effects make of the torque [N m] that an amended drive gives at the wheel, and their rates."""
    for effect, x in zip(effects, states, strict=True):
        torque = torque + effect.torque(drive, torque, x)
    return torque, [_each(effect, effect.rate(drive, torque, x), x) for effect, x in zip(effects, states, strict=True)]


def _each(effect: Any, rates: tuple[Scalar, ...], x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
    """Return an effect's rates, which must be one for each of its states."""
    if len(rates) != len(x):
        raise ParameterError(
            f"{type(effect).__name__}.rate returns {len(rates)} rates of {len(x)} states: give one each."
        )
    return rates


def law(name: str, inputs: Sequence[ca.SX], out: ca.SX) -> ca.Function:
    """Return the function of formulas that effects have written.

    Raises ParameterError: they hold a symbol of their own, or a number that is not finite.
    """
    free_symbols = {symbol.name() for symbol in ca.symvar(out)} - {
        symbol.name() for symbol in ca.symvar(ca.vertcat(*inputs))
    }
    function = ca.Function(name, inputs, [out], {"allow_free": True})
    constants = (at for at in range(function.n_instructions()) if function.instruction_id(at) == ca.OP_CONST)
    wrong = sorted(free_symbols) or [
        constant for at in constants if not math.isfinite(constant := function.instruction_constant(at))
    ]
    if wrong:
        raise ParameterError(
            f"The formulas of the effects ({name}) hold {wrong[0]}: they may hold finite numbers, the effects' own "
            "quantities and states, and what their hooks are given."
        )
    return function


def contact_law(effects: Sequence[Effect]) -> ca.Function:
    """Return the function (contact, states, parameters) -> load, its derivatives, rates, their derivatives, slip.

    The contact vector is GEOMETRY, the wheel's quantities, the soil's quantities. One output column, in blocks
    (column-major): load (4: f_t f_y f_n torque); d load / d (v_x v_y v_n rim); rate; d rate / d speeds;
    d load / d states; d rate / d states; S, S_y.
    """
    symbolic_effects, parameters = symbolic(effects)
    geometry = {name: ca.SX.sym(name) for name in GEOMETRY}
    (wheel, soil), constants = symbolic([Wheel(), Soil()])
    states = _states(effects)
    contact = Contact(S=0.0, S_y=0.0, wheel=wheel, soil=soil, **geometry)  # type: ignore[arg-type]
    contact = amend_subject(symbolic_effects, contact, states)
    slip = ca.vertcat(contact.S, contact.S_y, contact.h)
    slip_symbol = ca.SX.sym("slip", 3)
    contact = contact._replace(S=slip_symbol[0], S_y=slip_symbol[1], h=slip_symbol[2])
    load, rates = load_and_rates(symbolic_effects, contact, states)
    inputs = ca.vertcat(*geometry.values())
    force, rate, x = ca.vertcat(*load[:DRIVEN]), _column(rates), _column(states)
    blocks = [
        force,
        *_through(slip_symbol, slip, force, inputs[SPEEDS]),
        rate,
        *_through(slip_symbol, slip, rate, inputs[SPEEDS]),
        *_through(slip_symbol, slip, force, x),
        *_through(slip_symbol, slip, rate, x),
        slip[:2],
    ]
    out = ca.substitute(ca.densify(ca.vertcat(*blocks)), slip_symbol, slip)
    return law("contact_law", [ca.vertcat(inputs, constants), x, parameters], out)


def motor_law(motor: Motor, effects: Sequence[MotorEffect]) -> ca.Function:
    """Return the function ((delta, omega, wheel, bus current), states, parameters) -> torque and its derivatives.

    One output column: torque; d torque / d omega; current; supply voltage; rate; d rate / d omega;
    d torque / d states; d rate / d states.
    """
    (own_motor, *symbolic_effects), parameters = symbolic([motor, *effects])
    delta, omega, wheel, bus = (ca.SX.sym(name) for name in ("delta", "omega", "wheel", "bus_current"))
    states = _states(effects)
    drive: Drive = own_motor.drive(delta, omega)._replace(wheel=wheel, bus_current=bus)  # type: ignore[attr-defined]
    drive = amend_subject(symbolic_effects, drive, states)
    current = drive.current
    torque, rates = torque_and_rates(symbolic_effects, drive, drive.constant * current, states)
    rate, x = _column(rates), _column(states)
    blocks = [
        torque,
        *_derivatives(torque, omega),
        current,
        drive.supply,
        rate,
        *_derivatives(rate, omega),
        *_derivatives(torque, x),
        *_derivatives(rate, x),
    ]
    out = ca.densify(ca.vertcat(*blocks))
    return law("motor_law", [ca.vertcat(delta, omega, wheel, bus), x, parameters], out)


def generated_source(*functions: ca.Function, name: str = "laws") -> str:
    """Return C source of the functions, with helpers named after `name`."""
    code = ca.CodeGenerator(f"{name}.c", {"with_header": False})
    for function in functions:
        code.add(function)
    return str(code.dump())


def number_of_states(effects: Sequence[Effect] | Sequence[MotorEffect]) -> int:
    """Return how many states the effects have together; refuse more than the compiled step can hold."""
    count = sum(len(effect.states) for effect in effects)
    if count > MAX_STATES:
        names = [state.name for effect in effects for state in effect.states]
        raise ParameterError(
            f"The effects have {count} states a wheel ({', '.join(names)}); at most {MAX_STATES} are allowed."
        )
    return count


def _states(effects: Sequence[Any]) -> list[tuple[ca.SX, ...]]:
    number_of_states(effects)
    return [tuple(ca.SX.sym(state.name) for state in effect.states) for effect in effects]


def _column(tuples: Sequence[Sequence[Any]]) -> ca.SX:
    flat = [value for values in tuples for value in values]
    return ca.vertcat(*flat) if flat else ca.SX(0, 1)


def _derivatives(of: ca.SX, by: ca.SX) -> list[ca.SX]:
    """Return d of / d by, column by column."""
    if of.numel() == 0 or by.numel() == 0:
        return []
    return [ca.vec(ca.densify(ca.jacobian(of, by)))]


def _through(slip_symbol: ca.SX, slip: ca.SX, of: ca.SX, by: ca.SX) -> list[ca.SX]:
    """Return d of / d by with `slip_symbol` for what is `slip` of `by`: the quadrature is differentiated once."""
    if of.numel() == 0 or by.numel() == 0:
        return []
    chain = ca.mtimes(ca.jacobian(of, slip_symbol), ca.jacobian(slip, by))
    return [ca.vec(ca.densify(ca.jacobian(of, by) + chain))]


Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def as_numbers(function: ca.Function) -> Law:
    """Return a CasADi function of column vectors as one of NumPy arrays, evaluated by CasADi's own machine."""

    def call(first: np.ndarray, states: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        return np.array(function(first, states, parameters)).ravel()

    return call
