"""Several rig sets in one sand: what any of them declares of it holds for all, and what each has for itself."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from rover_pin.base.errors import DataError
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil
from rover_pin.measurements.rig_file import BEKKER_UNITS, BESIDE
from rover_pin.measurements.wheel_rig import WheelRig

T = TypeVar("T")

DECLARED_TOLERANCE = 1e-6
"""Share by which a constant that two sets declare may differ, and still be one: rounding of units."""

OF_SAND = (*quantities(Soil), *BEKKER_UNITS, *(name for name, of in BESIDE.items() if of.table == "soil"))
"""Names of what a set declares of the sand."""


def of_one_sand(rigs: Sequence[WheelRig]) -> WheelRig:
    """Return the set that stands for the sand of all: it declares whatever any of them does.

    It is the first whose wheel was pressed in, else the one that declares most: k_c and k_phi become k_1 and k_2 at its
    width. A range or an SD that is stated twice of one value is its own, else the first.

    Raises DataError: two sets of one name, or that declare different values of one constant.
    """
    names = [rig.name for rig in rigs]
    for name in (set_name for set_name in names if names.count(set_name) > 1):
        raise DataError(f"{name}: two sets have this name; give each its own, to tell whose numbers are meant.")
    stands = max(rigs, key=lambda rig: (bool(rig.trials), len(rig.declared)))
    declarations: dict[str, tuple[str, float]] = {}
    for rig in (stands, *rigs):
        for name, value in {**rig.declared, **_of_sand(rig.beside)}.items():
            first, former = declarations.setdefault(name, (rig.name, value))
            if not math.isclose(former, value, rel_tol=DECLARED_TOLERANCE):
                raise DataError(
                    f"{rig.name}: [soil] declares {name} = {value:.6g}, {first} {former:.6g} [SI]: one sand has one of "
                    "it; declare it alike, or in one of the sets alone."
                )
    return replace(
        stands,
        declared=_first([rig.declared for rig in (stands, *rigs)]),
        doubts=_first([rig.doubts for rig in (stands, *rigs)]),
        beside=_first([stands.beside, *(_of_sand(rig.beside) for rig in rigs)]),
        wheel_range=_first([stands.wheel_range, *(_of_sand(rig.wheel_range) for rig in rigs)]),
    )


def _of_sand(values: Mapping[str, T]) -> dict[str, T]:
    return {name: value for name, value in values.items() if name in OF_SAND}


def _first(tables: Sequence[Mapping[str, T]]) -> dict[str, T]:
    """Return all tables as one; of a name that several have the first counts."""
    return {name: value for table in reversed(tables) for name, value in table.items()}
