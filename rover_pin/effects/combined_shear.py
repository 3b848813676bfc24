"""Shear of a wheel that also moves along its axle: one shear stress, which depends on the slip of the whole travel."""

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
    """Thrust and side force share one shear strength of the soil: a side force reduces the thrust, and a slipping wheel
    slides sideways easily.

        tau = (c + sigma tan phi) (1 - exp(-|j| / k)),   |j|^2 = j_x^2 + j_y^2,
        f_y <- (1 - w) f_y - w r b int tau j_y / |j| dtheta,   thrust and torque with tau j_x / |j| likewise.

    (j_x, j_y) is the shear displacement of a point of the rim along and across the wheel
    (`soil.combined.combined_forces`). The stress tau opposes it, so that the resultant obeys Eq (3) (Mohr-Coulomb). The
    contact's slips S and S_y are replaced by the slips over the whole travel (`soil.slip.against_travel`), for every
    later effect and in the records; for straight travel these equal Eq (1). Compaction costs work only along the
    heading. The compaction resistance therefore falls by the fraction `soil.slip.pushed_aside`, to zero for a wheel
    that is pushed along its axle.

    With w = 1 this law replaces the side force of the effects before it (`SideShear`), for each newton of normal force
    as in `SoilTraction`. If the angles follow the sinkage, the contribution of the shear to f_n changes too. The moment
    about the vertical is the moment of f_y along the contact. An effect on the stresses (`PeakStress`) keeps its own
    straight shear. `form` and `angles` equal the form and the angles of the model's `SoilTraction`.

    Source and differences: `combined_forces`, `against_travel`. Differs from the paper: it has no side force.
    """

    title: ClassVar[str] = "combined shear"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "thrust and side force share one shear strength of the soil"
    share: Scalar = quantity(1.0, "", "1: this law, 0: the law of the effects before it", 0.0, 1.0, "w")
    form: NetTraction | TorqueTraction | GrossTraction = field(default_factory=TorqueTraction)
    angles: FixedAngles | SinkageAngles = field(default_factory=FixedAngles)
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}
    holds: ClassVar[tuple[str, ...]] = ("SideShear",)

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with slips that are computed from the whole travel of the wheel, sideways included,
        instead of the travel along its heading.
        """
        # Later effects and the records see these slips, so that one shear law holds for every direction of travel.
        S, S_y = against_travel(contact.S, contact.S_y, self.share)
        return contact._replace(S=S, S_y=S_y)

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the change of the wheel's load: a new side force in place of the earlier one, and the loss of thrust
        and torque.
        """
        wheel, soil, w = contact.wheel, contact.soil, self.share
        sideways = sideways_ratio(contact.S, contact.S_y)
        arc = self.angles.angles(contact.h, wheel, soil)
        # The load of the earlier effects belongs to straight shear, so that only the difference to combined shear is
        # added.
        straight = wheel_forces(contact.S, *arc, wheel, soil, NODES)
        sheared = combined_forces(contact.S, sideways, arc, wheel, soil, NODES)
        # Ratio of the normal forces with combined and with straight shear. Fixed angles leave the normal force
        # unchanged.
        q = 1.0 if isinstance(self.angles, FixedAngles) else sheared.along.f_n / straight.f_n
        # The compaction resistance acts along the heading only, so that its sideways fraction is added back to the
        # pull.
        rut = sheared.along.compaction * pushed_aside(contact.S, contact.S_y)
        along = sheared.along._replace(f_t=sheared.along.f_t + rut)
        # The changes of pull and torque for each newton of normal force.
        dF = self.form.factor(along, wheel, contact.S) - self.form.factor(straight, wheel, contact.S)
        dT = sheared.along.torque / sheared.along.f_n - straight.torque / straight.f_n
        # The effects before this one are scaled to the new normal force, then the changes of the force factors are
        # added.
        grown = Load(*(w * (q - 1.0) * part for part in load))
        carried = w * q * load.f_n
        f_y = carried * sheared.f_y / sheared.along.f_n - w * q * load.f_y
        moment = carried * sheared.moment / sheared.along.f_n - w * q * load.moment_z
        return grown.plus(Load(carried * dF, f_y, 0.0, carried * dT, moment))
