"""The paper's traction: the normal force by Eqs (4) and (6), and F(S) times that force as the tangential force."""

from dataclasses import dataclass, field
from typing import ClassVar

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import GrossTraction, NetTraction, TorqueTraction, wheel_forces

NODES = 12
"""Number of quadrature nodes for the integrals of the stresses in the simulator. The relative error is 1e-6 near Table
1, compared with 1e-9 for the default of the equations."""


@dataclass(frozen=True)
class SoilTraction(Effect):
    """The soil carries and drives the wheel by the paper's equations: f_n by Eqs (4)-(6) at the sinkage h, then f_t and
    torque as ratios to f_n.

        f_t = F(S) f_n,   torque = M(S) r f_n,   M = T / (r f_n)

    T is the torque of the shear stress. `form` selects the traction factor F (net: Eq 7 / Eq 6; torque: T / (r f_n);
    gross: thrust / f_n). `angles` selects whether F and M are taken at the paper's fixed angles or at the angles of the
    sinkage. Only `NetTraction` with `SinkageAngles` contains the resistance of a deeper rut; with the other choices, a
    deeper sinkage adds no resistance, except for the resistance that `SlipSinkage` and similar effects add. The pull of
    a braked wheel never does more work than the torque provides (`soil.wheel_forces.paid_for`), so that the soil gives
    no work.

    Source: the paper, sections 3.2 and 3.3. Differs from the paper: nothing with NetTraction and FixedAngles.
    """

    title: ClassVar[str] = "traction of the soil"
    meaning: ClassVar[str] = "the soil carries and drives the wheel by the paper's equations"
    form: NetTraction | TorqueTraction | GrossTraction = field(default_factory=TorqueTraction)
    angles: FixedAngles | SinkageAngles = field(default_factory=FixedAngles)

    @property
    def leaves_compaction_out(self) -> bool:
        """Whether the traction factor F does not fall as a rut deepens, so that the traction law does not contain the
        resistance of a deeper rut.

        This holds for all choices of `form` and `angles` except `NetTraction` with `SinkageAngles`.
        """
        return not (isinstance(self.form, NetTraction) and isinstance(self.angles, SinkageAngles))

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with a mark (`Contact.uncompacted`). The mark states whether later effects must add the
        resistance of a deeper rut.
        """
        return contact._replace(uncompacted=float(self.leaves_compaction_out))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the load of the soil on one contact patch of a wheel: tangential force f_t, normal force f_n, and
        torque.
        """
        wheel, soil = contact.wheel, contact.soil
        sunk = wheel_forces(contact.S, *SinkageAngles().angles(contact.h, wheel, soil), wheel, soil, NODES)
        # The normal force is always taken at the sinkage; the ratios F and M follow the choice of angles.
        acting = sunk
        if isinstance(self.angles, FixedAngles):
            acting = wheel_forces(contact.S, *self.angles.angles(contact.h, wheel, soil), wheel, soil, NODES)
        # f_t and torque are ratios at the chosen angles times the normal force at the sinkage.
        f_t = self.form.factor(acting, wheel, contact.S) * sunk.f_n
        return Load(f_t=f_t, f_n=sunk.f_n, torque=acting.torque / acting.f_n * sunk.f_n)
