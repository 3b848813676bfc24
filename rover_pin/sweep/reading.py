"""Read a batch study from a TOML file."""

import dataclasses
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.trust import Trust
from rover_pin.base.units import UNITS, USUAL, factor_to
from rover_pin.scenarios.drive_file import is_drive_file
from rover_pin.scenarios.scenario import scenario
from rover_pin.sweep.plan import Axis, Grid, LatinHypercube, LogRange, Range, Sobol, Values, kind_of
from rover_pin.sweep.study import Study

PLANS: dict[str, type[Any]] = {"grid": Grid, "latin-hypercube": LatinHypercube, "sobol": Sobol}
"""Word for `kind` in the table of the plan -> class of the plan."""
SCALES: dict[str, type[Range]] = {"linear": Range, "log": LogRange}
"""Word for `scale` in the table of a range -> class of the range."""
RANGE_KEYS = ("low", "high", "unit", "scale")
VALUES_KEYS = ("values", "unit")
SETTING_KEYS = ("value", "unit")
"""Keys that the table of a range (RANGE_KEYS), of a list of values (VALUES_KEYS) or of a setting (SETTING_KEYS) may
have. Any other key is refused."""
ENTRY_MARKS = {"low", "high", "values", "value"}
"""Keys that occur only in a table that describes the values of one parameter. A table without these keys is a group of
further parameters, as [parameters.soil]."""


def read_study(path: str | Path, trust: Trust = Trust()) -> Study:
    """Read a study from a TOML file such as::

        name = "ditch"
        scenario = "ditch"             # or a drive file in the folder of the study: "my-drive.toml"
        duration = 60.0                # s
        repeats = 1
        paired = [["soil.c", "soil.phi"]]
        plan = { kind = "sobol", cases = 64 }   # or "latin-hypercube"; or { kind = "grid", points = 5 }
        [settings]
        gravity = 1.62                 # SI, or { value = ..., unit = "..." }
        [parameters]
        terrain.wall_angle = { low = 20, high = 60, unit = "deg" }
        soil.k = { low = 1e-3, high = 1e-1, scale = "log" }
        soil.c = [0.0, 100.0]
        soil.phi = { values = [30, 37], unit = "deg" }

    Raises DataError if the file is missing, is not TOML, or names a file outside its folder that `trust` does not
    allow.
    Raises ParameterError if a name is unknown (the message lists similar names), if a range is empty, or if `Study`
    refuses a value.
    """
    table = read_toml(path)
    trust.refuse_elsewhere(table, Path(path))
    # A drive file is found from the folder of the study, and is checked on its own: an error then names the drive file.
    if isinstance(table.get("scenario"), str) and is_drive_file(table["scenario"]):
        table["scenario"] = str(trust.within(Path(path).parent, table["scenario"], str(path)))
        scenario(table["scenario"], trust=trust)
    try:
        return _study(table, trust)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from error


def _study(table: dict[str, Any], trust: Trust) -> Study:
    """Return the study that the content of a TOML file (`table`) describes. For the errors, see `read_study`."""
    # Misspelt keys are reported first. Otherwise the error would call a value missing although only its key is
    # misspelt.
    fields = (field for field in dataclasses.fields(Study) if field.name != "trust")
    _check_keys(table, [field.name for field in fields], "the study")
    for name in ("name", "scenario", "plan", "parameters"):
        if name not in table:
            raise ParameterError(f"the study has no '{name}': add it to the file.")
    axes = {name: _axis(name, entry) for name, entry in _flat(table["parameters"], "parameters")}
    settings = {}
    # A setting is a plain value or a table with a unit.
    for name, entry in _flat(table.get("settings", {}), "settings"):
        if isinstance(entry, Mapping):
            _check_keys(entry, SETTING_KEYS, f"setting '{name}'")
            try:
                entry = _si(entry["value"], entry)
            except ParameterError as error:
                raise ParameterError(f"setting '{name}': {error}") from error
        settings[name] = entry
    plan = table["plan"]
    if not isinstance(plan, Mapping) or "kind" not in plan:
        raise ParameterError('the plan has no kind: write for example plan = { kind = "sobol", cases = 64 }.')
    # All further keys of the plan's table are arguments of the plan's class.
    kind = _choice_of(plan["kind"], PLANS, "plan")
    arguments = {name: value for name, value in plan.items() if name != "kind"}
    _check_keys(arguments, [field.name for field in dataclasses.fields(kind)], f"the plan '{plan['kind']}'")
    # Only a grid has as many cases as its lists give; every other plan needs their number.
    if kind is not Grid and "cases" not in arguments:
        raise ParameterError(f"the plan '{plan['kind']}' has no 'cases': add the number of cases.")
    others = {name: value for name, value in table.items() if name not in ("plan", "parameters", "settings")}
    return Study(**others, plan=kind(**arguments), parameters=axes, settings=settings, trust=trust)


