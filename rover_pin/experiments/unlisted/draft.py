"""A draft of the effect that a term describes: a Python file for `--effects`, to be tried, refitted, edited."""

import math
import re
import textwrap
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.experiments.unlisted.actions import FORCE, GRIP, LEAN, READING, TORQUE, VOLTAGE
from rover_pin.experiments.unlisted.regressors import Hats, Polynomial, Wave
from rover_pin.experiments.unlisted.term import Term, sine

SINCE = dict.fromkeys(("time", "moment"), "x[0]")
ANGLES = dict.fromkeys(("wheel angle", "wheel angle since the start", "twice the wheel angle"), "x[0]")
PLACES = ("place", "local place", "periodic place")
STATES = dict.fromkeys(SINCE, ("time", "1.0", False)) | dict.fromkeys(ANGLES, ("angle", "drive.omega", True))
"""What is a state of the effect: its name, its rate, and whether it turns with the wheel."""

HEAD = '''"""Draft of an effect from what a fitted model left; look at it before you use it.

{said}
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import {arrays}

{imports}
from rover_pin.base.quantity import quantity


@dataclass(frozen=True)
class {name}({base}):
    """What a log leaves: see the top of this file.

    Source: estimated from a drive log. Differs from the paper: it has no such effect.
    """

    title: ClassVar[str] = "residual of a log"
    meaning: ClassVar[str] = "something acts that is on no list, as a log showed it"
    size: float = quantity(1.0, "", "1 is as estimated from the log", -20.0, 20.0, "s")
    neutral: ClassVar[dict[str, float]] = {{"size": 0.0}}
'''


class Base(NamedTuple):
    """A kind of effect: its class, what a file of it imports, what its rate is given, and what it sees of arguments."""

    name: str
    arrays: str
    imports: str
    rate_arguments: str
    sees: dict[str, str]


EFFECT = "from rover_pin.effects.effect import "
MOTOR = Base(
    "MotorEffect", "casadi as ca", EFFECT + "MotorEffect, State", "drive, torque",
    {"nothing": "0.0", "rate": "drive.omega", "duty": "drive.delta", "current": "drive.current", **SINCE, **ANGLES},
)  # fmt: skip
CONTACT = Base(
    "Effect", "casadi as ca", f"from rover_pin.contact import Load\n{EFFECT}Effect, State", "contact, load",
    {"nothing": "0.0", "slip": "contact.S", "rate": "contact.rim / contact.wheel.r", **SINCE}
    | dict.fromkeys(PLACES, "contact.x"),
)  # fmt: skip
BODY = Base(
    "BodyEffect", "casadi as ca", EFFECT + "BodyEffect, Push", "",
    {"nothing": "0.0", "pitch": "body.pitch", "roll": "body.roll", "heading": "ca.cos(body.yaw)"}
    | dict.fromkeys(PLACES, "body.x"),
)  # fmt: skip
SENSOR = Base(
    "SensorEffect", "numpy as np", EFFECT + "SensorEffect", "",
    {"nothing": "0.0 * t", "its own value": "{reading}", "time": "t - t[0]", "moment": "t - t[0]",
     "place": 'channels["body_x"]'} | dict.fromkeys(ANGLES, "np.cumsum({reading}) * (t[1] - t[0])"),
)  # fmt: skip
PUSHES = """
    def push(self, body):
        value = {{value}}
        speed = ca.sqrt(body.v_x * body.v_x + body.v_y * body.v_y + 1e-5)
        return Push({})
"""
LOADS = """
    def load(self, contact, load, x):
        value = {{value}}
        return Load({})
"""
ACTS = (
    (TORQUE, MOTOR, """
    def torque(self, drive, torque, x):
        value = {value}
        return {size}
"""),
    (VOLTAGE, MOTOR, """
    def amend(self, drive, x):
        value = {value}
        return drive._replace(delta=drive.delta + {size})
"""),
    (TORQUE, CONTACT, LOADS.format("torque=-{size}")),
    (FORCE, BODY, PUSHES.format("f_x=-{size} * body.v_x / speed, f_y=-{size} * body.v_y / speed")),
    (LEAN, BODY, PUSHES.format("f_x={size}")),
    (FORCE, CONTACT, LOADS.format(
        "f_t=-{size} / {wheels} * contact.v_x / ca.sqrt(contact.v_x * contact.v_x + 1e-5)"
    )),
    (GRIP, CONTACT, """
    def amend(self, contact, x):
        value = {value}
        phi = ca.atan(ca.fmax(0.0, 1.0 + {size}) * ca.tan(contact.soil.phi))
        return contact._replace(soil=contact.soil.replace(phi=phi))
"""),
    (READING, SENSOR, """
    def read(self, t, channels):
        value = {value}
        return {{"{where}": {reading} + {size}}}
"""),
)  # fmt: skip
"""What is acted on, by which kind of effect, with which method; the first that sees the argument drafts it."""


