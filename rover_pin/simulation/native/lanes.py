"""C code of a CasADi function that uses SIMD lanes: each operation is done for several contact patches or wheels at
once.
"""

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from rover_pin.base.errors import ParameterError
from rover_pin.base.files.paths import text_of_package

OPERATIONS = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}
"""Number of a CasADi operation -> its name, such as OP_ADD."""
UNARY = {
    "OP_NEG": "-{0}",
    "OP_SQ": "{0} * {0}",
    "OP_TWICE": "{0} + {0}",
    "OP_INV": "1.0 / {0}",
    "OP_NOT": "v_not({0})",
    "OP_SIGN": "v_sign({0})",
    "OP_FABS": "v_fabs({0})",
}
UNARY |= {
    f"OP_{name.upper()}": f"v_{name}({{0}})"
    for name in "sqrt exp expm1 log log1p sin cos tan asin acos atan sinh cosh tanh erf".split()
}
BINARY = {
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
"""UNARY and BINARY: name of a CasADi operation with one or with two arguments -> its C code, with {0} and {1} in place
of the arguments. lanes.h defines the functions v_..."""
COMMUTATIVE = ("OP_ADD", "OP_MUL")
"""Operations whose result does not change if the two arguments are exchanged. They are recognised as equal in both
orders."""


class _Value(NamedTuple):
    """An intermediate value of a function: its C code, and the indices of the other intermediate values that occur in
    this code.
    """

    code: str
    arguments: tuple[int, ...]


def header() -> str:
    """Return the C source (lanes.h) that must precede the code that `c_source` returns."""
    return text_of_package("rover_pin.simulation.native", "lanes.h")


def c_source(function: ca.Function, shared: Sequence[int] = ()) -> str:
    """Return the C source of a CasADi function, as `void name(const double *in0, ..., double *out)`, that evaluates the
    function in several SIMD lanes at once.

    LANES is the number of lanes. Each entry of an input and of the output is a group of LANES numbers, one for each
    lane; entry i begins at the index LANES i. Inputs whose numbers are listed in `shared` hold one number for each
    entry, which all lanes use. Equal values are computed once. exp(x) is computed as expm1(x) + 1 if expm1(x) occurs
    too, which it often does because CasADi differentiates expm1 into exp.

    Parameters
    ----------
    function : ca.Function
        A function of CasADi's scalars (SX) with one output.
    shared : sequence of int
        Numbers of the inputs that all lanes share.

    Raises
    ------
    ParameterError
        The function uses an operation that lanes.h does not have.
    """
    # First, all different intermediate values are numbered. `outputs` maps the index of each output entry to the number
    # of its value.
    values: list[_Value] = []
    number: dict[tuple[object, ...], int] = {}  # number of the value for an operation and its arguments
    slot: dict[int, int] = {}  # number of the value that each of CasADi's work slots holds
    outputs: dict[int, int] = {}

    def value(key: tuple[object, ...], code: str, arguments: tuple[int, ...] = ()) -> int:
        if key not in number:
            number[key] = len(values)
            values.append(_Value(code, arguments))
        return number[key]

    # Read the function's instructions in order. A value with a known operation and known arguments is not computed
    # again.
    for k in range(function.n_instructions()):
        name = OPERATIONS[function.instruction_id(k)]
        into, out = function.instruction_input(k), function.instruction_output(k)
        if name == "OP_INPUT":
            text = f"in{into[0]}[{into[1]}]"
            slot[out[0]] = value((name, *into), f"ALL({text})" if into[0] in shared else text)
        elif name == "OP_CONST":
            constant = float(function.instruction_constant(k))
            slot[out[0]] = value((name, constant), f"ALL({constant!r})")
        elif name == "OP_OUTPUT":
            outputs[out[1]] = slot[into[0]]
        elif name == "OP_ASSIGN":
            slot[out[0]] = slot[into[0]]
        else:
            template = UNARY.get(name) or BINARY.get(name)
            if template is None:
                raise ParameterError(
                    f"An effect uses CasADi's operation {name}, which the compiled step does not support: write the "
                    "effect with arithmetic, powers, comparisons and elementary functions only."
                )
            arguments = tuple(slot[i] for i in into[: 1 if name in UNARY else 2])
            key = (name, *(sorted(arguments) if name in COMMUTATIVE else arguments))
            slot[out[0]] = value(key, template.format(*(f"a{i}" for i in arguments)), arguments)
    # Replace exp(x) by expm1(x) + 1 if the function computes expm1(x) anyway.
    for key, i in number.items():
        less_one = number.get(("OP_EXPM1", *key[1:])) if key[0] == "OP_EXP" else None
        if less_one is not None:
            values[i] = _Value(f"a{less_one} + 1.0", (less_one,))
    # Only the outputs and all values that they use are computed, each value after the values that it uses. The search
    # goes depth first with an explicit stack, because the chains of a law are longer than Python's recursion limit.
    needed: dict[int, None] = {}
    stack = sorted(set(outputs.values()), reverse=True)
    while stack:
        missing = [i for i in values[stack[-1]].arguments if i not in needed]
        if missing:
            stack += missing[::-1]
        else:
            needed.setdefault(stack.pop())
    lines = [f"  const V a{i} = {values[i].code};" for i in needed]
    lines += [f"  out[{place}] = a{i};" for place, i in sorted(outputs.items())]
    # Entries of the output that are always zero do not occur among the function's instructions.
    lines += [f"  out[{place}] = ALL(0.0);" for place in range(function.numel_out(0)) if place not in outputs]
    # Inputs with one number for each lane arrive as plain doubles, and are cast to the vector type V.
    inputs = range(function.n_in())
    names = ", ".join(f"const double *restrict {'in' if k in shared else 'given'}{k}" for k in inputs)
    casts = [f"  const V *restrict in{k} = (const V *)given{k};" for k in inputs if k not in shared]
    body = "\n".join([*casts, "  V *restrict out = (V *)result;", *lines])
    return f"void {function.name()}({names}, double *restrict result) {{\n{body}\n}}\n"
