"""Lugs on the rim, which shear the soil at a radius larger than the radius of the wheel."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.wheel_forces import pull_of_shear


@dataclass(frozen=True)
class Grousers(Effect):
    """Lugs on the rim shear the soil at the radius r_s = q r, which is larger than the radius r of the wheel.

        r_s = r + lambda_s h_s = q r,   S <- slip of the rim at r_s,   k <- k / q,   torque <- q^2 torque

    h_s is the height of the lugs, and lambda_s places the shearing radius between rim (0) and lug tip (1). Eq (2) at
    r_s has the shear displacement j = r_s (theta_1 - theta) - (v / omega) (sin theta_1 - sin theta). This equals Eq (2)
    at r with v / (r omega) and k divided by q. The moment of the stress gains one factor q from the lever arm and one
    from the area. f_t increases by (q - 1) times its shear part, torque / r; for a braked wheel, f_t increases only so
    far that the pull does no more work than the torque provides (`paid_for`). The normal stress stays at r. The
    recorded slip is the slip at r_s.

    If the rim itself has S = 0, the lugs slip by 1 - 1 / q and pull. This holds when r is the radius below the lugs. If
    a test bed states r and slip at the tips of the lugs (`r_over_lugs`), S = 0 holds at the tips, and the shear at half
    height brakes a little. Two measured wheels of one sand, with and without lugs of 5 mm, decide between these two
    meanings of the stated radius: `tests/experiments/wheel_rig/test_lugs_at_no_slip.py` keeps the values of chi2 with
    the radius over and under the lugs, and with other values of lambda_s.

    Source: shearing radius between rim and lug tip, Ding, Gao, Deng, Nagatani and Yoshida, J. Terramechanics 48 (2011)
    27. Differs from the paper: its wheels are smooth. Differs from a model of each lug: no ripple as lugs pass.
    """

    title: ClassVar[str] = "grousers"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "lugs shear the soil at a radius greater than the rim's"
    h_s: Scalar = quantity(0.003, "m", "assumed: 1 to 5 mm on a wheel of this size", 0.0, 0.02, "h_s")
    lambda_s: Scalar = quantity(0.5, "", "assumed: half-way between rim and lug tip", 0.0, 1.0, "lambda_s")
    neutral: ClassVar[dict[str, float]] = {"h_s": 0.0}

    def _ratio(self, contact: Contact) -> Scalar:
        """Return the ratio [-] of the radius at which the lugs shear the soil to the radius of the rim."""
        return 1.0 + self.lambda_s * self.h_s / contact.wheel.r

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the slip and the shear displacement that hold at the radius at which the lugs shear
        the soil.
        """
        q, S = self._ratio(contact), contact.S
        # A braked rim with lugs may turn faster than the travel at r_s, and then drives: Eq (1) has a branch for each
        # case.
        faster = q * (1.0 + ca.fmin(S, 0.0))
        braking = ca.if_else(faster < 1.0, S + (q - 1.0) * (1.0 + S), 1.0 - 1.0 / ca.fmax(faster, 1.0))
        # The slip of a driven wheel at the larger radius: v is unchanged, while the rim speed grows by q.
        driving = S + (1.0 - S) * (1.0 - 1.0 / q)
        # The shear displacement at r_s is larger by q, which is written as a smaller modulus k.
        soil = contact.soil.replace(k=contact.soil.k / q)
        return contact._replace(S=ca.if_else(S < 0.0, braking, driving), soil=soil)

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the additional pull and torque of lugs, which shear the soil at a larger radius than the rim."""
        q, pull = self._ratio(contact), pull_of_shear(load.torque, contact.wheel, contact.S)
        return Load(f_t=(q - 1.0) * pull, torque=(q * q - 1.0) * load.torque)
