"""The model of a drive: a rover on a terrain of soils, its motors, and all effects that act on it."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Self, TypeVar

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.public import brief, public
from rover_pin.contact import Soil
from rover_pin.effects.effect import BodyEffect, Effect, MotorEffect, SensorEffect, joints_called
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.slip import AlgebraicSlip, RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.parameters.gravity import EARTH
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import reach_of
from rover_pin.simulation.model.cruise import CRUISE_SLIP, default_resistance
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.state import joints_of, suspension_dofs
from rover_pin.terrain.edits import bend_terrain
from rover_pin.terrain.section import DEEPEST
from rover_pin.terrain.terrain import Terrain

AnyEffect = Effect | MotorEffect | BodyEffect | SensorEffect
OneKind = TypeVar("OneKind", bound=AnyEffect)
BURIED = 0.5
"""Default limit for a buried wheel (assumed): if a wheel sinks deeper than this fraction of its radius, it counts as
buried, and the drive ends. Reason: a wheel that has sunk by half its radius pushes soil with its front, which Eqs (2)
to (7) of the paper do not describe."""
Change = tuple[tuple[float, ...], tuple[float, ...]]
"""Change of the rover that one body effect states: the results of its methods `ballast` (additional mass and its
position) and `rise` (tilt of gravity)."""
Bend = tuple[tuple[float, ...], tuple[float, ...]]
"""Change of the ground that one body effect states by its method `bend`: positions along x [m], and the changes of the
height there [m]."""
OWNERS = ("wheel", "channel", "joint")
"""Names of the fields that state where in the rover an effect acts. A model can have several effects of one class only
if they differ in such a field."""


@brief
@public
@dataclass(frozen=True)
class Model:
    """Everything that a drive needs, except for its commands. A model is frozen: `having`, `without` and `replace`
    return new models.

    Parameters
    ----------
    rover : Rover
        The rover, from `load_rover`.
    terrain : Terrain
        Height of the ground, and the index of the soil, at each position.
    soils : tuple of Soil
        The soil for each ground index of the terrain; `soils[0]` is the usual ground.
    motor : Motor
        The motor of every wheel.
    slip : AlgebraicSlip or RelaxedSlip
        Law of the slip. With AlgebraicSlip, the slip follows Eq (1) of the paper at once; with RelaxedSlip, it
        approaches this value over a distance. It acts before all other contact effects, except for effects that change
        the speeds of the wheel.
    effects, motor_effects, body_effects, sensor_effects : tuples
        Effects at a contact, in a motor, on the body, and on the sensors' readings. A drive ignores the sensor effects:
        they change only the log that is made of the drive (`sensors.measure`).
    gravity : float
        Gravity [m/s^2].
    buried : float
        Limit for the sinkage divided by the wheel radius. A wheel that sinks deeper counts as buried, and the drive
        ends.

    Raises
    ------
    ParameterError
        A number is beyond its limits, a ground index has no soil, or an effect cannot act in this rover.

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
                f"buried = {self.buried:g} is not allowed: it is the sinkage divided by the wheel radius at which a "
                f"drive ends, and must lie in (0, {DEEPEST:g}], because the contact law fails beyond this depth."
            )
        if not 0.0 < self.gravity < 100.0:
            raise ParameterError(f"gravity = {self.gravity:g} m/s^2 is not allowed: it must lie in (0, 100) m/s^2.")
        # The terrain refers to soils by index.
        used = self.terrain.ground_indices
        if max(used) >= len(self.soils):
            has = f"The terrain has ground with the soil index {max(used)}, but the model has only {len(self.soils)}"
            raise ParameterError(f"{has} soils, whose indices begin at 0; give a soil for each index of the terrain.")
        for effect in self.all_effects:
            if refusal := self.refusal(effect):
                raise ParameterError(refusal)

    @property
    def contact_effects(self) -> tuple[Effect, ...]:
        """All contact effects, including the law of slip, in the order of their action."""
        first = tuple(effect for effect in self.effects if effect.before_slip)
        return (*first, self.slip, *(effect for effect in self.effects if not effect.before_slip))

    @property
    def rigid_differential(self) -> bool:
        """Whether the model treats a differential between the rockers as rigid. This is the case unless a body effect
        makes the differential compliant. The value has no meaning for a rover without a differential.
        """
        return not any(effect.frees_differential for effect in self.body_effects)

    @property
    def built(self) -> Rover:
        """The rover that a drive of this model uses: the model's rover under the model's gravity, with the additional
        masses and the tilt of gravity that body effects state.
        """
        changes = tuple((effect.ballast(), effect.rise()) for effect in self.body_effects)
        return built_rover(self.rover, float(self.gravity), changes)

    @property
    def ground(self) -> Terrain:
        """The terrain that a drive of this model uses: the model's terrain with the changes of height that body effects
        state.
        """
        return built_ground(self.terrain, [effect.bend() for effect in self.body_effects])

    @property
    def wheel_share(self) -> float:
        """The rover's weight divided by the number of its wheels [N]."""
        return self.gravity * self.built.mass / len(self.rover.wheels)

    @property
    def all_effects(self) -> tuple[AnyEffect, ...]:
        """All effects: at the contact, in the motors, on the body, in the sensors."""
        return (*self.contact_effects, *self.motor_effects, *self.body_effects, *self.sensor_effects)

    def begin_at(self, x: float, y: float) -> Self:
        """Return the model for a drive that begins with the base at x, y [m]. Body effects that depend on the start of
        the drive store this position; all else is equal.
        """
        if not self.body_effects:
            return self
        return dataclasses.replace(self, body_effects=tuple(effect.begin_at(x, y) for effect in self.body_effects))

    def refusal(self, effect: AnyEffect) -> str:
        """Return the reason why an effect cannot act in the model's rover, for example because the rover has no such
        wheel; an empty string if the effect can act.
        """
        # Effects on the body act in parts that not every rover has.
        if isinstance(effect, BodyEffect):
            missing = "the suspension's pivots" if effect.in_pivots and not suspension_dofs(self.rover) else ""
            if effect.frees_differential and self.rover.differential is None:
                missing = "a differential"
            if missing:
                name = type(effect).__name__
                return f"{name} acts in {missing}, but rover '{self.rover.name}' has none: leave the effect out."
            joint, names = getattr(effect, "joint", ""), joints_of(self.rover).names
            if joints_called(joint, names) or not joint:
                return ""
            # "bogie" names both bogies, "bogie_l" one of them.
            pairs = dict.fromkeys(name.rpartition("_")[0] or name for name in names)
            return f"{type(effect).__name__}: the suspension has no joint '{joint}': {closest(joint, [*names, *pairs])}"
        if isinstance(effect, Effect):
            return ""
        # Effects of motors and sensors name their wheel, either by its name or by its number.
        wheel, wheels = getattr(effect, "wheel", ""), [mount.name for mount in self.rover.wheels]
        if isinstance(wheel, str) and wheel not in ("", *wheels):
            return f"{type(effect).__name__}: the rover has no wheel '{wheel}': {closest(wheel, wheels)}"
        if not isinstance(wheel, str) and not 0 <= wheel < len(wheels):
            return (
                f"{type(effect).__name__}: the rover has no wheel {wheel}: give a number from 0 to {len(wheels) - 1}, "
                f"in the order {', '.join(wheels)}."
            )
        return ""

    @public
    def having(self, effect: AnyEffect) -> Self:
        """Return the model with this effect added.

        If the model already has an effect of this class and this owner (wheel, channel or joint of the effect), the new
        effect replaces it.
        """
        # The base class of an effect decides where it acts.
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
        """Return the model without the effects of this class. The law of slip is never removed, because every drive
        needs one.
        """

        def others(present: tuple[OneKind, ...]) -> tuple[OneKind, ...]:
            return tuple(effect for effect in present if not isinstance(effect, kind))

        return dataclasses.replace(
            self,
            effects=others(self.effects),
            motor_effects=others(self.motor_effects),
            body_effects=others(self.body_effects),
            sensor_effects=others(self.sensor_effects),
        )

    @public
    def effect(self, kind: type[Any]) -> Any:
        """Return the model's effect of this class; if there are several, the first of them.

        Raises ParameterError: the model has no effect of this class.
        """
        for effect in self.all_effects:
            if isinstance(effect, kind):
                return effect
        names = (type(effect).__name__ for effect in self.all_effects)
        raise ParameterError(f"The model has no effect {kind.__name__}: {closest(kind.__name__, names)}")

    def replace(self, **changes: Any) -> Self:
        """Return the model with some fields changed."""
        return dataclasses.replace(self, **changes)


