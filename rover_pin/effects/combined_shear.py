"""The shear of a wheel that also moves along its axle: one stress against one slip, that of the whole travel."""

from dataclasses import dataclass, field
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.effects.soil_traction import NODES
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.combined import combined_forces, sideways_ratio
from rover_pin.soil.slip import against_travel, pushed_aside
from rover_pin.soil.wheel_forces import GrossTraction, NetTraction, TorqueTraction, wheel_forces


@dataclass(frozen=True)
class CombinedShear(Effect):
    """f_y <- (1 - w) f_y - w r b int tau j_y / |j| dtheta, thrust and torque by tau j_x / |j|, |j|^2 = j_x^2 + j_y^2.

    tau = (c + sigma tan phi) (1 - exp(-|j| / k)) points against the displacement of each point of the rim
    (`combined_forces`), so the resultant keeps to Eq (3): side force takes thrust away, and a slipping wheel slides
    sideways easily. S and S_y become those over the whole travel (`against_travel`) for every effect, and are what is
    recorded; straight they are Eq (1). Pressing a rut costs only where the heading goes: its resistance falls by the
    share `pushed_aside`, to nothing for a wheel pushed along its axle. With w = 1 it replaces the side force of the
    effects before it (`SideShear`), per normal force as `SoilTraction` has it; where the angles follow the sinkage the
    shear's share of f_n changes too. The moment about the vertical is that of f_y along the contact. An effect on the
    stresses (`PeakStress`) keeps its own straight shear. `form` and `angles` are those of the model's `SoilTraction`.
    Source and what differs: `combined_forces`, `against_travel`. Differs from the paper: it has no side force.
    """

    title: ClassVar[str] = "combined shear"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "thrust and side force share one shear strength of the soil"
    share: Scalar = quantity(1.0, "", "1: this law, 0: that of the effects before it", 0.0, 1.0, "w")
    form: NetTraction | TorqueTraction | GrossTraction = field(default_factory=TorqueTraction)
    angles: FixedAngles | SinkageAngles = field(default_factory=FixedAngles)
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}
    holds: ClassVar[tuple[str, ...]] = ("SideShear",)

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with its slip over the whole travel."""
        S, S_y = against_travel(contact.S, contact.S_y, self.share)
        return contact._replace(S=S, S_y=S_y)

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the side force in place of what it was, and what it takes of the thrust."""
        wheel, soil, w = contact.wheel, contact.soil, self.share
        sideways = sideways_ratio(contact.S, contact.S_y)
        arc = self.angles.angles(contact.h, wheel, soil)
        straight = wheel_forces(contact.S, *arc, wheel, soil, NODES)
        sheared = combined_forces(contact.S, sideways, arc, wheel, soil, NODES)
        q = 1.0 if isinstance(self.angles, FixedAngles) else sheared.along.f_n / straight.f_n
        rut = sheared.along.compaction * pushed_aside(contact.S, contact.S_y)
        along = sheared.along._replace(f_t=sheared.along.f_t + rut)
        dF = self.form.factor(along, wheel, contact.S) - self.form.factor(straight, wheel, contact.S)
        dT = sheared.along.torque / sheared.along.f_n - straight.torque / straight.f_n
        grown = Load(*(w * (q - 1.0) * part for part in load))
        carried = w * q * load.f_n
        f_y = carried * sheared.f_y / sheared.along.f_n - w * q * load.f_y
        moment = carried * sheared.moment / sheared.along.f_n - w * q * load.moment_z
        return grown.plus(Load(carried * dF, f_y, 0.0, carried * dT, moment))
