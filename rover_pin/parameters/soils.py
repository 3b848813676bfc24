"""Soil parameters with their sources: sands of the paper, other dry sands, lunar and Martian simulants, and hard
ground.

"The paper" is the paper on slip control of the rover Nexus 6. Its Table 1 lists identified soil constants, and its Eq
(4) is the law of normal stress. The first publications of the simulants were not available; each entry was checked in
public code that quotes it, as its docstring states. If a source does not state the angles of entry and exit, the angles
of Table 1 are assumed.
"""

import math
from dataclasses import dataclass

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.parameters.bekker import bekker

NEXUS6_WHEEL = Wheel()
"""Wheel of the rover Nexus 6. The diameter of 0.09 m is stated in section 2 of the paper; the width is assumed."""

TABLE_1 = Soil()
"""Dry sand with the constants of Table 1 of the paper, "identified from experiments". The sinkage exponent n and the
constants k_1 and k_2 of the normal stress are assumed (see `Soil`)."""


@dataclass(frozen=True)
class LiteratureSand(Soil):
    """Sand of section 4.1 of the paper: "in literature it appears that phi = 32 [deg], c = 0 and k = 0.025 [m]".

    All other constants are taken from Table 1.
    """

    c: Scalar = quantity(0.0, "Pa", "paper, section 4.1, its reference 18", 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(32.0), "rad", "paper, section 4.1: 32 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.025, "m", "paper, section 4.1", 1e-5, 0.5, "k")


LITERATURE_SAND = LiteratureSand()


HARD_GROUND = Soil(c=0.0, phi=math.radians(35.0), k=1e-3, k_1=1e6, k_2=0.0, n=1.0)
"""Rock or board under a rubber wheel, described by the equations for sand. The sinkage is 0.8 mm, and the full grip of
tan 35 deg is reached after a shear displacement of the order of 1 mm. The values are assumed, because the paper states
only that "in reality, the obstacle has a hard surface" (Fig 7)."""


SLOPE_SAND_SOURCE = "chosen for a slip of 0.2 on 10 deg: Ding et al. 2011, Fig 9"
"""Source of the numbers of `SlopeSand`."""


@dataclass(frozen=True)
class SlopeSand(Soil):
    """Firm dry sand: phi 41 deg, k 8 mm, otherwise Table 1 of the paper.

    The friction angle phi and the shear displacement k were chosen, not measured on one soil. With them the slip of
    Nexus 6 on slopes is about equal to the slip of the two wheels in `studies/data/ding-2011-*` (80 N, 315 mm; Ding et
    al. 2011, J. Terramechanics 48(1), Fig 9). The slip of a measured wheel on a slope follows from its drawbar pull,
    because a wheel that climbs steadily pulls its load times the tangent of the slope. On shallow slopes, Nexus 6 slips
    more on this sand than the measured wheels. On looser sands, such as the sand of `studies/data/cmu-grousered-wheel`,
    wheels slip far more.
    """

    phi: Scalar = quantity(math.radians(41.0), "rad", SLOPE_SAND_SOURCE, 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.008, "m", SLOPE_SAND_SOURCE, 1e-5, 0.5, "k")


# Wong states Bekker's constants; Eq (4) needs k_1 and k_2, which hold for the width of the Nexus 6 wheel.
WONG = "Wong, Theory of Ground Vehicles, dry sand (LLL)"
"""Source of the numbers of `DrySand`; LLL is the Land Locomotion Laboratory."""
K_1, K_2 = bekker(0.99e3, 1528.43e3, 1.1, NEXUS6_WHEEL.b)


@dataclass(frozen=True)
class DrySand(Soil):
    """Dry sand of the Land Locomotion Laboratory, the first row of Wong's table of soils, for a wheel of 50 mm width.

    n 1.1, k_c 0.99 kN/m^(n+1), k_phi 1528.43 kN/m^(n+2), c 1.04 kPa, phi 28 deg. The numbers agree with three public
    terramechanics codes that quote this row. The table states no k; Wong's range for sand is 10 mm (firm) to 25 mm
    (loose).
    """

    c: Scalar = quantity(1.04e3, "Pa", WONG, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(28.0), "rad", f"{WONG}: 28 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.025, "m", "Wong: 10 mm (firm sand) to 25 mm (loose sand)", 1e-5, 0.5, "k")
    k_1: Scalar = quantity(K_1, "Pa", f"{WONG}: k_c = 0.99 kN/m^(n+1), b = 0.05 m", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(K_2, "Pa/m", f"{WONG}: k_phi = 1528.43 kN/m^(n+2), b = 0.05 m", -1e12, 1e12, "k_2")
    n: Scalar = quantity(1.1, "", WONG, 0.05, 3.0, "n")


DRY_SAND = DrySand()


ISHIGAMI = "Ishigami et al. 2007, J. Field Robotics 24(3): FJS-1"
DING = "Ding et al. 2011, J. Terramechanics 48(1), and 2015: HIT-LSS1"
MOON = "Lunar Sourcebook 1991, as listed by Ding et al. 2015"
MARSSIM = "Zhou et al. 2023, MarsSim, Table 2: sand"

# Bekker's constants of each source, converted to k_1 and k_2 for the width of the Nexus 6 wheel.
FJS1_K = bekker(1.37e3, 814e3, 1.0, NEXUS6_WHEEL.b)
HIT_K = bekker(15.6e3, 2407.4e3, 1.1, NEXUS6_WHEEL.b)
MOON_K = bekker(1.4e3, 820e3, 1.0, NEXUS6_WHEEL.b)
MARS_K = bekker(13.6e3, 2259.1e3, 0.92, NEXUS6_WHEEL.b)


@dataclass(frozen=True)
class Fjs1(Soil):
    """FJS-1, Japan's lunar simulant: k_c 1.37 kN/m^2, k_phi 814 kN/m^3, n 1, c 0.8 kPa, phi 37.2 deg, k 36 mm.

    Two public codes with Ishigami's model quote these numbers. They give the shear displacement along the wheel as k_x
    = 0.043 beta + 0.036 m at the slip angle beta; the value here is k_x at beta = 0. Other sources quote a far
    smaller k.
    """

    c: Scalar = quantity(800.0, "Pa", ISHIGAMI, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(37.2), "rad", f"{ISHIGAMI}: 37.2 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.036, "m", f"{ISHIGAMI}: k_x at slip angle 0", 1e-5, 0.5, "k")
    k_1: Scalar = quantity(FJS1_K[0], "Pa", f"{ISHIGAMI}: k_c = 1.37 kN/m^(n+1)", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(FJS1_K[1], "Pa/m", f"{ISHIGAMI}: k_phi = 814 kN/m^(n+2)", -1e12, 1e12, "k_2")
    n: Scalar = quantity(1.0, "", ISHIGAMI, 0.05, 3.0, "n")


@dataclass(frozen=True)
class HitLss1(Soil):
    """HIT-LSS1, lunar simulant of Harbin: n 1.1, c 0.25 kPa, phi 31.9 deg, k 9.7 to 13.1 mm.

    k_c is 15.6 kN/m^(n+1) and k_phi 2407.4 kN/m^(n+2). The numbers agree with two public codes that quote Ding's
    tables. The data in `studies/data/ding-2011-*` were measured on this soil.
    """

    c: Scalar = quantity(250.0, "Pa", DING, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(31.9), "rad", f"{DING}: 31.9 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.0114, "m", f"{DING}: middle of 9.7 to 13.1 mm", 1e-5, 0.5, "k")
    k_1: Scalar = quantity(HIT_K[0], "Pa", f"{DING}: k_c = 15.6 kN/m^(n+1), b = 0.05 m", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(HIT_K[1], "Pa/m", f"{DING}: k_phi = 2407.4 kN/m^(n+2), b = 0.05 m", -1e12, 1e12, "k_2")
    n: Scalar = quantity(1.1, "", DING, 0.05, 3.0, "n")


@dataclass(frozen=True)
class LunarNominal(Soil):
    """Real lunar soil, estimated from Apollo data: k_c 1.4 kN/m^2, k_phi 820 kN/m^3, n 1, c 0.17 kPa, phi 35 deg.

    The shear displacement k is 18 mm. The numbers were checked in three public codes. Sources state phi from 30 to 50
    deg, depending on depth and density.
    """

    c: Scalar = quantity(170.0, "Pa", MOON, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(35.0), "rad", f"{MOON}: 35 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.018, "m", MOON, 1e-5, 0.5, "k")
    k_1: Scalar = quantity(MOON_K[0], "Pa", f"{MOON}: k_c = 1.4 kN/m^(n+1)", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(MOON_K[1], "Pa/m", f"{MOON}: k_phi = 820 kN/m^(n+2)", -1e12, 1e12, "k_2")
    n: Scalar = quantity(1.0, "", MOON, 0.05, 3.0, "n")


@dataclass(frozen=True)
class MarsSimSand(Soil):
    """Sand of MarsSim, a simulator of Mars rovers: k_c 13.6 kN/m^(n+1), k_phi 2259.1 kN/m^(n+2), n 0.92, c 462 Pa.

    phi is 35 deg and k 15 mm. The numbers agree with one public code that quotes MarsSim's Table 2. In MarsSim, n grows
    with the slip S (0.92 + 0.5 S); this entry holds for S = 0.
    """

    c: Scalar = quantity(462.3, "Pa", MARSSIM, 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(35.0), "rad", f"{MARSSIM}: 35 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.015, "m", MARSSIM, 1e-5, 0.5, "k")
    k_1: Scalar = quantity(MARS_K[0], "Pa", f"{MARSSIM}: k_c = 13.6 kN/m^(n+1), b = 0.05 m", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(MARS_K[1], "Pa/m", f"{MARSSIM}: k_phi = 2259.1 kN/m^(n+2), b = 0.05 m", -1e12, 1e12, "k_2")
    n: Scalar = quantity(0.92, "", f"{MARSSIM}: at S = 0", 0.05, 3.0, "n")


FJS_1, HIT_LSS1, LUNAR_NOMINAL, MARSSIM_SAND = Fjs1(), HitLss1(), LunarNominal(), MarsSimSand()
