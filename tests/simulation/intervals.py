"""Interval arithmetic for CasADi functions: bounds of the values that a function can have in many boxes of
its inputs."""

from typing import NamedTuple

import casadi as ca
import numpy as np

OPERATIONS = {getattr(ca, name): name.removeprefix("OP_") for name in dir(ca) if name.startswith("OP_")}
RISING = {"EXP": np.exp, "EXPM1": np.expm1, "TANH": np.tanh, "ATAN": np.arctan, "SQRT": np.sqrt, "LOG": np.log,
          "LOG1P": np.log1p, "ASIN": np.arcsin, "SINH": np.sinh}  # fmt: skip
DOMAIN = {"SQRT": (0.0, np.inf), "LOG": (np.finfo(float).tiny, np.inf), "ASIN": (-1.0, 1.0), "ACOS": (-1.0, 1.0)}
"""Where an operation has a value: an argument that may lie elsewhere is a fault."""


LARGEST = np.finfo(float).max
"""A bound beyond it is held here: what overflows is for another test."""


class Fault(NamedTuple):
    """An operation whose argument may lie where the operation is undefined, and the interval of this argument (2,
    boxes).
    """

    operation: str
    argument: np.ndarray


def outward(low, high):
    """Return an interval that is wider by two units in the last place, to include round-off and errors of elementary
    functions.
    """
    low, high = (np.nextafter(np.nextafter(end, way), way) for end, way in ((low, -np.inf), (high, np.inf)))
    return np.array([low, high])


def hull(*values):
    """Return the interval that contains all corners. The product of 0 and infinity counts as 0, because infinity is
    only a bound here.
    """
    corners = np.nan_to_num(np.array(values), nan=0.0, posinf=np.inf, neginf=-np.inf)
    return outward(corners.min(axis=0), corners.max(axis=0))


def _times(a, b):
    return hull(*(x * y for x in a for y in b))


def _square(a):
    low, high = hull(a[0] ** 2, a[1] ** 2)
    return np.array([np.where((a[0] <= 0.0) & (a[1] >= 0.0), 0.0, np.maximum(low, 0.0)), high])


def _inverse(a):
    low, high = hull(1.0 / a[1], 1.0 / a[0])
    holds = (a[0] <= 0.0) & (a[1] >= 0.0)
    return np.where(holds, [[-np.inf], [np.inf]], [low, high])


