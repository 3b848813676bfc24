"""Physical quantities as fields of a record: each has a value, a unit, bounds, and the source of its default value."""

import dataclasses
import math
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import casadi as ca
import numpy as np

from rover_pin.base.errors import DataError, ParameterError, UnknownAttributeError, closest
from rover_pin.base.public import refuse_unknown
from rover_pin.base.units import UNITS, factor_to


class Quantity(NamedTuple):
    """Describes a number that is a field of a `Record`: unit, source of the default, bounds and symbol.

    The value itself is in the record.
    """

    unit: str
    source: str
    low: float
    high: float
    symbol: str
    log_sd: float = 0.0
    """standard deviation of the natural logarithm of the number if only its order of magnitude is known, else 0"""


def quantity(
    value: float,
    unit: str,
    source: str,
    low: float = -math.inf,
    high: float = math.inf,
    symbol: str = "",
    log_sd: float = 0.0,
) -> Any:
    """Return a dataclass field for a number that has a unit, bounds and a source.

    Parameters
    ----------
    value : float
        Default value, in `unit`.
    unit : str
        SI unit; empty for a number without a unit.
    source : str
        Where the default value comes from; "assumed" if no source is published.
    low, high : float
        Bounds, in `unit`. A value outside the bounds is refused.
    symbol : str
        Symbol of the number in the equations.
    log_sd : float
        Standard deviation of the natural logarithm of the number if only its order of magnitude is known, else 0.

    Examples
    --------
    >>> from rover_pin.base.quantity import Record, quantity
    >>> @dataclasses.dataclass(frozen=True)
    ... class Spring(Record):
    ...     stiffness: float = quantity(50.0, "N/m", "assumed", 0.0, 1e6, "k_s")
    >>> Spring(stiffness="2 N/mm").stiffness
    2000.0
    """
    return dataclasses.field(default=value, metadata={"quantity": Quantity(unit, source, low, high, symbol, log_sd)})


def is_symbolic(value: object) -> bool:
    """Return whether `value` is a CasADi symbol or expression rather than a number."""
    return isinstance(value, (ca.SX, ca.MX))


def is_number(value: object) -> bool:
    """Return whether `value` is a number or a CasADi expression. True, False, texts and arrays do not count as
    numbers.
    """
    return is_symbolic(value) or (isinstance(value, (int, float, np.number, ca.DM)) and not isinstance(value, bool))


@dataclasses.dataclass(frozen=True)
class Record:
    """Base class of frozen records whose fields are made by `quantity(...)` and are checked when a record is created.

    A field may also hold a CasADi expression, so that it can be an unknown of a fit. A text with a unit, such as
    "33deg" or "5 mm", is converted to SI.

    Raises ParameterError: a number is not finite or is out of bounds, or a given field name does not exist.
    """

    def __new__(cls, *values: Any, **fields: Any) -> Self:
        """Create a record.

        Raises ParameterError: a given field name does not exist; the message lists similar names.
        """
        refuse_unknown(f"{cls.__name__} has no field", fields, [field.name for field in dataclasses.fields(cls)])
        return super().__new__(cls)

    def __post_init__(self) -> None:
        for name, spec in quantities(self).items():
            value = getattr(self, name)
            written = written_unit(value)
            if isinstance(value, str):
                value = parse_quantity(value, spec.unit, f"{type(self).__name__}.{name}")
                object.__setattr__(self, name, value)
            check(type(self).__name__, name, value, spec, written)

    if not TYPE_CHECKING:  # with __getattr__, a type checker would accept any attribute name

        def __getattr__(self, name: str) -> Any:
            """Raise an UnknownAttributeError, which lists the similar field names."""
            raise UnknownAttributeError(self, name, [field.name for field in dataclasses.fields(self)])

    def replace(self, **changes: Any) -> Self:
        """Return a copy of the record with the given fields changed.

        Raises ParameterError: a field does not exist, or its new value is not allowed.
        """
        return dataclasses.replace(self, **changes)

    def values(self) -> dict[str, Any]:
        """Return the quantities of the record in a dict from field name to value, in order of definition."""
        return {name: getattr(self, name) for name in quantities(self)}


def quantities(record: Record | type[Record]) -> dict[str, Quantity]:
    """Return the units, sources, bounds and symbols of a record's fields: a dict from field name to `Quantity`.

    `record` may be a record or its class. The dict omits fields that are not made by `quantity(...)`.

    Examples
    --------
    >>> from rover_pin import SOILS
    >>> quantities(SOILS["table-1"])["phi"].unit
    'rad'
    """
    kind: Any = record if isinstance(record, type) else type(record)
    return dict(_quantities_of_class(kind))


