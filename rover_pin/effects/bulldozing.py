"""The soil that a sunk wheel pushes ahead."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.passive import passive


@dataclass(frozen=True)
class Bulldozing(Effect):
    """f_t = -B b D_1 (c h + D_2 gamma h^2 / 2) v / sqrt(v^2 + u^2): earth pressure on the front of the rim.

    D_1 = cot X + tan(X + phi), D_2 = cot X + cot^2 X tan phi, X = 45 deg - phi / 2; u is `contact.fading`: at rest it
    does not push, from 2 mm/s on it is whole. B is the share of the front that pushes like a vertical plate of width b
    and height h: a wheel rolls over most of what a blade would push.
    Source: Hegedus (1960), in the form of Ishigami, Miwa, Nagatani and Yoshida, J. Field Robotics 24 (2007) 233, who
    put it on the sides of a wheel. Differs from the paper: its only resistance is that of compaction, in the net form.
    """

    title: ClassVar[str] = "bulldozing"
    family: ClassVar[str] = "resistance"
    meaning: ClassVar[str] = "a sunk wheel pushes soil ahead of its rim"
    share: Scalar = quantity(0.5, "", "assumed: between rolling over and pushing", 0.0, 3.0, "B")
    gamma: Scalar = quantity(15700.0, "N/m^3", "assumed: loose dry sand, 1600 kg/m^3, on Earth", 0.0, 1e5, "gamma")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance."""
        soil, wheel = contact.soil, contact.wheel
        h = ca.fmax(contact.h, 0.0)
        pressure = passive(soil.phi).per_width(h, soil.c, self.gamma)
        return Load(f_t=-self.share * wheel.b * pressure * contact.sense(self.v_0))
