"""Draft an effect that acts as a fitted term describes, both as the text of an effect file and as an object to be
tried.

A term is an action (for example a torque on one wheel) times a function of one argument (for example the angle of the
wheel). `draft` chooses a kind of effect that can perform the action and that knows the argument.

The text and the object use equal rounded numbers, so that both are one effect. The text is never executed here, because
it contains names of runs and channels, which come from the user's data.
"""

import math
import re
import textwrap
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Body, BodyEffect, Drive, Effect, MotorEffect, Push, SensorEffect, State
from rover_pin.experiments.unlisted.actions import FORCE, GRIP, LEAN, READING, TORQUE, VOLTAGE
from rover_pin.experiments.unlisted.regressors import Hats, Polynomial, Wave
from rover_pin.experiments.unlisted.terms import Term, sine
from rover_pin.simulation.model.effect_files import AnyEffect
from rover_pin.simulation.model.effect_source import IMPORTED_NAMES, Coefficient, DraftedEffect, EffectSource

Values = Any
"""Argument of a function: a float, an array over time, or a CasADi expression."""
MAX_SIZE = 20.0
"""Upper limit, and with a minus sign lower limit, of a draft's `size` in a fit. The size 1 is the estimated effect."""
MAX_CLASS_NAME = 60
"""Maximum number of letters of a drafted effect's class name. Further letters of the given name are cut off."""
STATES = (
    dict.fromkeys(("time", "moment"), (State("time"), "1.0"))
    | dict.fromkeys(
        ("wheel angle", "wheel angle since the start", "twice the wheel angle"),
        (State("angle", odd=True), "drive.omega"),
    )
)  # fmt: skip
"""Argument -> the state of an effect that holds this argument, and code of the state's time derivative. An angle is
odd: it changes its sign if the direction of travel is reversed."""
PLACES = ("place", "local place", "periodic place")
"""Arguments that are a position along x [m], of a wheel or of the base."""
READING_CODE = "channels[CHANNEL]"
"""Code of a sensor effect that reads the channel with the error. The effect file holds the channel's name as
CHANNEL."""

ARGUMENTS: dict[type[AnyEffect], dict[str, str]] = {
    MotorEffect: {
        "nothing": "0.0",
        "rate": "drive.omega",
        "duty": "drive.delta",
        "current": "drive.current",
        **dict.fromkeys(STATES, "x[0]"),
    },
    Effect: {
        "nothing": "0.0",
        "slip": "contact.S",
        "rate": "contact.rim / contact.wheel.r",
        **dict.fromkeys(("time", "moment"), "x[0]"),
        **dict.fromkeys(PLACES, "contact.x"),
    },
    BodyEffect: {
        "nothing": "0.0",
        "pitch": "body.pitch",
        "roll": "body.roll",
        "heading": "ca.cos(body.yaw)",
        **dict.fromkeys(PLACES, "body.x"),
    },
    SensorEffect: {
        "nothing": "0.0 * t",
        "its own value": READING_CODE,
        "time": "t - t[0]",
        "moment": "t - t[0]",
        "place": 'channels["body_x"]',
        **dict.fromkeys(
            ("wheel angle", "wheel angle since the start", "twice the wheel angle"),
            f"np.cumsum({READING_CODE}) * (t[1] - t[0])",
        ),
    },
}
"""Kind of effect -> the arguments that it knows, each with the code that computes the argument."""