def _power(a, b):
    """Return the interval of a^b = exp(b log a) for a >= 0. If b is a whole constant, a may have any sign."""
    if (b[0] == b[1]).all() and float(b[0][0]).is_integer() and b[0][0] >= 0.0:
        product_so_far = np.ones_like(a)
        for _ in range(int(b[0][0]) // 2):
            product_so_far = _times(product_so_far, _square(a))
        return _times(product_so_far, a) if b[0][0] % 2 else np.maximum(product_so_far, 0.0)
    return np.maximum(hull(*(np.maximum(x, 0.0) ** y for x in a for y in b)), 0.0)


def _wave(a, shift):
    """Return cos(a - shift)."""
    a = a - shift
    low, high = hull(np.cos(a[0]), np.cos(a[1]))
    top = np.floor(a[1] / (2 * np.pi)) >= np.ceil(a[0] / (2 * np.pi) - 1e-15)
    bottom = np.floor(a[1] / (2 * np.pi) - 0.5) >= np.ceil(a[0] / (2 * np.pi) - 0.5 - 1e-15)
    return np.array([np.where(bottom, -1.0, low), np.where(top, 1.0, high)])


def _truth(sure, never):
    return np.array([sure, ~never], dtype=float)


def _of_one(name, a):
    if name in RISING:
        return outward(*RISING[name](a))
    match name:
        case "NEG":
            return -a[::-1]
        case "SQ":
            return _square(a)
        case "TWICE":
            return 2.0 * a
        case "INV":
            return _inverse(a)
        case "NOT":
            return _truth((a[0] == 0.0) & (a[1] == 0.0), (a[0] > 0.0) | (a[1] < 0.0))
        case "SIGN":
            return np.sign(a)
        case "FABS":
            inside = (a[0] < 0.0) & (a[1] > 0.0)
            return np.array([np.where(inside, 0.0, np.abs(a).min(axis=0)), np.abs(a).max(axis=0)])
        case "COS":
            return _wave(a, 0.0)
        case "SIN":
            return _wave(a, np.pi / 2)
        case "TAN":
            poles = np.floor(a[1] / np.pi - 0.5) >= np.ceil(a[0] / np.pi - 0.5 - 1e-15)
            return np.where(poles, [[-np.inf], [np.inf]], outward(*np.tan(a)))
        case "ACOS":
            return outward(*np.arccos(a)[::-1])
        case "COSH":
            return _square(a) * 0.0 + outward(1.0, np.cosh(np.abs(a).max(axis=0)))
    raise NotImplementedError(name)


def _of_two(name, a, b):
    match name:
        case "ADD":
            return outward(*(a + b))
        case "SUB":
            return outward(*(a - b[::-1]))
        case "MUL":
            return _times(a, b)
        case "DIV":
            return _times(a, _inverse(b))
        case "POW" | "CONSTPOW":
            return _power(a, b)
        case "ATAN2":
            return np.array([0.0 * a[0] - np.pi, 0.0 * a[0] + np.pi])
        case "FMAX":
            return np.maximum(a, b)
        case "FMIN":
            return np.minimum(a, b)
        case "LE":
            return _truth(a[1] <= b[0], a[0] > b[1])
        case "LT":
            return _truth(a[1] < b[0], a[0] >= b[1])
        case "EQ":
            return _truth((a[0] == a[1]) & (b[0] == b[1]) & (a[0] == b[0]), (a[1] < b[0]) | (b[1] < a[0]))
        case "NE":
            return 1.0 - _of_two("EQ", a, b)[::-1]
        case "AND":
            return np.minimum(_held(a), _held(b))
        case "OR":
            return np.maximum(_held(a), _held(b))
        case "IF_ELSE_ZERO":
            sure, never = _held(a)[0] > 0.0, _held(a)[1] == 0.0
            open_ = np.array([np.minimum(b[0], 0.0), np.maximum(b[1], 0.0)])
            return np.where(sure, b, np.where(never, 0.0, open_))
    raise NotImplementedError(name)


def _held(a):
    """Return whether a number differs from 0, as an interval."""
    return 1.0 - _of_one("NOT", a)[::-1]


@np.errstate(all="ignore")
def evaluate(function, boxes):
    """Return the interval of a function's outputs (2, outputs, n) for boxes of its inputs (2, inputs, n), and all
    faults.
    """
    starts = np.cumsum([0, *(function.numel_in(i) for i in range(function.n_in()))])
    work, orders, faults, out = {}, {}, [], {}
    for k in range(function.n_instructions()):
        name = OPERATIONS[function.instruction_id(k)]
        into, target = function.instruction_input(k), function.instruction_output(k)
        of = [work.get(i) for i in into]
        if name == "INPUT":
            result = boxes[:, starts[into[0]] + into[1]]
        elif name == "CONST":
            result = np.full((2, boxes.shape[2]), function.instruction_constant(k))
        elif name in ("OUTPUT", "ASSIGN"):
            result = of[0]
        else:
            result = _of_one(name, *of) if len(of) == 1 else _of_two(name, *of)
            wrong = _undefined(name, of)
            if wrong.any():
                faults.append(Fault(name, of[-1 if name == "DIV" else 0][:, wrong]))
        order = into if name == "LE" else None
        if name == "ADD" and None not in (pair := [orders[i] for i in into]) and pair[0] == pair[1][::-1]:
            result = np.maximum(result, 1.0)  # a <= b or b <= a: how CasADi differentiates fmax
        clipped = np.clip(np.nan_to_num(result), -LARGEST, LARGEST)
        if name == "OUTPUT":
            out[target[1]] = clipped
        else:
            work[target[0]], orders[target[0]] = clipped, order
    return np.stack([out[place] for place in sorted(out)], axis=1), faults


def _undefined(name, of):
    """Return a mask of the boxes in which an operation may be undefined: x / 0, log 0, a pole, or the root of a
    negative number.
    """
    low, high = DOMAIN.get(name, (-np.inf, np.inf))
    wrong = (of[0][0] < low) | (of[0][1] > high)
    if name in ("DIV", "INV"):
        wrong |= (of[-1][0] <= 0.0) & (of[-1][1] >= 0.0)
    if name == "TAN":
        wrong |= ~np.isfinite(_of_one(name, of[0])).all(axis=0)
    if name in ("POW", "CONSTPOW"):
        full = (of[1][0] == of[1][1]) & (of[1][0] == np.round(of[1][0]))
        wrong |= np.where(full, (of[1][0] < 0.0) & (of[0][0] <= 0.0) & (of[0][1] >= 0.0), of[0][0] < 0.0)
        wrong |= (of[1][0] < 0.0) & (of[0][0] <= 0.0)
    return wrong
