"""What a deeper rut costs, against Bekker's integral and the load by brute force; what soil bears before a wall."""

import math
from itertools import product

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from rover_pin import Soil, Wheel, load_traction_factor
from rover_pin.soil.compaction import _pressure_load, compaction, sinking_resistance
from rover_pin.soil.curves import traction_curves
from rover_pin.soil.passive import passive

WHEEL, RATIO = Wheel(), 1.0 / 7.0


def pressure(at, theta_1, n):
    return max(math.cos(at) - math.cos(theta_1), 0.0) ** n * math.cos(at)


def pressure_force(theta_1, n):
    return 54207.3 * 0.045 * 0.05 * 0.9**n * quad(pressure, -RATIO * theta_1, theta_1, args=(theta_1, n))[0]


def test_the_pressure_is_as_good_as_stated():
    """Relative to adaptive quadrature, over exponents, arcs and exits."""
    off = []
    for n, theta_1, ratio in product([0.4, 0.5, 0.7, 1.0, 1.3, 1.6, 2.0], [0.1, 0.3, 0.6, 1.0], [0.0, RATIO, 0.5]):
        true, _ = quad(pressure, -ratio * theta_1, theta_1, args=(theta_1, n))
        load = _pressure_load(theta_1, (1.0 + ratio) * theta_1, WHEEL, Soil(n=n))
        off.append(abs(float(load) / (54207.3 * 0.9**n * true) - 1))
    assert 1e-4 < max(off) < 2.1e-4


def rut_work(theta_1, n):
    """b int p dz from where the rear lets go of the soil to the bottom, p = k_1 (z / b)^n."""
    bottom, left = (0.045 * (math.cos(at) - math.cos(theta_1)) for at in (0.0, RATIO * theta_1))
    assert left < bottom
    return 0.05 * quad(lambda z: 54207.3 * (z / 0.05) ** n, 0.0, left)[0]


@pytest.mark.parametrize("n", [0.5, 1.0, 1.4])
def test_compaction_is_bekkers_work_per_length(n):
    theta_1 = 0.6
    ours = float(compaction(theta_1, (1.0 + RATIO) * theta_1, WHEEL, Soil(n=n)))
    assert ours == pytest.approx(rut_work(theta_1, n), rel=1e-9)


@pytest.mark.parametrize("n", [0.5, 1.0, 1.3])
@pytest.mark.parametrize("rise", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("h", [0.001, 0.008, 0.02])
def test_a_deeper_rut_costs_more_under_the_same_load(n, rise, h):
    theta_1 = math.acos(1.0 - h / 0.045)
    load = pressure_force(theta_1, n + rise)
    before = brentq(lambda at: pressure_force(at, n) - load, 1e-3, 1.5)
    expected = rut_work(theta_1, n + rise) - rut_work(before, n)
    ours = float(sinking_resistance(h, WHEEL, Soil(n=n + rise), Soil(n=n)))
    assert expected > 0.0
    assert ours == pytest.approx(expected, abs=2.5e-3 * load)


ROOT_3 = math.sqrt(3.0)


def test_frictionless_soil_bears_two_cohesions_and_its_weight():
    """phi = 0: X = 45 deg, so D_1 = 2, D_2 = 1."""
    assert passive(0.0).per_width(0.3, 700.0, 16e3) == pytest.approx(2 * 700.0 * 0.3 + 16e3 * 0.3**2)


def test_thirty_degrees_have_whole_roots_of_three():
    """X = 30 deg: cot X = tan(X + phi) = sqrt 3, so D_1 = 2 sqrt 3 and D_2 = sqrt 3 + 3 / sqrt 3."""
    passive_ratio = passive(math.radians(30.0))
    assert passive_ratio == pytest.approx((2 * ROOT_3, 2 * ROOT_3, ROOT_3))
    assert passive_ratio.per_width(0.01, 200.0, 15e3) == pytest.approx(
        2 * ROOT_3 * (200.0 * 0.01 + ROOT_3 * 15e3 * 1e-4)
    )


@pytest.mark.parametrize("phi_deg", [5.0, 20.0, 38.0, 55.0])
def test_the_part_of_cohesion_is_rankines(phi_deg):
    """2 c h sqrt(N), N = (1 + sin phi) / (1 - sin phi), from Mohr's circle."""
    sine = math.sin(math.radians(phi_deg))
    rankine = 2 * math.sqrt((1 + sine) / (1 - sine))
    assert passive(math.radians(phi_deg)).per_width(0.02, 300.0, 0.0) == pytest.approx(300.0 * 0.02 * rankine)


def test_curves_cover_every_k_all_slips_and_a_given_exponent():
    soil = Soil(n=1.2)
    curve_set = traction_curves(soil, [0.004, 0.03])
    assert (curve_set.S[0], curve_set.S[-1], len(curve_set.S)) == (0.0, 1.0, 101)
    np.testing.assert_allclose(np.diff(curve_set.S), 0.01)
    assert {k for _, k in curve_set.curves} == {0.004, 0.03}
    default_curve, other_curve = (traction_curves(soil, n=n).curves["net", float(soil.k)] for n in (None, 0.7))
    assert default_curve[37] == load_traction_factor(0.37, soil, Wheel())
    assert other_curve[37] == load_traction_factor(0.37, soil.replace(n=0.7), Wheel())
    assert default_curve[37] != other_curve[37]
