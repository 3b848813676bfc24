"""Wheel-rig sets: what a single wheel pulled, asked for and sank at given slips and loads, and their folders."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.public import brief
from rover_pin.base.quantity import declared_sds, quantities, record_from
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.channel import RIG_CHANNELS, RigChannel, Sinkage
from rover_pin.measurements.checks import column, depths, positive, same_length, slips
from rover_pin.measurements.known import stated_ranges
from rover_pin.measurements.pressed import Trial, declared_trials, exponent, stiffness
from rover_pin.measurements.rig_errors import RigErrors, dimension_sds, stated_errors
from rover_pin.measurements.rig_file import (
    ANGLE,
    BEKKER_UNITS,
    declared_beside,
    declared_constants,
    number_si,
    read_points,
    refuse_unknown_keys,
    rim_of,
)
from rover_pin.parameters.bekker import bekker

SAME_SLIP = 0.15
"""Slips that span less tell nothing that depends on slip."""
SAME_LOAD = 1.5
"""Loads within this ratio count as one: they move the share of c in the strength too little."""

STRAIGHT = 0.01
"""Slip angle [rad] up to which a wheel runs straight, and its side force is not looked at."""


@brief
@dataclass(frozen=True, eq=False)
class WheelRig:
    """Steady runs of one wheel at given slip ratios and loads.

    Parameters
    ----------
    slip : array [points]
        Slip ratio, Eq (1) [-].
    load : float or array [points]
        Vertical load [N].
    channels : tuple of RigChannel
        What was measured: `DrawbarPull`, `Torque`, `Sinkage`, `SideForce`, `VerticalMoment`, with the SD of one run.
    wheel_range : mapping
        name -> (low, high) of sizes of the wheel, or constants of the soil, that are known only so well.
    declared : mapping
        name -> value (SI) of soil constants that come with the data from another measurement.
    levels : array [points]
        Label of repeats, or None.
    doubts : mapping
        name -> SD (SI) that is declared with a constant of `declared`.
    slip_angle : float or array [points]
        Angle between heading and travel, positive to the wheel's right [rad].
    errors, error_sd : RigErrors and mapping
        What the rig adds to its readings, and `rig.name` or `wheel.name` -> SD of what is not sure.
    trials : tuple of Trial
        The same wheel pressed into the same soil without turning.
    beside : mapping
        name -> value (SI) of `rig_file.BESIDE` that is declared: lugs, density, angle of repose.

    Raises
    ------
    DataError
        Columns that are empty, of different lengths, not finite or out of range; a load that is not positive.
    """

    wheel: Wheel
    slip: Any = field(repr=False)
    load: Any = field(repr=False)
    channels: tuple[RigChannel, ...] = field(repr=False)
    name: str = "wheel rig"
    wheel_range: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    declared: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    levels: np.ndarray | None = field(default=None, repr=False)
    doubts: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    slip_angle: Any = field(default=0.0, repr=False)
    errors: RigErrors = field(default_factory=RigErrors)
    error_sd: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    trials: tuple[Trial, ...] = ()
    beside: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def __post_init__(self) -> None:
        slip = column(self.slip, "slip", self.name)
        load = column(np.atleast_1d(self.load), "load", self.name)
        load = np.full(slip.size, load[0]) if load.size == 1 else load
        if not self.channels:
            raise DataError(
                f"{self.name}: no channel was measured; give one of {', '.join(c.column for c in RIG_CHANNELS)}."
            )
        same_length(self.name, slip=slip, load=load, **{c.column: c.measured for c in self.channels})
        slips(slip, "slip", self.name)
        positive(load, "load", "N", self.name)
        for channel in self.channels:
            if isinstance(channel, Sinkage):
                depths(channel.measured, self.wheel.r, channel.column, self.name)
        object.__setattr__(self, "slip", slip)
        object.__setattr__(self, "load", load)
        angle = np.broadcast_to(np.asarray(self.slip_angle, dtype=float), slip.shape)
        object.__setattr__(self, "slip_angle", column(angle, ANGLE, self.name))

    @property
    def loads_vary(self) -> bool:
        """Whether the loads differ enough to tell what depends on them."""
        return bool(np.max(self.load) >= SAME_LOAD * np.min(self.load))

    @property
    def askew(self) -> np.ndarray:
        """Which runs have a slip angle [points]."""
        return np.abs(np.asarray(self.slip_angle)) > STRAIGHT

    @property
    def loads(self) -> np.ndarray:
        """Vertical loads [N]."""
        return np.asarray(self.load)

    def only(self, *kinds: type[RigChannel]) -> Self:
        """Return the set with these channels only."""
        return replace(self, channels=tuple(channel for channel in self.channels if isinstance(channel, kinds)))

    def rows(self, keep: Any) -> Self:
        """Return the set with these points only, chosen as NumPy chooses: a mask, indices or a slice.

        A channel of which none of these points has a value is left out.
        """
        channels = tuple(
            type(channel)(channel.measured[keep], channel.sd[keep])
            for channel in self.channels
            if channel.has_value[keep].any()
        )
        levels = None if self.levels is None else self.levels[keep]
        slip, load, angle = self.slip[keep], self.load[keep], self.slip_angle[keep]
        return replace(self, slip=slip, load=load, channels=channels, levels=levels, slip_angle=angle)

    def declared_soil(self, soil: Soil) -> Soil:
        """Return `soil` with what the data declare of it, Bekker's constants converted for this wheel's width.

        Where the wheel was pressed in, that tells k_1 + k_2 b, all put into k_1, and n unless it is declared.
        """
        constants = {name: value for name, value in self.declared.items() if name in quantities(Soil)}
        soil = soil.replace(**constants)
        if self.trials:
            n = self._pressed_n
            return soil.replace(n=n, k_1=stiffness(self.trials, self.wheel, n) * self.wheel.b**n, k_2=0.0)
        if not BEKKER_UNITS.keys() <= self.declared.keys():
            return soil
        k_1, k_2 = bekker(self.declared["k_c"], self.declared["k_phi"], soil.n, self.wheel.b)
        return soil.replace(k_1=k_1, k_2=k_2)

    @cached_property
    def _pressed_n(self) -> float:
        """The exponent at which the trials tell k_1: as declared, else the one that meets them best."""
        return self.declared["n"] if "n" in self.declared else exponent(self.trials, self.wheel)


def read_wheel_rig(folder: str | Path, trust: Trust = Trust()) -> WheelRig:
    """Return the wheel-rig set of a folder: `rig.toml` and the `points.csv` it names, there unless `trust` allows more.

    The noise of a channel is `[noise]` of `rig.toml` (`<channel>` in a unit, or `<channel>_over_load`), else the column
    `<channel>_sd_<unit>`.

    Raises DataError: a missing file, column or noise; an unknown unit; values that are not finite, out of range, or
    look like percent or millimetres.
    """
    folder = Path(folder)
    document = read_toml(folder / "rig.toml")
    where = f"{folder.name}/rig.toml"
    if document.get("kind") != "wheel-rig":
        raise DataError(f"{where}: kind = {document.get('kind')!r} is not a wheel rig; write kind = 'wheel-rig'.")
    refuse_unknown_keys(document, where)
    try:
        dimensions, rim_share = rim_of(document, where)
        table = read_points(folder, document, rim_share, trust)
        errors, error_sd = stated_errors(table_in(document, "rig", where), f"{where}: [rig]")
        return WheelRig(
            wheel=record_from(Wheel, dimensions, where),
            slip=table["slip"],
            load=table["load_N"],
            channels=_channels(table, table_in(document, "noise", where), where),
            name=str(document.get("name", folder.name)),
            wheel_range=stated_ranges({**dimensions, **table_in(document, "soil", where)}, where),
            declared=declared_constants(table_in(document, "soil", where), where),
            levels=table["level"].to_numpy() if "level" in table else None,
            doubts=declared_sds(table_in(document, "soil", where), Soil, where),
            slip_angle=slip_angles(table, f"{folder.name}: the points"),
            errors=errors,
            error_sd={**error_sd, **dimension_sds(dimensions, where)},
            trials=declared_trials(document, folder, where, trust),
            beside=declared_beside(document, where),
        )
    except ParameterError as error:
        raise DataError(str(error)) from error


def slip_angles(table: pd.DataFrame, where: str) -> np.ndarray:
    """Return the angle between the wheel's plane and its travel [rad] of each run, 0 where none is given."""
    return column(table[ANGLE], ANGLE, where) if ANGLE in table else np.zeros(len(table))


def _channels(table: pd.DataFrame, noise: Mapping[str, Any], where: str) -> tuple[RigChannel, ...]:
    askew = (np.abs(slip_angles(table, where)) > STRAIGHT).any()
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
