"""The files of a rig set: keys and numbers of `rig.toml`, columns of the points; what nothing reads is refused."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.table import measured_points
from rover_pin.base.files.toml_file import table_in, text_in
from rover_pin.base.quantity import quantities, refuse_strange, to_si, value_and_unit
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.channel import RIG_CHANNELS, DrawbarPull
from rover_pin.measurements.checks import column, slips
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.parameters.bekker import bekker_si
from rover_pin.soil.slip import rim_and_travel, slip_ratios

RIG_FILE = "rig.toml"
TEXTS = ("kind", "name", "source", "licence", "method", "missing", "note")
BEKKER_UNITS = {"k_c": "N/m^(n+1)", "k_phi": "N/m^(n+2)"}
CHANNELS = tuple(kind.column.rpartition("_")[0] for kind in RIG_CHANNELS)
"""Channels as `[noise]` names them."""
SLOPE, STEEPEST = "slope_rad", math.radians(60.0)
"""The incline that a wheel climbs at a steady slip, in place of its drawbar pull; the most that is read [rad]."""


class Beside(NamedTuple):
    """What may be declared besides r, b and the soil's constants: its unit, its range, and whose table it is in."""

    unit: str
    low: float
    high: float
    table: str


BESIDE = {
    "lug_height": Beside("m", 0.0, 1.0, "wheel"),
    "lug_width": Beside("m", 0.0, 1.0, "wheel"),
    "lug_count": Beside("", 0.0, 1000.0, "wheel"),
    "bulk_density": Beside("kg/m^3", 100.0, 1e4, "soil"),
    "angle_of_repose": Beside("rad", 0.0, math.radians(60.0), "soil"),
}
"""Lugs and sand as the effects of the contact take them: see `experiments.wheel_rig.presets`."""
SPEEDS, ANGLE = ("travel_speed_mps", "rim_speed_mps"), "slip_angle_rad"
"""Columns of the speeds, of the wheel's centre and of its rim, and of the angle between heading and travel."""
OF_SPEEDS = "slips of speeds"
"""How many runs of a table have the slip of their speeds, among its attributes."""
SMOOTH = "smooth"
"""Surface of a wheel without lugs."""
OVER_LUGS = "r_over_lugs"
"""Key of [wheel]: whether r, and with it slip and rim speed, are measured over the lugs."""
TABLES = {
    "files": ("points", "penetration", "transient"),
    "wheel": (*quantities(Wheel), "surface", OVER_LUGS, *(name for name, of in BESIDE.items() if of.table == "wheel")),
    "soil": (*quantities(Soil), *BEKKER_UNITS, *(name for name, of in BESIDE.items() if of.table == "soil")),
    "rig": tuple(quantities(RigErrors)),
    "speed": ("carriage", "rim"),
    "noise": (*(f"{name}{end}" for name in CHANNELS for end in ("", "_over_load")), "slope"),
}
"""What each table may hold."""
MEANT = {
    "friction_angle": "phi", "internal_friction": "phi", "cohesion": "c", "exponent": "n", "sinkage_exponent": "n",
    "shear_modulus": "k", "shear_displacement": "k", "kc": "k_c", "kphi": "k_phi", "radius": "r", "diameter": "r",
    "width": "b",
}  # fmt: skip
"""Names that others give to these constants."""


def refuse_unknown_keys(document: Mapping[str, Any], where: str) -> None:
    """Refuse a key of `rig.toml`, or of one of its tables, that nothing reads.

    Raises DataError: an unknown key, with the one that may be meant, or what must be a table and is none.
    """
    _refuse(document, (*TEXTS, *TABLES), where, "a rig set")
    for name, keys in TABLES.items():
        _refuse(table_in(document, name, where), (*keys, "note"), where, f"[{name}]")


def _refuse(table: Mapping[str, Any], allowed: Iterable[str], where: str, owner: str) -> None:
    allowed = tuple(allowed)
    for key in table:
        if key not in allowed:
            meant = MEANT.get(key.lower(), "")
            hint = f"did you mean '{meant}'? " if meant in allowed else ""
            raise DataError(f"{where}: there is no key '{key}' in {owner}: {hint}{closest(key, allowed)}")


