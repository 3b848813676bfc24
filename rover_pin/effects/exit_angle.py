"""A contact that reaches further behind the axle, because a slipping rim carries soil round."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class ExitAngle(Effect):
    """The contact reaches further behind the axle the more the wheel slips, because the rim carries soil round.

        lambda <- clip(lambda + e_1 S, 0, 1),   lambda = -theta_2 / theta_1,
        theta_2 <- clip(theta_2 - e_1 S theta_1, -theta_1, 0).

    theta_1 is the entry angle and theta_2 the exit angle. The effect changes both descriptions of the exit: the ratio
    lambda, for angles that follow the sinkage, and the fixed theta_2 of the soil. The contact ends between the axle and
    the mirror image of its front end. At S = 0 the soil's own values hold.

    Source: the ratio follows Ishigami, Miwa, Nagatani and Yoshida, J. Field Robotics 24 (2007) 233; its slope with slip
    is an assumed form. Differs from the paper: it holds theta_2 constant.
    """

    title: ClassVar[str] = "growing exit angle"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "the slipping rim carries soil round and stays in contact further behind the axle"
    e_1: Scalar = quantity(0.3, "", "assumed: the exit angle triples from S = 0 to 1", -1.0, 1.0, "e_1")
    neutral: ClassVar[dict[str, float]] = {"e_1": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the exit angle that belongs to its slip.

        Both descriptions of the exit angle in the soil are changed: the ratio to the entry angle, and the fixed angle.
        """
        soil, change = contact.soil, self.e_1 * contact.S
        # The two limits keep the rear end of the contact between the point below the axle and the mirror image of the
        # front end.
        ratio = ca.fmin(ca.fmax(soil.exit_ratio + change, 0.0), 1.0)
        theta_2 = ca.fmin(ca.fmax(soil.theta_2 - change * soil.theta_1, -soil.theta_1), 0.0)
        return contact._replace(soil=soil.replace(exit_ratio=ratio, theta_2=theta_2))
