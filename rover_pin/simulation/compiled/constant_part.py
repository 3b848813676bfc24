"""A law in two parts: what its constants decide, worked out once, and what is left for every call."""

from typing import NamedTuple

import casadi as ca


class SplitLaw(NamedTuple):
    """One law as two functions with law(first, states, parameters) = during(varying, states, before(constants))."""

    before: ca.Function
    "(constants, parameters) -> held: every value that `during` needs of them, once each"
    during: ca.Function
    "(varying, states, held) -> the law's output"


def split_law(law: ca.Function, varying: int) -> SplitLaw:
    """Split the function (first, states, parameters) -> column by what can change from call to call.

    Both parts do the operations of the whole in its order; equal expressions are worked out once.

    Parameters
    ----------
    law : ca.Function
        A function of three columns, on CasADi's scalars (SX).
    varying : int
        How many entries of `first` vary, from the front; the others and the parameters are constants.
    """
    moving, constants = ca.SX.sym("varying", varying), ca.SX.sym("constant", law.numel_in(0) - varying)
    states, parameters = ca.SX.sym("state", law.numel_in(1)), ca.SX.sym("parameter", law.numel_in(2))
    out = ca.cse(law(ca.vertcat(moving, constants), states, parameters))
    fixed = ca.vertcat(constants, parameters)
    expression, symbols, values = ca.extract_parametric(out, fixed, {"extract_trivial": True})
    precomputed, value = (ca.vertcat(*entries) if entries else ca.SX(0, 1) for entries in (symbols, values))
    return SplitLaw(
        ca.Function(f"{law.name()}_before", [constants, parameters], [value]),
        ca.Function(f"{law.name()}_during", [moving, states, precomputed], [expression]),
    )
