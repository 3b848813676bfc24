"""Formulas that a user writes to compute a column from other columns: column names, numbers, + - * / ** and functions.

A formula is parsed into a syntax tree, and only column names, numbers, these operators and the functions of this module
are evaluated. Therefore a formula cannot run other code.
"""

import ast
import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, closest

MAX_FORMULA = 1000
"""Maximum number of characters of a formula. A longer text is refused, because parsing it could exhaust the memory."""
EARTH_A, EARTH_E2 = 6378137.0, 6.69437999014e-3
"""Semi-major axis [m] and squared eccentricity of the WGS 84 ellipsoid, which describes the shape of the earth."""

Array = np.ndarray


def roll(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Return the roll angle [rad] (rows,) of quaternions of any norm: vector part x, y, z and scalar part w.

    The order of rotations is yaw, pitch, roll. The roll is NaN where all four numbers are zero.
    """
    return np.asarray(np.arctan2(2 * (w * x + y * z), _square(x, y, z, w) - 2 * (x * x + y * y)))


def pitch(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Return the pitch angle [rad] (rows,) of quaternions of any norm: vector part x, y, z and scalar part w.

    The order of rotations is yaw, pitch, roll, and the pitch is positive with the nose down. It is NaN where all four
    numbers are zero.
    """
    return np.asarray(np.arcsin(np.clip(2 * (w * y - z * x) / _square(x, y, z, w), -1, 1)))


def yaw(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Return the yaw angle [rad] (rows,) of quaternions of any norm: vector part x, y, z and scalar part w.

    The angle has no jumps of a full turn from row to row. It is NaN where all four numbers are zero.
    """
    return unwrap_angle(np.arctan2(2 * (w * z + x * y), _square(x, y, z, w) - 2 * (y * y + z * z)))


def _square(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Return the squared norm (rows,) of quaternions, or NaN where all four numbers are zero.

    A sensor that knows no attitude reports four zeros.
    """
    square = w * w + x * x + y * y + z * z
    return np.where(square > 0, square, np.nan)


def unwrap_angle(angle: Array) -> Array:
    """Return an angle [rad] (rows,) without jumps of full turns from row to row. Missing values (NaN) stay missing."""
    angle = np.array(angle, dtype=float)
    finite = np.isfinite(angle)
    angle[finite] = np.unwrap(angle[finite])
    return angle


def north(lat: Array, lon: Array) -> Array:
    """Return the distance north of the first position [m] (rows,) from latitudes and longitudes [deg].

    The distance is M (lat - lat_0), where lat_0 is the latitude of the first row with a position. M is the radius of
    the meridian there, a (1 - e^2) / (1 - e^2 sin^2 lat_0)^1.5, with a and e of the WGS 84 ellipsoid. The longitudes
    are not used; `north` takes them so that it is called like `east`.
    """
    first = np.radians(_first(lat))
    radius = EARTH_A * (1 - EARTH_E2) / (1 - EARTH_E2 * np.sin(first) ** 2) ** 1.5
    return np.asarray(radius * (np.radians(lat) - first))


def east(lat: Array, lon: Array) -> Array:
    """Return the distance east of the first position [m] (rows,) from latitudes and longitudes [deg].

    The distance is N cos(lat_0) (lon - lon_0), where lat_0 and lon_0 are the first latitude and longitude. N is the
    radius a / sqrt(1 - e^2 sin^2 lat_0), with a and e of the WGS 84 ellipsoid.
    """
    first = np.radians(_first(lat))
    radius = EARTH_A / np.sqrt(1 - EARTH_E2 * np.sin(first) ** 2)
    return np.asarray(radius * np.cos(first) * (np.radians(lon) - np.radians(_first(lon))))


def course(x: Array, y: Array, t: Array) -> Array:
    """Return the direction of travel [rad] (rows,): the direction of the path from 0.5 s before to 0.5 s after each
    row.

    x and y are positions [m] and t are times [s], all arrays (rows,). Where the rover hardly moves, the direction is
    interpolated between the rows of clear motion.
    """
    return heading(x, y, t, np.ones(len(t)))


def heading(x: Array, y: Array, t: Array, v: Array) -> Array:
    """Return the heading [rad] (rows,) of a rover from its path, if it drives forwards where v >= 0 and backwards where
    v < 0.

    x and y are positions [m], t are times [s] and v are speeds [m/s], all arrays (rows,).
    """
    # Two positions are the minimum for a direction.
    finite = np.isfinite(x + y)
    if finite.sum() < 2:
        return np.full(len(t), np.nan)
    # A rover that drives backwards looks against its motion, so the sign of the change is reversed.
    dx, dy = (np.where(v < 0, -1.0, 1.0) * change(coordinate, t, finite) for coordinate in (x, y))
    distance = np.hypot(dx, dy)
    # While a rover stands still, noise alone decides the direction, so rows with a short distance are not used.
    use = distance > 0.3 * np.median(distance[distance > 0]) if np.any(distance > 0) else distance > 0
    if not use.any():
        return np.zeros(len(t))
    return np.asarray(np.interp(t, t[use], np.unwrap(np.arctan2(dy, dx)[use])))


def change(value: Array, t: Array, finite: Array) -> Array:
    """Return the change of a value (rows,) from 0.5 s before to 0.5 s after each row; t are the times of the rows [s].

    Only rows where `finite` is True are used; between them the value is interpolated linearly.
    """
    ahead, before = (np.interp(at, t[finite], value[finite]) for at in (t + 0.5, t - 0.5))
    return np.asarray(ahead - before)


def rate(value: Array, t: Array) -> Array:
    """Return the time derivative of a value (rows,) by central differences, for example the speed from an encoder
    count.

    t are the times of the rows [s].
    """
    return np.asarray(np.gradient(value, t)) if len(t) > 1 else np.zeros(len(t))


def integral(value: Array, t: Array) -> Array:
    """Return the integral of a value over time from the first row on (trapezoidal rule), for example the angle from a
    gyro rate.

    t are the times of the rows [s]. Missing values (NaN) are interpolated linearly.
    """
    finite = np.isfinite(value)
    # One missing value would otherwise make all later values of the sum NaN.
    gapless = np.interp(t, t[finite], value[finite]) if finite.any() else np.full(len(t), np.nan)
    return np.concatenate([[0.0], np.cumsum(0.5 * (gapless[1:] + gapless[:-1]) * np.diff(t))])[: len(t)]


def _first(values: Array) -> float:
    """Return the first finite value of a column, or NaN if no value is finite.

    The functions `north` and `east` take this value as the origin of their positions.
    """
    finite = np.asarray(values)[np.isfinite(values)]
    return float(finite[0]) if finite.size else float("nan")


FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    "sin": (np.sin, 1), "cos": (np.cos, 1), "tan": (np.tan, 1), "asin": (np.arcsin, 1), "acos": (np.arccos, 1),
    "atan": (np.arctan, 1), "atan2": (np.arctan2, 2), "sqrt": (np.sqrt, 1), "abs": (np.abs, 1), "hypot": (np.hypot, 2),
    "sign": (np.sign, 1), "radians": (np.radians, 1), "degrees": (np.degrees, 1), "unwrapped": (unwrap_angle, 1),
    "roll": (roll, 4), "pitch": (pitch, 4), "yaw": (yaw, 4), "north": (north, 2), "east": (east, 2),
    "course": (course, 3), "heading": (heading, 4), "rate": (rate, 2), "integral": (integral, 2),
}  # fmt: skip
"""Name of a function that a formula may call -> the function and its number of arguments."""
CONSTANTS = {"pi": np.pi}
"""Name of a constant that a formula may use -> its value."""
OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}  # fmt: skip
"""Node of an operator with two operands in the syntax tree -> the function that calculates it."""
COLUMN = "col"
"""Name of the pseudo-function `col`. In a formula, `col("any name")` means a column whose name is not an identifier."""


