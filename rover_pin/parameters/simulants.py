"""Simulants of lunar and Martian soil, converted to Eq (4) for a wheel 50 mm wide.

None of these was read in its first publication: each was checked in public code that quotes it, as its docstring says.
The angles and the exit ratio are Table 1's, assumed.
"""

import math
from dataclasses import dataclass

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar, Soil
from rover_pin.parameters.bekker import bekker
from rover_pin.parameters.yoshida import NEXUS6_WHEEL

ISHIGAMI = "Ishigami et al. 2007, J. Field Robotics 24(3): FJS-1"
DING = "Ding et al. 2011, J. Terramechanics 48(1), and 2015: HIT-LSS1"
MOON = "Lunar Sourcebook 1991, as listed by Ding et al. 2015"
MARSSIM = "Zhou et al. 2023, MarsSim, Table 2: sand"

FJS1_K = bekker(1.37e3, 814e3, 1.0, NEXUS6_WHEEL.b)
HIT_K = bekker(15.6e3, 2407.4e3, 1.1, NEXUS6_WHEEL.b)
MOON_K = bekker(1.4e3, 820e3, 1.0, NEXUS6_WHEEL.b)
MARS_K = bekker(13.6e3, 2259.1e3, 0.92, NEXUS6_WHEEL.b)


@dataclass(frozen=True)
class Fjs1(Soil):
    """FJS-1, Japan's lunar simulant: k_c 1.37 kN/m^2, k_phi 814 kN/m^3, n 1, c 0.8 kPa, phi 37.2 deg, k 36 mm.

    Two public codes that follow Ishigami's model quote these numbers and k_x = 0.043 beta + 0.036 m, here at slip angle
    beta = 0. The k of other sources is far smaller.
    """

    c: Scalar = quantity(800.0, "Pa", ISHIGAMI, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(37.2), "rad", f"{ISHIGAMI}: 37.2 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.036, "m", f"{ISHIGAMI}: k_x at slip angle 0", 1e-5, 0.5, "k")
    k_1: Scalar = quantity(FJS1_K[0], "Pa", f"{ISHIGAMI}: k_c = 1.37 kN/m^(n+1)", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(FJS1_K[1], "Pa/m", f"{ISHIGAMI}: k_phi = 814 kN/m^(n+2)", -1e12, 1e12, "k_2")
    n: Scalar = quantity(1.0, "", ISHIGAMI, 0.05, 3.0, "n")


@dataclass(frozen=True)
class HitLss1(Soil):
    """HIT-LSS1, Harbin's lunar simulant: k_c 15.6, k_phi 2407.4, n 1.1, c 0.25 kPa, phi 31.9 deg, k 9.7 to 13.1 mm.

    Checked in two public codes that quote Ding's tables; also the soil of `studies/data/ding-2011-*`.
    """

    c: Scalar = quantity(250.0, "Pa", DING, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(31.9), "rad", f"{DING}: 31.9 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.0114, "m", f"{DING}: middle of 9.7 to 13.1 mm", 1e-5, 0.5, "k")
    k_1: Scalar = quantity(HIT_K[0], "Pa", f"{DING}: k_c = 15.6 kN/m^(n+1), b = 0.05 m", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(HIT_K[1], "Pa/m", f"{DING}: k_phi = 2407.4 kN/m^(n+2), b = 0.05 m", -1e12, 1e12, "k_2")
    n: Scalar = quantity(1.1, "", DING, 0.05, 3.0, "n")


@dataclass(frozen=True)
class LunarNominal(Soil):
    """The Apollo estimate of real lunar soil: k_c 1.4 kN/m^2, k_phi 820 kN/m^3, n 1, c 0.17 kPa, phi 35 deg, k 18 mm.

    Not a simulant. Checked in three public codes; phi is quoted from 30 to 50 deg with depth and density.
    """

    c: Scalar = quantity(170.0, "Pa", MOON, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(35.0), "rad", f"{MOON}: 35 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.018, "m", MOON, 1e-5, 0.5, "k")
    k_1: Scalar = quantity(MOON_K[0], "Pa", f"{MOON}: k_c = 1.4 kN/m^(n+1)", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(MOON_K[1], "Pa/m", f"{MOON}: k_phi = 820 kN/m^(n+2)", -1e12, 1e12, "k_2")
    n: Scalar = quantity(1.0, "", MOON, 0.05, 3.0, "n")


@dataclass(frozen=True)
class MarsSimSand(Soil):
    """The sand of MarsSim, a Mars rover simulator: k_c 13.6, k_phi 2259.1, n 0.92, c 462 Pa, phi 35 deg, k 15 mm.

    Checked in one public code that quotes MarsSim's Table 2. Its n grows with slip (0.92 + 0.5 S); here S = 0.
    """

    c: Scalar = quantity(462.3, "Pa", MARSSIM, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(35.0), "rad", f"{MARSSIM}: 35 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.015, "m", MARSSIM, 1e-5, 0.5, "k")
    k_1: Scalar = quantity(MARS_K[0], "Pa", f"{MARSSIM}: k_c = 13.6 kN/m^(n+1), b = 0.05 m", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(MARS_K[1], "Pa/m", f"{MARSSIM}: k_phi = 2259.1 kN/m^(n+2), b = 0.05 m", -1e12, 1e12, "k_2")
    n: Scalar = quantity(0.92, "", f"{MARSSIM}: at S = 0", 0.05, 3.0, "n")


FJS_1, HIT_LSS1, LUNAR_NOMINAL, MARSSIM_SAND = Fjs1(), HitLss1(), LunarNominal(), MarsSimSand()
