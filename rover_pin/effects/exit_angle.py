"""Soil carried round by a slipping rim: the contact reaches further behind the axle."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class ExitAngle(Effect):
    """lambda <- lambda + e_1 S within [0, 1], lambda = -theta_2 / theta_1; theta_2 alike within [-theta_1, 0].

    Both readings of the exit angle move alike: the ratio, for angles that follow the sinkage, and the soil's fixed
    theta_2; the contact ends between the axle and as far behind it as it began. The soil's own values are those at
    S = 0. Source: the ratio is that of Ishigami, Miwa, Nagatani and
    Yoshida, J. Field Robotics 24 (2007) 233; its slope with slip is an assumed form. Differs from the paper: it holds
    theta_2.
    """

    title: ClassVar[str] = "growing exit angle"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "the slipping rim carries soil round and stays in contact further behind the axle"
    e_1: Scalar = quantity(0.3, "", "assumed: the exit angle triples from S = 0 to 1", -1.0, 1.0, "e_1")
    neutral: ClassVar[dict[str, float]] = {"e_1": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the exit angle of its slip."""
        soil, change = contact.soil, self.e_1 * contact.S
        ratio = ca.fmin(ca.fmax(soil.exit_ratio + change, 0.0), 1.0)
        theta_2 = ca.fmin(ca.fmax(soil.theta_2 - change * soil.theta_1, -soil.theta_1), 0.0)
        return contact._replace(soil=soil.replace(exit_ratio=ratio, theta_2=theta_2))
