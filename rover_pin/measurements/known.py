"""What is known of a number apart from the points that are fitted: the range that is stated, the SD that is assumed."""

from collections.abc import Mapping
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.quantity import quantities, to_si
from rover_pin.contact import Soil, Wheel

DECLARED_SD, UNDECLARED_SD = 0.35, 0.7
"""Relative SD of a modulus that is declared without one (bench tests), or not at all: assumed, as in the loop."""

SIZE_SD = 0.01
"""Relative SD of a wheel's r or b that states none: assumed, as of a drive log's radii (`Sampling.wheel_error`)."""


def stated_ranges(table: Mapping[str, Any], where: str) -> dict[str, tuple[float, float]]:
    """Return name -> (low, high), in SI, of each size of the wheel or constant of the soil that states both.

    Raises ParameterError: an unknown unit, or no number.
    Raises DataError: a range that does not hold its value.
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
