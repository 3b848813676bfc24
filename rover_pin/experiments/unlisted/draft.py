"""A draft of the effect that a term describes: a Python file for `--effects`, to be tried, refitted, edited."""

from __future__ import annotations

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

CLOCK, TURNED = ("time", "1.0", False), ("angle", "drive.omega", True)
SINCE = {"time": "x[0]", "moment": "x[0]"}
ANGLES = dict.fromkeys(("wheel angle", "wheel angle since the start", "twice the wheel angle"), "x[0]")
SEEN = {
    "motor": {
        "nothing": "0.0",
        "rate": "drive.omega",
        "duty": "drive.delta",
        "current": "drive.current",
        **SINCE,
        **ANGLES,
    },
    "contact": {"nothing": "0.0", "slip": "contact.S", "rate": "contact.rim / contact.wheel.r", **SINCE}
    | dict.fromkeys(("place", "local place", "periodic place"), "contact.x"),
    "body": {"nothing": "0.0", "pitch": "body.pitch", "roll": "body.roll", "heading": "ca.cos(body.yaw)"}
    | dict.fromkeys(("place", "local place", "periodic place"), "body.x"),
    "sensor": {
        "nothing": "0.0 * t",
        "own": "{own}",
        "time": "t - t[0]",
        "moment": "t - t[0]",
        "place": 'channels["body_x"]',
    }
    | dict.fromkeys(ANGLES, "np.cumsum({own}) * (t[1] - t[0])"),
}
"""What each kind of effect sees of the arguments of terms."""

HEAD = '''"""Draft of an effect from what a fitted model left; look at it before you use it.

{said}
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

{arrays}

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
ARRAYS = dict.fromkeys(("MotorEffect", "Effect", "BodyEffect"), "import casadi as ca") | {
    "SensorEffect": "import numpy as np"
}
IMPORTS = {
    "MotorEffect": "from rover_pin.effects.effect import MotorEffect, State",
    "Effect": "from rover_pin.contact import Load\nfrom rover_pin.effects.effect import Effect, State",
    "BodyEffect": "from rover_pin.effects.effect import BodyEffect, Push",
    "SensorEffect": "from rover_pin.effects.effect import SensorEffect",
}
STATES = """    states: ClassVar[tuple[State, ...]] = (State("{0}", odd={2}),)
"""
RATE = """
    def rate(self, {sees}, x):
        return ({rate},)
"""
TORQUES = """
    def torque(self, drive, torque, x):
        value = {value}
        return {here}
"""
DUTIES = """
    def amend(self, drive, x):
        value = {value}
        return drive._replace(delta=drive.delta + {here})
"""
PUSHES = """
    def push(self, body):
        value = {value}
        speed = ca.sqrt(body.v_x * body.v_x + body.v_y * body.v_y + 1e-5)
        return {push}
"""
LOADS = """
    def load(self, contact, load, x):
        value = {value}
        return {load}
"""
GRIPS = """
    def amend(self, contact, x):
        value = {value}
        phi = ca.atan(ca.fmax(0.0, 1.0 + self.size * value) * ca.tan(contact.soil.phi))
        return contact._replace(soil=contact.soil.replace(phi=phi))
"""
READS = """
    def read(self, t, channels):
        value = {value}
        return {{"{channel}": channels["{channel}"] + self.size * value}}
"""
SHARE = "Load(f_t=-self.size * value / {wheels} * contact.v_x / ca.sqrt(contact.v_x * contact.v_x + 1e-5))"


class _Kind(NamedTuple):
    sees: str
    base: str
    body: str
    argument: str


def draft(term: Term, name: str, wheels: Sequence[str]) -> str:
    """Return the text of an effect file with the effect `name` that a term describes; `wheels` are their names.

    Its `size` is 1 as estimated and 0 without. Where every run has its own numbers, those of the first run (the phase)
    or the mean of all runs stand.

    Raises
    ------
    ParameterError
        The term is a function of something that no such effect sees; it has to be written by hand.
    """
    kind, name = _kind(term, wheels), class_name(name)
    if kind is None:
        raise ParameterError(
            f"{term.acts} that depends on '{term.argument.name}' cannot be drafted: "
            "no kind of effect that acts so sees it; write one by hand from the term's curve."
        )
    argument = term.argument.name
    state = TURNED if argument in ANGLES else CLOCK if argument in SINCE else None
    value = _value(term, kind.argument)
    sentence = textwrap.fill(f"It {term.description}.", 110)
    text = HEAD.format(said=sentence, name=name, base=kind.base, arrays=ARRAYS[kind.base], imports=IMPORTS[kind.base])
    if state and kind.sees:
        text += STATES.format(*state)
        rate = RATE.format(sees=kind.sees, rate=state[1])
    else:
        rate = ""
    return text + kind.body.replace("{value}", value) + rate


def can_draft(term: Term, wheels: Sequence[str]) -> bool:
    """Return whether some kind of effect acts as the term does and sees what it depends on."""
    return _kind(term, wheels) is not None


def class_name(name: str) -> str:
    """Return a name for a Python class from any text."""
    words = "".join(word[:1].upper() + word[1:] for word in re.findall("[A-Za-z0-9]+", name))
    return words if words[:1].isalpha() else f"Remainder{words}"


def _kind(term: Term, wheels: Sequence[str]) -> _Kind | None:
    """Return which effect can act and see as the term does, and the method that does it; None if there is none."""
    acts, argument, where = term.act.kind, term.argument.name, term.act.where
    if acts in (TORQUE, VOLTAGE) and argument in SEEN["motor"]:
        number = tuple(wheels).index(where) if where else 0
        expression = (
            f"ca.if_else(ca.fabs(drive.wheel - {number}) < 0.5, self.size * value, 0.0)"
            if where
            else "self.size * value"
        )
        body = (TORQUES if acts == TORQUE else DUTIES).replace("{here}", expression)
        return _Kind("drive, torque", "MotorEffect", body, SEEN["motor"][argument])
    if acts == TORQUE and not where and argument in SEEN["contact"]:
        return _Kind(
            "contact, load",
            "Effect",
            LOADS.replace("{load}", "Load(torque=-self.size * value)"),
            SEEN["contact"][argument],
        )
    if acts in (FORCE, LEAN) and argument in SEEN["body"]:
        against = "Push(f_x=-self.size * value * body.v_x / speed, f_y=-self.size * value * body.v_y / speed)"
        return _Kind(
            "",
            "BodyEffect",
            PUSHES.replace("{push}", against if acts == FORCE else "Push(f_x=self.size * value)"),
            SEEN["body"][argument],
        )
    if acts == FORCE and argument in SEEN["contact"]:
        return _Kind(
            "contact, load",
            "Effect",
            LOADS.replace("{load}", SHARE.format(wheels=len(wheels))),
            SEEN["contact"][argument],
        )
    if acts == GRIP and argument in SEEN["contact"]:
        return _Kind("contact, load", "Effect", GRIPS, SEEN["contact"][argument])
    if acts == READING and argument.replace("its own value", "own") in SEEN["sensor"]:
        reading = f'channels["{where}"]'
        return _Kind(
            "",
            "SensorEffect",
            READS.format(value="{value}", channel=where),
            SEEN["sensor"][argument.replace("its own value", "own")].format(own=reading),
        )
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