@lru_cache(maxsize=1024)
def _quantities_of_class(kind: Any) -> dict[str, Quantity]:
    """Return a dict from field name to `Quantity` for a class of records. The result is computed once for each
    class.
    """
    return {
        field.name: field.metadata["quantity"] for field in dataclasses.fields(kind) if "quantity" in field.metadata
    }


def check(owner: str, name: str, value: Any, spec: Quantity, written: str = "") -> None:
    """Check that a value is a finite number within the bounds of `spec`. A CasADi expression is not checked.

    The error calls the number `owner.name`, or `name` if `owner` is empty. `written` is the unit that the user wrote
    (empty means SI); the error states the number and its bounds in this unit.

    Raises ParameterError: the value is not a number, is not finite, or is out of bounds.
    """
    if is_symbolic(value):
        return
    name = f"{owner}.{name}" if owner else name
    if not is_number(value):
        raise ParameterError(f"{name} = {value!r} is not a number; give a number (unit: {spec.unit or 'none'}).")
    number = as_float(value)
    if not (math.isfinite(number) and spec.low <= number <= spec.high):
        # The bounds are in SI; the error states them in the unit in which the user wrote the number.
        size = factor_to(written, spec.unit) if written else 1.0
        unit = f" {written or spec.unit}".rstrip()
        # A number without a unit that would be allowed in degrees or millimetres was probably meant in that unit.
        meant = "" if written else MEANT.get(spec.unit, "")
        is_meant = bool(meant) and spec.low <= number * UNITS[meant][1] <= spec.high
        hint = f"Did you mean {number:g} {meant}? " if is_meant else ""
        raise ParameterError(
            f"{name} = {number / size:g}{unit} is not allowed: it must lie in "
            f"[{spec.low / size:g}, {spec.high / size:g}]{unit}. {hint}Its default comes from: {spec.source}."
        )


MEANT = {"rad": "deg", "rad/m": "deg/m", "m": "mm"}
"""SI unit -> the unit that a user probably meant by a number without a unit that is out of bounds. The error then
suggests this unit."""


def as_float(value: Any) -> float:
    """Return a number as a float; a whole number that is too large for a float becomes infinity."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def to_si(value: Any, unit: Any, expected: str, where: str) -> float:
    """Return a number that is given in `unit`, converted to the SI unit `expected`.

    `where` is the beginning of an error message.

    Raises ParameterError: `value` is not a number, or `unit` is unknown or measures another kind of quantity than
    `expected`.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
        raise ParameterError(f"{where}: {value!r} is not a number; give a number (unit: {expected or 'none'}).")
    # factor_to returns NaN for an unknown unit and for a unit of another kind of quantity.
    unit, factor = str(unit), factor_to(str(unit), expected)
    if math.isnan(factor):
        kind = [name for name, (si, _) in UNITS.items() if si == expected] or [expected or "none"]
        raise ParameterError(f"{where}: unit '{unit}' does not fit this quantity; use one of {', '.join(kind)}.")
    return factor * as_float(value)


WRITTEN = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?:\s*([^\d\s.,].*)|\s+(\S.*))?")
"""Pattern of a number and a unit that may follow it, with or without a blank between the two."""


def parse_quantity(value: Any, expected: str, where: str, bare: str | None = None) -> float:
    """Return a number, or a text such as "5mm", "30 deg" or "1.2 kPa", as a number in the SI unit `expected`.

    A value that states no unit is taken to be in the unit `bare`, or in `expected` if `bare` is None. `where` is the
    beginning of an error message.

    Raises ParameterError: the value is not a number, or its unit measures another kind of quantity than `expected`.

    Examples
    --------
    >>> parse_quantity("5mm", "m", "soil.k")
    0.005
    """
    default_unit = expected if bare is None else bare
    if not isinstance(value, str):
        return to_si(value, default_unit, expected, where)
    match = WRITTEN.fullmatch(value.strip().replace("\N{MINUS SIGN}", "-"))
    if match is None:
        try:
            return float(value)  # "nan" and "inf", which the bounds refuse later
        except ValueError:
            unit = f" [{default_unit}]" if default_unit else ""
            point = "; write decimals with a point" if "," in value else ""
            raise ParameterError(f"{where} = {value!r} is not a number{unit}{point}.") from None
    return to_si(float(match[1]), (match[2] or match[3] or default_unit).strip(), expected, where)


def written_unit(value: Any) -> str:
    """Return the unit in a text such as "5 mm"; an empty text if the text states no unit or `value` is not a text."""
    match = WRITTEN.fullmatch(value.strip().lstrip("+-\N{MINUS SIGN}")) if isinstance(value, str) else None
    return (match[2] or match[3] or "").strip() if match else ""


ENTRY = ("value", "unit", "sd", "low", "high", "source", "note")
"""Keys that a table of one quantity may have in a TOML file, as in `k = { value = 5, unit = "mm" }`. An unknown key is
refused. Only some kinds of files use more keys than value and unit."""


