"""The shear of a wheel that also moves along its axle: one stress, shared by thrust and side force."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.effects.soil_traction import NODES
from rover_pin.quantity import quantity
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.combined import combined_forces, sideways_ratio
from rover_pin.soil.traction import GrossTraction, NetTraction, TorqueTraction, wheel_forces


@dataclass(frozen=True)
class CombinedShear(Effect):
    """f_y = -r b int tau j_y / |j| dtheta, and thrust and torque of tau j_x / |j|, |j|^2 = j_x^2 + (scale j_y)^2.

    tau = (c + sigma tan phi) (1 - exp(-|j| / k)) points against the displacement of each point of the rim
    (`combined_forces`), so the resultant keeps to Eq (3): side force takes thrust away, and a slipping wheel slides
    sideways easily. Added is the difference from straight running, per normal force as `SoilTraction` has it; an effect
    on the stresses (`PeakStress`) keeps its own straight shear. What the soil takes of the motion is never negative
    where the displacement and the speed of the rim have the same direction.
    `form` and `angles` must be those of the model's `SoilTraction`.
    Source and what differs: `combined_forces`. Differs from the paper: it has no side force.
    """

    scale: Scalar = quantity(1.0, "", "assumed: the soil shears across as it does along, k over its own k", 0.0, 5.0)
    form: NetTraction | TorqueTraction | GrossTraction = field(default_factory=TorqueTraction)
    angles: FixedAngles | SinkageAngles = field(default_factory=FixedAngles)
    neutral: ClassVar[dict[str, float]] = {"scale": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the side force, and what it takes of the thrust."""
        wheel, soil = contact.wheel, contact.soil
        sideways = self.scale * sideways_ratio(contact.S, contact.S_y)
        own = SinkageAngles().angles(contact.h, wheel, soil)
        straight = wheel_forces(contact.S, *own, wheel, soil, NODES)
        sheared = combined_forces(contact.S, sideways, own, wheel, soil, NODES)
        q = sheared.along.f_n / straight.f_n
        if isinstance(self.angles, FixedAngles):
            fixed = self.angles.angles(contact.h, wheel, soil)
            straight = wheel_forces(contact.S, *fixed, wheel, soil, NODES)
            sheared = combined_forces(contact.S, sideways, fixed, wheel, soil, NODES)
        dF = self.form.factor(sheared.along, wheel) - self.form.factor(straight, wheel)
        dT = sheared.along.torque / sheared.along.f_n - straight.torque / straight.f_n
        grown = Load(*((q - 1.0) * part for part in load))
        carried = q * load.f_n
        return grown.plus(Load(carried * dF, carried * sheared.f_y / sheared.along.f_n, 0.0, carried * dT))