def number_si(entry: Any, expected: str, where: str) -> float:
    """Return a number, or a `{ value, unit }` entry, in the SI unit `expected`.

    Raises DataError: there is no number.
    Raises ParameterError: an unknown key, or a unit of another kind.
    """
    if isinstance(entry, Mapping):
        refuse_strange(entry, where)
    value, unit = value_and_unit(entry, expected)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise DataError(f"{where} has no number; write {{ value = 1.0, unit = '{expected}' }}.")
    return to_si(value, unit, expected, where)


def declared_constants(table: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the soil constants of a table [soil] by name, Bekker's among them, in SI; errors as of `number_si`."""
    units = {name: quantity.unit for name, quantity in quantities(Soil).items()}
    constants = {
        name: number_si(entry, units[name], f"{where}: {name}") for name, entry in table.items() if name in units
    }
    for name in (key for key in BEKKER_UNITS if key in table):
        entry = table[name] if isinstance(table[name], Mapping) else {"value": table[name]}
        unit, place = str(entry.get("unit", BEKKER_UNITS[name])), f"{where}: {name}"
        constants[name] = bekker_si(name, number_si({**entry, "unit": ""}, "", place), unit, constants.get("n"), place)
    return constants


def declared_beside(document: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return what `BESIDE` has of [wheel] and [soil], by name, in SI.

    Raises DataError: no number, or one out of its range.
    """
    values = {}
    for name, of in BESIDE.items():
        table = table_in(document, of.table, where)
        if name in table:
            values[name] = number_si(table[name], of.unit, f"{where}: {name}")
            if not of.low <= values[name] <= of.high:
                within = f"{of.low:g} to {of.high:.4g} {of.unit}".rstrip()
                raise DataError(
                    f"{where}: {name} = {values[name]:.4g} {of.unit} lies outside {within}; check its unit."
                )
    smooth = table_in(document, "wheel", where).get("surface") == SMOOTH
    return {"lug_height": 0.0, **values} if smooth else values


def rim_of(document: Mapping[str, Any], where: str) -> tuple[dict[str, Any], float]:
    """Return the sizes of [wheel], r that of the rim, and the rim's radius over the stated one.

    Raises DataError: a size that is missing; `r_over_lugs` that is neither true nor false, without lugs, or with lugs
    as high as r.
    """
    wheel_table = table_in(document, "wheel", where)
    for name in quantities(Wheel):
        if name not in wheel_table:
            raise DataError(f"{where}: [wheel] has no {name}; write {name} = {{ value, unit = 'm' }}.")
    dimensions, over_lugs = {name: wheel_table[name] for name in quantities(Wheel)}, wheel_table.get(OVER_LUGS, False)
    if not isinstance(over_lugs, bool):
        raise DataError(f"{where}: {OVER_LUGS} = {over_lugs!r}; write true or false.")
    if not over_lugs:
        return dimensions, 1.0
    r = number_si(dimensions["r"], "m", f"{where}: r")
    lug = declared_beside(document, where).get("lug_height")
    if lug is None or not lug < r:
        why = "needs lug_height" if lug is None else f"leaves no rim: lug_height = {lug:g} m"
        raise DataError(f"{where}: {OVER_LUGS} = true {why}; give the lugs' height over the rim.")
    entry = dimensions["r"] if isinstance(dimensions["r"], Mapping) else {"value": r}
    ends, unit = ("value", "low", "high"), entry.get("unit", "m")
    lengths = {key: to_si(entry[key], unit, "m", f"{where}: {key} of r") for key in (*ends, "sd") if key in entry}
    at_rim = {key: length - lug * (key in ends) for key, length in lengths.items()}
    return {**dimensions, "r": {**at_rim, "unit": "m"}}, (r - lug) / r


def read_rig_points(folder: Path, document: Mapping[str, Any], rim_share: float, trust: Trust) -> pd.DataFrame:
    """Return the points of a set as the model takes them: a slope as load and pull, slips and speeds of the rim.

    Parameters
    ----------
    rim_share : float
        Radius of the rim over the stated one.

    Raises
    ------
    DataError
        A missing file or column, one in another unit, or a slope beside a drawbar pull, that is no angle or has no SD.
    """
    where = f"{folder.name}/rig.toml"
    points = trust.within(folder, text_in(table_in(document, "files", where), "points", where, "points.csv"), where)
    table = measured_points(points, ("slip", "load_N"))
    points_label = f"{folder.name}/{points.name}"
    _refuse_other_units(table, points_label)
    table = _with_slips(table, points_label)
    if SLOPE in table:
        table = _on_a_slope(table, table_in(document, "noise", where), points_label)
    return table if rim_share == 1.0 else _at_the_rim(table, rim_share, points_label)


def _refuse_other_units(table: pd.DataFrame, where: str) -> None:
    """Refuse a column such as `sinkage_mm`, or `sinkage` alone: it would be read as not measured."""
    columns = ("slip", "load_N", SLOPE, *(kind.column for kind in RIG_CHANNELS))
    stems = {name.rpartition("_")[0] or name: name for name in columns}
    for name in map(str, table.columns):
        stem = name if name in stems else name.rpartition("_")[0]
        if name not in columns and stem in stems:
            expected = stems[stem]
            raise DataError(f"{where}: column '{name}' is not read: {closest(name, [expected])} Convert it to SI.")


def _with_slips(table: pd.DataFrame, where: str) -> pd.DataFrame:
    """Return the table with the slip of both speeds where it has none, as where it is divided by a locked wheel's."""
    if not pd.api.types.is_numeric_dtype(table["slip"]):
        return table
    slip = table["slip"].to_numpy(dtype=float)
    empty = ~np.isfinite(slip)
    if not empty.any() or not set(SPEEDS) <= set(table):
        if np.isinf(slip).any():
            row, columns = int(np.argmax(np.isinf(slip))) + 1, " and ".join(SPEEDS)
            advice = "by Eq (1) a locked wheel has -1, one that spins and stands 1: give that, or columns of"
            raise DataError(f"{where}: slip is infinite in row {row}; {advice} {columns}.")
        return table
    travel, rim = (column(table[name], name, where, gaps=True) for name in SPEEDS)
    angle = table[ANGLE].to_numpy(dtype=float) if ANGLE in table else 0.0
    converted = table.assign(slip=np.where(empty, slip_ratios(rim, travel * np.cos(angle)), slip))
    converted.attrs[OF_SPEEDS] = int(empty.sum())
    return converted


def _on_a_slope(table: pd.DataFrame, noise: Mapping[str, Any], where: str) -> pd.DataFrame:
    """Return the table with the load W cos(slope) and the pull W sin(slope) that a wheel of weight W needs uphill."""
    if DrawbarPull.column in table:
        raise DataError(f"{where}: {SLOPE} replaces {DrawbarPull.column}; leave one of the two out.")
    slope, weight = column(table[SLOPE], SLOPE, where), column(table["load_N"], "load_N", where)
    if np.max(np.abs(slope)) > STEEPEST:
        raise DataError(f"{where}: {SLOPE} reaches {np.max(np.abs(slope)):g}; give radians, positive uphill.")
    converted = table.assign(load_N=weight * np.cos(slope), **{DrawbarPull.column: weight * np.sin(slope)})
    sd = number_si(noise["slope"], "rad", f"{where}: noise of slope") if "slope" in noise else table.get("slope_sd_rad")
    return converted if sd is None else converted.assign(drawbar_pull_sd_N=weight * np.cos(slope) * sd)


def _at_the_rim(table: pd.DataFrame, share: float, where: str) -> pd.DataFrame:
    """Return the table with slips and rim speeds of a rim whose radius is this share of the stated one, by Eq (1)."""
    slip = column(table["slip"], "slip", where)
    slips(slip, "slip", where)
    rim, travel = rim_and_travel(slip)
    converted = table.assign(slip=slip_ratios(share * rim, travel))
    return (
        converted.assign(rim_speed_mps=share * converted["rim_speed_mps"])
        if "rim_speed_mps" in converted
        else converted
    )
