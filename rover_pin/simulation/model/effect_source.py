"""Source text of an effect file that this program writes for a user. All such files have one layout, and this module
encodes the texts in them.

Three parts of the program write such files: `rover-pin new-effect`; the search in the residual of a wheel rig, which
drafts an effect; and the search in the residual of a drive log, which also drafts an effect. Each part fills in an
`EffectSource`.

The names in the text (of a rig, a run, a channel) come from data files, so they are encoded as Python literals,
docstrings or comments, and can contain no code. The program never executes the text that it writes. If the program has
to try a drafted effect at once, the effect is made of functions instead (`EffectSource.effect`).
"""

import ast
import inspect
import keyword
import re
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rover_pin.base.encode import python_docstring, python_string
from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import quantity
from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect, State
from rover_pin.simulation.model.effect_files import AnyEffect, effect_class

IMPORTS = {
    "collections.abc": "Mapping",
    "dataclasses": "dataclass",
    "typing": "ClassVar",
    "rover_pin.base.quantity": "quantity",
    "rover_pin.contact": "Contact Load Scalar right_angle",
    "rover_pin.effects.effect": "Body BodyEffect Drive Effect MotorEffect Push SensorEffect State",
    "rover_pin.soil.slip": "slip_ratio",
}
"""For each module, the names that an effect file may import from it, separated by spaces."""
IMPORTED_NAMES = frozenset(" ".join(IMPORTS.values()).split())
"""Names that are not allowed for the class of an effect, because the effect file imports them, and the class would hide
the import."""

HEAD = '''"""{summary}"""

from __future__ import annotations

{imports}
{constants}

@dataclass(frozen=True)
class {name}({base}):
    """{law}

    {origin}
    """

    # what a reader calls the effect, and what follows "because" in a report
    title: ClassVar[str] = {title}
    meaning: ClassVar[str] = {meaning}
    # value, unit, source of the value, lower bound, upper bound, symbol
{coefficients}
    neutral: ClassVar[dict[str, float]] = {{{neutral}}}  # the values at which the effect vanishes
'''


class Coefficient(NamedTuple):
    """A numeric parameter of a drafted effect. The effect's file declares it by `quantity(value, unit, source, low,
    high, symbol)`.
    """

    name: str
    value: float
    unit: str
    "SI unit; empty for a number without unit"
    source: str
    "origin of the value, such as 'assumed' or 'fitted'"
    low: float
    high: float
    symbol: str = ""


class DraftedEffect(NamedTuple):
    """A drafted effect in two forms with equal numbers: the text of a Python file for the user, and an object that a
    fit can use.
    """

    text: str
    "content of the effect's file, written for the user; the program never executes it"
    effect: AnyEffect
    "the effect as an object, which a fit can try at once"


