"""The model: a rover on a terrain of soils, its motors, and everything that pushes on it."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self, TypeVar

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.public import brief, public
from rover_pin.base.quantity import Record
from rover_pin.contact import Soil
from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect, SensorEffect, joints_called
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.slip import AlgebraicSlip, RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.simulation.compiled.suspension import joints_of, suspension_dofs
from rover_pin.simulation.model.built import built_ground, built_rover
from rover_pin.simulation.model.cruise import CRUISE_SLIP, default_resistance
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.section import DEEPEST
from rover_pin.terrain.terrain import Terrain

AnyEffect = Effect | MotorEffect | BodyEffect | SensorEffect
OneKind = TypeVar("OneKind", bound=AnyEffect)
BURIED = 0.5
"""Assumed: a wheel that stands half a radius deep pushes soil with its front, which Eqs (2)-(7) leave out."""
OWNERS = ("wheel", "channel", "joint")
"""Fields that say whose an effect is: a model may have one of a class for each."""


@brief
@public
@dataclass(frozen=True)
class Model:
    """Everything a drive needs besides its commands. Frozen: `having`, `without` and `replace` give new models.

    `soils[0]` is the ground; the terrain's ground index names the others. `slip` comes first of all effects but those
    on the speeds it is taken from. `sensor_effects` say how a log of the drive reads; the drive itself ignores them.

    Parameters
    ----------
    rover : Rover
        As `load_rover` gives it.
    terrain : Terrain
        The ground's height, and which soil lies where.
    soils : tuple of Soil
        One for each ground of the terrain.
    motor : Motor
        Of every wheel.
    slip : AlgebraicSlip or RelaxedSlip
        Eq (1) at once, or with the way a contact needs to take it up.
    effects, motor_effects, body_effects, sensor_effects : tuples
        What acts at a contact, in a motor, on the body, on what sensors read.
    gravity : float
        [m/s^2]
    buried : float
        Sinkage over wheel radius from which a wheel counts as buried and a drive ends.

    Raises
    ------
    ParameterError
        A number that is not allowed, a ground without a soil, or effects that do not go together.

    Examples
    --------
    >>> from rover_pin import scenario
    >>> from rover_pin.effects.slip_sinkage import SlipSinkage
    >>> plain = scenario("flat").model
    >>> sinking = plain.having(SlipSinkage(n_1=0.5))
    >>> len(sinking.effects) - len(plain.effects), sinking.without(SlipSinkage) == plain
    (1, True)
    """

    rover: Rover
    terrain: Terrain
    soils: tuple[Soil, ...]
    motor: Motor
    slip: AlgebraicSlip | RelaxedSlip = field(default_factory=RelaxedSlip)
    effects: tuple[Effect, ...] = ()
    motor_effects: tuple[MotorEffect, ...] = ()
    gravity: float = EARTH
    body_effects: tuple[BodyEffect, ...] = ()
    sensor_effects: tuple[SensorEffect, ...] = ()
    buried: float = BURIED

    def __post_init__(self) -> None:
        if not 0.0 < self.buried <= DEEPEST:
            raise ParameterError(
                f"buried = {self.buried:g} is not allowed: it must lie in (0, {DEEPEST:g}] wheel radii, "
                "beyond which the contact law is held."
            )
        if not 0.0 < self.gravity < 100.0:
            raise ParameterError(f"gravity = {self.gravity:g} m/s^2 is not allowed: it must lie in (0, 100) m/s^2.")
        used = self.terrain.ground_indices
        if max(used) >= len(self.soils):
            has = f"The terrain has ground of soil index {max(used)}, but the model has {len(self.soils)} soils"
            raise ParameterError(f"{has}; give one soil per index.")
        for effect in self.all_effects:
            if refusal := self.refusal(effect):
                raise ParameterError(refusal)

    @property
    def contact_effects(self) -> tuple[Effect, ...]:
        """All contact effects in the order in which they act."""
        first = tuple(effect for effect in self.effects if effect.before_slip)
        return (*first, self.slip, *(effect for effect in self.effects if not effect.before_slip))

    @property
    def rigid_differential(self) -> bool:
        """Whether the differential, if the rover has one, holds its rockers rigidly together."""
        return not any(effect.frees_differential for effect in self.body_effects)

    @property
    def built(self) -> Rover:
        """The rover as it is driven: under the model's gravity, with what its effects make it carry and lean."""
        changes = tuple((effect.ballast(), effect.rise()) for effect in self.body_effects)
        return built_rover(self.rover, float(self.gravity), changes)

    @property
    def ground(self) -> Terrain:
        """The terrain as it is driven: with what effects make it bend."""
        return built_ground(self.terrain, [effect.bend() for effect in self.body_effects])

    @property
    def wheel_share(self) -> float:
        """An equal share of the rover's weight for each wheel [N]."""
        return self.gravity * self.built.mass / len(self.rover.wheels)

    @property
    def all_effects(self) -> tuple[AnyEffect, ...]:
        """All effects: at the contact, in the motors, on the body, in the sensors."""
        return (*self.contact_effects, *self.motor_effects, *self.body_effects, *self.sensor_effects)

    def begin_at(self, x: float, y: float) -> Self:
        """Return the model as a drive meets it that begins with the base at x, y [m]."""
        if not self.body_effects:
            return self
        return dataclasses.replace(self, body_effects=tuple(effect.begin_at(x, y) for effect in self.body_effects))

    def refusal(self, effect: AnyEffect) -> str:
        """Return why this effect cannot act in the model's rover, or an empty string."""
        if isinstance(effect, BodyEffect):
            return _missing_part(effect, self.rover) or _unknown_joint(effect, joints_of(self.rover).names)
        owned = isinstance(effect, (MotorEffect, SensorEffect))
        return _unknown_wheel(effect, [wheel.name for wheel in self.rover.wheels]) if owned else ""

    @public
    def having(self, effect: AnyEffect) -> Self:
        """Return the model with this effect added, in the place of one of the same class and wheel or channel."""
        if isinstance(effect, (AlgebraicSlip, RelaxedSlip)):
            return dataclasses.replace(self, slip=effect)
        if isinstance(effect, MotorEffect):
            return dataclasses.replace(self, motor_effects=_having(self.motor_effects, effect))
        if isinstance(effect, BodyEffect):
            return dataclasses.replace(self, body_effects=_having(self.body_effects, effect))
        if isinstance(effect, SensorEffect):
            return dataclasses.replace(self, sensor_effects=_having(self.sensor_effects, effect))
        return dataclasses.replace(self, effects=_having(self.effects, effect))

    @public
    def without(self, kind: type[AnyEffect]) -> Self:
        """Return the model without the effects of this class; the slip stays."""
        return dataclasses.replace(
            self,
            effects=_without(self.effects, kind),
            motor_effects=_without(self.motor_effects, kind),
            body_effects=_without(self.body_effects, kind),
            sensor_effects=_without(self.sensor_effects, kind),
        )

    @public
    def effect(self, kind: type[Any]) -> Any:
        """Return the model's effect of this class, the first where there are several."""
        for effect in self.all_effects:
            if isinstance(effect, kind):
                return effect
        names = (type(effect).__name__ for effect in self.all_effects)
        raise ParameterError(f"The model has no effect {kind.__name__}: {closest(kind.__name__, names)}")

    def replace(self, **changes: Any) -> Self:
        """Return the model with these fields changed."""
        return dataclasses.replace(self, **changes)