def evaluate(text: str, columns: Mapping[str, Array], where: str) -> Array:
    """Return the value of a formula for each row of a table, an array (rows,).

    `columns` maps column names to arrays (rows,), and `where` is the beginning of an error message.

    Raises DataError: the text is not a formula, names an unknown column or function, or holds anything but arithmetic.

    Examples
    --------
    >>> evaluate("2 * a + 1", {"a": np.array([0.0, 1.0])}, "--column").tolist()
    [1.0, 3.0]
    """
    # A constant formula, such as `2 * pi`, is repeated for every row.
    tree, length = _parse_formula(text, where), len(next(iter(columns.values())))
    with np.errstate(all="ignore"):
        try:
            result = np.asarray(_value(tree, columns, where), dtype=float)
            return np.array(np.broadcast_to(result, (length,)))
        except (OverflowError, RecursionError, ZeroDivisionError) as error:
            raise DataError(f"{where}: {text!r} has no value ({error}); check the numbers in the formula.") from None


def names_in(text: str, where: str) -> tuple[str, ...]:
    """Return the names of the columns that a formula uses, in order of appearance and without repetition.

    Raises DataError: the text is not a formula. `where` is the beginning of the message.
    """
    return tuple(dict.fromkeys(_names(_parse_formula(text, where))))


