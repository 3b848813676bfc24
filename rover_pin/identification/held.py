"""The numbers that a fit holds: what each is, where it is from, and within which range it may be wrong."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from rover_pin.base.quantity import Record, quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.identification.one_sand import as_held, sand_of, sets_of
from rover_pin.identification.result import Held
from rover_pin.measurements.channel import Evidence
from rover_pin.measurements.known import ASSUMED, DECLARED_SD, SIZE_SD, UNDECLARED_SD, Known, range_of
from rover_pin.measurements.rig_file import BEKKER_UNITS
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.soil.stress import modulus

STATED = "its declared SD"
"""Where the range of a number is from whose SD the data state."""


class AssumedSd(NamedTuple):
    """SD that is assumed of a number that states none."""

    declared: float
    "of one that comes with the data: a bench test of this soil"
    otherwise: float
    "of one of another soil"
    relative: bool = False


ASSUMED_SDS = {
    "r": AssumedSd(SIZE_SD, SIZE_SD, relative=True),
    "b": AssumedSd(SIZE_SD, SIZE_SD, relative=True),
    "c": AssumedSd(DECLARED_SD, 300.0),
    "phi": AssumedSd(math.radians(2.0), math.radians(4.0)),
    "k": AssumedSd(DECLARED_SD, UNDECLARED_SD, relative=True),
    "k_1": AssumedSd(DECLARED_SD, UNDECLARED_SD, relative=True),
    "k_2": AssumedSd(DECLARED_SD, UNDECLARED_SD, relative=True),
    "n": AssumedSd(0.1, 0.3),
    "theta_1": AssumedSd(math.radians(2.0), math.radians(4.0)),
    "theta_2": AssumedSd(math.radians(2.0), math.radians(4.0)),
    "exit_ratio": AssumedSd(0.05, 0.1),
}
"""Assumed, as the loops take them; a relative one is of the logarithm, and a stated c's of its size."""


def held_numbers(
    data: Evidence | Sequence[WheelRig], soil: Soil, free: Sequence[str], user_sources: Mapping[str, str] | None = None
) -> tuple[Held, ...]:
    """Return every number of wheel and soil that a fit of `free` holds, with its 95 % range.

    The range is the data's own where they state one, else 1.96 `ASSUMED_SDS`. Of one width only k_1 + k_2 b counts:
    where both are held they are one number; where one is free and the other 0, that is no assumption. Of several widths
    a 0 is one: that the modulus does, or does not, grow with the width. Sizes of several wheels that are stated alike
    are one number, others name their set.

    Parameters
    ----------
    user_sources : mapping of str to str
        Name -> source of what the user has set.

    Raises
    ------
    DataError
        Sets that declare different values of one constant.
    """
    sets, sand = sets_of(data), sand_of(data)
    one_width = len({float(evidence.wheel.b) for evidence in sets}) == 1
    inputs = _FitInputs(sand, soil, user_sources or {}, sand.known_ranges, sand.declared_soil(soil), one_width)
    pressure = one_width and not {"k_1", "k_2"}.intersection(free)
    names = (name for name in quantities(Soil) if name not in free and not (pressure and name == "k_2"))
    of_soil = (inputs.pressure() if pressure and name == "k_1" and soil.k_2 else inputs.fixed(name) for name in names)
    dimensions = [name for name in quantities(Wheel) if name not in free]
    if not isinstance(data, Sequence):
        return (*(inputs.fixed(name) for name in dimensions), *of_soil)
    return (*_of_wheels(data, soil, dimensions), *of_soil)


def _of_wheels(rigs: Sequence[WheelRig], soil: Soil, dimensions: Sequence[str]) -> Iterator[Held]:
    """Yield the sizes of several wheels; one that not all have moves the wheels of those sets alone."""
    for size in dimensions:
        rows = [(rig.name, _FitInputs(rig, soil, {}, rig.known_ranges, soil, True).fixed(size)) for rig in rigs]
        for names, fixed in as_held(rows, len(rigs)):
            ends = [partial(_resized, rigs, names, size, end) for end in (fixed.low, fixed.high)]
            scope = ", every set's alike" if len(names) == len(rigs) else ""
            yield fixed._replace(source=f"{fixed.source}{scope}", ends=(ends[0], ends[1]))


def _resized(rigs: Sequence[WheelRig], names: Sequence[str], size: str, value: float) -> tuple[WheelRig, ...]:
    """Return sets, those of these names with another size of their wheel."""
    return tuple(
        dataclasses.replace(rig, wheel=rig.wheel.replace(**{size: value})) if rig.name in names else rig for rig in rigs
    )