def _missing_part(effect: BodyEffect, rover: Rover) -> str:
    """Return the refusal of an effect in a part that the rover has not."""
    missing = "the suspension's pivots" if effect.in_pivots and not suspension_dofs(rover) else ""
    if effect.frees_differential and rover.differential is None:
        missing = "a differential"
    name = type(effect).__name__
    return missing and f"{name} acts in {missing}, but rover '{rover.name}' has none: leave the effect out."


def _unknown_wheel(effect: Record, names: list[str]) -> str:
    """Return the refusal of an effect that belongs to a wheel, by number or by name, that the rover has not."""
    wheel = getattr(effect, "wheel", "")
    if isinstance(wheel, str) and wheel not in ("", *names):
        return f"{type(effect).__name__}: the rover has no wheel '{wheel}': {closest(wheel, names)}"
    if not isinstance(wheel, str) and not 0 <= wheel < len(names):
        return (
            f"{type(effect).__name__}: the rover has no wheel {wheel}: give one of 0 to {len(names) - 1}, in the order "
            f"{', '.join(names)}."
        )
    return ""


def _unknown_joint(effect: BodyEffect, names: Sequence[str]) -> str:
    """Return the refusal of an effect that belongs to a joint, or a pair of them, that the suspension has not."""
    joint = getattr(effect, "joint", "")
    if joints_called(joint, names) or not joint:
        return ""
    pairs = dict.fromkeys(name.rpartition("_")[0] or name for name in names)
    return f"{type(effect).__name__}: the suspension has no joint '{joint}': {closest(joint, [*names, *pairs])}"


