"""The model of several wheels in one sand: soil and effects are shared, wheels and the rigs' errors are each set's."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rover_pin.contact import Soil, Wheel
from rover_pin.effects.effect import Effect
from rover_pin.effects.interface_friction import InterfaceFriction
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.presets import LUGS
from rover_pin.measurements.rig_errors import RigErrors

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
