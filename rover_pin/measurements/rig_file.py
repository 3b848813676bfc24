"""The files of a wheel-rig data set: the keys and numbers of `rig.toml`, and the columns of the points file.

Unknown keys are refused, because a misspelled declaration would otherwise be ignored silently.
"""

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
from rover_pin.measurements.channel import RIG_CHANNELS, DrawbarPull, MotorTorque, RigErrors, sd_column
from rover_pin.measurements.checks import PAPER_DEFINITION, column, slip_by_definition, slips
from rover_pin.parameters.bekker import bekker_si
from rover_pin.parameters.gravity import EARTH, GRAVITIES, gravity_from
from rover_pin.soil.slip import rim_and_travel, slip_ratios

RIG_FILE = "rig.toml"
"""Name of the file that describes a wheel-rig data set."""
TEXTS = ("kind", "name", "source", "licence", "method", "missing", "note")
"""Keys of rig.toml that hold text."""
SLIP_DEFINITION, GRAVITY = "slip_definition", "gravity"
"""Keys of rig.toml for the definition of slip (`checks.SLIP_DEFINITIONS`) and for the gravity at the test [m/s^2]."""
LOAD_MASS = "load_kg"
"""Name of a column of the points that may replace load_N: the mass on the wheel [kg]. The load is this mass times
gravity."""
MOTOR_CURRENT, TORQUE_CONSTANT = "motor_current_A", "torque_constant"
"""Name of a column of the points that may replace motor_torque_Nm, the current of the wheel's motor [A]; and key of
[rig] with the torque at the axle for each ampere [N m/A]."""
BEKKER_UNITS = {"k_c": "N/m^(n+1)", "k_phi": "N/m^(n+2)"}
"""Units of Bekker's constants, which depend on the exponent n."""
CHANNELS = tuple(kind.column.rpartition("_")[0] for kind in RIG_CHANNELS)
"""Names of the channels whose noise the table [noise] of rig.toml may state."""
SLOPE, MAX_SLOPE = "slope_rad", math.radians(60.0)
"""SLOPE is the name of the column with the slope [rad] that a wheel climbs at a steady slip; this column replaces the
column of the drawbar pull. MAX_SLOPE is the largest accepted slope [rad]: no wheel climbs a steeper slope of loose
soil, so that a larger number must be in degrees."""


class ExtraNumber(NamedTuple):
    """A number that rig.toml may declare in addition to the wheel's r and b and the soil constants: its unit, its range
    [SI], and the table of rig.toml that holds it.
    """

    unit: str
    low: float
    high: float
    table: str


BESIDE = {
    "lug_height": ExtraNumber("m", 0.0, 1.0, "wheel"),
    "lug_width": ExtraNumber("m", 0.0, 1.0, "wheel"),
    "lug_count": ExtraNumber("", 0.0, 1000.0, "wheel"),
    "bulk_density": ExtraNumber("kg/m^3", 100.0, 1e4, "soil"),
    "angle_of_repose": ExtraNumber("rad", 0.0, math.radians(60.0), "soil"),
}
"""Name -> number of the lugs or the sand that rig.toml may declare. `experiments.wheel_rig.declared` states which
effects use them."""
SPEEDS, ANGLE = ("travel_speed_mps", "rim_speed_mps"), "slip_angle_rad"
"""Names of columns: travel speed and rim speed, and the slip angle between the wheel's plane and its travel."""
OF_SPEEDS = "slips of speeds"
"""Name of an attribute of a table of points: the number of runs whose slip was computed from travel and rim speed."""
OF_MASSES, CONVERTED = "loads of masses", "converted slips"
"""Names of attributes of a table of points: whether the loads were computed from masses, and a text on how the slips
were converted to Eq (1)."""
SMOOTH = "smooth"
"""Value of the key `surface` in [wheel] of rig.toml for a wheel without lugs."""
OVER_LUGS = "r_over_lugs"
"""Name of a key of [wheel] in rig.toml: whether the radius r, the slip and the rim speed refer to the tips
of the lugs."""
TABLES = {
    "files": ("points", "penetration", "transient"),
    "wheel": (*quantities(Wheel), "surface", OVER_LUGS, *(name for name, of in BESIDE.items() if of.table == "wheel")),
    "soil": (*quantities(Soil), *BEKKER_UNITS, *(name for name, of in BESIDE.items() if of.table == "soil")),
    "rig": (*quantities(RigErrors), TORQUE_CONSTANT),
    "speed": ("carriage", "rim"),
    "noise": (*(f"{name}{end}" for name in CHANNELS for end in ("", "_over_load")), "slope", MOTOR_CURRENT[:-2]),
}
"""The tables that rig.toml may have, each with the keys that it may hold."""
MEANT = {
    "friction_angle": "phi", "internal_friction": "phi", "cohesion": "c", "exponent": "n", "sinkage_exponent": "n",
    "shear_modulus": "k", "shear_displacement": "k", "kc": "k_c", "kphi": "k_phi", "radius": "r", "diameter": "r",
    "width": "b",
}  # fmt: skip
"""Names that other publications give to the constants of rig.toml, with our names; an error message
suggests our name."""