def _flat(table: Any, where: str, prefix: str = "") -> list[tuple[str, Any]]:
    """Return the entries of a table of parameters with their dotted names.

    TOML reads `soil.k = ...` as a table inside a table, but `"soil.k" = ...` as one name. Both give 'soil.k' here.
    `where` is the name of the table for errors.
    """
    if not isinstance(table, Mapping):
        raise ParameterError(f"{where} must be a table, which begins with the line [{where}].")
    entries = []
    for name, entry in table.items():
        # A table without the keys of an entry groups names, as in [parameters.soil].
        if isinstance(entry, Mapping) and not ENTRY_MARKS & set(entry):
            entries += _flat(entry, where, f"{prefix}{name}.")
        else:
            entries.append((f"{prefix}{name}", entry))
    return entries


def _axis(name: str, entry: Any) -> Axis:
    """Return the values of one parameter from its entry in the TOML file.

    The entry is a list of values, a table with the list `values`, or a table with the ends `low` and `high` of a range.
    """
    try:
        # A list states no unit, so its numbers are in SI units.
        if isinstance(entry, list):
            return Values(entry)
        if not isinstance(entry, Mapping):
            raise ParameterError(f"{entry!r} is a single value: give a list or a range, or move it to [settings].")
        if "values" in entry:
            _check_keys(entry, VALUES_KEYS, "the list")
            values = entry["values"]
            return Values([_si(value, entry) for value in values] if isinstance(values, list) else values)
        _check_keys(entry, RANGE_KEYS, "the range")
        for end in ("low", "high"):
            if end not in entry:
                raise ParameterError(f"the range has no '{end}': give low and high.")
        scale = _choice_of(entry.get("scale", "linear"), SCALES, "scale")
        return scale(_si(entry["low"], entry), _si(entry["high"], entry))
    except ParameterError as error:
        raise ParameterError(f"parameter '{name}': {error}") from error


def _si(value: Any, entry: Mapping[str, Any]) -> Any:
    """Return a value of an entry in SI units. If the entry has no unit, its value is already in SI units."""
    if "unit" not in entry:
        return value
    unit = entry["unit"]
    # The kind of quantity is not known here. The unit decides it: the first SI unit to which it converts is taken.
    factor = next(
        (candidate for candidate in (factor_to(str(unit), si) for si in USUAL) if not math.isnan(candidate)), None
    )
    if factor is None or not isinstance(unit, str):
        raise ParameterError(f"there is no unit '{unit}': {closest(unit, UNITS)}")
    if kind_of(value) != "number":
        raise ParameterError(f"{value!r} has a unit but is not a finite number.")
    return value * factor


def _choice_of(word: Any, choices: Mapping[str, Any], noun: str) -> Any:
    """Return the entry of `choices` whose name is `word`.

    Raises ParameterError: there is no such entry. The message lists similar names, and calls the entry a `noun`.
    """
    if not isinstance(word, str) or word not in choices:
        raise ParameterError(f"there is no {noun} '{word}': {closest(word, choices)}")
    return choices[word]


def _check_keys(entry: Mapping[str, Any], allowed: Iterable[str], where: str) -> None:
    """Check that all keys of a table are allowed.

    Raises ParameterError: a key is not allowed. `where` is the beginning of the message.
    """
    for name in entry:
        if name not in allowed:
            raise ParameterError(f"{where} has no key '{name}': {closest(name, allowed)}")