SPEED_CODE = "speed = ca.sqrt(body.v_x * body.v_x + body.v_y * body.v_y + 1e-5)\n"
ACTIONS: tuple[tuple[str, type[AnyEffect], str, str], ...] = (
    (TORQUE, MotorEffect, "torque", "return {size}"),
    (VOLTAGE, MotorEffect, "amend", "return drive._replace(delta=drive.delta + {size})"),
    (TORQUE, Effect, "load", "return Load(torque=-{size})"),
    (FORCE, BodyEffect, "push",
     SPEED_CODE + "return Push(f_x=-{size} * body.v_x / speed, f_y=-{size} * body.v_y / speed)"),
    (LEAN, BodyEffect, "push", "return Push(f_x={size})"),
    (FORCE, Effect, "load",
     "return Load(f_t=-{size} / {wheels} * contact.v_x / ca.sqrt(contact.v_x * contact.v_x + 1e-5))"),
    (GRIP, Effect, "amend",
     "phi = ca.atan(ca.fmax(0.0, 1.0 + {size}) * ca.tan(contact.soil.phi))\n"
     "return contact._replace(soil=contact.soil.replace(phi=phi))"),
    (READING, SensorEffect, "read", f"return {{{{CHANNEL: {READING_CODE} + {{size}}}}}}"),
)  # fmt: skip
"""Actions, each with a kind of effect that can perform the action, the name of the method (hook) and its code. A draft
uses the first row whose kind of effect also knows the argument of the term."""


class DraftedFunction(NamedTuple):
    """The function of a signal that was estimated from a residual, in two forms: as code, and as a Python function of a
    number or an array.
    """

    code: str
    value_at: Callable[[Values], Values]


def draft(term: Term, name: str, wheels: Sequence[str]) -> DraftedEffect:
    """Draft the effect that a fitted term describes, and return it as the text of an effect file and as an object.

    The effect has one coefficient, `size`: 1 is the estimated effect and 0 is no effect. If the numbers of the term
    differ from run to run, the effect takes the phase of the first run and the mean of each other number.

    Parameters
    ----------
    term : Term
        Action and function that describe the residual of a fitted drive model.
    name : str
        Name of the effect. `class_name` converts it to the name of the class.
    wheels : sequence of str
        Names of the rover's wheels, in the order of the model.

    Raises
    ------
    ParameterError
        The function depends on a signal that is not known to any kind of effect with this action.
    """
    row = _carrier(term)
    if row is None:
        raise ParameterError(
            f"{term.act.description} that depends on '{term.argument.name}' cannot be drafted: "
            "no kind of effect with that action knows this signal; write an effect by hand from the term's curve."
        )
    base, hook, code = row
    argument, where = term.argument.name, term.act.where
    size = "self.size * value"
    if where and base is MotorEffect:
        # A motor effect is called for every motor, so the effect of one wheel is 0 at all other wheels.
        size = f"ca.if_else(ca.fabs(drive.wheel - {tuple(wheels).index(where)}) < 0.5, {size}, 0.0)"
    value = f"value = {_curve(term, ARGUMENTS[base][argument]).code}\n"
    hooks = {hook: value + code.format(size=size, wheels=len(wheels))}
    functions = _hook_functions(term, base, tuple(wheels))
    # Time and wheel angle are no inputs of a wheel's or motor's effect, so the effect integrates them as a state.
    states: tuple[State, ...] = ()
    if argument in STATES and base in (Effect, MotorEffect):
        state, rate = STATES[argument]
        states, hooks["rate"] = (state,), f"return ({rate},)"
        functions["rate"] = (lambda self, drive, torque, x: (drive.omega,)) if state.odd else lambda *inputs: (1.0,)
    # The text and the object get the same names, numbers and bounds.
    source = EffectSource(
        class_name(name),
        base,
        "Draft of an effect that imitates the residual of a fitted model; read the file before you use it.\n\n"
        + textwrap.fill(f"It {term.description}.", 110),
        "The residual of a drive log, as the top of this file describes.",
        "Source: estimated from a drive log. Differs from the paper: the paper has no such effect.",
        "residual of a log",
        "something acts that is on no list, as a log showed it",
        (Coefficient("size", 1.0, "", "1 is as estimated from the log", -MAX_SIZE, MAX_SIZE, "s"),),
        {"size": 0.0},
        hooks,
        {"CHANNEL": where} if base is SensorEffect else {},
        states,
    )
    return DraftedEffect(source.text, source.effect(functions))


def can_draft(term: Term) -> bool:
    """Return whether an effect can be drafted from a term (an action of an unknown effect times a function of a
    signal).

    A kind of effect must exist that can perform the action and that knows the signal. `draft` refuses all other terms.
    """
    return _carrier(term) is not None


