"""Earth pressure on the disc: the closed form against quadrature, signs, and how it builds up."""

import math

import pytest
from scipy.integrate import quad

from rover_pin.contact import Load, Wheel
from rover_pin.effects.flank_pressure import FlankPressure

WHEEL = Wheel(r=0.0625, b=0.06)


def side_force(patch, S_y, h=0.02, c=0.0, **numbers):
    contact = patch(S=0.0, S_y=S_y, h=h, wheel=WHEEL, soil=patch().soil.replace(c=c))
    return float(FlankPressure(**numbers).load(contact, Load(), ()).f_y)


@pytest.mark.parametrize("h", [1e-5, 0.003, 0.02, 0.05])
@pytest.mark.parametrize("c", [0.0, 300.0])
def test_full_pressure_is_the_integral_over_the_buried_segment(patch, h, c):
    """phi = 30 deg: D_1 = D_2 = 2 sqrt 3; the depth of the segment at x along the chord is that of the circle."""
    half = math.sqrt(0.0625**2 - (0.0625 - h) ** 2)

    def pressure(x):
        depth = math.sqrt(0.0625**2 - x * x) - (0.0625 - h)
        return 2 * math.sqrt(3.0) * (c * depth + math.sqrt(3.0) * 13000.0 * depth**2)

    most = quad(pressure, -half, half)[0]
    found = side_force(patch, 1e3, h, c, share=1.0, k_f=0.01, gamma=13000.0, phi_f=math.radians(30.0))
    assert found == pytest.approx(-most, rel=1e-6)


def test_it_opposes_the_sideways_motion_and_builds_up_with_it(patch):
    assert side_force(patch, 0.0) == 0.0
    assert side_force(patch, 0.2) == pytest.approx(-side_force(patch, -0.2))
    some, more, most = (side_force(patch, S_y) for S_y in (0.05, 0.3, 10.0))
    assert most < more < some < 0.0
    assert some == pytest.approx(most * 0.05 / 0.024 * 0.0625 * math.acos(1 - 0.02 / 0.0625) * 8 / 7, rel=0.2)


def test_a_deeper_wheel_is_held_the_more(patch):
    shallow, deep = side_force(patch, 10.0, 0.005), side_force(patch, 10.0, 0.02)
    assert deep / shallow == pytest.approx(4**2.5, rel=0.1)
