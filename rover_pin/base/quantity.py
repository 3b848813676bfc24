"""A physical quantity as a field with unit, bounds and source, and the record made of such fields."""

import dataclasses
import math
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.public import refuse_unknown
from rover_pin.base.units import UNITS, factor_to


class Quantity(NamedTuple):
    """What is known of a field besides its value."""

    unit: str
    source: str
    low: float
    high: float
    symbol: str
    log_sd: float = 0.0
    "SD of its logarithm where even its order is assumed; 0 where more is known"


def quantity(
    value: float,
    unit: str,
    source: str,
    low: float = -math.inf,
    high: float = math.inf,
    symbol: str = "",
    log_sd: float = 0.0,
) -> Any:
    """A dataclass field of a number, by default `value` [unit], in [low, high]; its `source`, `symbol` and `log_sd`."""
    return dataclasses.field(default=value, metadata={"quantity": Quantity(unit, source, low, high, symbol, log_sd)})


def is_symbolic(value: object) -> bool:
    """Return whether `value` is a CasADi symbol or expression rather than a number."""
    return isinstance(value, (ca.SX, ca.MX))


def is_number(value: object) -> bool:
    """Return whether `value` is a number or a CasADi expression: no text, no array, not True or False."""
    return is_symbolic(value) or (isinstance(value, (int, float, np.number, ca.DM)) and not isinstance(value, bool))


@dataclasses.dataclass(frozen=True)
class Record:
    """Frozen fields from `quantity(...)`, checked on creation; a field may also hold a CasADi expression.

    Raises ParameterError: a number that is not finite or lies outside its bounds, or a name that it does not have.
    """

    def __new__(cls, *values: Any, **fields: Any) -> Self:
        """Return the record, its fields' names looked at first."""
        refuse_unknown(f"{cls.__name__} has no field", fields, [field.name for field in dataclasses.fields(cls)])
        return super().__new__(cls)

    def __post_init__(self) -> None:
        for name, spec in quantities(self).items():
            check(type(self).__name__, name, getattr(self, name), spec)

    def replace(self, **changes: Any) -> Self:
        """Return the record with these fields changed; an unknown name is an error that lists the close ones."""
        return dataclasses.replace(self, **changes)

    def values(self) -> dict[str, Any]:
        """Return name -> value of the quantities, in order."""
        return {name: getattr(self, name) for name in quantities(self)}


def quantities(record: Record | type[Record]) -> dict[str, Quantity]:
    """Return name -> Quantity (value, unit, source, bounds) of a `record` or of its class, in order of definition."""
    kind: Any = record if isinstance(record, type) else type(record)
    return dict(_declared_quantities(kind))


@lru_cache(maxsize=1024)
def _declared_quantities(kind: Any) -> dict[str, Quantity]:
    return {
        field.name: field.metadata["quantity"] for field in dataclasses.fields(kind) if "quantity" in field.metadata
    }


def check(owner: str, name: str, value: Any, spec: Quantity, written: str = "") -> None:
    """Refuse a number that is not finite or is out of bounds, in the unit `written` beside it; let expressions pass."""
    if is_symbolic(value):
        return
    name = f"{owner}.{name}" if owner else name
    if not is_number(value):
        raise ParameterError(f"{name} = {value!r} is not a number; give one in {spec.unit or 'no unit'}.")
    number = as_float(value)
    if not (math.isfinite(number) and spec.low <= number <= spec.high):
        size = factor_to(written, spec.unit) if written else 1.0
        unit = f" {written or spec.unit}".rstrip()
        hint = "" if written else _meant_unit(number, spec)
        raise ParameterError(
            f"{name} = {number / size:g}{unit} is not allowed: it must lie in "
            f"[{spec.low / size:g}, {spec.high / size:g}]{unit}. {hint}Its default comes from: {spec.source}."
        )


MEANT = {"rad": "deg", "rad/m": "deg/m", "m": "mm"}
"""The unit that a number out of bounds may have been in."""


def _meant_unit(number: float, spec: Quantity) -> str:
    """Return in words the unit in which a number that is out of bounds would be allowed, or nothing."""
    unit = MEANT.get(spec.unit, "")
    return f"Did you mean {number:g} {unit}? " if unit and spec.low <= number * UNITS[unit][1] <= spec.high else ""


def as_float(value: Any) -> float:
    """Return a number as a float; a whole number beyond all floats is infinite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def to_si(value: Any, unit: Any, expected: str, where: str) -> float:
    """Return `value` in the SI unit `expected`; `unit` must be of the same kind.

    Raises ParameterError: what is not a number, an unknown unit, or one of another kind, with `where` it stands.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
        raise ParameterError(f"{where}: {value!r} is not a number; give one in {expected or 'no unit'}.")
    unit, factor = str(unit), factor_to(str(unit), expected)
    if math.isnan(factor):
        kind = [name for name, (si, _) in UNITS.items() if si == expected] or [expected or "none"]
        raise ParameterError(
            f"{where}: unit '{unit}' does not measure what is asked for; use one of {', '.join(kind)}."
        )
    return factor * as_float(value)


