"""What is known of a number apart from the points that are fitted: its 95 % range, as stated or as assumed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from rover_pin.base.errors import DataError
from rover_pin.base.quantity import quantities, to_si
from rover_pin.contact import Soil, Wheel
from rover_pin.estimation.profile import NORMAL_95

DECLARED_SD, UNDECLARED_SD = 0.35, 0.7
"""Relative SD of a modulus that is declared without one (bench tests), or not at all: assumed, as in the loop."""

ASSUMED = "assumed of one stated without an SD"
"""Where a range is from that nobody stated."""

SIZE_SD = 0.01
"""Relative SD of a wheel's r or b that states none: assumed, as of a drive log's radii (`Sampling.wheel_error`)."""


class Known(NamedTuple):
    """A number that was measured, or declared, apart from the points [SI]."""

    source: str
    "where the value is from"
    low: float
    high: float
    range_source: str
    "where the range is from"
    at_low: Mapping[str, float] = MappingProxyType({})
    "what else the same measurement says where the number is at `low`"
    at_high: Mapping[str, float] = MappingProxyType({})


def range_of(value: float, sd: float, relative: bool = False) -> tuple[float, float]:
    """Return the 95 % range of a number by its SD, that of its logarithm where it is `relative`."""
    if not relative:
        return value - NORMAL_95 * sd, value + NORMAL_95 * sd
    low, high = sorted((value * math.exp(-NORMAL_95 * sd), value * math.exp(NORMAL_95 * sd)))
    return low, high


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
    for name, quantity in (quantities(Wheel) | quantities(Soil)).items():
        entry, place = table.get(name), f"{where}: {name}"
        if isinstance(entry, Mapping) and {"low", "high"} <= entry.keys():
            unit = entry.get("unit", quantity.unit)
            low, value, high = (to_si(entry.get(end), unit, quantity.unit, place) for end in ("low", "value", "high"))
            if not low <= value <= high:
                raise DataError(f"{place} = {value:.4g} is not between its low = {low:.4g} and high = {high:.4g} [SI].")
            ranges[name] = (low, high)
    return ranges


def declared_ranges(
    values: Mapping[str, float], ranges: Mapping[str, tuple[float, float]], sds: Mapping[str, float]
) -> dict[str, Known]:
    """Return declared numbers with the range that is stated, cut to 1.96 of a stated SD; of neither, that of a size."""
    known_ranges = {}
    for name, value in values.items():
        sd = sds.get(name, math.inf if name in ranges else SIZE_SD * value)
        (low, high), of_sd = ranges.get(name, (-math.inf, math.inf)), range_of(value, sd)
        low, high = max(low, of_sd[0]), min(high, of_sd[1])
        range_source = "its declared SD" if name in sds else "its declared range" if name in ranges else ASSUMED
        known_ranges[name] = Known("declared with the data", low, high, range_source)
    return known_ranges
