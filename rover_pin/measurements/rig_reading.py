"""The wheel-rig set of a folder: runs with their noise and speeds, and what the folder leaves unsaid."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.quantity import declared_sds, record_from
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.channel import RIG_CHANNELS, RigChannel, SideForce
from rover_pin.measurements.checks import Finding, column
from rover_pin.measurements.known import stated_ranges
from rover_pin.measurements.pressed import declared_trials
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.measurements.rig_file import (
    ANGLE,
    OF_SPEEDS,
    OVER_LUGS,
    RIG_FILE,
    SLOPE,
    SPEEDS,
    declared_beside,
    declared_constants,
    number_si,
    read_rig_points,
    refuse_unknown_keys,
    rim_of,
)
from rover_pin.measurements.rig_set import STRAIGHT, RigSet
from rover_pin.soil.slip import STANDS, rim_and_travel, slip_ratios

OTHERS = ("slip", "load_N", "run", "level", ANGLE, SLOPE, "slope_sd_rad", *SPEEDS)
"""Columns of the points that are read besides the channels and their SDs."""
MIN_SIMILARITY = 0.7
"""Share of letters in common from which a column may be meant to be another, misspelt."""


def read_rig_set(folder: str | Path, trust: Trust = Trust()) -> RigSet:
    """Return the set of a folder: `rig.toml` and the `points.csv` it names, there unless `trust` allows more.

    The noise of a channel is `[noise]` of `rig.toml` (`<channel>` in a unit, or `<channel>_over_load`), else the column
    `<channel>_sd_<unit>`.

    Raises DataError: a missing file, column or noise; an unknown unit; values that are not finite, out of range, or
    look like percent or millimetres; speeds that contradict the slip.
    """
    folder = Path(folder)
    document, where = read_toml(folder / RIG_FILE), f"{folder.name}/{RIG_FILE}"
    if document.get("kind") != "wheel-rig":
        raise DataError(f"{where}: kind = {document.get('kind')!r} is not a wheel rig; write kind = 'wheel-rig'.")
    refuse_unknown_keys(document, where)
    tables = {name: table_in(document, name, where) for name in ("files", "wheel", "soil", "rig", "noise", "speed")}
    points_file = f"{folder.name}/{tables['files'].get('points', 'points.csv')}"
    try:
        dimensions, rim_share = rim_of(document, where)
        table = read_rig_points(folder, document, rim_share, trust)
        rig = {name: entry for name, entry in tables["rig"].items() if name != "note"}
        errors = record_from(RigErrors, rig, f"{where}: [rig]")
        error_sd = {f"rig.{name}": sd for name, sd in declared_sds(rig, RigErrors, f"{where}: [rig]").items()}
        data = RigSet(
            wheel=record_from(Wheel, dimensions, where),
            slip=table["slip"],
            load=table["load_N"],
            channels=_channels(table, tables["noise"], where),
            name=str(document.get("name", folder.name)),
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
        )
        speeds = _speeds(_stated_speeds(table, tables["speed"], where), data, points_file)
    except ParameterError as error:
        raise DataError(str(error)) from error
    unread = (
        *_misspelt_columns(table, points_file),
        *_askew(data),
        *_unsaid_radius(data, OVER_LUGS in tables["wheel"], where),
        *_of_speeds(table, points_file),
    )
    return replace(data, speeds=speeds, unread=unread)


def _slip_angles(table: pd.DataFrame, where: str) -> np.ndarray:
    """Return the angle between the wheel's plane and its travel [rad] of each run, 0 where none is given."""
    return column(table[ANGLE], ANGLE, where) if ANGLE in table else np.zeros(len(table))


def _channels(table: pd.DataFrame, noise: Mapping[str, Any], where: str) -> tuple[RigChannel, ...]:
    askew = (np.abs(_slip_angles(table, where)) > STRAIGHT).any()
    present = [kind for kind in RIG_CHANNELS if kind.column in table and (askew or not kind.is_sideways)]
    return tuple(
        kind(column(table[kind.column], kind.column, where, gaps=True), _sd(kind, table, noise, where))
        for kind in present
    )


def _sd(kind: type[RigChannel], table: pd.DataFrame, noise: Mapping[str, Any], where: str) -> Any:
    stem, _, suffix = kind.column.rpartition("_")
    if stem in noise:
        return number_si(noise[stem], kind.unit, f"{where}: noise of {stem}")
    if f"{stem}_over_load" in noise:
        share = number_si(noise[f"{stem}_over_load"], "", f"{where}: {stem}_over_load")
        return share * column(table["load_N"], "load_N", where)
    if f"{stem}_sd_{suffix}" in table:
        return table[f"{stem}_sd_{suffix}"]
    raise DataError(
        f"{where}: the noise of {stem} is not stated; write [noise] {stem} = {{ value, unit = '{kind.unit}' }}."
    )


