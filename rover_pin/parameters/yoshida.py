"""The paper's own numbers: Table 1 and section 2, and the sand of the literature that section 4.1 quotes."""

import math
from dataclasses import dataclass

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar, Soil, Wheel

NEXUS6_WHEEL = Wheel()
"""The wheel of Nexus 6: diameter 0.09 m (section 2); the width is assumed."""

TABLE_1 = Soil()
"""Table 1, "identified from experiments" on dry sand; n, k_1, k_2 are assumed (see the fields of `Soil`)."""


@dataclass(frozen=True)
class LiteratureSand(Soil):
    """Section 4.1: "in literature it appears that phi = 32 [deg], c = 0 and k = 0.025 [m]"; the rest is Table 1's."""

    c: Scalar = quantity(0.0, "Pa", "paper, section 4.1, its reference 18", 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(32.0), "rad", "paper, section 4.1: 32 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.025, "m", "paper, section 4.1", 1e-5, 0.5, "k")


LITERATURE_SAND = LiteratureSand()
