"""Dry sand of the Land Locomotion Laboratory, the first row of Wong's table of soils."""

import math
from dataclasses import dataclass

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar, Soil
from rover_pin.parameters.bekker import bekker
from rover_pin.parameters.yoshida import NEXUS6_WHEEL

WONG = "Wong, Theory of Ground Vehicles, dry sand (LLL)"
K_1, K_2 = bekker(0.99e3, 1528.43e3, 1.1, NEXUS6_WHEEL.b)


@dataclass(frozen=True)
class DrySand(Soil):
    """Dry sand: n 1.1, k_c 0.99 kN/m^(n+1), k_phi 1528.43 kN/m^(n+2), c 1.04 kPa, phi 28 deg; for b = 50 mm.

    Checked against three public terramechanics codes that quote the same row. The table gives no k: 10 mm (firm) to
    25 mm (loose) is Wong's range for sand. The angles and the exit ratio are Table 1's, assumed.
    """

    c: Scalar = quantity(1.04e3, "Pa", WONG, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(28.0), "rad", f"{WONG}: 28 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.025, "m", "Wong: 10 mm (firm sand) to 25 mm (loose sand)", 1e-5, 0.5, "k")
    k_1: Scalar = quantity(K_1, "Pa", f"{WONG}: k_c = 0.99 kN/m^(n+1), b = 0.05 m", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(K_2, "Pa/m", f"{WONG}: k_phi = 1528.43 kN/m^(n+2), b = 0.05 m", -1e12, 1e12, "k_2")
    n: Scalar = quantity(1.1, "", WONG, 0.05, 3.0, "n")


DRY_SAND = DrySand()
