"""Arithmetic on columns as a user writes it, safely: names, numbers, + - * / **, and the functions below; no more.

The text is parsed into a tree of which only these kinds of nodes are walked, so that no formula runs code.
"""

import ast
import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, closest

LONGEST = 1000
"""Characters of a formula."""
EARTH_A, EARTH_E2 = 6378137.0, 6.69437999014e-3
"""Semi-major axis [m] and squared eccentricity of WGS 84."""

Array = np.ndarray


def roll(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Return the roll [rad] of a quaternion (world z-y-x)."""
    return np.asarray(np.arctan2(2 * (w * x + y * z), _square(x, y, z, w) - 2 * (x * x + y * y)))


def pitch(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Return the pitch [rad] of a quaternion (world z-y-x), nose down positive."""
    return np.asarray(np.arcsin(np.clip(2 * (w * y - z * x) / _square(x, y, z, w), -1, 1)))


def yaw(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Return the yaw [rad] of a quaternion (world z-y-x), unwrapped."""
    return unwrap_angle(np.arctan2(2 * (w * z + x * y), _square(x, y, z, w) - 2 * (y * y + z * z)))


def _square(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Return the squared length of a quaternion, NaN of one that is lost: all zeros are no attitude."""
    square = w * w + x * x + y * y + z * z
    return np.where(square > 0, square, np.nan)


def unwrap_angle(angle: Array) -> Array:
    """Return an angle [rad] without jumps of whole turns, gaps left as they are."""
    angle = np.array(angle, dtype=float)
    finite = np.isfinite(angle)
    angle[finite] = np.unwrap(angle[finite])
    return angle


def north(lat: Array, lon: Array) -> Array:
    """Return how far north of the first place [m] geographic places [deg] lie, on the tangent plane there.

    M (lat - lat_0) with the meridian's radius M = a (1 - e^2) / (1 - e^2 sin^2 lat_0)^1.5; 1 mm off within 300 m.
    """
    first = np.radians(_first(lat))
    radius = EARTH_A * (1 - EARTH_E2) / (1 - EARTH_E2 * np.sin(first) ** 2) ** 1.5
    return np.asarray(radius * (np.radians(lat) - first))


def east(lat: Array, lon: Array) -> Array:
    """Return how far east of the first place [m] geographic places [deg] lie: N cos(lat_0) (lon - lon_0)."""
    first = np.radians(_first(lat))
    radius = EARTH_A / np.sqrt(1 - EARTH_E2 * np.sin(first) ** 2)
    return np.asarray(radius * np.cos(first) * (np.radians(lon) - np.radians(_first(lon))))


def course(x: Array, y: Array, t: Array) -> Array:
    """Return the direction of travel [rad] over the second around each row, held where it is too slow to tell."""
    return heading(x, y, t, np.ones(len(t)))


def heading(x: Array, y: Array, t: Array, v: Array) -> Array:
    """Return the course [rad] of a rover that drives ahead where v > 0 and backwards where v < 0."""
    finite = np.isfinite(x + y)
    if finite.sum() < 2:
        return np.full(len(t), np.nan)
    dx, dy = (np.where(v < 0, -1.0, 1.0) * change(coordinate, t, finite) for coordinate in (x, y))
    way = np.hypot(dx, dy)
    use = way > 0.3 * np.median(way[way > 0]) if np.any(way > 0) else way > 0
    if not use.any():
        return np.zeros(len(t))
    return np.asarray(np.interp(t, t[use], np.unwrap(np.arctan2(dy, dx)[use])))


def change(value: Array, t: Array, finite: Array) -> Array:
    """Return by how much a value changes over the second around each row, straight between its `finite` rows."""
    ahead, before = (np.interp(at, t[finite], value[finite]) for at in (t + 0.5, t - 0.5))
    return np.asarray(ahead - before)


def rate(value: Array, t: Array) -> Array:
    """Return d(value)/dt by central differences, of an encoder's count as an example."""
    return np.asarray(np.gradient(value, t)) if len(t) > 1 else np.zeros(len(t))


def integral(value: Array, t: Array) -> Array:
    """Return the integral of value dt from the first row by trapezoids, a gyroscope's heading as an example."""
    finite = np.isfinite(value)
    gapless = np.interp(t, t[finite], value[finite]) if finite.any() else np.full(len(t), np.nan)
    return np.concatenate([[0.0], np.cumsum(0.5 * (gapless[1:] + gapless[:-1]) * np.diff(t))])[: len(t)]


def _first(values: Array) -> float:
    finite = np.asarray(values)[np.isfinite(values)]
    return float(finite[0]) if finite.size else float("nan")


FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    "sin": (np.sin, 1), "cos": (np.cos, 1), "tan": (np.tan, 1), "asin": (np.arcsin, 1), "acos": (np.arccos, 1),
    "atan": (np.arctan, 1), "atan2": (np.arctan2, 2), "sqrt": (np.sqrt, 1), "abs": (np.abs, 1), "hypot": (np.hypot, 2),
    "sign": (np.sign, 1), "radians": (np.radians, 1), "degrees": (np.degrees, 1), "unwrapped": (unwrap_angle, 1),
    "roll": (roll, 4), "pitch": (pitch, 4), "yaw": (yaw, 4), "north": (north, 2), "east": (east, 2),
    "course": (course, 3), "heading": (heading, 4), "rate": (rate, 2), "integral": (integral, 2),
}  # fmt: skip
"""What a formula may call, and with how many numbers."""
CONSTANTS = {"pi": np.pi}
OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}  # fmt: skip
COLUMN = "col"
"""col("any name") is the column of a name that is no word of a formula."""


