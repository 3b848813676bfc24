"""Model of several wheels in one sand: soil and effects are shared; wheel and reading errors belong to one data set."""

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
from rover_pin.experiments.wheel_rig.declared import LUGS
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.measurements.channel import RigErrors
from rover_pin.measurements.rig_file import BEKKER_UNITS, BESIDE
from rover_pin.measurements.rig_set import RigSet

SET_RECORDS = (("wheel", "wheel"), ("rig", "errors"))
"""Parts of a joint model that each data set has for itself: the word in the names of their parameters (as in
`set.wheel.r`), and the field of `SetRecords`."""


@dataclass(frozen=True)
class SetRecords:
    """Parts of a joint model that belong to one data set: its wheel, its reading errors, and its declared lug
    height.
    """

    wheel: Wheel
    errors: RigErrors
    "errors of the rig's readings"
    lugs: float | None
    "declared height of the wheel's lugs [m]; None if not declared"


@dataclass(frozen=True)
class JointModel:
    """Model of several wheels in one sand, with one soil and common effects for all data sets.

    Each wheel has the name of its data set. An effect of lugs acts under every wheel except a wheel that is declared to
    have no lugs. The lug height in the effect is the height of the highest lugs. For another wheel, it is reduced in
    proportion to the declared height of its lugs. `InterfaceFriction` is an effect of a smooth rim, so it acts under
    every wheel except a wheel that is declared to have lugs: between lugs, sand shears on sand.
    """

    soil: Soil
    effects: tuple[Effect, ...]
    parts: Mapping[str, SetRecords]
    """name of each data set -> its wheel, reading errors and lug height"""

    def having(self, effect: Effect) -> JointModel:
        """Return the model with one more effect. The effect acts under all wheels, after the effects that the model
        already has.
        """
        return dataclasses.replace(self, effects=(*self.effects, effect))

    @property
    def records(self) -> dict[str, Any]:
        """Mapping from names to the parts of the model that have numbers to fit.

        The names are "soil", the class name of each effect, and `set.wheel` and `set.rig` for each data set.
        """
        of_sets = {
            f"{name}.{kind}": getattr(part, field) for name, part in self.parts.items() for kind, field in SET_RECORDS
        }
        return {"soil": self.soil, **{type(effect).__name__: effect for effect in self.effects}, **of_sets}

    def with_record(self, owner: str, record: Any) -> JointModel:
        """Return the model with another part: `record` replaces the part named `owner`, which is a key of `records`."""
        if owner == "soil":
            return dataclasses.replace(self, soil=record)
        # Names with a dot belong to one data set, such as `set.wheel`; all others are classes of effects.
        name, _, kind = owner.rpartition(".")
        if name in self.parts:
            part = dataclasses.replace(self.parts[name], **{dict(SET_RECORDS)[kind]: record})
            return dataclasses.replace(self, parts={**self.parts, name: part})
        effects = tuple(record if type(effect).__name__ == owner else effect for effect in self.effects)
        return dataclasses.replace(self, effects=effects)

    def of(self, name: str) -> RigModel:
        """Return the model of the data set `name` alone.

        It has the shared soil, the wheel and the reading errors of the data set, and those effects that act under this
        wheel.
        """
        part, share, effects = self.parts[name], self.lug_share(name), []
        for effect in self.effects:
            # Heights of lugs among the effect's numbers; only effects of lugs have such numbers.
            heights = [height for height in LUGS if height in effect.neutral]
            acts = not part.lugs if isinstance(effect, InterfaceFriction) else part.lugs != 0.0 or not heights
            if acts:
                effects.append(effect.replace(**{height: getattr(effect, height) * share for height in heights}))
        return RigModel(part.wheel, self.soil, tuple(effects), part.errors)

    def lug_share(self, name: str) -> float:
        """Return the lug height of the data set `name`, divided by the largest lug height of all data sets.

        The ratio is 1 if the data set does not declare its lugs, and 0 if the data set declares that its wheel has no
        lugs.
        """
        # An undeclared height counts as that of the highest lugs.
        lugs = self.parts[name].lugs
        return lugs / max(part.lugs or 0.0 for part in self.parts.values()) if lugs else float(lugs is None)


T = TypeVar("T")

DECLARED_TOLERANCE = 1e-6
"""Maximum relative difference between two declarations of a constant that count as equal. Conversions of units cause
rounding errors."""

SAND_NUMBERS = (*quantities(Soil), *BEKKER_UNITS, *(name for name, of in BESIDE.items() if of.table == "soil"))
"""Names of the numbers about the sand that a data set can declare."""


def of_one_sand(rigs: Sequence[RigSet]) -> RigSet:
    """Return one of the data sets, completed by the declarations of all data sets about the sand that they share.

    The returned data set is the first one with pressing trials, or otherwise the one with most declarations. This
    choice matters because k_c and k_phi are converted to k_1 and k_2 at the width of its wheel. If several data sets
    state a range or an SD of one constant, the statement of the returned data set is used, and otherwise the first one.

    Raises
    ------
    DataError
        Two data sets declare different values of one constant. Or a density is declared and the data sets were tested
        under different gravity, although the model has only one weight of the sand.
    """
    # Gravity acts only on the weight of the sand, so different gravities matter only if a density is declared.
    weighed = [rig for rig in rigs if "bulk_density" in _first([rig.beside for rig in rigs])]
    for rig in weighed:
        if not math.isclose(rig.gravity, weighed[0].gravity, rel_tol=DECLARED_TOLERANCE):
            raise DataError(
                f"{rig.name}: gravity is {rig.gravity:g} m/s^2, but {weighed[0].gravity:g} m/s^2 for "
                f"{weighed[0].name}. A joint fit has one weight of the sand for all data sets: fit them one by one, or "
                "leave bulk_density out."
            )
    chosen = max(rigs, key=lambda rig: (bool(rig.trials), len(rig.declared)))
    # The first declaration of each constant is compared with all later ones.
    declarations: dict[str, tuple[str, float]] = {}
    for rig in (chosen, *rigs):
        for name, value in {**rig.declared, **_of_sand(rig.beside)}.items():
            first, former = declarations.setdefault(name, (rig.name, value))
            if not math.isclose(former, value, rel_tol=DECLARED_TOLERANCE):
                raise DataError(
                    f"{rig.name}: [soil] declares {name} = {value:.6g}, but {first} declares {former:.6g} [SI]. "
                    "One sand has one value: declare the same value in all sets, or declare it in one set only."
                )
    return replace(
        chosen,
        declared=_first([rig.declared for rig in (chosen, *rigs)]),
        doubts=_first([rig.doubts for rig in (chosen, *rigs)]),
        beside=_first([chosen.beside, *(_of_sand(rig.beside) for rig in rigs)]),
        wheel_range=_first([chosen.wheel_range, *(_of_sand(rig.wheel_range) for rig in rigs)]),
    )


def _of_sand(values: Mapping[str, T]) -> dict[str, T]:
    """Return those entries of a table of declarations that concern the sand."""
    return {name: value for name, value in values.items() if name in SAND_NUMBERS}


def _first(tables: Sequence[Mapping[str, T]]) -> dict[str, T]:
    """Return several tables merged into one. If several tables have a key, the value of the first one is taken."""
    return {name: value for table in reversed(tables) for name, value in table.items()}
