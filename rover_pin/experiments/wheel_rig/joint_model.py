"""Model of several wheels in one sand: soil and effects are shared; wheel and reading errors belong to one data set."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from rover_pin.base.errors import DataError
from rover_pin.base.quantity import Record, quantities
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
    """Parts of a joint model that belong to one data set: its wheel, its reading errors, its declared lug height, and
    the weight of the sand under it.
    """

    wheel: Wheel
    errors: RigErrors
    "errors of the rig's readings"
    lugs: float | None
    "declared height of the wheel's lugs [m]; None if not declared"
    weight: float = 1.0
    """gravity at the test, divided by the gravity for which the numbers of the joint model hold [-]"""


@dataclass(frozen=True)
class JointModel:
    """Model of several wheels in one sand, with one soil and common effects for all data sets.

    Each wheel has the name of its data set. An effect of lugs acts under every wheel except a wheel that is declared to
    have no lugs. The lug height in the effect is the height of the highest lugs. For another wheel, it is reduced in
    proportion to the declared height of its lugs. `InterfaceFriction` is an effect of a smooth rim, so it acts under
    every wheel except a wheel that is declared to have lugs: between lugs, sand shears on sand.

    Data sets may be measured under different gravity. The numbers of the soil hold for one gravity. Under another
    gravity, the unit weight gamma and the pressure moduli k_1 and k_2 are multiplied by the ratio of both gravities.
    For dry sand of constant density and friction angle, the pressure under a wheel of width b at the sinkage h is p =
    gamma b f(h / b, phi), because no other quantity has the dimension of a pressure. Limit: a cohesion c carries load
    without weight, so that k_1 of a cohesive soil falls less.

    Source: dimensional analysis, as in Reece's (c k_c + gamma b k_phi) (h / b)^n, Proc. IMechE 180 (1965) 45; Kobayashi
    et al., J. Terramechanics 47 (2010) 261, and Wong and Kobayashi, J. Terramechanics 49 (2012) 349: in parabolic
    flights the sinkage of a wheel of given mass did not depend on the gravity.
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
                effects.append(_scaled(effect, {**dict.fromkeys(heights, share), **dict.fromkeys(WEIGHT, part.weight)}))
        soil = _scaled(self.soil, dict.fromkeys(MODULI, part.weight))
        return RigModel(part.wheel, soil, tuple(effects), part.errors)

    def lug_share(self, name: str) -> float:
        """Return the lug height of the data set `name`, divided by the largest lug height of all data sets.

        The ratio is 1 if the data set does not declare its lugs, and 0 if the data set declares that its wheel has no
        lugs.
        """
        # An undeclared height counts as that of the highest lugs.
        lugs = self.parts[name].lugs
        return lugs / max(part.lugs or 0.0 for part in self.parts.values()) if lugs else float(lugs is None)

    def share(self, name: str, parameter: str) -> float:
        """Return the ratio of a parameter of the data set `name` to this parameter of the joint model.

        The ratio differs from 1 for the heights of lugs, and under another gravity for the weight and the moduli of the
        sand. `parameter` is a name such as "soil.k_1".
        """
        quantity = parameter.rpartition(".")[2]
        if quantity in LUGS:
            return self.lug_share(name)
        return self.parts[name].weight if quantity in (*WEIGHT, *MODULI) else 1.0


WEIGHT, MODULI = ("gamma",), ("k_1", "k_2")
"""Names of the parameters that are proportional to gravity: the unit weight of the sand in effects, and the pressure
moduli of the soil."""

R = TypeVar("R", bound=Record)


def _scaled(record: R, ratios: Mapping[str, float]) -> R:
    """Return a part of a model with some of its numbers multiplied by the given ratios; names that it does not have are
    ignored.
    """
    present = {name: ratio for name, ratio in ratios.items() if ratio != 1.0 and name in quantities(record)}
    return record.replace(**{name: getattr(record, name) * ratio for name, ratio in present.items()})


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
    The soil constants hold for the gravity of the returned data set.

    Raises
    ------
    DataError
        Two data sets declare different values of one constant.
    """
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