@lru_cache(maxsize=64)
def built_rover(rover: Rover, gravity: float, changes: tuple[Change, ...]) -> Rover:
    """Return a rover under a gravity [m/s^2], with additional masses and tilts of gravity. `changes` holds the masses
    and tilts that each body effect states.

    Calls with equal arguments return one object, so that results that are stored for a rover (`rover_fields`) can be
    used for all its drives.
    """
    rover = rover.under(gravity)
    for ballast, rise in changes:
        rover = rover.carrying(*ballast) if any(ballast) else rover
        rover = rover.rising(*rise) if any(rise) else rover
    return rover


def built_ground(terrain: Terrain, bends: Sequence[Bend]) -> Terrain:
    """Return a terrain with changes of its height along x. `bends` holds the changes that each body effect states.
    Calls with equal arguments return one object, which can be a key of caches.

    Without such changes the terrain itself is returned, and the cache is not searched, because the search compares all
    heights of a dense grid, which takes the time of a short drive.
    """
    actual_bends = tuple(bend for bend in bends if bend[0])
    return _bent_ground(terrain, actual_bends) if actual_bends else terrain


@lru_cache(maxsize=64)
def _bent_ground(terrain: Terrain, bends: tuple[Bend, ...]) -> Terrain:
    """Return a terrain with the changes of height in `bends` added one after the other. The result is stored for later
    calls.
    """
    for x, rise in bends:
        terrain = bend_terrain(terrain, x, rise)
    return terrain