def refuse_unknown_keys(document: Mapping[str, Any], where: str) -> None:
    """Raise DataError if `rig.toml`, or one of its tables, has a key that no part of the package reads. The message
    names the key that the user may have meant.

    DataError is also raised if the key of a table, such as `wheel`, holds a number or a text instead of a table.
    """
    _refuse(document, (*TEXTS, SLIP_DEFINITION, GRAVITY, *TABLES), where, "a rig set")
    for name, keys in TABLES.items():
        _refuse(table_in(document, name, where), (*keys, "note"), where, f"[{name}]")


def _refuse(table: Mapping[str, Any], allowed: Iterable[str], where: str, owner: str) -> None:
    """Raise DataError if a table of rig.toml has a key that is not in `allowed`; the message calls the
    table `owner`.
    """
    allowed = tuple(allowed)
    for key in table:
        if key not in allowed:
            meant = MEANT.get(key.lower(), "")
            hint = f"did you mean '{meant}'? " if meant in allowed else ""
            raise DataError(f"{where}: there is no key '{key}' in {owner}: {hint}{closest(key, allowed)}")


def number_si(entry: Any, expected: str, where: str) -> float:
    """Return the value of an entry of rig.toml in the SI unit `expected`. The entry is a number, or a table { value,
    unit }.

    Raises
    ------
    DataError
        The entry has no number.
    ParameterError
        The entry has an unknown key, or a unit of another kind.

    Examples
    --------
    >>> number_si({"value": 25.0, "unit": "mm"}, "m", "rig.toml: b")
    0.025
    """
    if isinstance(entry, Mapping):
        refuse_strange(entry, where)
    value, unit = value_and_unit(entry, expected)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise DataError(f"{where} has no number: write {{ value = 1.0, unit = '{expected}' }}.")
    return to_si(value, unit, expected, where)