def quote(name: str) -> str:
    """Return the text that a formula contains to refer to the column `name`.

    A name that is an identifier is returned unchanged; any other name, such as "speed [rpm]", is written `col("...")`.
    """
    plain = name.isidentifier() and name not in FUNCTIONS and name not in CONSTANTS and name != COLUMN
    return name if plain else f'{COLUMN}("{name}")' if '"' not in name else f"{COLUMN}({name!r})"


def _parse_formula(text: str, where: str) -> ast.expr:
    """Return the syntax tree of a formula.

    Raises DataError: the text is longer than MAX_FORMULA, or is not a formula. `where` is the beginning of the message.
    """
    if len(text) > MAX_FORMULA:
        raise DataError(f"{where}: the formula has {len(text)} characters, but at most {MAX_FORMULA} are allowed.")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise DataError(
            f"{where}: {text!r} is not a formula; write a formula such as 0.5 * (a + b), raw * 0.01 - 3 or "
            f'{COLUMN}("any name [rpm]") / 9.55.'
        ) from None


def _names(node: ast.expr) -> Iterator[str]:
    """Yield the names of the columns in a syntax tree, in order of appearance."""
    if isinstance(node, ast.Call) and _is_column(node):
        yield str(node.args[0].value)  # type: ignore[attr-defined]
    elif isinstance(node, ast.Name):
        yield from () if node.id in CONSTANTS else (node.id,)
    else:
        # The name of a called function is no column, so only the arguments of a call are searched.
        inner = node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node)
        for child in inner:
            if isinstance(child, ast.expr):
                yield from _names(child)


def _is_column(node: ast.Call) -> bool:
    """Return whether a function call in a formula is `col("name")`, which means the column with this name."""
    text = len(node.args) == 1 and isinstance(node.args[0], ast.Constant) and isinstance(node.args[0].value, str)
    return text and isinstance(node.func, ast.Name) and node.func.id == COLUMN and not node.keywords


def _value(node: ast.expr, columns: Mapping[str, Array], where: str) -> Any:
    """Return the value of a formula's syntax tree: a number, or an array (rows,).

    `columns` maps column names to arrays (rows,), and `where` is the beginning of an error message.

    Raises DataError: the tree holds something else than numbers, columns, arithmetic and calls of known functions, a
    column or function is unknown, or a function has a wrong number of arguments.
    """
    # Only plain numbers are allowed: True and texts are constants of Python as well.
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return CONSTANTS[node.id] if node.id in CONSTANTS else _column(node.id, columns, where)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        # NumPy returns inf or NaN where Python's own arithmetic would raise an error, for example for 1 / 0.
        return OPERATORS[type(node.op)](
            *(np.asarray(_value(operand, columns, where)) for operand in (node.left, node.right))
        )
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.UAdd, ast.USub)):
        value = _value(node.operand, columns, where)
        return -value if isinstance(node.op, ast.USub) else value
    # Only a function that is called by its name is allowed, so that no attribute of an object can be reached.
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if _is_column(node):
            return _column(str(node.args[0].value), columns, where)  # type: ignore[attr-defined]
        name = node.func.id
        if name not in FUNCTIONS:
            raise DataError(f"{where}: there is no function '{name}' in a formula: {closest(name, FUNCTIONS)}")
        function, count = FUNCTIONS[name]
        if len(node.args) != count or node.keywords:
            raise DataError(
                f"{where}: {name} takes {count} argument{'s' * (count > 1)}, as in {name}({', '.join('abcd'[:count])})."
            )
        length = len(next(iter(columns.values())))
        # Each argument gets one value for each row, so that a function may be given plain numbers too.
        arguments = [np.asarray(_value(argument, columns, where), dtype=float) for argument in node.args]
        return function(*(np.broadcast_to(argument, (length,)) for argument in arguments))
    raise DataError(
        f"{where}: {ast.unparse(node)!r} is not allowed in a formula; use columns, numbers, + - * / ** and "
        f"{', '.join(FUNCTIONS)}."
    )


def _column(name: str, columns: Mapping[str, Array], where: str) -> Array:
    """Return the values (rows,) of the column with this name.

    Raises DataError: no column has this name; the message lists similar names.
    """
    if name not in columns:
        raise DataError(f"{where}: there is no column '{name}': {closest(name, columns)}")
    return columns[name]
