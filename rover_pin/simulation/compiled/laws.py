"""The effects of a model as two CasADi functions: the contact law, which computes the load at a contact patch, and the
motor law, which computes the torque of a motor.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import casadi as ca
import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Record, quantities
from rover_pin.contact import Contact, Load, Scalar, Soil, Wheel
from rover_pin.effects.effect import Drive, Effect, MotorEffect
from rover_pin.simulation.model.motor import Motor

GEOMETRY = ("h", "v_x", "v_y", "v_n", "rim", "x", "axle")
"""Inputs of the contact law that change from step to step: sinkage [m]; speed of the wheel along the patch forwards, to
the left and into the ground [m/s]; speed of the rim [m/s]; x of the wheel's centre [m]; number of its axle. They are
the first entries of the contact vector; the constants of wheel and soil follow them."""
SPEEDS = slice(1, 5)
"""Indices in the contact vector of the four speeds v_x, v_y, v_n and rim. The load is differentiated by these
speeds."""
LOAD_ENTRIES = 4
"""Number of entries of a `Load` that a drive uses: f_t, f_y, f_n, torque. The fifth entry, the moment about the normal
of the patch, is for a test rig only."""
MAX_STATES = 8
"""Largest number of states that all contact effects may have together at one wheel, and that all motor effects may have
together. Beyond this number, the model is refused, because the arrays of the compiled step have this size."""

Subject = TypeVar("Subject", Contact, Drive)
States = Sequence[tuple[Scalar, ...]]


def symbolic(records: Sequence[Record]) -> tuple[list[Record], ca.SX]:
    """Return copies of records (effects, soils, wheels) with a CasADi symbol in the place of every quantity, and one
    column of all these symbols. Formulas of the records then become expressions of the symbols.
    """
    copies, symbols = [], []
    for i, record in enumerate(records):
        named = {name: ca.SX.sym(f"{name}_{i}") for name in quantities(record)}
        copies.append(record.replace(**named))
        symbols += list(named.values())
    return copies, ca.vertcat(*symbols) if symbols else ca.SX(0, 1)


def numbers(records: Sequence[Record]) -> np.ndarray:
    """Return the values of all quantities of several records in one array. Their order equals the order of the symbols
    that `symbolic` returns for these records.
    """
    return np.array([float(value) for record in records for value in record.values().values()])


def amend_subject(effects: Sequence[Any], subject: Subject, states: States) -> Subject:
    """Return a contact (or the state of a motor) after all effects have changed it by their method `amend`, one after
    the other. `states` holds one tuple of states for each effect.
    """
    for effect, x in zip(effects, states, strict=True):
        subject = effect.amend(subject, x)
    return subject


def load_and_rates(effects: Sequence[Any], contact: Contact, states: States) -> tuple[Load, list[tuple[Scalar, ...]]]:
    """Return the total load of all effects at a contact patch, and for each effect the rates of change of its states.

    `contact` is the contact after all effects have changed it (`amend_subject`). Each effect receives the sum of the
    loads of the effects before it, and its own load is added to this sum.
    """
    # Rates are computed after all loads, because they may depend on the total load.
    load = Load()
    for effect, x in zip(effects, states, strict=True):
        load = load.plus(effect.load(contact, load, x))
    return load, [_rates(effect, effect.rate(contact, load, x), x) for effect, x in zip(effects, states, strict=True)]


def torque_and_rates(
    effects: Sequence[Any], drive: Drive, torque: Scalar, states: States
) -> tuple[Scalar, list[tuple[Scalar, ...]]]:
    """Return the torque at the wheel [N m] with all motor effects, and for each effect the rates of change of its
    states.

    Parameters
    ----------
    effects : sequence of MotorEffect
        The effects, in the order of their action. Each receives the torque with the effects before it, and adds its own
        torque.
    drive : Drive
        State of the motor after all effects have changed it (`amend_subject`).
    torque : float or symbol
        Torque of the motor in this state, before any effect adds a torque [N m].
    states : sequence of tuples
        The states of each effect.
    """
    for effect, x in zip(effects, states, strict=True):
        torque = torque + effect.torque(drive, torque, x)
    return torque, [_rates(effect, effect.rate(drive, torque, x), x) for effect, x in zip(effects, states, strict=True)]


def _rates(effect: Any, rates: tuple[Scalar, ...], x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
    """Return the rates of change of an effect's states, after a check that each state has one rate."""
    if len(rates) != len(x):
        raise ParameterError(
            f"{type(effect).__name__}.rate returns {len(rates)} rates for {len(x)} states: give one for each state."
        )
    return rates