def evaluate(text: str, columns: Mapping[str, Array], where: str) -> Array:
    """Return what a formula makes of columns, one number a row.

    Raises DataError: it is no formula, names an unknown column or function, or holds anything but arithmetic.
    """
    tree, length = _parse_formula(text, where), len(next(iter(columns.values())))
    with np.errstate(all="ignore"):
        try:
            result = np.asarray(_value(tree, columns, where), dtype=float)
            return np.array(np.broadcast_to(result, (length,)))
        except (OverflowError, RecursionError, ZeroDivisionError) as error:
            raise DataError(f"{where}: {text!r} has no value ({error}); look at its numbers.") from None


def names_in(text: str, where: str) -> tuple[str, ...]:
    """Return the columns that a formula names, in order."""
    return tuple(dict.fromkeys(_names(_parse_formula(text, where))))


def quote(name: str) -> str:
    """Return a column's name as a formula has it."""
    plain = name.isidentifier() and name not in FUNCTIONS and name not in CONSTANTS and name != COLUMN
    return name if plain else f'{COLUMN}("{name}")' if '"' not in name else f"{COLUMN}({name!r})"


def _parse_formula(text: str, where: str) -> ast.expr:
    if len(text) > LONGEST:
        raise DataError(f"{where}: a formula of {len(text)} characters; {LONGEST} are the most that are read.")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise DataError(
            f"{where}: {text!r} is no formula; write one as in 0.5 * (a + b), raw * 0.01 - 3 or "
            f'{COLUMN}("any name [rpm]") / 9.55.'
        ) from None


def _names(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Call) and _is_column(node):
        yield str(node.args[0].value)  # type: ignore[attr-defined]
    elif isinstance(node, ast.Name):
        yield from () if node.id in CONSTANTS else (node.id,)
    else:
        inner = node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node)
        for child in inner:
            if isinstance(child, ast.expr):
                yield from _names(child)


def _is_column(node: ast.Call) -> bool:
    text = len(node.args) == 1 and isinstance(node.args[0], ast.Constant) and isinstance(node.args[0].value, str)
    return text and isinstance(node.func, ast.Name) and node.func.id == COLUMN and not node.keywords


def _value(node: ast.expr, columns: Mapping[str, Array], where: str) -> Any:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return CONSTANTS[node.id] if node.id in CONSTANTS else _column(node.id, columns, where)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        return OPERATORS[type(node.op)](
            *(np.asarray(_value(operand, columns, where)) for operand in (node.left, node.right))
        )
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.UAdd, ast.USub)):
        value = _value(node.operand, columns, where)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return _evaluate_call(node, node.func.id, columns, where)
    raise DataError(
        f"{where}: {ast.unparse(node)!r} is not allowed in a formula; use columns, numbers, + - * / ** and "
        f"{', '.join(FUNCTIONS)}."
    )


def _column(name: str, columns: Mapping[str, Array], where: str) -> Array:
    if name not in columns:
        raise DataError(f"{where}: there is no column '{name}': {closest(name, columns)}")
    return columns[name]


def _evaluate_call(node: ast.Call, name: str, columns: Mapping[str, Array], where: str) -> Any:
    if _is_column(node):
        return _column(str(node.args[0].value), columns, where)  # type: ignore[attr-defined]
    if name not in FUNCTIONS:
        raise DataError(f"{where}: there is no function '{name}' in a formula: {closest(name, FUNCTIONS)}")
    function, count = FUNCTIONS[name]
    if len(node.args) != count or node.keywords:
        raise DataError(f"{where}: {name} takes {count} number{'s' * (count > 1)}, as in {name}({'abcd'[:count]}).")
    length = len(next(iter(columns.values())))
    arguments = [np.asarray(_value(argument, columns, where), dtype=float) for argument in node.args]
    return function(*(np.broadcast_to(argument, (length,)) for argument in arguments))