@dataclass(frozen=True)
class EffectSource:
    """The contents of an effect's file. `text` joins them to the text of the file, and `effect` makes the effect as an
    object.

    `summary`, `law`, `origin`, `title`, `meaning` and `constants` may contain texts from data files. The values of
    `hooks` are Python code and must contain no text from data files: the code uses the name of a constant for such a
    text.

    Examples
    --------
    >>> from rover_pin.effects.effect import MotorEffect
    >>> friction = EffectSource(
    ...     "Friction", MotorEffect, "Friction of a gear.", "torque = -b omega.", "Source: assumed.", "friction",
    ...     "the gear resists", (Coefficient("b", 0.01, "N m s", "assumed", 0.0, 10.0),), {"b": 0.0},
    ...     {"torque": "return -self.b * drive.omega"},
    ... )
    >>> friction.text.splitlines()[-1].strip()
    'return -self.b * drive.omega'
    >>> friction.effect({"torque": lambda self, drive, torque, x: -self.b * drive.omega}).b
    0.01
    """

    name: str
    """name of the effect's class"""
    base: type[AnyEffect]
    "base class of the effect: Effect, MotorEffect, BodyEffect or SensorEffect"
    summary: str
    """text of the docstring at the beginning of the effect's file"""
    law: str
    """equation of the effect; it becomes the first line of the class's docstring"""
    origin: str
    """source of the equation and its difference from the paper; it becomes the rest of the class's docstring"""
    title: str
    """name of the effect in reports, in words"""
    meaning: str
    "meaning of the effect, as a clause that can follow 'because'"
    coefficients: tuple[Coefficient, ...]
    neutral: Mapping[str, float]
    """name of a coefficient -> its value at which the effect vanishes"""
    hooks: Mapping[str, str]
    """name of a hook (method of the base class) -> Python code of its body, not indented"""
    constants: Mapping[str, str] = field(default_factory=dict)
    """name -> text of a constant that the hooks' code uses, such as a channel's name"""
    states: tuple[State, ...] = ()
    helpers: tuple[Callable[..., Any], ...] = ()
    "functions of this package that the code of the hooks calls; the effect's file contains a copy of their code"

    def __post_init__(self) -> None:
        usable = self.name.isascii() and self.name.isidentifier() and not keyword.iskeyword(self.name)
        if not usable or self.name in IMPORTED_NAMES:
            raise ParameterError(
                f"'{self.name}' cannot be the name of an effect: give a class name, for example StickySoil, other than "
                "the names that an effect file imports (such as Load or Contact)."
            )

    @property
    def text(self) -> str:
        """Content of the effect's file: Python code in UTF-8, which the program itself never executes."""
        # The `def` line and the docstring of each hook are copied from the base class. The statement after the
        # docstring is the default of the base class; the code of the hook takes its place, indented below the `def`
        # line.
        members = []
        for hook, code in self.hooks.items():
            lines = inspect.getsource(getattr(self.base, hook)).splitlines(keepends=True)
            default = ast.parse(textwrap.dedent("".join(lines))).body[0].body[1]  # type: ignore[attr-defined]
            members.append("".join(lines[: default.lineno - 1]) + textwrap.indent(code, " " * 8))
        helpers = [inspect.getsource(helper).rstrip() for helper in self.helpers]
        # The imports of all names that the code of hooks and helpers uses; a name in a comment needs no import.
        code = re.sub("#.*", "", "\n".join([*members, *helpers]))
        used = {"dataclass", "ClassVar", "quantity", "Scalar", self.base.__name__, *re.findall(r"\b\w+\b", code)}
        used |= {"State"} if self.states else set()
        imports = {
            module: f"from {module} import {', '.join(name for name in names.split() if name in used)}"
            for module, names in IMPORTS.items()
            if not used.isdisjoint(names.split())
        }
        # Three blocks, as a formatter orders them: the standard library, other packages, this package.
        ours = [line for module, line in imports.items() if module.startswith("rover_pin")]
        standard = [line for line in imports.values() if line not in ours]
        others = [
            f"import {package} as {name}" for package, name in (("casadi", "ca"), ("numpy", "np")) if name in used
        ]
        blocks = ("\n".join(block) for block in (standard, others, ours) if block)
        head = HEAD.format(
            summary=python_docstring(self.summary),
            imports="\n\n".join(blocks),
            constants="".join(f"\n{name} = {_literal(value)}\n" for name, value in self.constants.items()),
            name=self.name,
            base=self.base.__name__,
            law=python_docstring(self.law),
            origin=python_docstring(self.origin),
            title=_literal(self.title),
            meaning=_literal(self.meaning),
            coefficients="\n".join(
                f"    {number.name}: Scalar = quantity({number.value!r}, {_literal(number.unit)}, "
                f"{_literal(number.source)}, {number.low!r}, {number.high!r}"
                + (f", {_literal(number.symbol)})" if number.symbol else ")")
                for number in self.coefficients
            ),
            neutral=", ".join(f"{_literal(name)}: {value!r}" for name, value in self.neutral.items()),
        )
        if self.states:
            states = "".join(f"State({_literal(state.name)}, odd={state.odd}), " for state in self.states).rstrip()
            head += f"    states: ClassVar[tuple[State, ...]] = ({states})\n"
        return "\n".join([head, "\n\n".join(members)]) + "".join(f"\n\n\n{helper}" for helper in helpers) + "\n"

    def effect(self, hooks: Mapping[str, Callable[..., Any]]) -> AnyEffect:
        """Return the effect as an object, with the numbers of the file and with `hooks` (name of a hook -> function) as
        its methods.

        The program never executes the text of the file. To try a drafted effect, `close-loop` therefore uses functions
        in place of the code in `self.hooks`; both must compute equal values.
        """
        coefficients = {number.name: quantity(*number[1:]) for number in self.coefficients}
        members = {
            "title": self.title,
            "meaning": self.meaning,
            "neutral": dict(self.neutral),
            **({"states": self.states} if self.states else {}),
            **hooks,
        }
        # The text differs if the law differs, so that it distinguishes two drafts with the same name in a cache.
        return effect_class(self.name, self.base, coefficients, members, self.text)()