def value_and_unit(entry: Any, unit: str) -> tuple[Any, Any]:
    """Return the value and the unit of a quantity from its entry in a TOML file.

    The entry is a table `{ value, unit }`, or a plain number, which is in the unit `unit`.
    """
    return (entry.get("value"), entry.get("unit", unit)) if isinstance(entry, Mapping) else (entry, unit)


def refuse_strange(entry: Mapping[str, Any], where: str) -> None:
    """Check the keys of the table of one quantity in a TOML file. A misspelt `unit` would otherwise be ignored.

    Raises ParameterError: a key is not one of ENTRY. `where` is the beginning of the message.
    """
    for key in entry:
        if key not in ENTRY:
            raise ParameterError(f"{where} has no key '{key}': {closest(key, ENTRY)}")


def declared_sd(entry: Any, unit: str, where: str) -> float | None:
    """Return the standard deviation (SD) that a quantity's entry in a file states, in SI; None if the entry states no
    SD.

    The entry gives the SD in its own unit, or in `unit` if it names none.

    Raises DataError: the SD is not a positive number. `where` is the beginning of the message.
    Raises ParameterError: the unit is unknown or measures another kind of quantity than `unit`.
    """
    if not isinstance(entry, Mapping) or "sd" not in entry:
        return None
    sd = entry["sd"]
    if isinstance(sd, bool) or not isinstance(sd, (int, float)) or not 0.0 < sd < math.inf:
        raise DataError(f"{where} is {sd!r}: give a positive number in the unit of its value, or leave it out.")
    return to_si(sd, str(entry.get("unit", unit)), unit, where)


def declared_sds(table: Mapping[str, Any], record: type[Record], where: str) -> dict[str, float]:
    """Return the standard deviations (SD) that a table of a file states: a dict from the quantity's name to its SD in
    SI.

    `record` is the class of records whose quantities the table holds. The dict omits quantities without a stated SD.

    Raises DataError: an SD is not a positive number. `where` is the beginning of the message.
    Raises ParameterError: a unit is unknown or measures another kind of quantity.
    """
    units = {name: spec.unit for name, spec in quantities(record).items() if name in table}
    sds = {name: declared_sd(table[name], unit, f"{where}: the sd of '{name}'") for name, unit in units.items()}
    return {name: sd for name, sd in sds.items() if sd is not None}


def record_from(record: type[Record], table: Mapping[str, Any], where: str) -> Any:
    """Return a record of the class `record` whose fields come from a table of a TOML file.

    An entry of the table is a number in SI, or a table `{ value, unit }`.

    Raises ParameterError: `table` is not a table, or has an unknown field, an unknown unit or a value that is not
    allowed. `where` is the beginning of the message.
    """
    if not isinstance(table, Mapping):
        raise ParameterError(
            f"{where}: {table!r} is not a table; write one line for each quantity, such as name = 1.0."
        )
    specs = quantities(record)
    # The record is created from plain numbers in SI, so each entry with a unit is converted first.
    fields = dict(table)
    for name, entry in table.items():
        if name not in specs:
            raise ParameterError(f"{where}: {record.__name__} has no field '{name}': {closest(name, specs)}")
        # The keys of an entry and its bounds are checked here, so that the error can name the place in the file.
        if isinstance(entry, Mapping):
            refuse_strange(entry, f"{where}: '{name}'")
            if "value" not in entry:
                raise ParameterError(f"{where}: '{name}' needs a 'value': {name} = {{ value = 1.0, unit = '...' }}.")
            unit = specs[name].unit
            fields[name] = to_si(entry["value"], entry.get("unit", unit), unit, f"{where}: '{name}'")
            check(f"{where}: {record.__name__}", name, fields[name], specs[name], str(entry.get("unit", "")))
    # A number that was given without a table is checked by the record itself; its error gets the place in the file.
    try:
        return record(**fields)
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from error


def as_table(record: Record) -> dict[str, Any]:
    """Return a record as a dict from field name to `{ value, unit }`, which can be written to TOML and read by
    `record_from`.

    Raises ParameterError: a field holds a CasADi expression, which has no number to write.

    Examples
    --------
    >>> from rover_pin.rover.rover import load_rover
    >>> as_table(load_rover("nexus6").wheels[0].wheel)
    {'r': {'value': 0.045, 'unit': 'm'}, 'b': {'value': 0.05, 'unit': 'm'}}
    """
    table: dict[str, Any] = {}
    for name, spec in quantities(record).items():
        value = getattr(record, name)
        if is_symbolic(value):
            raise ParameterError(
                f"{type(record).__name__}.{name} is a CasADi expression ({value}), which cannot be written to a file: "
                "give this field a number."
            )
        table[name] = {"value": float(value), **({"unit": spec.unit} if spec.unit else {})}
    return table