def class_name(name: str) -> str:
    """Return a valid class name for a drafted effect, made of the letters and digits of any text.

    Every word begins with a capital letter. If the result is not a valid class name, or is a name that the effect's
    file imports, "Remainder" is put in front of it.

    Examples
    --------
    >>> class_name("eccentric wheel")
    'EccentricWheel'
    >>> class_name("3 wheels")
    'Remainder3Wheels'
    """
    # A reserved word, a name that the file imports, or a name like a base class would break the file.
    words = "".join(word[:1].upper() + word[1:] for word in re.findall("[A-Za-z0-9]+", name))[:MAX_CLASS_NAME]
    reserved = IMPORTED_NAMES | {"None", "True", "False"}
    is_free = words[:1].isalpha() and words not in reserved and not words.endswith("Effect")
    return words if is_free else f"Remainder{words}"


def _carrier(term: Term) -> tuple[type[AnyEffect], str, str] | None:
    """Return the kind of effect that can perform the action of a term, with the name and the code of its method (hook).

    A term is an action times a function of a signal. The result is None if no kind of effect can perform the action and
    knows the signal.
    """
    for action, base, hook, code in ACTIONS:
        # Only motors and sensors know which wheel or channel they belong to.
        can_locate = not term.act.where or base in (MotorEffect, SensorEffect)
        if action == term.act.kind and term.argument.name in ARGUMENTS[base] and can_locate:
            return base, hook, code
    return None