def declared_constants(table: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the soil constants that a table [soil] declares (name -> value in SI), including Bekker's k_c and k_phi.

    Raises DataError if an entry has no number, and ParameterError if an entry has an unknown key or unit (see
    `number_si`).
    """
    units = {name: quantity.unit for name, quantity in quantities(Soil).items()}
    constants = {
        name: number_si(entry, units[name], f"{where}: {name}") for name, entry in table.items() if name in units
    }
    # The dimension of k_c and k_phi depends on the exponent n, so their units are converted separately.
    for name in (key for key in BEKKER_UNITS if key in table):
        entry = table[name] if isinstance(table[name], Mapping) else {"value": table[name]}
        unit, place = str(entry.get("unit", BEKKER_UNITS[name])), f"{where}: {name}"
        constants[name] = bekker_si(name, number_si({**entry, "unit": ""}, "", place), unit, constants.get("n"), place)
    return constants


def declared_beside(document: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the numbers of lugs and sand that [wheel] and [soil] of rig.toml declare, as a mapping from the names in
    `BESIDE` to values in SI.

    A wheel with a smooth surface has lugs of height 0. Raises DataError if an entry has no number, or if a number lies
    outside its range.
    """
    values = {}
    # The ranges find values in a wrong unit, for example a lug height in millimetres.
    for name, of in BESIDE.items():
        table = table_in(document, of.table, where)
        if name in table:
            values[name] = number_si(table[name], of.unit, f"{where}: {name}")
            if not of.low <= values[name] <= of.high:
                within = f"{of.low:g} to {of.high:.4g} {of.unit}".rstrip()
                raise DataError(
                    f"{where}: {name} = {values[name]:.4g} {of.unit} lies outside {within}; check its unit."
                )
    # A smooth wheel has lugs of height 0, unless a height is stated.
    smooth = table_in(document, "wheel", where).get("surface") == SMOOTH
    return {"lug_height": 0.0, **values} if smooth else values


def rim_of(document: Mapping[str, Any], where: str) -> tuple[dict[str, Any], float]:
    """Return the wheel's sizes with the radius of the rim, and the ratio of this radius to the stated radius r.

    The ratio is 1 unless the key `r_over_lugs` states that r is the radius of the lug tips.

    Parameters
    ----------
    document : mapping
        The content of rig.toml.
    where : str
        Name of the file, for error messages.

    Raises
    ------
    DataError
        A size is missing; `r_over_lugs` is neither true nor false, or is true without lugs or with lugs as high as r.
    """
    wheel_table = table_in(document, "wheel", where)
    for name in quantities(Wheel):
        if name not in wheel_table:
            raise DataError(f"{where}: [wheel] has no {name}: write {name} = {{ value, unit = 'm' }}.")
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
    # The radius and both ends of its range are reduced by the lug height; the SD does not change.
    entry = dimensions["r"] if isinstance(dimensions["r"], Mapping) else {"value": r}
    ends, unit = ("value", "low", "high"), entry.get("unit", "m")
    lengths = {key: to_si(entry[key], unit, "m", f"{where}: {key} of r") for key in (*ends, "sd") if key in entry}
    at_rim = {key: length - lug * (key in ends) for key, length in lengths.items()}
    return {**dimensions, "r": {**at_rim, "unit": "m"}}, (r - lug) / r


def declared_gravity(document: Mapping[str, Any], where: str) -> float:
    """Return the gravity at the test [m/s^2] that rig.toml declares; the Earth's gravity if it declares none.

    The entry is a number, a table { value, unit }, or a name such as "moon". Raises DataError if it is none of these,
    or if it lies outside (0, 100) m/s^2.
    """
    # A name such as "moon" stands for the gravity of that body.
    entry = document.get(GRAVITY, EARTH)
    if isinstance(entry, str):
        if entry not in GRAVITIES:
            raise DataError(f"{where}: gravity = {entry!r} is not known: {closest(entry, GRAVITIES)}")
        return GRAVITIES[entry]
    return gravity_from(entry, where)


def read_rig_points(folder: Path, document: Mapping[str, Any], rim_share: float, trust: Trust) -> pd.DataFrame:
    """Read the points of a data set and convert them as models need them: load [N], slip of Eq (1) at the rim, and
    channels in SI.

    Eq (1) of the paper is S = (r omega - v) / max(r omega, v), with the rim speed r omega and the travel speed v.
    Masses become loads, and currents of the motor torques. Slips of another definition, or of the lug tips, become the
    rim's slip of Eq (1). Missing slips are computed from both speeds. A slope becomes a load and a pull.

    Parameters
    ----------
    folder : Path
        The folder of the data set.
    document : mapping
        The content of its rig.toml.
    rim_share : float
        Ratio of the rim's radius to the stated radius, from `rim_of`.
    trust : Trust
        Allows a points file outside the folder.

    Raises
    ------
    DataError
        A missing file or column; a column in another unit; a slope next to a drawbar pull, or a slope that is no angle;
        a current of the motor without a torque constant.
    """
    where = f"{folder.name}/rig.toml"
    points = trust.within(folder, text_in(table_in(document, "files", where), "points", where, "points.csv"), where)
    table = measured_points(points, ("slip",))
    points_label = f"{folder.name}/{points.name}"
    # A mass on the wheel is a load only after multiplication by the gravity at the test.
    if LOAD_MASS in table and "load_N" not in table:
        mass = column(table[LOAD_MASS], LOAD_MASS, points_label)
        table = table.drop(columns=LOAD_MASS).assign(load_N=mass * declared_gravity(document, where))
        table.attrs[OF_MASSES] = True
    elif "load_N" not in table:
        table = measured_points(points, ("slip", "load_N"))  # refuses, and names the column that may be meant
    # A known column in another unit or without a unit, such as `sinkage_mm` or `sinkage`, would otherwise be ignored,
    # as if the channel had not been measured. Column names are therefore compared without their units.
    table = _with_motor_torque(table, document, where, points_label)
    columns = ("slip", "load_N", SLOPE, *(kind.column for kind in RIG_CHANNELS))
    stems = {name.rpartition("_")[0] or name: name for name in columns}
    for name in map(str, table.columns):
        stem = name if name in stems else name.rpartition("_")[0]
        if name not in columns and stem in stems:
            advice = f"{closest(name, [stems[stem]])} Convert it to SI."
            raise DataError(f"{points_label}: column '{name}' is not read: {advice}")
    # Slips are completed before they are converted, because missing ones follow from speeds by Eq (1).
    table = _with_slips(table, points_label)
    definition = document.get(SLIP_DEFINITION, PAPER_DEFINITION)
    if definition != PAPER_DEFINITION:
        given = column(table["slip"], "slip", points_label)
        converted = slip_by_definition(given, definition, points_label)
        # The finding shows the largest conversion, so that the user can check the definition.
        farthest = int(np.argmax(np.abs(given)))
        table = table.assign(slip=converted)
        table.attrs[CONVERTED] = f"slip {given[farthest]:.4g} becomes {converted[farthest]:.4g}"
    if SLOPE in table:
        # A wheel of weight W that climbs a slope steadily has the load W cos(slope) and the pull W sin(slope).
        if DrawbarPull.column in table:
            raise DataError(f"{points_label}: {SLOPE} replaces {DrawbarPull.column}; leave one of the two columns out.")
        slope, weight = (column(table[name], name, points_label) for name in (SLOPE, "load_N"))
        if np.max(np.abs(slope)) > MAX_SLOPE:
            raise DataError(
                f"{points_label}: {SLOPE} reaches {np.max(np.abs(slope)):g}; give radians, positive uphill."
            )
        sd = table.get("slope_sd_rad")
        table = table.assign(load_N=weight * np.cos(slope), **{DrawbarPull.column: weight * np.sin(slope)})
        # The SD of the slope becomes an SD of the pull: d(W sin s) = W cos(s) ds. [noise] may state it for all runs.
        noise = table_in(document, "noise", where)
        if "slope" in noise:
            sd = number_si(noise["slope"], "rad", f"{points_label}: noise of slope")
        if sd is not None:
            table = table.assign(drawbar_pull_sd_N=weight * np.cos(slope) * sd)
    if rim_share != 1.0:
        # Slips at the tips of the lugs become slips at the rim, whose radius is rim_share times the stated radius. Slip
        # fixes the ratio of rim to travel speed. The rim speed is reduced to the rim's radius, and the slip follows
        # anew.
        slip = column(table["slip"], "slip", points_label)
        slips(slip, "slip", points_label)
        rim, travel = rim_and_travel(slip)
        table = table.assign(slip=slip_ratios(rim_share * rim, travel))
        if "rim_speed_mps" in table:
            table = table.assign(rim_speed_mps=rim_share * table["rim_speed_mps"])
    return table


def _with_motor_torque(table: pd.DataFrame, document: Mapping[str, Any], where: str, points_label: str) -> pd.DataFrame:
    """Return the table of points with the current of the motor converted to the torque at the axle, by the torque
    constant that [rig] of rig.toml declares.

    An SD of the current, as a column or in [noise], becomes an SD of this torque. Raises DataError if the torque
    constant is missing, or if the table has the torque by motor current too.
    """
    if MOTOR_CURRENT not in table:
        return table
    constant = table_in(document, "rig", where).get(TORQUE_CONSTANT)
    if constant is None:
        raise DataError(
            f"{points_label}: {MOTOR_CURRENT} needs the torque at the axle for each ampere: write [rig] "
            f"{TORQUE_CONSTANT} = {{ value, unit = 'N m/A' }}, with the ratio of the gear."
        )
    if MotorTorque.column in table:
        raise DataError(f"{points_label}: {MOTOR_CURRENT} replaces {MotorTorque.column}; leave one of the two out.")
    by_ampere = number_si(constant, "N m/A", f"{where}: {TORQUE_CONSTANT}")
    if not 0.0 < by_ampere < math.inf:
        raise DataError(f"{where}: {TORQUE_CONSTANT} = {by_ampere:g} N m/A is not a positive number.")
    noise, stem = table_in(document, "noise", where), MOTOR_CURRENT.rpartition("_")[0]
    sd: Any = table.get(sd_column(MOTOR_CURRENT))
    sd = number_si(noise[stem], "A", f"{where}: noise of {stem}") if stem in noise else sd
    current = column(table[MOTOR_CURRENT], MOTOR_CURRENT, points_label, gaps=True)
    table = table.drop(columns=MOTOR_CURRENT).assign(**{MotorTorque.column: by_ampere * current})
    return table if sd is None else table.assign(**{sd_column(MotorTorque.column): abs(by_ampere) * sd})


def _with_slips(table: pd.DataFrame, where: str) -> pd.DataFrame:
    """Return the table of points with missing or infinite slips replaced by slips that follow from both speeds by Eq
    (1) of the paper.

    Such slips occur if a laboratory divided by the rim speed of a locked wheel, which is 0.
    """
    if not pd.api.types.is_numeric_dtype(table["slip"]):
        return table
    slip = table["slip"].to_numpy(dtype=float)
    # Only missing slips are computed; stated slips are kept.
    empty = ~np.isfinite(slip)
    if not empty.any() or not set(SPEEDS) <= set(table):
        if np.isinf(slip).any():
            row, columns = int(np.argmax(np.isinf(slip))) + 1, " and ".join(SPEEDS)
            advice = "by Eq (1), a locked wheel has slip -1, and a wheel that spins on the spot has slip 1"
            raise DataError(
                f"{where}: slip is infinite in row {row}; {advice}. Replace the infinite value by -1 or 1, or add the "
                f"columns {columns}."
            )
        return table
    travel, rim = (column(table[name], name, where, gaps=True) for name in SPEEDS)
    # Slip refers to the travel along the wheel's plane.
    angle = table[ANGLE].to_numpy(dtype=float) if ANGLE in table else 0.0
    converted = table.assign(slip=np.where(empty, slip_ratios(rim, travel * np.cos(angle)), slip))
    converted.attrs[OF_SPEEDS] = int(empty.sum())
    return converted


def stated_ranges(table: Mapping[str, Any], where: str) -> dict[str, tuple[float, float]]:
    """Return the ranges that rig.toml states for wheel sizes and soil constants: name -> (low, high) in SI.

    Only entries that state both ends of a range are returned.

    Parameters
    ----------
    table : mapping
        Entries of [wheel] and [soil]; `{ value = 62.5, low = 58, high = 62.5, unit = "mm" }` states a range.
    where : str
        Name of the file, for error messages.

    Raises
    ------
    ParameterError
        An unknown unit, or an entry without a number.
    DataError
        A range that does not contain its value.
    """
    ranges = {}
    for name, quantity in (quantities(Wheel) | quantities(Soil)).items():
        entry, place = table.get(name), f"{where}: {name}"
        # A range needs both ends; an SD alone is handled elsewhere.
        if isinstance(entry, Mapping) and {"low", "high"} <= entry.keys():
            unit = entry.get("unit", quantity.unit)
            low, value, high = (to_si(entry.get(end), unit, quantity.unit, place) for end in ("low", "value", "high"))
            if not low <= value <= high:
                raise DataError(f"{place} = {value:.4g} is not between its low = {low:.4g} and high = {high:.4g} [SI].")
            ranges[name] = (low, high)
    return ranges
