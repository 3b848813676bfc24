"""The model of several wheels in one sand: soil and effects are shared, wheels and the rigs' errors are each set's."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from rover_pin.base.errors import DataError
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.effects.effect import Effect
from rover_pin.effects.interface_friction import InterfaceFriction
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.presets import LUGS
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.measurements.rig_file import BEKKER_UNITS, BESIDE
from rover_pin.measurements.rig_set import RigSet

OWN = (("wheel", "wheel"), ("rig", "errors"))
"""Records that each set has for itself, as parameters and as a `Part` name them."""


@dataclass(frozen=True)
class Part:
    """What is a set's own: its wheel, its rig's errors, and the height of its lugs [m], None if not declared."""

    wheel: Wheel
    errors: RigErrors
    lugs: float | None


@dataclass(frozen=True)
class JointModel:
    """One soil and one tuple of effects under several wheels, by the name of their set.

    An effect of lugs acts under all wheels but those that declare none; its height is that of the highest, and others
    have theirs in proportion. `InterfaceFriction`, of a smooth rim, acts under all wheels but those that declare lugs:
    between lugs sand shears on sand.
    """

    soil: Soil
    effects: tuple[Effect, ...]
    parts: Mapping[str, Part]

    def having(self, effect: Effect) -> JointModel:
        """Return the model with one more effect."""
        return dataclasses.replace(self, effects=(*self.effects, effect))

    @property
    def records(self) -> dict[str, Any]:
        """Soil and effects, and `set.wheel` and `set.rig` of each set, by name."""
        of_sets = {f"{name}.{kind}": getattr(part, field) for name, part in self.parts.items() for kind, field in OWN}
        return {"soil": self.soil, **{type(effect).__name__: effect for effect in self.effects}, **of_sets}

    def with_record(self, owner: str, record: Any) -> JointModel:
        """Return the model with another record of this name."""
        if owner == "soil":
            return dataclasses.replace(self, soil=record)
        name, _, kind = owner.rpartition(".")
        if name in self.parts:
            part = dataclasses.replace(self.parts[name], **{dict(OWN)[kind]: record})
            return dataclasses.replace(self, parts={**self.parts, name: part})
        effects = tuple(record if type(effect).__name__ == owner else effect for effect in self.effects)
        return dataclasses.replace(self, effects=effects)

    def of(self, name: str) -> RigModel:
        """Return the model of one set."""
        part, share = self.parts[name], self.lug_share(name)
        acting = (effect for effect in self.effects if _acts(effect, part.lugs))
        effects = (
            acting_effect.replace(
                **{height: getattr(acting_effect, height) * share for height in _heights(acting_effect)}
            )
            for acting_effect in acting
        )
        return RigModel(part.wheel, self.soil, tuple(effects), part.errors)

    def lug_share(self, name: str) -> float:
        """Return the height of a set's lugs over that of the highest; 1 where it is not declared."""
        lugs = self.parts[name].lugs
        return lugs / max(part.lugs or 0.0 for part in self.parts.values()) if lugs else float(lugs is None)


def _acts(effect: Effect, lugs: float | None) -> bool:
    """Return whether an effect acts under a wheel with lugs of this height, None where it is not declared."""
    return not lugs if isinstance(effect, InterfaceFriction) else lugs != 0.0 or not _heights(effect)


def _heights(effect: Effect) -> list[str]:
    """Return which numbers of an effect are heights of lugs."""
    return [name for name in LUGS if name in effect.neutral]


T = TypeVar("T")

DECLARED_TOLERANCE = 1e-6
"""Share by which a constant that two sets declare may differ, and still be one: rounding of units."""

OF_SAND = (*quantities(Soil), *BEKKER_UNITS, *(name for name, of in BESIDE.items() if of.table == "soil"))
"""Names of what a set declares of the sand."""


def of_one_sand(rigs: Sequence[RigSet]) -> RigSet:
    """Return the set that stands for the sand of all: it declares whatever any of them does.

    It is the first whose wheel was pressed in, else the one that declares most: k_c and k_phi become k_1 and k_2 at its
    width. A range or an SD that is stated twice of one value is its own, else the first.

    Raises DataError: two sets that declare different values of one constant.
    """
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
