"""What soil bears before a wall that pushes it, and where Newton's search for the entry angle begins."""

import math

import numpy as np
import pytest

from rover_pin.contact import Soil, Wheel
from rover_pin.soil.curves import traction_curves
from rover_pin.soil.passive import passive
from rover_pin.soil.traction import load_traction_factor

ROOT_3 = math.sqrt(3.0)


def test_frictionless_soil_bears_two_cohesions_and_its_weight():
    """phi = 0: X = 45 deg, so D_1 = 2, D_2 = 1."""
    assert passive(0.0).per_width(0.3, 700.0, 16e3) == pytest.approx(2 * 700.0 * 0.3 + 16e3 * 0.3**2)


def test_thirty_degrees_have_whole_roots_of_three():
    """X = 30 deg: cot X = tan(X + phi) = sqrt 3, so D_1 = 2 sqrt 3 and D_2 = sqrt 3 + 3 / sqrt 3."""
    found = passive(math.radians(30.0))
    assert found == pytest.approx((2 * ROOT_3, 2 * ROOT_3, ROOT_3))
    assert found.per_width(0.01, 200.0, 15e3) == pytest.approx(2 * ROOT_3 * (200.0 * 0.01 + ROOT_3 * 15e3 * 1e-4))


@pytest.mark.parametrize("phi_deg", [5.0, 20.0, 38.0, 55.0])
def test_the_part_of_cohesion_is_rankines(phi_deg):
    """2 c h sqrt(N), N = (1 + sin phi) / (1 - sin phi), from Mohr's circle."""
    sine = math.sin(math.radians(phi_deg))
    rankine = 2 * math.sqrt((1 + sine) / (1 - sine))
    assert passive(math.radians(phi_deg)).per_width(0.02, 300.0, 0.0) == pytest.approx(300.0 * 0.02 * rankine)


def test_curves_cover_every_k_all_slips_and_a_given_exponent():
    soil = Soil(n=1.2)
    found = traction_curves(soil, [0.004, 0.03])
    assert (found.S[0], found.S[-1], len(found.S)) == (0.0, 1.0, 101)
    np.testing.assert_allclose(np.diff(found.S), 0.01)
    assert {k for _, k in found.curves} == {0.004, 0.03}
    own, other = (traction_curves(soil, n=n).curves["net", float(soil.k)] for n in (None, 0.7))
    assert own[37] == load_traction_factor(0.37, soil, Wheel())
    assert other[37] == load_traction_factor(0.37, soil.replace(n=0.7), Wheel())
    assert own[37] != other[37]
