"""What a rig itself adds to its readings: tares, zeros, cross-talk, scales; none unless `rig.toml` states them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.errors import DataError
from rover_pin.measurements.channel import ASSUMED, WIDTH_95, Known
from rover_pin.quantity import Record, declared_sds, quantities, quantity, record_from, to_si

SIZE_SD = 0.01
"""Relative SD of a wheel's r or b that states none: assumed, as of a drive log's radii (`Sampling.wheel_error`)."""


@dataclass(frozen=True)
class RigErrors(Record):
    """What a rig reads of the forces f_t, f_y, the torque T and the sinkage h of a wheel under the load W.

    The wheel carries W' = s_W W. Read are s_f f_t + f_0 + x W', s_f f_y + f_y0, T + T_0 with T_0 the tare and the
    friction of bearing and seals, and h + h_0, a zero that is off, or a radius that is told over or under the lugs.
    Neutral is a rig without errors. What `rig.toml` states with an `sd` is a nuisance of every fit, with that prior;
    what it states without one is taken off as it is.
    Source: what rigs do; a constant 1.26 N m was 99 % of one measured set's torque residual.
    """

    torque_tare: Scalar = quantity(0.0, "N m", "none unless [rig] states it", -1e4, 1e4, "T_0")
    pull_tare: Scalar = quantity(0.0, "N", "none unless [rig] states it", -1e5, 1e5, "f_0")
    side_tare: Scalar = quantity(0.0, "N", "none unless [rig] states it", -1e5, 1e5, "f_y0")
    sinkage_zero: Scalar = quantity(0.0, "m", "none unless [rig] states it", -1.0, 1.0, "h_0")
    crosstalk: Scalar = quantity(0.0, "", "share of the load that the pull's cell shows: none", -0.5, 0.5, "x")
    load_scale: Scalar = quantity(1.0, "", "load over that stated: 1", 0.5, 2.0, "s_W")
    force_scale: Scalar = quantity(1.0, "", "reading over force: 1", 0.5, 2.0, "s_f")

    def read(self, pull: Scalar, torque: Scalar, h: Scalar, side: Scalar, load: Scalar) -> tuple[Scalar, ...]:
        """Return what the rig reads of pull [N], torque [N m], sinkage [m], side force [N] under the load W' [N]."""
        return (
            self.force_scale * pull + self.pull_tare + self.crosstalk * load,
            torque + self.torque_tare,
            h + self.sinkage_zero,
            self.force_scale * side + self.side_tare,
        )


def stated_errors(table: Mapping[str, Any], where: str) -> tuple[RigErrors, dict[str, float]]:
    """Return the errors of a table [rig], and `rig.name` -> SD of each that states one, in SI.

    Raises
    ------
    ParameterError
        An unknown name, unit or value.
    DataError
        An SD that is no positive number.
    """
    about = {name: entry for name, entry in table.items() if name != "note"}
    errors = record_from(RigErrors, about, where)
    return errors, {f"rig.{name}": sd for name, sd in declared_sds(about, RigErrors, where).items()}


def unsure_sizes(table: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return `wheel.name` -> SD [m] of each size of a table [wheel] that states one.

    Raises
    ------
    ParameterError
        An unknown unit.
    DataError
        An SD that is no positive number.
    """
    return {f"wheel.{name}": sd for name, sd in declared_sds(table, Wheel, where).items()}


def stated_ranges(table: Mapping[str, Any], where: str) -> dict[str, tuple[float, float]]:
    """Return name -> (low, high), in SI, of each size of the wheel or constant of the soil that states both.

    Raises
    ------
    ParameterError
        An unknown unit, or no number.
    DataError
        A range that does not hold its value.
    """
    ranges = {}
    for name, about in (quantities(Wheel) | quantities(Soil)).items():
        entry, place = table.get(name), f"{where}: {name}"
        if isinstance(entry, Mapping) and {"low", "high"} <= entry.keys():
            unit = entry.get("unit", about.unit)
            low, value, high = (to_si(entry.get(end), unit, about.unit, place) for end in ("low", "value", "high"))
            if not low <= value <= high:
                raise DataError(f"{place} = {value:.4g} is not between its low = {low:.4g} and high = {high:.4g} [SI].")
            ranges[name] = (low, high)
    return ranges


def declared_ranges(
    values: Mapping[str, float], ranges: Mapping[str, tuple[float, float]], sds: Mapping[str, float]
) -> dict[str, Known]:
    """Return declared numbers with the range that is stated, cut to 1.96 of a stated SD; of neither, that of a size."""
    known = {}
    for name, value in values.items():
        sd = sds.get(name, math.inf if name in ranges else SIZE_SD * value)
        low, high = ranges.get(name, (-math.inf, math.inf))
        low, high = max(low, value - WIDTH_95 * sd), min(high, value + WIDTH_95 * sd)
        doubt = "its declared SD" if name in sds else "its declared range" if name in ranges else ASSUMED
        known[name] = Known("declared with the data", low, high, doubt)
    return known
