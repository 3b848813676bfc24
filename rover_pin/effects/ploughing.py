"""A braked wheel that ploughs: a fraction of the sand in its way is pushed ahead and does not carry the wheel."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar, fading
from rover_pin.effects.effect import Effect, State
from rover_pin.effects.slip_sinkage import rut_cost
from rover_pin.effects.slip_softening import approach, lift, loosen, share_of, softer
from rover_pin.soil.passive import passive
from rover_pin.soil.slip import ACROSS_SHARE, positive_part

SHARPNESS = 16
"""Exponent that sets how sharply the limit m of 1 + S is rounded. With 16, the stiffness at S = m - 1 is 4 % above the
stiffness of a locked wheel for a_b = 1."""
MAX_LOST_REAR = 0.9
"""Maximum distance of the contact's rear end in front of the axle, as a fraction of the entry angle."""


@dataclass(frozen=True)
class Ploughing(Effect):
    """A braked wheel ploughs: it pushes the fraction p of the sand in its way ahead, and this sand does not carry the
    wheel.

        p = 1 - (1 + S)^a_b for S < 0,   k_1, k_2 <- (1 - p) (k_1, k_2),
        f_t = -B p b D_1 (c h + D_2 gamma h^2 / 2),   lambda <- max(lambda - e_b p, -0.9).

    A wheel meets sand at the speed v, and its rim takes in r omega = (1 + S) v. With a_b = 1 the difference p = -S is
    pushed ahead. This has three consequences, each with its own parameter. The remaining sand carries the load, so that
    the stiffnesses k_1 and k_2 fall by the factor 1 - p. The heap in front pushes back by f_t, like a wall as deep as
    the wheel has sunk (h). The wheel leans on the heap and loses the rear of its contact: lambda = -theta_2 / theta_1
    falls, and theta_2 rises accordingly, so that the contact may end in front of the axle. The state follows -ln(1 + S)
    over the travel L. The deeper rut costs work (`rut_cost`), and the lift of the wheel at the end of a skid costs work
    as in `SlipSoftening`.

    Near a locked wheel, 1 + S is limited to m. A locked wheel (S = -1) takes in no sand by rolling, but it rests on the
    sand that passes below it, like a dragged plate. Runs without a locked wheel do not show m, so that a prediction of
    a locked wheel is uncertain by the prior of m.

    Source: an assumed form, compared with others in studies/wheel_laws.py; earth pressure: Hegedus (1960); Wong and
    Reece, J. Terramechanics 4(2) (1967) 7, for the fact that the bottom of a skidding wheel separates from the soil in
    front. Differs from the paper: it uses the laws of a driven wheel for S < 0.
    """

    title: ClassVar[str] = "ploughing"
    family: ClassVar[str] = "resistance"
    meaning: ClassVar[str] = "a braked wheel pushes a part of the sand ahead, which then does not carry it"
    a_b: Scalar = quantity(1.0, "", "conservation of volume; 0.6 to 1 fitted on one measured wheel", 0.0, 4.0, "a_b")
    share: Scalar = quantity(1.0, "", "assumed: the heap is as wide as the wheel", 0.0, 5.0, "B")
    e_b: Scalar = quantity(0.4, "", "one measured wheel (studies/wheel_laws.py): 0.3 to 0.5", 0.0, 2.0, "e_b")
    locked: Scalar = quantity(0.2, "", "assumed: locked, it rests on sand as at S = -0.8", 0.02, 0.9, "m")
    gamma: Scalar = quantity(15700.0, "N/m^3", "assumed: loose dry sand, 1600 kg/m^3, on Earth", 0.0, 1e5, "gamma")
    phi_f: Scalar = quantity(math.radians(30.0), "rad", "assumed: Table 1's sand", 0.0, math.radians(60.0), "phi_f")
    length: Scalar = quantity(0.066, "m", "assumed: the length L of SlipSoftening", 1e-3, 1.0, "L")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    states: ClassVar[tuple[State, ...]] = (State("ploughed"),)
    neutral: ClassVar[dict[str, float]] = {"a_b": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with sand that is softened by the part pushed ahead, and with a contact arc that has lost
        its rear.
        """
        # The state is the skid; a_b times the skid is the lost logarithm of the stiffness, since 1 - p = exp(-a_b x).
        contact, lost = loosen(contact, self.a_b * x[0]), self.e_b * self._pushed_share(x[0])
        soil = contact.soil
        # The lean on the heap moves the rear end of the contact forwards, in both descriptions of the exit angle.
        ratio = ca.fmax(soil.exit_ratio - lost, -MAX_LOST_REAR)
        theta_2 = ca.fmin(soil.theta_2 + lost * soil.theta_1, MAX_LOST_REAR * soil.theta_1)
        return contact._replace(soil=soil.replace(exit_ratio=ratio, theta_2=theta_2))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance f_t [N] of the heap in front of the wheel, of the deeper rut, and of the climb out of
        the rut.
        """
        # The heap is a wall as deep as the wheel has sunk, and as wide as the wheel.
        h = ca.fmax(contact.h, 0.0)
        wall = contact.wheel.b * passive(self.phi_f).per_width(h, contact.soil.c, self.gamma)
        # The wheel is lifted while the followed skid is larger than the present one.
        up = lift(contact, load, self.a_b * (x[0] - self._skid(contact)), self.length)
        # The heap faces the heading: kappa of `against_travel` is the part of the sideways speed that counts.
        v, v_y, u = contact.v_x, ACROSS_SHARE * contact.v_y, fading(contact.rim, self.v_0, 1.0)
        heap = self.share * self._pushed_share(x[0]) * wall * v / ca.sqrt(v * v + v_y * v_y + u * u)
        # The deeper rut is compared with the rut in the sand without this effect's loss of stiffness.
        firm = softer(contact, share_of(contact, self.a_b * x[0]))
        return Load(f_t=-heap - up * contact.sense(self.v_0) - rut_cost(contact, firm))

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the time derivative [1/s] of the skid state, which follows -ln(1 + S) for a slip S < 0."""
        return (approach(contact, self._skid(contact) - x[0]) / self.length,)

    def _pushed_share(self, skid: Scalar) -> Scalar:
        """Return the fraction [-] of the sand in front of the wheel that is pushed ahead, for the skid state `skid`,
        which follows -ln(1 + S).
        """
        return -ca.expm1(-self.a_b * ca.fmax(skid, 0.0))

    def _skid(self, contact: Contact) -> Scalar:
        """Return the skid -ln(1 + S) for a slip S < 0, limited smoothly near a locked wheel, and 0 for S > 0."""
        # A smooth maximum of 1 + S and its minimum m, by a power mean.
        rolled, least = 1.0 - positive_part(-contact.S), self.locked**SHARPNESS
        return ca.log((1.0 + least) / (rolled**SHARPNESS + least)) / SHARPNESS
