"""A CasADi function as C over SIMD lanes: every operation once, for all patches or wheels together."""

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from rover_pin.base.errors import ParameterError
from rover_pin.base.files.paths import text_of_package

OPERATIONS = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}
ONE = {
    "OP_NEG": "-{0}",
    "OP_SQ": "{0} * {0}",
    "OP_TWICE": "{0} + {0}",
    "OP_INV": "1.0 / {0}",
    "OP_NOT": "v_not({0})",
    "OP_SIGN": "v_sign({0})",
    "OP_FABS": "v_fabs({0})",
}
ONE |= {
    f"OP_{name.upper()}": f"v_{name}({{0}})"
    for name in "sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh erf".split()
}
TWO = {
    "OP_ADD": "{0} + {1}",
    "OP_SUB": "{0} - {1}",
    "OP_MUL": "{0} * {1}",
    "OP_DIV": "{0} / {1}",
    "OP_POW": "v_pow({0}, {1})",
    "OP_CONSTPOW": "v_pow({0}, {1})",
    "OP_ATAN2": "v_atan2({0}, {1})",
    "OP_FMAX": "v_fmax({0}, {1})",
    "OP_FMIN": "v_fmin({0}, {1})",
    "OP_LE": "v_truth({0} <= {1})",
    "OP_LT": "v_truth({0} < {1})",
    "OP_EQ": "v_truth({0} == {1})",
    "OP_NE": "v_truth({0} != {1})",
    "OP_AND": "v_and({0}, {1})",
    "OP_OR": "v_or({0}, {1})",
    "OP_IF_ELSE_ZERO": "v_if({0}, {1})",
}
EITHER_WAY = ("OP_ADD", "OP_MUL")
"""Operations whose order of arguments is nothing."""


class _Value(NamedTuple):
    code: str
    of: tuple[int, ...]


def header() -> str:
    """Return the C source that lanes need."""
    return text_of_package("rover_pin.simulation.native", "lanes.h")


def c_source(function: ca.Function, shared: Sequence[int] = ()) -> str:
    """Return C source of `void name(const double *in0, ..., double *out)`, over lanes.

    Entry i of an input or of the output is LANES numbers from LANES i on; inputs that are `shared` are plain numbers,
    the same in all lanes. Equal values are worked out once, and exp(x) as expm1(x) + 1 where that is there: CasADi
    differentiates the second into the first.
    """
    values, outputs = _number_values(function, frozenset(shared))
    lines = [f"  const V a{i} = {values[i].code};" for i in _needed_values(values, set(outputs.values()))]
    lines += [f"  out[{place}] = a{i};" for place, i in sorted(outputs.items())]
    lines += [f"  out[{place}] = ALL(0.0);" for place in range(function.numel_out(0)) if place not in outputs]
    inputs = range(function.n_in())
    names = ", ".join(f"const double *restrict {'in' if k in shared else 'given'}{k}" for k in inputs)
    casts = [f"  const V *restrict in{k} = (const V *)given{k};" for k in inputs if k not in shared]
    body = "\n".join([*casts, "  V *restrict out = (V *)result;", *lines])
    return f"void {function.name()}({names}, double *restrict result) {{\n{body}\n}}\n"


def _number_values(function: ca.Function, shared: frozenset[int]) -> tuple[list[_Value], dict[int, int]]:
    """Return all values, each once, and which of them each place of the output is."""
    values: list[_Value] = []
    number: dict[tuple[object, ...], int] = {}
    slot: dict[int, int] = {}
    outputs: dict[int, int] = {}

    def value(key: tuple[object, ...], code: str, of: tuple[int, ...] = ()) -> int:
        if key not in number:
            number[key] = len(values)
            values.append(_Value(code, of))
        return number[key]

    for k in range(function.n_instructions()):
        name = OPERATIONS[function.instruction_id(k)]
        into, out = function.instruction_input(k), function.instruction_output(k)
        if name == "OP_INPUT":
            slot[out[0]] = value((name, *into), _input(into[0], into[1], shared))
        elif name == "OP_CONST":
            constant = float(function.instruction_constant(k))
            slot[out[0]] = value((name, constant), f"ALL({constant!r})")
        elif name == "OP_OUTPUT":
            outputs[out[1]] = slot[into[0]]
        elif name == "OP_ASSIGN":
            slot[out[0]] = slot[into[0]]
        else:
            of = tuple(slot[i] for i in into[: 1 if name in ONE else 2])
            key = (name, *(sorted(of) if name in EITHER_WAY else of))
            slot[out[0]] = value(key, _code(name, of), of)
    return _with_shared_exponentials(values, number), outputs


def _input(argument: int, entry: int, shared: frozenset[int]) -> str:
    text = f"in{argument}[{entry}]"
    return f"ALL({text})" if argument in shared else text


def _code(name: str, of: tuple[int, ...]) -> str:
    template = ONE.get(name) or TWO.get(name)
    if template is None:
        raise ParameterError(
            f"The compiled step does not know CasADi's operation {name}, which an effect uses: write the effect with "
            "arithmetic, powers, comparisons and elementary functions."
        )
    return template.format(*(f"a{i}" for i in of))


def _with_shared_exponentials(values: list[_Value], number: dict[tuple[object, ...], int]) -> list[_Value]:
    for key, i in number.items():
        less_one = number.get(("OP_EXPM1", *key[1:])) if key[0] == "OP_EXP" else None
        if less_one is not None:
            values[i] = _Value(f"a{less_one} + 1.0", (less_one,))
    return values


def _needed_values(values: list[_Value], wanted: set[int]) -> list[int]:
    """Return the values that the wanted ones need, each after what it needs."""
    done: dict[int, None] = {}
    stack = sorted(wanted, reverse=True)
    while stack:
        missing = [i for i in values[stack[-1]].of if i not in done]
        if missing:
            stack += missing[::-1]
        else:
            done.setdefault(stack.pop())
    return list(done)
