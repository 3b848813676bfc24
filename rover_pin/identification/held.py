"""The numbers that a fit holds: what each is, where it is from, and within which range it may be wrong."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rover_pin.contact import Soil
from rover_pin.identification.result import Held
from rover_pin.measurements.channel import FIELDS, Evidence
from rover_pin.measurements.known import ASSUMED, DECLARED_SD, SIZE_SD, UNDECLARED_SD, Known, range_of
from rover_pin.measurements.rig_file import BEKKER_UNITS
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
    data: Evidence, soil: Soil, free: Sequence[str], said: Mapping[str, str] | None = None
) -> tuple[Held, ...]:
    """Return every number of wheel and soil that a fit of `free` holds, with its 95 % range.

    The range is the data's own where they state one, else 1.96 SDs of `DOUBTS`. Of one width only k_1 + k_2 b counts:
    where both are held they are one number; where one is free and the other 0, that is no assumption.

    Parameters
    ----------
    said : mapping of str to str
        Name -> source of what the user has set.
    """
    given = _Given(data, soil, said or {}, data.known, data.declared_soil(soil))
    pressure = not {"k_1", "k_2"}.intersection(free)
    names = (name for name in FIELDS if name not in free and not (pressure and name == "k_2"))
    return tuple(given.pressure() if pressure and name == "k_1" and soil.k_2 else given.held(name) for name in names)


@dataclass(frozen=True, eq=False)
class _Given:
    """What a fit is given of wheel and soil, and by whom: `own` is the soil as the data have it."""

    data: Evidence
    soil: Soil
    said: Mapping[str, str]
    known: Mapping[str, Known]
    own: Soil

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
            return Held(name, about.unit, value, self._source(name), value, value, "the other stands for k_1 + k_2 b")
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
