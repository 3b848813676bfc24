"""Read a wheel-rig data set from its folder: the runs, the noise, the speeds, and findings on facts that the files do
not state.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.encode import printable
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.quantity import declared_sd, declared_sds, record_from
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.channel import RIG_CHANNELS, MotorTorque, RigChannel, RigErrors, SideForce, sd_column
from rover_pin.measurements.checks import Finding, column
from rover_pin.measurements.pressed import declared_trials
from rover_pin.measurements.repeats import MIN_FREEDOM, level_numbers, repeat_groups, repeat_noise
from rover_pin.measurements.rig_file import (
    ANGLE,
    CONVERTED,
    GRAVITY,
    OF_MASSES,
    OF_SPEEDS,
    OVER_LUGS,
    RIG_FILE,
    SLOPE,
    SPEEDS,
    TORQUE_CONSTANT,
    declared_beside,
    declared_constants,
    declared_gravity,
    number_si,
    read_rig_points,
    refuse_unknown_keys,
    rim_of,
    stated_ranges,
)
from rover_pin.measurements.rig_set import STRAIGHT, RigSet
from rover_pin.soil.slip import STANDS, rim_and_travel, slip_ratios

OTHERS = ("slip", "load_N", "run", "level", ANGLE, SLOPE, "slope_sd_rad", *SPEEDS)
"""Names of the columns of points.csv that are read in addition to the channels and their SDs."""
OF_REPEATS = "noise of repeats"
"""Name of an attribute of a table of points: one text for each channel whose noise was estimated from repeated runs."""
MIN_SIMILARITY = 0.7
"""Minimum similarity of two names (difflib's ratio, from 0 to 1). Above this value, one name may be a misspelling of
the other name."""


def read_rig_set(folder: str | Path, trust: Trust = Trust()) -> RigSet:
    """Read a wheel-rig data set from its folder, with the file `rig.toml` and the points file that rig.toml names.

    The noise of a channel is stated in `[noise]` of `rig.toml`, as `<channel>` in the channel's unit or as
    `<channel>_over_load`, a fraction of the load. Otherwise the column `<channel>_sd_<unit>` of the points holds the
    noise. If neither states it, the noise is estimated from the scatter of repeated runs, and a finding reports this.

    Parameters
    ----------
    folder : path
        The folder of the data set.
    trust : Trust
        Allows files outside the folder; by default every file must lie in the folder.

    Raises
    ------
    DataError
        A missing file or column; a noise that is neither stated nor shown by repeated runs; an unknown unit; values
        that are not finite, are out of range, or look like percent or millimetres; speeds that contradict the slip.

    Examples
    --------
    >>> from rover_pin.base.files.paths import data_path
    >>> len(read_rig_set(data_path("cmu-smooth-wheel")).slip)
    15
    """
    folder = Path(folder)
    document, where = read_toml(folder / RIG_FILE), f"{folder.name}/{RIG_FILE}"
    if document.get("kind") != "wheel-rig":
        raise DataError(f"{where}: kind = {document.get('kind')!r} is no wheel rig: write kind = 'wheel-rig'.")
    refuse_unknown_keys(document, where)
    tables = {name: table_in(document, name, where) for name in ("files", "wheel", "soil", "rig", "noise", "speed")}
    points_file = f"{folder.name}/{tables['files'].get('points', 'points.csv')}"
    # A ParameterError of a record becomes a DataError, because its cause is in the files.
    try:
        dimensions, rim_share = rim_of(document, where)
        table = read_rig_points(folder, document, rim_share, trust)
        rig = {name: entry for name, entry in tables["rig"].items() if name not in ("note", TORQUE_CONSTANT)}
        errors = record_from(RigErrors, rig, f"{where}: [rig]")
        # Uncertain errors of the rig and uncertain sizes of the wheel are nuisance parameters of later fits.
        error_sd = {f"rig.{name}": sd for name, sd in declared_sds(rig, RigErrors, f"{where}: [rig]").items()}
        # An uncertain torque constant is an uncertain scale of the torque that follows from it.
        constant = tables["rig"].get(TORQUE_CONSTANT, 0.0)
        sd = declared_sd(constant, "N m/A", f"{where}: the sd of '{TORQUE_CONSTANT}'")
        if sd is not None and MotorTorque.column in table:
            by_ampere = number_si(constant, "N m/A", f"{where}: {TORQUE_CONSTANT}")
            error_sd.setdefault("rig.motor_torque_scale", sd / by_ampere)
        data = RigSet(
            wheel=record_from(Wheel, dimensions, where),
            slip=table["slip"],
            load=table["load_N"],
            channels=_channels(table, tables["noise"], where),
            name=printable(str(document.get("name", folder.name))),
            wheel_range=stated_ranges({**dimensions, **tables["soil"]}, where),
            declared=declared_constants(tables["soil"], where),
            levels=table["level"].to_numpy() if "level" in table else None,
            doubts=declared_sds(tables["soil"], Soil, where),
            slip_angle=_slip_angles(table, f"{folder.name}: the points"),
            errors=errors,
            error_sd=error_sd | {f"wheel.{name}": sd for name, sd in declared_sds(dimensions, Wheel, where).items()},
            trials=declared_trials(document, folder, where, trust),
            beside=declared_beside(document, where),
            runs=tuple(map(str, table["run"])) if "run" in table else (),
            source=str(document.get("source", "")),
            points_file=points_file,
            gravity=declared_gravity(document, where),
            gravity_is_assumed=GRAVITY not in document,
        )
        # Speeds are compared with the slips, so they are read after the set has checked these.
        # A constant speed in [speed] replaces a missing column of speeds.
        stated_speeds = {
            name: number_si(tables["speed"][key], "m/s", f"{where}: [speed] {key}")
            for name, key in zip(SPEEDS, ("carriage", "rim"), strict=True)
            if key in tables["speed"] and name not in table
        }
        speeds = _speeds(table.assign(**stated_speeds), data, points_file)
    except ParameterError as error:
        raise DataError(str(error)) from error
    unread = tuple(_reading_findings(table, data, OVER_LUGS in tables["wheel"], where, points_file))
    return replace(data, speeds=speeds, unread=unread)


def _slip_angles(table: pd.DataFrame, where: str) -> np.ndarray:
    """Return the slip angle of each run [rad] (runs,): the angle between the wheel's plane and its travel.

    If the table has no column of slip angles, all angles are 0.
    """
    return column(table[ANGLE], ANGLE, where) if ANGLE in table else np.zeros(len(table))


def _channels(table: pd.DataFrame, noise: Mapping[str, Any], where: str) -> tuple[RigChannel, ...]:
    """Return the measured channels (pull, torque, sinkage, ...) of a table of rig runs, each with its noise.

    Side force and vertical moment are omitted if no run has a slip angle. `noise` is the table [noise] of rig.toml.
    """
    # Side force and vertical moment are compared only in runs with a slip angle.
    askew = (np.abs(_slip_angles(table, where)) > STRAIGHT).any()
    present = [kind for kind in RIG_CHANNELS if kind.column in table and (askew or not kind.is_sideways)]
    return tuple(
        kind(column(table[kind.column], kind.column, where, gaps=True), _sd(kind, table, noise, where))
        for kind in present
    )


def _sd(kind: type[RigChannel], table: pd.DataFrame, noise: Mapping[str, Any], where: str) -> Any:
    """Return the SD of a rig channel, either as one number for all runs or as one value for each run.

    If [noise] of rig.toml states the SD, in the unit of the channel or as a fraction of the load, this value is taken.
    Otherwise the column with the SD of the channel is taken, and without this column the scatter of repeated runs.
    Raises DataError if the SD is stated nowhere and too few runs are repeated.
    """
    # The declaration in rig.toml precedes a column of SDs.
    stem = kind.column.rpartition("_")[0]
    if stem in noise:
        return number_si(noise[stem], kind.unit, f"{where}: noise of {stem}")
    if f"{stem}_over_load" in noise:
        share = number_si(noise[f"{stem}_over_load"], "", f"{where}: {stem}_over_load")
        return share * column(table["load_N"], "load_N", where)
    if sd_column(kind.column) in table:
        return table[sd_column(kind.column)]
    # Repeated runs show the noise of one run, including the difference between two preparations of the bed.
    slip = column(table["slip"], "slip", where)
    levels = level_numbers(slip, table["level"].to_numpy() if "level" in table else None)
    group = repeat_groups(levels, column(table["load_N"], "load_N", where), _slip_angles(table, where))
    scatter = repeat_noise(column(table[kind.column], kind.column, where, gaps=True), slip, group)
    if scatter is None:
        raise DataError(
            f"{where}: the noise of {stem} is not stated, and fewer than {MIN_FREEDOM} values repeat others at the "
            f"same slip and load: write [noise] {stem} = {{ value, unit = '{kind.unit}' }}."
        )
    table.attrs.setdefault(OF_REPEATS, []).append(
        f"the noise of {stem} is not stated: {scatter.sd:.3g} {kind.unit} from the scatter of repeats with "
        f"{scatter.freedom} degrees of freedom"
    )
    return scatter.sd


def _speeds(table: pd.DataFrame, data: RigSet, where: str) -> np.ndarray | None:
    """Return the travel speed along the wheel's plane and the rim speed [m/s] of each run (runs, 2); None if both are
    unknown.

    If only one speed is known, the other follows from the slip ratio by Eq (1) of the paper. Raises DataError if both
    speeds are known and contradict the slip.
    """
    slip, angle = data.slip, data.slip_angle
    measured_speeds = {name: column(table[name], name, where) for name in SPEEDS if name in table}
    if not measured_speeds:
        return None
    if len(measured_speeds) == 1:
        # Eq (1) fixes the ratio of both speeds; the measured speed gives the scale. A speed of 0 at the slip of a run
        # does not determine the other speed.
        ((name, speed),) = measured_speeds.items()
        rim, travel = rim_and_travel(slip)
        speed, share = (speed * np.cos(angle), travel) if name == SPEEDS[0] else (speed, rim)
        if np.min(share) < STANDS:
            row = int(np.argmin(share))
            raise DataError(
                f"{where}: row {row + 1} has slip {slip[row]:.3g}. At this slip {name} is 0, so it does not determine "
                "the other speed: give columns of both speeds."
            )
        return np.column_stack([travel, rim]) * (speed / share)[:, None]
    # With both speeds, the slip is determined twice; a contradiction means a wrong unit or sign.
    travel, rim = measured_speeds[SPEEDS[0]] * np.cos(angle), measured_speeds[SPEEDS[1]]
    S = slip_ratios(rim, travel)
    # A locked wheel that is pushed along its axle neither rolls nor travels ahead, so its slip is undefined.
    rolls = np.maximum(np.abs(travel), np.abs(rim)) > STANDS * np.abs(measured_speeds[SPEEDS[0]])
    off = np.where(rolls, np.abs(S - slip), 0.0)
    if off.max() > 0.05:
        row = int(off.argmax())
        raise DataError(
            f"{where}: row {row + 1} has slip {slip[row]:.3g}, but its speeds give {S[row]:.3g} by Eq (1); check the "
            "units and signs of slip, rim_speed_mps and travel_speed_mps."
        )
    return np.column_stack([travel, rim])


def _reading_findings(
    table: pd.DataFrame, data: RigSet, radius_is_stated: bool, where: str, points_file: str
) -> Iterator[Finding]:
    """Yield findings on facts that the files do not state clearly, and on conversions that were made while reading.

    Parameters
    ----------
    table : DataFrame
        The points as read.
    data : RigSet
        The data set.
    radius_is_stated : bool
        Whether [wheel] of rig.toml states if the radius refers to the rim or to the tips of the lugs.
    where, points_file : str
        Names of the data set's `rig.toml` and of its points file, for the findings.
    """
    # A column that is not read, but whose name is similar to a missing column, is probably a misspelling.
    present = [str(name) for name in table.columns]
    channels = [kind.column for kind in RIG_CHANNELS]
    missing = [name for name in (*OTHERS, *channels) if name not in present]
    noises = [sd_column(name) for name in channels]
    for name in (column_name for column_name in present if column_name not in (*OTHERS, *channels, *noises)):
        similarity = {expected: SequenceMatcher(None, name.lower(), expected.lower()).ratio() for expected in missing}
        closest_match = max(similarity, key=lambda expected: similarity[expected], default="")
        if closest_match and similarity[closest_match] >= MIN_SIMILARITY:
            todo = f"did you mean '{closest_match}', in SI? rename it, otherwise its values are not used"
            yield Finding(f"column '{name}' is not read", points_file, todo)
    askew = data.askew
    # A slip angle without a side force leaves the lateral model undetermined.
    if askew.any() and not any(isinstance(channel, SideForce) for channel in data.channels):
        largest = math.degrees(float(np.abs(data.slip_angle).max()))
        what = f"{int(askew.sum())} of {askew.size} runs have a slip angle (maximum {largest:.3g} deg)"
        yield Finding(what, points_file, f"their side force was not measured: give it as {SideForce.column}")
    # If r is the radius of the rim, the lug tips slip even at S = 0, so the results depend on this assumption.
    if data.beside.get("lug_height") and not radius_is_stated:
        todo = (
            f"r, slip and rim speed are assumed to refer to the rim, so that the lug tips slip at S = 0; write "
            f"{OVER_LUGS} = true or false"
        )
        yield Finding(f"lug_height without {OVER_LUGS}", where, todo)
    if table.attrs.get(OF_SPEEDS):
        message = f"{table.attrs[OF_SPEEDS]} of {len(table)} runs have no finite slip"
        yield Finding(message, points_file, "their slip is computed from the speeds by Eq (1): -1 for a locked wheel")
    for what in table.attrs.get(OF_REPEATS, []):
        yield Finding(what, points_file, "state it in [noise] of rig.toml if it is known better")
    if CONVERTED in table.attrs:
        what = f"slips are converted to Eq (1) by slip_definition ({table.attrs[CONVERTED]})"
        yield Finding(what, points_file, "remove this key if the column already holds the slip of Eq (1)")
    if OF_MASSES in table.attrs and data.gravity_is_assumed:
        what = f"loads are load_kg times {data.gravity:g} m/s^2, the Earth's gravity, which is assumed"
        yield Finding(what, points_file, "declare gravity in rig.toml if the test was elsewhere")