WRITTEN = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?:\s*([^\d\s.,].*)|\s+(\S.*))?")


def parse_quantity(value: Any, expected: str, where: str, bare: str | None = None) -> float:
    """Return the SI number of a value as one writes it: `0.005`, or `"5mm"`, `"30 deg"`, `"1.2 kPa"` with its unit.

    A number that names no unit is in `bare`, or in `expected` where that is None.

    Raises ParameterError: what is not a number, or has a unit of another kind, with `where` it stands.
    """
    default_unit = expected if bare is None else bare
    if not isinstance(value, str):
        return to_si(value, default_unit, expected, where)
    match = WRITTEN.fullmatch(value.strip().replace("\N{MINUS SIGN}", "-"))
    if match is None:
        try:
            return float(value)  # as nan and inf are written, which bounds refuse
        except ValueError:
            unit = f" [{default_unit}]" if default_unit else ""
            point = "; write decimals with a point" if "," in value else ""
            raise ParameterError(f"{where} = {value!r} is not a number{unit}{point}.") from None
    return to_si(float(match[1]), (match[2] or match[3] or default_unit).strip(), expected, where)


def written_unit(value: Any) -> str:
    """Return the unit that a text names behind its number, as `parse_quantity` reads it; empty where it names none."""
    match = WRITTEN.fullmatch(value.strip().lstrip("+-\N{MINUS SIGN}")) if isinstance(value, str) else None
    return (match[2] or match[3] or "").strip() if match else ""


ENTRY = ("value", "unit", "sd", "low", "high", "source", "note")
"""Keys of a quantity in a file; what is known of it besides value and unit is for those who ask."""


def value_and_unit(entry: Any, unit: str) -> tuple[Any, Any]:
    """Return value and unit of an entry as a file gives it: a `{ value, unit }`, or a number in `unit`."""
    return (entry.get("value"), entry.get("unit", unit)) if isinstance(entry, Mapping) else (entry, unit)


def refuse_strange(entry: Mapping[str, Any], where: str) -> None:
    """Refuse a key that no quantity in a file has: a misspelt unit would be none."""
    for key in entry:
        if key not in ENTRY:
            raise ParameterError(f"{where} has no key '{key}': {closest(key, ENTRY)}")


def declared_sd(entry: Any, unit: str, where: str) -> float | None:
    """Return the SD that a quantity's entry states, in the SI unit; None where it states none.

    Raises DataError: it is no positive number.
    Raises ParameterError: an unknown unit, or one of another kind.
    """
    if not isinstance(entry, Mapping) or "sd" not in entry:
        return None
    sd = entry["sd"]
    if isinstance(sd, bool) or not isinstance(sd, (int, float)) or not 0.0 < sd < math.inf:
        raise DataError(f"{where} is {sd!r}: give a positive number in the unit of its value, or leave it out.")
    return to_si(sd, str(entry.get("unit", unit)), unit, where)


def declared_sds(table: Mapping[str, Any], record: type[Record], where: str) -> dict[str, float]:
    """Return name -> SD (SI) of a record's quantities that a table states with one; errors as of `declared_sd`."""
    units = {name: spec.unit for name, spec in quantities(record).items() if name in table}
    sds = {name: declared_sd(table[name], unit, f"{where}: the sd of '{name}'") for name, unit in units.items()}
    return {name: sd for name, sd in sds.items() if sd is not None}


def record_from(record: type[Record], table: Mapping[str, Any], where: str) -> Any:
    """Return `record(**fields)` from a table of numbers (SI) or `{ value, unit }` entries, as read from TOML.

    Raises ParameterError: not a table, an unknown field, unit or value, with `where` it stands.
    """
    if not isinstance(table, Mapping):
        raise ParameterError(f"{where}: {table!r} is not a table; write one line a quantity, as name = 1.0.")
    specs = quantities(record)
    fields = dict(table)
    for name, entry in table.items():
        if name not in specs:
            raise ParameterError(f"{where}: {record.__name__} has no field '{name}': {closest(name, specs)}")
        if isinstance(entry, Mapping):
            refuse_strange(entry, f"{where}: '{name}'")
            if "value" not in entry:
                raise ParameterError(f"{where}: '{name}' needs a 'value': {name} = {{ value = 1.0, unit = '...' }}.")
            unit = specs[name].unit
            fields[name] = to_si(entry["value"], entry.get("unit", unit), unit, f"{where}: '{name}'")
            check(f"{where}: {record.__name__}", name, fields[name], specs[name], str(entry.get("unit", "")))
    try:
        return record(**fields)
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from error


def as_table(record: Record) -> dict[str, Any]:
    """Return a record as a table that `record_from` reads: { value, unit } by name.

    Raises ParameterError: a field that holds an expression.
    """
    return {name: _entry(record, name, spec.unit) for name, spec in quantities(record).items()}


def _entry(record: Record, name: str, unit: str) -> dict[str, Any]:
    value = getattr(record, name)
    if is_symbolic(value):
        raise ParameterError(f"{type(record).__name__}.{name} is an expression, {value}: give it a number to write it.")
    return {"value": float(value), **({"unit": unit} if unit else {})}