def _having(present: tuple[OneKind, ...], effect: OneKind) -> tuple[OneKind, ...]:
    changed = [effect if same_place(entry, effect) else entry for entry in present]
    if not any(entry is effect for entry in changed):
        changed.append(effect)
    return tuple(changed)


def same_place(first: AnyEffect, second: AnyEffect) -> bool:
    """Return whether a model can have only one of the two: they are of a class and of one wheel or channel."""
    owners = [tuple(getattr(effect, name, None) for name in OWNERS) for effect in (first, second)]
    return type(first) is type(second) and owners[0] == owners[1]


def _without(present: tuple[OneKind, ...], kind: type[AnyEffect]) -> tuple[OneKind, ...]:
    return tuple(effect for effect in present if not isinstance(effect, kind))


def base_effects(soil: Soil, rover: Rover, traction: SoilTraction, gravity: float = EARTH) -> tuple[Effect, ...]:
    """Return the traction law, damping, the `default_resistance` of this soil, rover and gravity, side shear.

    The resistance is a number of `soil`: where the model's soil is changed later, `cruising` takes it anew. The
    net form holds its own compaction resistance, so it gets none.
    """
    if traction.form.name == "net":
        return (traction, NormalDamping(), SideShear())
    R = default_resistance(soil, rover, traction, gravity)
    return (traction, NormalDamping(), MotionResistance(R=R), SideShear())


def cruising(model: Model, S: float = CRUISE_SLIP) -> Model:
    """Return the model with the motion resistance at which it drives its flat ground at slip S [-]: R = F(S).

    Raises ParameterError: a slip at which the soil gives no pull or more than its load, or the net form, whose
    compaction resistance is part of F.
    """
    traction = model.effect(SoilTraction)
    if traction.form.name == "net":
        raise ParameterError(
            f"cruise_slip = {S:g}: the net form holds its own compaction resistance, so its slip on the flat follows "
            "from the soil: leave it out, or take form=torque or gross."
        )
    R = default_resistance(model.soils[0], model.rover, traction, model.gravity, S) if -1.0 < S <= 1.0 else -1.0
    if not 0.0 <= R <= 1.0:
        raise ParameterError(
            f"cruise_slip = {S:g}: no resistance R in [0, 1] makes the flat cruise there: give a slip in (-1, 1] at "
            "which the soil pulls; `rover-pin curve` draws F(S)."
        )
    present = [effect for effect in model.effects if isinstance(effect, MotionResistance)]
    return model.having((present[0] if present else MotionResistance()).replace(R=R))