def draft(term: Term, name: str, wheels: Sequence[str]) -> str:
    """Return the text of an effect file with the effect `name` that a term describes; `wheels` are their names.

    Its `size` is 1 as estimated and 0 without. Where every run has its own numbers, those of the first run (the phase)
    or the mean of all runs stand.

    Raises ParameterError: the term is a function of something that no such effect sees; it has to be written by hand.
    """
    way = _base_and_method(term)
    if way is None:
        raise ParameterError(
            f"{term.act.description} that depends on '{term.argument.name}' cannot be drafted: "
            "no kind of effect that acts so sees it; write one by hand from the term's curve."
        )
    base, method = way
    where, reading = term.act.where, f'channels["{term.act.where}"]'
    size = "self.size * value"
    if where and base is MOTOR:
        size = f"ca.if_else(ca.fabs(drive.wheel - {tuple(wheels).index(where)}) < 0.5, {size}, 0.0)"
    text = HEAD.format(
        said=textwrap.fill(f"It {term.description}.", 110), name=class_name(name), base=base.name, arrays=base.arrays,
        imports=base.imports,
    )  # fmt: skip
    state, rate = STATES.get(term.argument.name, ()) if base.rate_arguments else (), ""
    if state:
        text += f'    states: ClassVar[tuple[State, ...]] = (State("{state[0]}", odd={state[2]}),)\n'
        rate = f"\n    def rate(self, {base.rate_arguments}, x):\n        return ({state[1]},)\n"
    value = _value(term, base.sees[term.argument.name].format(reading=reading))
    return text + method.format(value=value, size=size, wheels=len(wheels), where=where, reading=reading) + rate


def can_draft(term: Term) -> bool:
    """Return whether some kind of effect acts as the term does and sees what it depends on."""
    return _base_and_method(term) is not None


def class_name(name: str) -> str:
    """Return a name for a Python class from any text."""
    words = "".join(word[:1].upper() + word[1:] for word in re.findall("[A-Za-z0-9]+", name))
    return words if words[:1].isalpha() else f"Remainder{words}"


def _base_and_method(term: Term) -> tuple[Base, str] | None:
    """Return which effect can act and see as the term does, and the method that does it; None if there is none."""
    for kind, base, method in ACTS:
        somewhere = not term.act.where or base in (MOTOR, SENSOR)
        if kind == term.act.kind and term.argument.name in base.sees and somewhere:
            return base, method
    return None


def _value(term: Term, z: str) -> str:
    """Return the estimated function of the expression z, as Python text."""
    arrays = "np" if term.act.kind == READING else "ca"
    basis, size = term.argument.basis, term.size
    if isinstance(basis, Wave):
        amplitude, phase = sine(term)
        return (
            f"{float(np.mean(amplitude)):.6g} * {arrays}.sin({2 * math.pi / basis.length:.6g} * ({z}) + {phase[0]:.5g})"
        )
    numbers = size.reshape(-1, len(basis.of(basis.grid))).mean(axis=0)
    if isinstance(basis, Hats):
        return _piecewise(basis, numbers, z, arrays)
    assert isinstance(basis, Polynomial)
    scaled = f"(({z}) - {basis.centre:.6g}) / {basis.half:.6g}"
    return " + ".join(f"{c:.6g}" + f" * ({scaled})" * power for power, c in enumerate(numbers))


def _piecewise(basis: Hats, numbers: np.ndarray, z: str, arrays: str) -> str:
    """Return a piecewise linear function as a sum of ramps."""
    low, high = ("ca.fmax", "ca.fmin") if arrays == "ca" else ("np.maximum", "np.minimum")
    nodes, spacing = basis.nodes, basis.nodes[1] - basis.nodes[0]
    ramps = [
        f"{rise:.6g} * {high}(1.0, {low}(0.0, (({z}) - {node:.6g}) / {spacing:.6g}))"
        for node, rise in zip(nodes[:-1], np.diff(numbers), strict=True)
        if rise
    ]
    return "(\n            " + "\n            + ".join([f"{numbers[0]:.6g}", *ramps]) + "\n        )"
