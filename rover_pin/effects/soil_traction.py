"""The paper's traction: Eqs (4) and (6) give the normal force, F(S) times it the tangential force."""

from dataclasses import dataclass, field
from typing import ClassVar

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import GrossTraction, NetTraction, TorqueTraction, wheel_forces

NODES = 12
"""Quadrature nodes in the simulator: 1e-6 relative near Table 1, against 1e-9 for the equations' own default."""


@dataclass(frozen=True)
class SoilTraction(Effect):
    """f_n by Eqs (4)-(6) at the sinkage h, then f_t = F(S) f_n and torque = M(S) r f_n, M(S) = T / (r f_n).

    `form` says which ratio F is (net: Eq 7 / Eq 6; torque: T / (r f_n); gross: thrust / f_n), `angles` whether F and M
    are taken at the paper's fixed angles or at those of the sinkage. A deeper rut costs more in the net form with
    `SinkageAngles` alone; in the others sinking costs nothing but what `SlipSinkage` and its like add. Braking, no form
    pulls more than its torque pays for (`soil.wheel_forces.paid_for`): the soil gives no work.
    Source: the paper, sections 3.2 and 3.3. Differs from the paper: nothing with NetTraction and FixedAngles.
    """

    title: ClassVar[str] = "traction of the soil"
    meaning: ClassVar[str] = "the soil carries and drives the wheel by the paper's equations"
    form: NetTraction | TorqueTraction | GrossTraction = field(default_factory=TorqueTraction)
    angles: FixedAngles | SinkageAngles = field(default_factory=FixedAngles)

    @property
    def leaves_compaction_out(self) -> bool:
        """Whether F does not fall as a rut deepens: in all but the net form whose angles follow it."""
        return not (isinstance(self.form, NetTraction) and isinstance(self.angles, SinkageAngles))

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact that knows whether a deeper rut still has to be paid for."""
        return contact._replace(uncompacted=float(self.leaves_compaction_out))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return f_t, f_n and torque of the patch."""
        wheel, soil = contact.wheel, contact.soil
        sunk = wheel_forces(contact.S, *SinkageAngles().angles(contact.h, wheel, soil), wheel, soil, NODES)
        acting = sunk
        if isinstance(self.angles, FixedAngles):
            acting = wheel_forces(contact.S, *self.angles.angles(contact.h, wheel, soil), wheel, soil, NODES)
        f_t = self.form.factor(acting, wheel, contact.S) * sunk.f_n
        return Load(f_t=f_t, f_n=sunk.f_n, torque=acting.torque / acting.f_n * sunk.f_n)