def first_version(name: str, acts: str) -> EffectSource:
    """Return a small example of an effect, as a start for a user who writes an effect with a new law.

    `rover-pin new-effect` writes the text of this example to a file. The example works unchanged, so that a user can
    change one line at a time.

    Parameters
    ----------
    name : str
        Name of the effect's class, such as StickySoil.
    acts : str
        Where the effect acts: "contact" (example: soil that sticks to the rim), "motor" (example: viscous friction) or
        "body" (example: a drag).

    Raises
    ------
    ParameterError
        `name` cannot be the name of an effect's class.
    """
    # Hooks run with floats and with CasADi symbols, which a user of NumPy would not expect.
    scalars = (
        "# All inputs are scalars, floats or CasADi symbols: use functions of ca, such as ca.tanh, and none of np.\n"
    )
    examples: dict[str, tuple[type[AnyEffect], str, str, str, tuple[Coefficient, ...], tuple[str, str]]] = {
        "contact": (
            Effect, "torque = a tanh(r omega / v_0): soil that sticks to the rim", "sticky soil",
            "soil sticks to the rim",
            (
                Coefficient("a", 0.01, "N m", "assumed", 0.0, 1.0),
                Coefficient("v_0", 0.005, "m/s", "assumed", 1e-6, 1.0),
            ),
            ("load", "return Load(torque=self.a * ca.tanh(contact.rim / self.v_0))"),
        ),
        "motor": (
            MotorEffect, "torque = -b omega: friction that grows with the speed", "friction that grows with speed",
            "the gear resists in proportion to its rate",
            (Coefficient("b", 0.01, "N m s", "assumed", 0.0, 10.0),),
            ("torque", "return -self.b * drive.omega"),
        ),
        "body": (
            BodyEffect, "F = -d (v_x, v_y): a drag on the base", "drag on the base",
            "the base is held back in proportion to its speed",
            (Coefficient("d", 5.0, "N s/m", "assumed", 0.0, 1000.0),),
            ("push", "return Push(f_x=-self.d * body.v_x, f_y=-self.d * body.v_y)"),
        ),
    }  # fmt: skip
    base, law, title, meaning, coefficients, (hook, code) = examples[acts]
    return EffectSource(
        name,
        base,
        f"{name}: say in one line what the effect is.",
        f"{law}.",
        "This equation is an example: replace it by your own.\n\n"
        "    Source: assumed. Differs from the paper: the paper has no such effect.",
        title,
        meaning,
        coefficients,
        # The first coefficient scales the effect, so that the effect vanishes where it is 0.
        {coefficients[0].name: 0.0},
        {hook: scalars + code},
    )


def _literal(text: str) -> str:
    """Return a text as a Python string literal. The literal is in double quotes, unless the text itself contains
    quotes.
    """
    literal = python_string(text)
    return literal if '"' in literal or "'" in literal[1:-1] else f'"{literal[1:-1]}"'