def _having(present: tuple[OneKind, ...], effect: OneKind) -> tuple[OneKind, ...]:
    """Return the effects `present` with the new effect `effect`. It replaces the effect of its class and owner if there
    is one, otherwise it is added at the end.
    """
    changed = [effect if same_place(entry, effect) else entry for entry in present]
    if not any(entry is effect for entry in changed):
        changed.append(effect)
    return tuple(changed)


def same_place(first: AnyEffect, second: AnyEffect) -> bool:
    """Return whether two effects exclude each other in a model, because their class and their owner (wheel, channel or
    joint) are equal.
    """
    owners = [tuple(getattr(effect, name, None) for name in OWNERS) for effect in (first, second)]
    return type(first) is type(second) and owners[0] == owners[1]


def base_effects(soil: Soil, rover: Rover, traction: SoilTraction, gravity: float = EARTH) -> tuple[Effect, ...]:
    """Return the contact effects of a usual model: traction, damping, motion resistance and side shear.

    The motion resistance is computed for `soil` (`default_resistance`). If the model's soil is changed later,
    `cruising` computes the resistance again. The traction form `net` already contains the compaction resistance, so no
    motion resistance is added to it.
    """
    if traction.form.name == "net":
        return (traction, NormalDamping(), SideShear())
    R = default_resistance(soil, rover, traction, gravity)
    return (traction, NormalDamping(), MotionResistance(R=R), SideShear())


def cruising(model: Model, S: float = CRUISE_SLIP) -> Model:
    """Return the model with the motion resistance R = F(S), so that its rover cruises on level ground at the slip S
    [-]. F is the traction factor (pull divided by load) of its soil.

    Raises
    ------
    ParameterError
        At this slip the soil gives no pull, or a pull above the load; or the traction form is `net`, whose traction
        factor already contains the compaction resistance.
    """
    traction = model.effect(SoilTraction)
    if traction.form.name == "net":
        raise ParameterError(
            f"cruise_slip = {S:g} cannot be used with form=net: this traction form already contains the compaction "
            "resistance, so that the slip on level ground follows from the soil. Leave cruise_slip out, or choose "
            "form=torque or form=gross."
        )
    # A slip outside (-1, 1] has no traction; it gets a resistance that the check below refuses.
    R = default_resistance(model.soils[0], model.rover, traction, model.gravity, S) if -1.0 < S <= 1.0 else -1.0
    if not 0.0 <= R <= 1.0:
        raise ParameterError(
            f"cruise_slip = {S:g} is not possible: the rover would cruise at this slip only with a motion resistance "
            "R outside [0, 1]. Give a slip in (-1, 1] at which the soil pulls the wheel forwards; `rover-pin curve` "
            "draws the pull divided by the load, F(S)."
        )
    # Replace the resistance of the model's present effect, or add the effect.
    present = [effect for effect in model.effects if isinstance(effect, MotionResistance)]
    return model.having((present[0] if present else MotionResistance()).replace(R=R))


def implausible(model: Model) -> tuple[str, ...]:
    """Return warnings about additional masses that a body effect puts at an impossible position. There is one sentence
    for each axis along which the base's centre of mass is moved outside the rover's bodies.
    """
    loads = [effect for effect in model.body_effects if any(effect.ballast())]
    if not loads:
        return ()
    names, (low, high) = " and ".join(type(effect).__name__ for effect in loads), reach_of(model.rover)
    # Joint 1 is the free base; its inertia includes the loads.
    place = model.built.model.inertias[1].lever
    return tuple(
        f"{names} puts the base's centre of mass at {axis} = {1e3 * centre:.0f} mm, outside the rover, whose bodies "
        f"reach from {1e3 * least:.0f} to {1e3 * most:.0f} mm along {axis}: the cause is not an added "
        "mass, or the URDF is wrong"
        for axis, centre, least, most in zip("xyz", place, low, high, strict=True)
        if not least <= centre <= most
    )
