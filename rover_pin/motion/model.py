"""The model: a rover on a terrain of soils, its motors, and everything that pushes on it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Self, TypeVar

from rover_pin.body.rover import Rover
from rover_pin.body.terrain import Terrain
from rover_pin.contact import Soil
from rover_pin.effects.effect import Effect, MotorEffect
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.slip import AlgebraicSlip, RelaxedSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.errors import ParameterError, closest
from rover_pin.motion.motor import Motor
from rover_pin.parameters.gravity import EARTH
from rover_pin.soil.traction import load_traction_factor

AnyEffect = TypeVar("AnyEffect", Effect, MotorEffect)


@dataclass(frozen=True)
class Model:
    """Everything a drive needs besides its commands. Frozen: `having`, `without` and `replace` give new models.

    `soils[0]` is the ground; the terrain's ground index names the others. `slip` comes first of all effects.
    """

    rover: Rover
    terrain: Terrain
    soils: tuple[Soil, ...]
    motor: Motor
    slip: AlgebraicSlip | RelaxedSlip = field(default_factory=RelaxedSlip)
    effects: tuple[Effect, ...] = ()
    motor_effects: tuple[MotorEffect, ...] = ()
    gravity: float = EARTH

    def __post_init__(self) -> None:
        if not 0.0 < self.gravity < 100.0:
            raise ParameterError(f"gravity = {self.gravity:g} m/s^2 is not allowed: it must lie in (0, 100) m/s^2.")
        used = self.terrain.ground_indices
        if max(used) >= len(self.soils):
            raise ParameterError(
                f"The terrain has ground of soil index {max(used)}, but the model has {len(self.soils)} soils; "
                "give one soil per index."
            )

    @property
    def contact_effects(self) -> tuple[Effect, ...]:
        """All contact effects in the order in which they act."""
        return (self.slip, *self.effects)

    def having(self, effect: Effect | MotorEffect) -> Self:
        """Return the model with this effect added, in the place of one of the same class."""
        if isinstance(effect, (AlgebraicSlip, RelaxedSlip)):
            return dataclasses.replace(self, slip=effect)
        if isinstance(effect, MotorEffect):
            return dataclasses.replace(self, motor_effects=_having(self.motor_effects, effect))
        return dataclasses.replace(self, effects=_having(self.effects, effect))

    def without(self, kind: type[Effect] | type[MotorEffect]) -> Self:
        """Return the model without the effects of this class."""
        return dataclasses.replace(
            self,
            effects=tuple(effect for effect in self.effects if not isinstance(effect, kind)),
            motor_effects=tuple(effect for effect in self.motor_effects if not isinstance(effect, kind)),
        )

    def effect(self, kind: type[Any]) -> Any:
        """Return the model's effect of this class."""
        for effect in (*self.contact_effects, *self.motor_effects):
            if isinstance(effect, kind):
                return effect
        names = [type(effect).__name__ for effect in (*self.contact_effects, *self.motor_effects)]
        raise ParameterError(f"The model has no effect {kind.__name__}: {closest(kind.__name__, names)}")

    def replace(self, **changes: Any) -> Self:
        """Return the model with these fields changed."""
        names = [each.name for each in dataclasses.fields(self)]
        for name in changes:
            if name not in names:
                raise ParameterError(f"Model has no field '{name}': {closest(name, names)}")
        return dataclasses.replace(self, **changes)


def _having(present: tuple[AnyEffect, ...], effect: AnyEffect) -> tuple[AnyEffect, ...]:
    changed = [effect if type(other) is type(effect) else other for other in present]
    if not any(each is effect for each in changed):
        changed.append(effect)
    return tuple(changed)


CRUISE_SLIP = 0.05
"""Assumed slip on the flat; the paper says that it 'stays near 0'."""
CRUISE_SPEED, CRUISE_DUTY = 0.05, 0.55
"""Paper, section 5: the test bed runs at 0.05 m/s in a steady state when the duty is 0.55."""


def base_effects(soil: Soil, rover: Rover, traction: SoilTraction) -> tuple[Effect, ...]:
    """Return the traction law, damping, the resistance that makes the flat cruise at CRUISE_SLIP, and side shear.

    The net form holds its own compaction resistance, so it gets none.
    """
    wheel = rover.wheels[0].wheel
    cruise = float(load_traction_factor(CRUISE_SLIP, soil, wheel, traction.form, traction.angles))
    resistance = () if traction.form.name == "net" else (MotionResistance(R=max(cruise, 0.0)),)
    return (traction, NormalDamping(), *resistance, SideShear())
