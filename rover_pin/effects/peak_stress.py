"""The normal stress peaks in front of the axle, the further the more the wheel slips."""

from dataclasses import dataclass, field
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.effects.soil_traction import NODES
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.peak_stress import PeakAngle, peak_stress_forces
from rover_pin.soil.wheel_forces import GrossTraction, NetTraction, TorqueTraction, WheelForces, wheel_forces

MARGIN = 0.02
"""theta_m keeps this share of the arc from both ends."""


@dataclass(frozen=True)
class PeakStress(Effect):
    """A share w of the stress is Wong and Reece's, with its peak at theta_m = (a_0 + a_1 S) theta_1, the rest Eq (4)'s.

    With q the ratio of the normal forces (Wong and Reece's over Eq 6's, at the sinkage's angles) and F, M the factors
    of f_t and torque by f_n, all that depends on f_n so far grows by w (q - 1), and w q dF f_n, w q dM r f_n are added.
    `form` and `angles` must be those of the model's `SoilTraction`, whose forces this replaces.

    Source: Wong and Reece, J. Terramechanics 4(1) (1967) 81; values: Ishigami, Miwa, Nagatani and Yoshida, J. Field
    Robotics 24 (2007) 233. Differs from the paper: it has the peak under the axle. Differs from Wong and Reece: theta_m
    stays within the arc for any a_0, a_1 and S, their braking wheel has other stresses.
    """

    title: ClassVar[str] = "stress peak ahead of the axle"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "the pressure under the wheel peaks further ahead the more it slips"
    share: Scalar = quantity(1.0, "", "1: Wong and Reece's stress, 0: the paper's", 0.0, 1.0, "w")
    a_0: Scalar = quantity(0.40, "", "Ishigami et al. 2007, within Wong and Reece's range", 0.0, 1.0, "a_0")
    a_1: Scalar = quantity(0.15, "", "Ishigami et al. 2007, within Wong and Reece's range", -1.0, 1.0, "a_1")
    form: NetTraction | TorqueTraction | GrossTraction = field(default_factory=TorqueTraction)
    angles: FixedAngles | SinkageAngles = field(default_factory=FixedAngles)
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what the moved peak adds to the load of the traction."""
        wheel = contact.wheel
        flat, peaked = self._both(contact, SinkageAngles())
        q = peaked.f_n / flat.f_n
        if isinstance(self.angles, FixedAngles):
            flat, peaked = self._both(contact, self.angles)
        dF = self.form.factor(peaked, wheel, contact.S) - self.form.factor(flat, wheel, contact.S)
        dT = peaked.torque / peaked.f_n - flat.torque / flat.f_n
        grown = Load(*(self.share * (q - 1.0) * part for part in load))
        carried = self.share * q * load.f_n
        return grown.plus(Load(f_t=carried * dF, torque=carried * dT))

    def _both(self, contact: Contact, angles: FixedAngles | SinkageAngles) -> tuple[WheelForces, WheelForces]:
        wheel, soil = contact.wheel, contact.soil
        theta_1, theta_2 = angles.angles(contact.h, wheel, soil)
        flat = wheel_forces(contact.S, theta_1, theta_2, wheel, soil, NODES)
        edge = MARGIN * (theta_1 - theta_2)
        theta_m = PeakAngle(self.a_0, self.a_1).at(contact.S, theta_1)
        theta_m = ca.fmin(ca.fmax(theta_m, theta_2 + edge), theta_1 - edge)
        return flat, peak_stress_forces(contact.S, (theta_1, theta_m, theta_2), wheel, soil, NODES)
