"""A normal stress whose peak lies in front of the axle and moves forwards with slip."""

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

MIN_END_DISTANCE = 0.02
"""Smallest distance of the stress peak from both ends of the contact, as a fraction of the contact's arc."""


@dataclass(frozen=True)
class PeakStress(Effect):
    """The normal stress under the wheel has its peak in front of the axle, and the peak moves forwards with slip.

        sigma <- (1 - w) sigma_4 + w sigma_WR,   theta_m = (a_0 + a_1 S) theta_1

    sigma_4 is the stress of Eq (4), with its peak under the axle, and sigma_WR the stress of Wong and Reece, with its
    peak at the angle theta_m. q is the ratio of their normal forces at the angles of the sinkage; F and M are the
    ratios of f_t and torque / r to f_n. All forces of the effects before that are proportional to f_n grow by w (q -
    1), and w q dF f_n and w q dM r f_n are added, where dF and dM are the differences of F and M between both stresses.
    `form` and `angles` must equal the form and the angles of the model's `SoilTraction`, whose forces this effect
    replaces.

    Source: Wong and Reece, J. Terramechanics 4(1) (1967) 81; values: Ishigami, Miwa, Nagatani and Yoshida, J. Field
    Robotics 24 (2007) 233. Differs from the paper: its peak lies under the axle. Differs from Wong and Reece: theta_m
    stays within the arc for all a_0, a_1 and S, and their braked wheel has other stresses.
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
        """Return the change of the wheel's load if the peak of the normal stress moves from under the axle to its place
        in front of it.
        """
        wheel = contact.wheel
        # The ratio of the normal forces is always that at the sinkage; the force factors follow the model's choice of
        # angles.
        flat, peaked = self._both(contact, SinkageAngles())
        q = peaked.f_n / flat.f_n
        if isinstance(self.angles, FixedAngles):
            flat, peaked = self._both(contact, self.angles)
        dF = self.form.factor(peaked, wheel, contact.S) - self.form.factor(flat, wheel, contact.S)
        dT = peaked.torque / peaked.f_n - flat.torque / flat.f_n
        # Earlier forces grow with the normal force; then the changes of the ratios F and M are added.
        grown = Load(*(self.share * (q - 1.0) * part for part in load))
        carried = self.share * q * load.f_n
        return grown.plus(Load(f_t=carried * dF, torque=carried * dT))

    def _both(self, contact: Contact, angles: FixedAngles | SinkageAngles) -> tuple[WheelForces, WheelForces]:
        """Return the wheel forces for two normal stresses at equal contact angles: the stress of Eq (4) with its peak
        under the axle, and the stress with the moved peak.
        """
        wheel, soil = contact.wheel, contact.soil
        theta_1, theta_2 = angles.angles(contact.h, wheel, soil)
        flat = wheel_forces(contact.S, theta_1, theta_2, wheel, soil, NODES)
        # A peak at an end of the contact would divide by the zero length of one branch of the stress.
        edge = MIN_END_DISTANCE * (theta_1 - theta_2)
        theta_m = PeakAngle(self.a_0, self.a_1).at(contact.S, theta_1)
        theta_m = ca.fmin(ca.fmax(theta_m, theta_2 + edge), theta_1 - edge)
        return flat, peak_stress_forces(contact.S, (theta_1, theta_m, theta_2), wheel, soil, NODES)
