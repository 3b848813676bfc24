"""A wheel-rig set as the loop needs it: runs with levels and speeds, and what was measured elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.public import brief
from rover_pin.base.quantity import quantities
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.measurements.channel import RIG_CHANNELS, SideForce
from rover_pin.measurements.checks import Finding, column
from rover_pin.measurements.pressed import ASSUMED_UNCERTAINTY, Trial
from rover_pin.measurements.rig_file import (
    ANGLE,
    BEKKER_UNITS,
    OF_SPEEDS,
    OVER_LUGS,
    SLOPE,
    SPEEDS,
    number_si,
    read_points,
    rim_of,
    slip_of_speeds,
)
from rover_pin.measurements.wheel_rig import WheelRig, read_wheel_rig

SAME_LEVEL = 0.02
"""Slips within this of their neighbour are one level where the data name none."""

STANDS = 1e-3
"""Share of the faster of rim and travel below which a speed stands still."""

RIG_FILE = "rig.toml"

FRICTION = ("phi", "FlankPressure.phi_f", "Ploughing.phi_f")
"""Numbers that are the friction of the sand, which its angle of repose bounds from below."""

OTHERS = ("slip", "load_N", "run", "level", ANGLE, SLOPE, "slope_sd_rad", *SPEEDS)
"""Columns of the points that are read besides the channels and their SDs."""

MIN_SIMILARITY = 0.7
"""Share of letters in common from which a column may be meant to be another, misspelt."""


class Independent(NamedTuple):
    """A soil constant known from another measurement: its range [SI] at a given exponent."""

    name: str
    unit: str
    low: float
    high: float
    source: str
    tolerance: float = ASSUMED_UNCERTAINTY
    "share of both ends that is granted"


@brief
@dataclass(frozen=True, eq=False)
class RigSet:
    """Runs of a wheel rig; `level` [runs] numbers the levels whose `level_names` are kept."""

    rig: WheelRig
    level: np.ndarray = field(repr=False)
    level_names: tuple[str, ...]
    runs: tuple[str, ...] = field(repr=False)
    speeds: np.ndarray | None = field(default=None, repr=False)
    source: str = ""
    misspelt: tuple[Finding, ...] = ()
    "columns that look like one that is missing, and what a set leaves unsaid"
    points_file: str = ""
    "what the runs were read from, where it is a file"

    def place(self, column_name: str) -> str:
        """Return where a column stands, as a finding says it."""
        return f"{self.points_file}: {column_name}" if self.points_file else column_name

    def rows(self, keep: Any) -> RigSet:
        """Return the set with these runs only."""
        level_names = np.array(self.level_names)[self.level[keep]]
        names, level = np.unique(level_names, return_inverse=True)
        order = np.argsort([np.mean(self.rig.slip[keep][level_names == name]) for name in names])
        place = np.argsort(order)
        return replace(
            self,
            rig=self.rig.rows(keep),
            level=place[level],
            level_names=tuple(map(str, names[order])),
            runs=tuple(np.array(self.runs)[keep]),
            speeds=None if self.speeds is None else self.speeds[keep],
        )

    def soil(self) -> Soil:
        """Return the soil as declared: what the data state, n from pressing the wheel in, the rest as Table 1 has it.

        One width tells k_1 + k_2 b only, so all of it is put into k_1.
        """
        soil = self.rig.declared_soil(Soil())
        return soil.replace(k_1=soil.k_1 + soil.k_2 * float(self.rig.wheel.b), k_2=0.0)

    @property
    def trials(self) -> tuple[Trial, ...]:
        """The same wheel pressed in without turning."""
        return self.rig.trials

    @property
    def rolled(self) -> RigSet:
        """The set without its pressings."""
        return replace(self, rig=replace(self.rig, trials=()))

    def independent(self, n: float) -> tuple[Independent, ...]:
        """Return what other measurements say of the soil, at the exponent n, and of the wheel's lugs.

        One width tells K_eff = (k_1 + k_2 b) / b^n; constants that are stated do at the n that goes with them.
        """
        constants = [
            Independent(name, quantities(Soil)[name].unit, value, value, "stated with the data")
            for name, value in self.rig.declared.items()
            if name in quantities(Soil) and name not in ("n", "k_1", "k_2")
        ]
        if {"k_1", *BEKKER_UNITS} & self.rig.declared.keys() and not self.trials and n == float(self.soil().n):
            K = float(self.soil().k_1) / float(self.rig.wheel.b) ** n
            constants.append(Independent("K_eff", "Pa/m^n", K, K, "stated with the data"))
        lugs = self.rig.beside.get("lug_height", 0.0)
        if lugs > 0.0:
            names = ("LugExcavation.h_l", "Grousers.h_s")
            constants += [Independent(name, "m", lugs, lugs, "lug_height of [wheel]") for name in names]
        if "angle_of_repose" in self.rig.beside:
            least, most = self.rig.beside["angle_of_repose"], quantities(Soil)["phi"].high
            source = "angle_of_repose: dry sand stands no steeper than its own friction; a smooth rim may slide on it"
            constants += [Independent(name, "rad", least, most, source, 0.0) for name in FRICTION]
        return tuple(constants)


def read_rig_set(folder: str | Path, trust: Trust = Trust()) -> RigSet:
    """Return the set of a folder with `rig.toml`, with levels, speeds and pressing trials where it has them.

    Raises DataError: what `read_wheel_rig` refuses; speeds that contradict the slip; a pressing file that cannot be
    read.
    """
    folder = Path(folder)
    rig, rig_table = read_wheel_rig(folder, trust), read_toml(folder / RIG_FILE)
    where = f"{folder.name}/{RIG_FILE}"
    table = read_points(folder, rig_table, rim_of(rig_table, where)[1], trust)
    points_file = f"{folder.name}/{table_in(rig_table, 'files', where).get('points', 'points.csv')}"
    speed_table = _stated_speeds(table, table_in(rig_table, "speed", where), where)
    speeds = _speeds(speed_table, rig.slip, np.asarray(rig.slip_angle), points_file)
    names = tuple(map(str, table["run"])) if "run" in table else tuple(f"run {i + 1}" for i in range(len(table)))
    data = as_rig_set(rig, names, speeds, str(rig_table.get("source", "")))
    declares_radius = OVER_LUGS in table_in(rig_table, "wheel", where)
    return replace(
        data,
        points_file=points_file,
        misspelt=(
            *_misspelt(table, points_file),
            *_askew(rig, points_file),
            *_unsaid(rig, declares_radius, where),
            *_of_speeds(table, points_file),
        ),
    )


def _of_speeds(table: pd.DataFrame, where: str) -> Iterator[Finding]:
    """Yield how many runs have the slip of their speeds, as a locked wheel may have none in its table."""
    if table.attrs.get(OF_SPEEDS):
        message = f"{table.attrs[OF_SPEEDS]} of {len(table)} runs have no finite slip"
        yield Finding(message, where, "it follows from their speeds by Eq (1): -1 where the wheel is locked")


def _unsaid(rig: WheelRig, is_declared: bool, where: str) -> Iterator[Finding]:
    """Yield that a wheel with lugs does not say over what its radius is measured: at S = 0 its lugs slip or do not."""
    if rig.beside.get("lug_height") and not is_declared:
        todo = (
            f"r, slip and rim speed are taken as the rim's, whose lugs slip at S = 0; write {OVER_LUGS} = true or false"
        )
        yield Finding(f"lug_height without {OVER_LUGS}", where, todo)


def _misspelt(table: pd.DataFrame, where: str) -> Iterator[Finding]:
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


def as_rig_set(rig: WheelRig, runs: tuple[str, ...] = (), speeds: np.ndarray | None = None, source: str = "") -> RigSet:
    """Return a `WheelRig` as a `RigSet`: its own levels, or classes of slip where it names none."""
    slip = np.asarray(rig.slip)
    labels = _classes(slip) if rig.levels is None else np.array([str(level) for level in rig.levels])
    names, level = np.unique(labels, return_inverse=True)
    order = np.argsort([slip[level == i].mean() for i in range(len(names))])
    place = np.argsort(order)
    runs = runs or tuple(f"run {i + 1}" for i in range(slip.size))
    return RigSet(rig, place[level], tuple(map(str, names[order])), runs, speeds, source)


def _classes(slip: np.ndarray) -> np.ndarray:
    order = np.argsort(slip)
    jumps = np.concatenate([[0], np.cumsum(np.diff(slip[order]) > SAME_LEVEL)])
    index = np.empty(slip.size, dtype=int)
    index[order] = jumps
    return np.array([f"S = {slip[index == i].mean():.2f}" for i in index])


def _askew(rig: WheelRig, where: str) -> Iterator[Finding]:
    askew = rig.askew
    if askew.any() and not any(isinstance(channel, SideForce) for channel in rig.channels):
        most = math.degrees(float(np.abs(rig.slip_angle).max()))
        what = f"{int(askew.sum())} of {askew.size} runs have a slip angle, of {most:.3g} deg at most"
        yield Finding(what, where, f"their side force was not measured: give it as {SideForce.column}")


def _stated_speeds(table: pd.DataFrame, declared: Mapping[str, Any], where: str) -> pd.DataFrame:
    """Return the table with the speeds of [speed], of the carriage and of the rim, where it has no such column."""
    declared_speeds = {
        name: number_si(declared[key], "m/s", f"{where}: [speed] {key}")
        for name, key in zip(SPEEDS, ("carriage", "rim"), strict=True)
        if key in declared and name not in table
    }
    return table.assign(**declared_speeds)


def _speeds(table: pd.DataFrame, slip: np.ndarray, angle: np.ndarray, where: str) -> np.ndarray | None:
    """Return the speeds of travel along the wheel's plane and of the rim [runs, 2], or None where neither is known.

    Of one alone the other follows from Eq (1). Refuses speeds that contradict the slip.
    """
    measured_speeds = {name: column(table[name], name, where) for name in SPEEDS if name in table}
    if not measured_speeds:
        return None
    if len(measured_speeds) == 1:
        return _by_slip(measured_speeds, slip, angle, where)
    travel, rim = measured_speeds[SPEEDS[0]] * np.cos(angle), measured_speeds[SPEEDS[1]]
    S = slip_of_speeds(travel, rim)
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
    rim, travel = 1.0 + np.minimum(slip, 0.0), 1.0 - np.maximum(slip, 0.0)
    speed, share = (speed * np.cos(angle), travel) if name == SPEEDS[0] else (speed, rim)
    if np.min(share) < STANDS:
        row = int(np.argmin(share))
        raise DataError(
            f"{where}: row {row + 1} has slip {slip[row]:.3g}, at which {name} is 0 and does not tell the other speed; "
            "give columns of both."
        )
    return np.column_stack([travel, rim]) * (speed / share)[:, None]
