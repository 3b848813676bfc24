"""The numbers that a fit holds: what each is, where it is from, and within which range it may be wrong."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from rover_pin.contact import Soil, Wheel
from rover_pin.identification.one_sand import as_held, sand_of, sets_of
from rover_pin.identification.result import Held
from rover_pin.measurements.channel import Evidence
from rover_pin.measurements.known import ASSUMED, DECLARED_SD, SIZE_SD, UNDECLARED_SD, Known, range_of
from rover_pin.measurements.rig_file import BEKKER_UNITS
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.quantity import Record, quantities
from rover_pin.soil.stress import modulus

STATED = "its declared SD"
"""Where the range of a number is from whose SD the data state."""


class Doubt(NamedTuple):
    """SD that is assumed of a number that states none."""

    stated: float
    "of one that comes with the data: a bench test of this soil"
    otherwise: float
    "of one of another soil"
    relative: bool = False


DOUBTS = {
    "r": Doubt(SIZE_SD, SIZE_SD, relative=True),
    "b": Doubt(SIZE_SD, SIZE_SD, relative=True),
    "c": Doubt(DECLARED_SD, 300.0),
    "phi": Doubt(math.radians(2.0), math.radians(4.0)),
    "k": Doubt(DECLARED_SD, UNDECLARED_SD, relative=True),
    "k_1": Doubt(DECLARED_SD, UNDECLARED_SD, relative=True),
    "k_2": Doubt(DECLARED_SD, UNDECLARED_SD, relative=True),
    "n": Doubt(0.1, 0.3),
    "theta_1": Doubt(math.radians(2.0), math.radians(4.0)),
    "theta_2": Doubt(math.radians(2.0), math.radians(4.0)),
    "exit_ratio": Doubt(0.05, 0.1),
}
"""Assumed, as the loops take them; a relative one is of the logarithm, and a stated c's of its size."""


def held_numbers(
    data: Evidence | Sequence[WheelRig], soil: Soil, free: Sequence[str], said: Mapping[str, str] | None = None
) -> tuple[Held, ...]:
    """Return every number of wheel and soil that a fit of `free` holds, with its 95 % range.

    The range is the data's own where they state one, else 1.96 SDs of `DOUBTS`. Of one width only k_1 + k_2 b counts:
    where both are held they are one number; where one is free and the other 0, that is no assumption. Of several widths
    a 0 is one: that the modulus does, or does not, grow with the width. Sizes of several wheels that are stated alike
    are one number, others name their set.

    Parameters
    ----------
    said : mapping of str to str
        Name -> source of what the user has set.

    Raises
    ------
    DataError
        Sets that declare different values of one constant.
    """
    sets, sand = sets_of(data), sand_of(data)
    one_width = len({float(each.wheel.b) for each in sets}) == 1
    given = _Given(sand, soil, said or {}, sand.known, sand.declared_soil(soil), one_width)
    pressure = one_width and not {"k_1", "k_2"}.intersection(free)
    names = (name for name in quantities(Soil) if name not in free and not (pressure and name == "k_2"))
    of_soil = (given.pressure() if pressure and name == "k_1" and soil.k_2 else given.held(name) for name in names)
    sizes = [name for name in quantities(Wheel) if name not in free]
    if not isinstance(data, Sequence):
        return (*(given.held(name) for name in sizes), *of_soil)
    return (*_of_wheels(data, soil, sizes), *of_soil)


def _of_wheels(rigs: Sequence[WheelRig], soil: Soil, sizes: Sequence[str]) -> Iterator[Held]:
    """Yield the sizes of several wheels; one that not all have moves the wheels of those sets alone."""
    for size in sizes:
        rows = [(rig.name, _Given(rig, soil, {}, rig.known, soil, True).held(size)) for rig in rigs]
        for names, held in as_held(rows, len(rigs)):
            ends = [partial(_resized, rigs, names, size, end) for end in (held.low, held.high)]
            alike = ", every set's alike" if len(names) == len(rigs) else ""
            yield held._replace(source=f"{held.source}{alike}", ends=(ends[0], ends[1]))


def _resized(rigs: Sequence[WheelRig], names: Sequence[str], size: str, value: float) -> tuple[WheelRig, ...]:
    """Return sets, those of these names with another size of their wheel."""
    return tuple(
        dataclasses.replace(rig, wheel=rig.wheel.replace(**{size: value})) if rig.name in names else rig for rig in rigs
    )