@dataclass(frozen=True, eq=False)
class _FitInputs:
    """What a fit is given of wheel and soil, and by whom: `data_soil` is the soil as the data have it."""

    data: Evidence
    soil: Soil
    user_sources: Mapping[str, str]
    known_ranges: Mapping[str, Known]
    data_soil: Soil
    one_width: bool

    def fixed(self, name: str) -> Held:
        """Return one number as it is held."""
        record = self._record(name)
        value, quantity, known_range = (
            float(getattr(record, name)),
            quantities(record)[name],
            self.known_ranges.get(name),
        )
        if known_range is not None and self._is_datas(name):
            ends = ({name: known_range.low, **known_range.at_low}, {name: known_range.high, **known_range.at_high})
            return Held(
                name,
                quantity.unit,
                value,
                known_range.source,
                known_range.low,
                known_range.high,
                known_range.range_source,
                ends,
                known_range.range_source != ASSUMED,
            )
        if name in ("k_1", "k_2") and not value:
            if self.one_width:
                return Held(name, quantity.unit, 0.0, self._source(name), 0.0, 0.0, "the other stands for k_1 + k_2 b")
            return self._none_of(name)
        low, high, range_source = self._range(name, value)
        low, high = max(low, quantity.low), min(high, quantity.high)
        ends = ({name: low}, {name: high})
        return Held(
            name, quantity.unit, value, self._source(name), low, high, range_source, ends, range_source == STATED
        )

    def pressure(self) -> Held:
        """Return k_1 + k_2 b, of which k_1 takes what moves."""
        value, wide = float(modulus(self.data.wheel, self.soil)), float(self.soil.k_2 * self.data.wheel.b)
        by = "k_2" if "k_2" in self.user_sources else "k_1"
        low, high, range_source = self._range(by, value)
        ends = ({"k_1": low - wide}, {"k_1": high - wide})
        return Held("k_1 + k_2 b", "Pa", value, self._source(by), low, high, range_source, ends, range_source == STATED)

    def _none_of(self, name: str) -> Held:
        """Return a k_1 or k_2 of 0 under several widths; its other end is all of k_1 + k_2 b of the sand's set."""
        counterpart, b = ("k_1" if name == "k_2" else "k_2"), float(self.data.wheel.b)
        most = float(modulus(self.data.wheel, self.soil)) / (b if name == "k_2" else 1.0)
        range_source = f"none or all of k_1 + k_2 b at b = {b:g} m: assumed"
        unit = quantities(self.soil)[name].unit
        return Held(name, unit, 0.0, self._source(name), 0.0, most, range_source, ({}, {name: most, counterpart: 0.0}))

    def _record(self, name: str) -> Record:
        return self.data.wheel if name in quantities(self.data.wheel) else self.soil

    def _is_datas(self, name: str) -> bool:
        """Return whether the fit holds the number at what the data say of it."""
        data_record = self.data.wheel if name in quantities(self.data.wheel) else self.data_soil
        fixed_value = float(getattr(self._record(name), name))
        return name not in self.user_sources and math.isclose(float(getattr(data_record, name)), fixed_value)

    def _is_declared(self, name: str) -> bool:
        """Return whether the data declare it, k_1 and k_2 also by k_c and k_phi."""
        names = BEKKER_UNITS.keys() if name in ("k_1", "k_2") and name not in self.data.declared else {name}
        return self._is_datas(name) and self.data.declared.keys() >= names

    def _range(self, name: str, value: float) -> tuple[float, float, str]:
        """Return the 95 % range of a value, and where it is from."""
        assumed_sd, declared = ASSUMED_SDS[name], self._is_declared(name)
        if declared and name in self.data.doubts:
            sd = self.data.doubts[name]
            return *range_of(value, sd / abs(value) if assumed_sd.relative else sd, assumed_sd.relative), STATED
        if not declared and name not in self.user_sources and name in quantities(self.soil):
            return *range_of(value, assumed_sd.otherwise, assumed_sd.relative), "assumed of another soil's"
        return *range_of(value, assumed_sd.declared * (value if name == "c" else 1.0), assumed_sd.relative), ASSUMED

    def _source(self, name: str) -> str:
        record = self._record(name)
        if name in self.user_sources:
            return self.user_sources[name]
        if self._is_declared(name):
            return "declared with the data"
        default = next(field.default for field in dataclasses.fields(record) if field.name == name)
        if getattr(record, name) == default:
            return quantities(record)[name].source
        return "of the data's wheel" if record is self.data.wheel else "as given"