def _stated_speeds(table: pd.DataFrame, declared: Mapping[str, Any], where: str) -> pd.DataFrame:
    """Return the table with the speeds of [speed], of the carriage and of the rim, where it has no such column."""
    declared_speeds = {
        name: number_si(declared[key], "m/s", f"{where}: [speed] {key}")
        for name, key in zip(SPEEDS, ("carriage", "rim"), strict=True)
        if key in declared and name not in table
    }
    return table.assign(**declared_speeds)


def _speeds(table: pd.DataFrame, data: RigSet, where: str) -> np.ndarray | None:
    """Return the speeds of travel along the wheel's plane and of the rim [runs, 2], or None where neither is known.

    Of one alone the other follows from Eq (1). Refuses speeds that contradict the slip.
    """
    slip, angle = data.slip, data.slip_angle
    measured_speeds = {name: column(table[name], name, where) for name in SPEEDS if name in table}
    if not measured_speeds:
        return None
    if len(measured_speeds) == 1:
        return _by_slip(measured_speeds, slip, angle, where)
    travel, rim = measured_speeds[SPEEDS[0]] * np.cos(angle), measured_speeds[SPEEDS[1]]
    S = slip_ratios(rim, travel)
    # locked and pushed along its axle, a wheel has any slip
    rolls = np.maximum(np.abs(travel), np.abs(rim)) > STANDS * np.abs(measured_speeds[SPEEDS[0]])
    off = np.where(rolls, np.abs(S - slip), 0.0)
    if off.max() > 0.05:
        row = int(off.argmax())
        raise DataError(
            f"{where}: row {row + 1} has slip {slip[row]:.3g}, but its speeds give {S[row]:.3g} by Eq (1); check the "
            "units and signs of slip, rim_speed_mps and travel_speed_mps."
        )
    return np.column_stack([travel, rim])


def _by_slip(measured_speeds: Mapping[str, np.ndarray], slip: np.ndarray, angle: np.ndarray, where: str) -> np.ndarray:
    """Return both speeds [runs, 2], of which one is known, by Eq (1)."""
    ((name, speed),) = measured_speeds.items()
    rim, travel = rim_and_travel(slip)
    speed, share = (speed * np.cos(angle), travel) if name == SPEEDS[0] else (speed, rim)
    if np.min(share) < STANDS:
        row = int(np.argmin(share))
        raise DataError(
            f"{where}: row {row + 1} has slip {slip[row]:.3g}, at which {name} is 0 and does not tell the other speed; "
            "give columns of both."
        )
    return np.column_stack([travel, rim]) * (speed / share)[:, None]


def _misspelt_columns(table: pd.DataFrame, where: str) -> Iterator[Finding]:
    """Yield columns that are not read and are spelt nearly as one that is not there."""
    present = [str(name) for name in table.columns]
    channels = [kind.column for kind in RIG_CHANNELS]
    missing = [name for name in (*OTHERS, *channels) if name not in present]
    noises = ["_sd_".join(name.rsplit("_", 1)) for name in channels]
    for name in (column_name for column_name in present if column_name not in (*OTHERS, *channels, *noises)):
        similarity = {expected: SequenceMatcher(None, name.lower(), expected.lower()).ratio() for expected in missing}
        closest_match = max(similarity, key=lambda expected: similarity[expected], default="")
        if closest_match and similarity[closest_match] >= MIN_SIMILARITY:
            todo = f"did you mean '{closest_match}', in SI? rename it, else what it holds is not used"
            yield Finding(f"column '{name}' is not read", where, todo)


def _askew(data: RigSet) -> Iterator[Finding]:
    askew = data.askew
    if askew.any() and not any(isinstance(channel, SideForce) for channel in data.channels):
        most = math.degrees(float(np.abs(data.slip_angle).max()))
        what = f"{int(askew.sum())} of {askew.size} runs have a slip angle, of {most:.3g} deg at most"
        yield Finding(what, data.points_file, f"their side force was not measured: give it as {SideForce.column}")


def _unsaid_radius(data: RigSet, is_declared: bool, where: str) -> Iterator[Finding]:
    """Yield that a wheel with lugs does not say over what its radius is measured: at S = 0 its lugs slip or do not."""
    if data.beside.get("lug_height") and not is_declared:
        todo = (
            f"r, slip and rim speed are taken as the rim's, whose lugs slip at S = 0; write {OVER_LUGS} = true or false"
        )
        yield Finding(f"lug_height without {OVER_LUGS}", where, todo)


def _of_speeds(table: pd.DataFrame, where: str) -> Iterator[Finding]:
    """Yield how many runs have the slip of their speeds, as a locked wheel may have none in its table."""
    if table.attrs.get(OF_SPEEDS):
        message = f"{table.attrs[OF_SPEEDS]} of {len(table)} runs have no finite slip"
        yield Finding(message, where, "it follows from their speeds by Eq (1): -1 where the wheel is locked")