@dataclass(frozen=True, eq=False)
class _Given:
    """What a fit is given of wheel and soil, and by whom: `own` is the soil as the data have it."""

    data: Evidence
    soil: Soil
    said: Mapping[str, str]
    known: Mapping[str, Known]
    own: Soil
    one_width: bool

    def held(self, name: str) -> Held:
        """Return one number as it is held."""
        record = self._record(name)
        value, about, known = float(getattr(record, name)), quantities(record)[name], self.known.get(name)
        if known is not None and self._is_datas(name):
            ends = ({name: known.low, **known.at_low}, {name: known.high, **known.at_high})
            return Held(
                name, about.unit, value, known.source, known.low, known.high, known.doubt, ends, known.doubt != ASSUMED
            )
        if name in ("k_1", "k_2") and not value:
            if self.one_width:
                return Held(name, about.unit, 0.0, self._source(name), 0.0, 0.0, "the other stands for k_1 + k_2 b")
            return self._none_of(name)
        low, high, doubt = self._range(name, value)
        low, high = max(low, about.low), min(high, about.high)
        ends = ({name: low}, {name: high})
        return Held(name, about.unit, value, self._source(name), low, high, doubt, ends, doubt == STATED)

    def pressure(self) -> Held:
        """Return k_1 + k_2 b, of which k_1 takes what moves."""
        value, wide = float(modulus(self.data.wheel, self.soil)), float(self.soil.k_2 * self.data.wheel.b)
        by = "k_2" if "k_2" in self.said else "k_1"
        low, high, doubt = self._range(by, value)
        ends = ({"k_1": low - wide}, {"k_1": high - wide})
        return Held("k_1 + k_2 b", "Pa", value, self._source(by), low, high, doubt, ends, doubt == STATED)

    def _none_of(self, name: str) -> Held:
        """Return a k_1 or k_2 of 0 under several widths; its other end is all of k_1 + k_2 b of the sand's set."""
        other, b = ("k_1" if name == "k_2" else "k_2"), float(self.data.wheel.b)
        most = float(modulus(self.data.wheel, self.soil)) / (b if name == "k_2" else 1.0)
        doubt = f"none or all of k_1 + k_2 b at b = {b:g} m: assumed"
        unit = quantities(self.soil)[name].unit
        return Held(name, unit, 0.0, self._source(name), 0.0, most, doubt, ({}, {name: most, other: 0.0}))

    def _record(self, name: str) -> Record:
        return self.data.wheel if name in quantities(self.data.wheel) else self.soil

    def _is_datas(self, name: str) -> bool:
        """Return whether the fit holds the number at what the data say of it."""
        own = self.data.wheel if name in quantities(self.data.wheel) else self.own
        held = float(getattr(self._record(name), name))
        return name not in self.said and math.isclose(float(getattr(own, name)), held)

    def _is_declared(self, name: str) -> bool:
        """Return whether the data declare it, k_1 and k_2 also by k_c and k_phi."""
        names = BEKKER_UNITS.keys() if name in ("k_1", "k_2") and name not in self.data.declared else {name}
        return self._is_datas(name) and self.data.declared.keys() >= names

    def _range(self, name: str, value: float) -> tuple[float, float, str]:
        """Return the 95 % range of a value, and where it is from."""
        about, declared = DOUBTS[name], self._is_declared(name)
        if declared and name in self.data.doubts:
            sd = self.data.doubts[name]
            return *range_of(value, sd / abs(value) if about.relative else sd, about.relative), STATED
        if not declared and name not in self.said and name in quantities(self.soil):
            return *range_of(value, about.otherwise, about.relative), "assumed of another soil's"
        return *range_of(value, about.stated * (value if name == "c" else 1.0), about.relative), ASSUMED

    def _source(self, name: str) -> str:
        record = self._record(name)
        if name in self.said:
            return self.said[name]
        if self._is_declared(name):
            return "declared with the data"
        default = next(field.default for field in dataclasses.fields(record) if field.name == name)
        if getattr(record, name) == default:
            return quantities(record)[name].source
        return "of the data's wheel" if record is self.data.wheel else "as given"