def _hook_functions(term: Term, base: type[AnyEffect], wheels: tuple[str, ...]) -> dict[str, Callable[..., Any]]:
    """Return the main method (hook) of a drafted effect as a Python function, under the name of the hook.

    The function computes the values of the code in `ACTIONS` and `ARGUMENTS`, with an equal order of operations. Tests
    compare both to the last bit.
    """
    value_at, argument, action, where = _curve(term, "").value_at, term.argument.name, term.act.kind, term.act.where
    if base is SensorEffect:

        def read(self: Any, t: np.ndarray, channels: Any) -> dict[str, np.ndarray]:
            # The cases correspond to the entries of ARGUMENTS for sensor effects.
            if argument == "place":
                seen = channels["body_x"]
            elif argument == "its own value":
                seen = channels[where]
            elif argument == "nothing":
                seen = 0.0 * t
            else:
                seen = t - t[0] if argument in ("time", "moment") else np.cumsum(channels[where]) * (t[1] - t[0])
            return {where: channels[where] + self.size * value_at(seen)}

        return {"read": read}
    if base is MotorEffect:

        def motor_size(self: Any, drive: Drive, x: tuple[Scalar, ...]) -> Scalar:
            seen = {"nothing": 0.0, "rate": drive.omega, "duty": drive.delta, "current": drive.current}
            size = self.size * value_at(x[0] if argument in STATES else seen[argument])
            return ca.if_else(ca.fabs(drive.wheel - wheels.index(where)) < 0.5, size, 0.0) if where else size

        def torque(self: Any, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> Scalar:
            return motor_size(self, drive, x)

        def amend_drive(self: Any, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
            return drive._replace(delta=drive.delta + motor_size(self, drive, x))

        return {"torque": torque} if action == TORQUE else {"amend": amend_drive}
    if base is BodyEffect:

        def push(self: Any, body: Body) -> Push:
            seen = {"nothing": 0.0, "pitch": body.pitch, "roll": body.roll, "heading": ca.cos(body.yaw)}
            seen |= dict.fromkeys(PLACES, body.x)
            size = self.size * value_at(seen[argument])
            # The constant 1e-5 keeps the direction of motion differentiable at rest.
            speed = ca.sqrt(body.v_x * body.v_x + body.v_y * body.v_y + 1e-5)
            return (
                Push(f_x=size) if action == LEAN else Push(f_x=-size * body.v_x / speed, f_y=-size * body.v_y / speed)
            )

        return {"push": push}

    def contact_size(self: Any, contact: Contact, x: tuple[Scalar, ...]) -> Scalar:
        seen = {"nothing": 0.0, "slip": contact.S, "rate": contact.rim / contact.wheel.r}
        seen |= dict.fromkeys(PLACES, contact.x)
        return self.size * value_at(x[0] if argument in STATES else seen[argument])

    def load(self: Any, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        size = contact_size(self, contact, x)
        if action == TORQUE:
            return Load(torque=-size)
        # The force on the body is shared equally by all wheels.
        return Load(f_t=-size / len(wheels) * contact.v_x / ca.sqrt(contact.v_x * contact.v_x + 1e-5))

    def amend_contact(self: Any, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        phi = ca.atan(ca.fmax(0.0, 1.0 + contact_size(self, contact, x)) * ca.tan(contact.soil.phi))
        return contact._replace(soil=contact.soil.replace(phi=phi))

    return {"amend": amend_contact} if action == GRIP else {"load": load}


def _curve(term: Term, z: str) -> DraftedFunction:
    """Return the estimated function of a term in two forms: as code with the expression `z` as argument, and as a
    Python function.

    A term is an action times this function of a signal. Every number is rounded alike in both forms, so that both are
    equal.
    """
    arrays, library = ("np", np) if term.act.kind == READING else ("ca", ca)
    basis, size = term.argument.basis, term.size
    if isinstance(basis, Wave):
        # Amplitudes are averaged over the runs. Phases cannot be averaged, so the first run's phase is taken.
        amplitudes, phases = sine(term)
        amplitude, rate, phase = f"{np.mean(amplitudes):.6g}", f"{2 * math.pi / basis.length:.6g}", f"{phases[0]:.5g}"
        return DraftedFunction(
            f"{amplitude} * {arrays}.sin({rate} * ({z}) + {phase})",
            lambda value: float(amplitude) * library.sin(float(rate) * value + float(phase)),
        )
    # If each run has its own numbers, a single effect can only have their mean.
    numbers = size.reshape(-1, len(basis.of(basis.grid))).mean(axis=0)
    if isinstance(basis, Hats):
        # A piecewise linear function is a sum of ramps. Each ramp rises between two neighbouring nodes and is constant
        # elsewhere.
        low, high = ("ca.fmax", "ca.fmin") if arrays == "ca" else ("np.maximum", "np.minimum")
        above, below = (ca.fmax, ca.fmin) if arrays == "ca" else (np.maximum, np.minimum)
        spacing, first = f"{basis.nodes[1] - basis.nodes[0]:.6g}", f"{numbers[0]:.6g}"
        # A ramp rises from 0 at its node to its height at the next node; ramps without height are left out.
        ramps = [
            (f"{rise:.6g}", f"{node:.6g}")
            for node, rise in zip(basis.nodes[:-1], np.diff(numbers), strict=True)
            if rise
        ]
        lines = [f"{rise} * {high}(1.0, {low}(0.0, (({z}) - {node}) / {spacing}))" for rise, node in ramps]

        def piecewise(value: Values) -> Values:
            total = float(first)
            for rise, node in ramps:
                total = total + float(rise) * below(1.0, above(0.0, (value - float(node)) / float(spacing)))
            return total

        return DraftedFunction("(\n    " + "\n    + ".join([first, *lines]) + "\n)", piecewise)

    assert isinstance(basis, Polynomial)
    centre, half, coefficients = f"{basis.centre:.6g}", f"{basis.half:.6g}", [f"{number:.6g}" for number in numbers]
    scaled = f"(({z}) - {centre}) / {half}"

    def polynomial(value: Values) -> Values:
        # The products are in the order of the code, so that both forms agree to the last bit.
        total = float(coefficients[0])
        for power, coefficient in enumerate(coefficients[1:], start=1):
            product = float(coefficient)
            for _ in range(power):
                product = product * ((value - float(centre)) / float(half))
            total = total + product
        return total

    return DraftedFunction(" + ".join(c + f" * ({scaled})" * power for power, c in enumerate(coefficients)), polynomial)
