"""Resistance of the soil that a sunk wheel pushes in front of its rim."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.passive import passive


@dataclass(frozen=True)
class Bulldozing(Effect):
    """A sunk wheel pushes the soil in front of its rim, and the passive earth pressure of this soil resists the travel.

        f_t = -B b D_1 (c h + D_2 gamma h^2 / 2) v / sqrt(v^2 + u^2),
        D_1 = cot X + tan(X + phi),   D_2 = cot X + cot^2 X tan phi,   X = 45 deg - phi / 2,

    with the sinkage h, the wheel's width b and travel speed v, and cohesion c, friction angle phi and unit weight gamma
    of the soil. B is the ratio of the resistance to the resistance of a vertical plate of width b and height h: a wheel
    rolls over most of the soil that a blade would push. The last factor is 1 while the wheel travels and 0 at rest, so
    that the pressure never drives the wheel; u is the small speed `contact.fading`.

    Source: Hegedus (1960), in the form of Ishigami, Miwa, Nagatani and Yoshida, J. Field Robotics 24 (2007) 233, who
    apply it to the sides of a wheel. Differs from the paper: its only resistance is the compaction resistance in the
    drawbar pull (`NetTraction`).
    """

    title: ClassVar[str] = "bulldozing"
    family: ClassVar[str] = "resistance"
    meaning: ClassVar[str] = "a sunk wheel pushes soil ahead of its rim"
    share: Scalar = quantity(0.5, "", "assumed: between rolling over and pushing", 0.0, 3.0, "B")
    gamma: Scalar = quantity(15700.0, "N/m^3", "assumed: loose dry sand, 1600 kg/m^3, on Earth", 0.0, 1e5, "gamma")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the load that this effect adds: the resistance f_t [N] of the soil in front of the rim."""
        # The wall in front of the rim is as wide as the wheel and as deep as its sinkage.
        soil, wheel = contact.soil, contact.wheel
        # A wheel that has left the ground pushes no soil.
        h = ca.fmax(contact.h, 0.0)
        pressure = passive(soil.phi).per_width(h, soil.c, self.gamma)
        return Load(f_t=-self.share * wheel.b * pressure * contact.sense(self.v_0))
