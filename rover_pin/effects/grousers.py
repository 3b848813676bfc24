"""Lugs on the rim: the soil shears at a radius greater than that of the wheel."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.wheel_forces import pull_of_shear


@dataclass(frozen=True)
class Grousers(Effect):
    """Shear at r_s = r + lambda_s h_s = q r: S <- slip of the rim at r_s, k <- k / q, torque <- q^2 torque.

    With Eq (2) at r_s, j = r_s (theta_1 - theta) - (v / omega)(sin theta_1 - sin theta), which is Eq (2) at r with v /
    (r omega) and k divided by q. The moment of the stress gains q for the arm and q for the area; f_t gains (q - 1) of
    its shear, torque / r (braking: what that pays for, `paid_for`). The normal stress stays at r. The slip that is
    recorded is then that at r_s.

    At S = 0 of the rim lugs slip by 1 - 1 / q, and pull. With r under the lugs that is so; where a test bed tells r and
    slip over them (`r_over_lugs`), S = 0 is at the tips, and the shear half-way up brakes a little. Two measured wheels
    of one sand with 5 mm lugs and without pull alike at the stated S = 0, -0.055 +- 0.005 and -0.054 +- 0.007 of the
    load. Fitted together, r over the lugs holds both to 0.1 N, with lambda_s = 0.5 best of 0 to 1 (chi2 107, without
    the effect 115); r under the lugs misses by 0.9 N (141). Their two published radii differ by 4.5 mm
    (tests/experiments/wheel_rig/test_lugs_at_no_slip.py).

    Source: shearing radius between rim and lug tip, Ding, Gao, Deng, Nagatani and Yoshida, J. Terramechanics 48 (2011)
    27. Differs from the paper: smooth wheels. Differs from lugs one by one: no ripple at their passing.
    """

    title: ClassVar[str] = "grousers"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "lugs shear the soil at a radius greater than the rim's"
    h_s: Scalar = quantity(0.003, "m", "assumed: 1 to 5 mm on a wheel of this size", 0.0, 0.02, "h_s")
    lambda_s: Scalar = quantity(0.5, "", "assumed: half-way between rim and lug tip", 0.0, 1.0, "lambda_s")
    neutral: ClassVar[dict[str, float]] = {"h_s": 0.0}

    def _ratio(self, contact: Contact) -> Scalar:
        return 1.0 + self.lambda_s * self.h_s / contact.wheel.r

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with slip and shear displacement at the lugs' radius."""
        q, S = self._ratio(contact), contact.S
        faster = q * (1.0 + ca.fmin(S, 0.0))
        braking = ca.if_else(faster < 1.0, S + (q - 1.0) * (1.0 + S), 1.0 - 1.0 / ca.fmax(faster, 1.0))
        driving = S + (1.0 - S) * (1.0 - 1.0 / q)
        soil = contact.soil.replace(k=contact.soil.k / q)
        return contact._replace(S=ca.if_else(S < 0.0, braking, driving), soil=soil)

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what the greater radius adds."""
        q, pull = self._ratio(contact), pull_of_shear(load.torque, contact.wheel, contact.S)
        return Load(f_t=(q - 1.0) * pull, torque=(q * q - 1.0) * load.torque)