def law(name: str, inputs: Sequence[ca.SX], out: ca.SX) -> ca.Function:
    """Return a CasADi function with these inputs and the output `out`, an expression with the contributions of all
    effects. First the expression is checked, because effects may be written by a user.

    Raises
    ------
    ParameterError
        The expression contains a symbol that is not among the inputs, or a number that is not finite.
    """
    free_symbols = {symbol.name() for symbol in ca.symvar(out)} - {
        symbol.name() for symbol in ca.symvar(ca.vertcat(*inputs))
    }
    # CasADi itself would report a free symbol by its name only, without the reason.
    function = ca.Function(name, inputs, [out], {"allow_free": True})
    # A constant such as 1 / 0 does not appear as a symbol; it is found among the function's instructions.
    constants = (
        function.instruction_constant(k)
        for k in range(function.n_instructions())
        if function.instruction_id(k) == ca.OP_CONST
    )
    wrong = sorted(free_symbols) or [constant for constant in constants if not math.isfinite(constant)]
    if wrong:
        raise ParameterError(
            f"The formulas of the effects ({name}) hold {wrong[0]}, which is not allowed: they may only contain finite "
            "numbers, the effects' own quantities and states, and the arguments of their hooks."
        )
    return function


def contact_law(effects: Sequence[Effect]) -> ca.Function:
    """Return a CasADi function that computes the load at a contact patch, the rates of the effects' states, the
    derivatives of both, and the slip.

    The inputs of the function are the contact vector, the states, and the parameters of the effects. The contact vector
    holds the numbers of GEOMETRY, then the quantities of the wheel and of the soil. The output is one column of blocks,
    each column-major: load (f_t, f_y, f_n, torque); d load / d (v_x, v_y, v_n, rim); rates; d rates / d speeds; d load
    / d states; d rates / d states; S and S_y.

    Parameters
    ----------
    effects : sequence of Effect
        The effects, in the order of their action.

    Raises
    ------
    ParameterError
        The effects have too many states, or formulas that are not allowed (`law`).
    """
    # All quantities become symbols: what changes from step to step, wheel and soil, states, and the effects' own.
    symbolic_effects, parameters = symbolic(effects)
    geometry = {name: ca.SX.sym(name) for name in GEOMETRY}
    (wheel, soil), constants = symbolic([Wheel(), Soil()])
    states = _states(effects)
    contact = Contact(S=0.0, S_y=0.0, wheel=wheel, soil=soil, **geometry)  # type: ignore[arg-type]
    contact = amend_subject(symbolic_effects, contact, states)
    # The load depends on the speeds mostly through slip and sinkage. With symbols in their place the quadrature of the
    # stress is differentiated three times instead of once for each speed; the chain rule does the rest.
    slip = ca.vertcat(contact.S, contact.S_y, contact.h)
    slip_symbol = ca.SX.sym("slip", 3)
    contact = contact._replace(S=slip_symbol[0], S_y=slip_symbol[1], h=slip_symbol[2])
    load, rates = load_and_rates(symbolic_effects, contact, states)
    inputs = ca.vertcat(*geometry.values())
    force, rate, x = ca.vertcat(*load[:LOAD_ENTRIES]), _column(rates), _column(states)

    def derivatives(values: ca.SX, variables: ca.SX) -> list[ca.SX]:
        """Return the total derivatives of `values` by `variables`, column by column: the direct part, and the part
        through the symbols of slip and sinkage (chain rule).
        """
        if values.numel() == 0 or variables.numel() == 0:
            return []
        chain = ca.mtimes(ca.jacobian(values, slip_symbol), ca.jacobian(slip, variables))
        return [ca.vec(ca.densify(ca.jacobian(values, variables) + chain))]

    # Make the output column, and replace the slip symbols by the slip's expressions.
    blocks = [
        force,
        *derivatives(force, inputs[SPEEDS]),
        rate,
        *derivatives(rate, inputs[SPEEDS]),
        *derivatives(force, x),
        *derivatives(rate, x),
        slip[:2],
    ]
    out = ca.substitute(ca.densify(ca.vertcat(*blocks)), slip_symbol, slip)
    return law("contact_law", [ca.vertcat(inputs, constants), x, parameters], out)


def motor_law(motor: Motor, effects: Sequence[MotorEffect]) -> ca.Function:
    """Return a CasADi function that computes the torque of a motor with all motor effects, and its derivatives.

    The inputs of the function are a vector, the states, and the parameters. The vector holds duty delta [-], wheel rate
    omega [rad/s], number of the wheel and current of the supply [A]. The output is one column: torque at the wheel [N
    m]; d torque / d omega; motor current [A]; supply voltage [V]; rates of the states; d rates / d omega; d torque / d
    states; d rates / d states.

    Parameters
    ----------
    motor : Motor
        The motor; its quantities are the first parameters.
    effects : sequence of MotorEffect
        The effects, in the order of their action.

    Raises
    ------
    ParameterError
        The effects have too many states, or formulas that are not allowed (`law`).
    """
    (own_motor, *symbolic_effects), parameters = symbolic([motor, *effects])
    delta, omega, wheel, bus = (ca.SX.sym(name) for name in ("delta", "omega", "wheel", "bus_current"))
    states = _states(effects)
    drive: Drive = own_motor.drive(delta, omega)._replace(wheel=wheel, bus_current=bus)  # type: ignore[attr-defined]
    drive = amend_subject(symbolic_effects, drive, states)
    # Torque constant times current is the torque before the effects that act on it.
    current = drive.current
    torque, rates = torque_and_rates(symbolic_effects, drive, drive.constant * current, states)
    rate, x = _column(rates), _column(states)

    def derivatives(values: ca.SX, variables: ca.SX) -> list[ca.SX]:
        """Return the derivatives of `values` by `variables` as a list with one column (column-major), or an empty list
        if there are none.
        """
        if values.numel() == 0 or variables.numel() == 0:
            return []
        return [ca.vec(ca.densify(ca.jacobian(values, variables)))]

    # The column of outputs, in the order in which the C code reads it.
    blocks = [
        torque,
        *derivatives(torque, omega),
        current,
        drive.supply,
        rate,
        *derivatives(rate, omega),
        *derivatives(torque, x),
        *derivatives(rate, x),
    ]
    out = ca.densify(ca.vertcat(*blocks))
    return law("motor_law", [ca.vertcat(delta, omega, wheel, bus), x, parameters], out)


def generated_source(*functions: ca.Function, name: str = "laws") -> str:
    """Return the C source that CasADi generates for the functions. `name` becomes part of the names of the helper
    functions in it, so that two sources can be compiled into one program.
    """
    code = ca.CodeGenerator(f"{name}.c", {"with_header": False})
    for function in functions:
        code.add(function)
    return str(code.dump())


def number_of_states(effects: Sequence[Effect] | Sequence[MotorEffect]) -> int:
    """Return the number of states that all effects have together; raise an error if the compiled step cannot hold so
    many.
    """
    count = sum(len(effect.states) for effect in effects)
    if count > MAX_STATES:
        names = [state.name for effect in effects for state in effect.states]
        raise ParameterError(
            f"The effects have {count} states at each wheel ({', '.join(names)}); at most {MAX_STATES} are allowed: "
            "leave out one of the effects that have these states."
        )
    return count


def _states(effects: Sequence[Any]) -> list[tuple[ca.SX, ...]]:
    """Return CasADi symbols for the states of all effects: one tuple of symbols for each effect."""
    number_of_states(effects)
    return [tuple(ca.SX.sym(state.name) for state in effect.states) for effect in effects]


def _column(tuples: Sequence[Sequence[Any]]) -> ca.SX:
    """Return all entries of several tuples as one CasADi column, in their order."""
    flat = [value for values in tuples for value in values]
    return ca.vertcat(*flat) if flat else ca.SX(0, 1)


Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""A law that is evaluated with NumPy arrays: a function (first input, states, parameters) -> output column, as
`contact_law` and `motor_law` describe them."""


def as_numbers(function: ca.Function) -> Law:
    """Return a law as a Python function of NumPy arrays. CasADi evaluates it, so that no compiler is needed."""

    def call(first: np.ndarray, states: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        return np.array(function(first, states, parameters)).ravel()

    return call


class SplitLaw(NamedTuple):
    """A law divided into two functions for speed: `before` computes all parts that depend on constants only, and
    `during` computes the rest.

    law(first, states, parameters) = during(varying, states, before(constants, parameters)), where `varying` and
    `constants` are the two parts of the input `first`. `before` is evaluated once for each pair of wheel and soil,
    `during` in every step.
    """

    before: ca.Function
    """function (constants, parameters) -> the intermediate values that depend on these inputs only"""
    during: ca.Function
    """function (varying, states, intermediate values from `before`) -> output of the law"""


def split_law(law: ca.Function, varying: int) -> SplitLaw:
    """Divide a law (first, states, parameters) -> column into a function of its constants, which is evaluated once, and
    a function for the rest, which is evaluated in every step.

    The two functions do the operations of the whole law in its order, so that the result is equal to the bit. Equal
    expressions are computed once.

    Parameters
    ----------
    law : ca.Function
        A function of three columns, made of CasADi's scalars (SX).
    varying : int
        Number of entries of the input `first`, from its beginning, that vary from call to call. The other entries of
        `first` and all parameters are constants.
    """
    moving, constants = ca.SX.sym("varying", varying), ca.SX.sym("constant", law.numel_in(0) - varying)
    states, parameters = ca.SX.sym("state", law.numel_in(1)), ca.SX.sym("parameter", law.numel_in(2))
    out = ca.cse(law(ca.vertcat(moving, constants), states, parameters))
    fixed = ca.vertcat(constants, parameters)
    # `extract_parametric` names every expression of the constants alone; these become the input of the second part.
    expression, symbols, values = ca.extract_parametric(out, fixed, {"extract_trivial": True})
    precomputed, value = (ca.vertcat(*entries) if entries else ca.SX(0, 1) for entries in (symbols, values))
    return SplitLaw(
        ca.Function(f"{law.name()}_before", [constants, parameters], [value]),
        ca.Function(f"{law.name()}_during", [moving, states, precomputed], [expression]),
    )
