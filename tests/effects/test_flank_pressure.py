"""Earth pressure on the disc: the closed form against quadrature, signs, and how it builds up."""

import math

import pytest
from scipy.integrate import quad

from rover_pin.contact import Load, Wheel
from rover_pin.effects.flank_pressure import FlankPressure

WHEEL = Wheel(r=0.0625, b=0.06)


def beside(patch, S_y, h=0.02, c=0.0, trench=0.0):
    return patch(S=0.0, S_y=S_y, h=h, v_y=0.03 * S_y, trench=trench, wheel=WHEEL, soil=patch().soil.replace(c=c))


def side_force(patch, S_y, h=0.02, c=0.0, **numbers):
    return float(FlankPressure(**numbers).load(beside(patch, S_y, h, c), Load(), ()).f_y)


@pytest.mark.parametrize("h", [1e-5, 0.003, 0.02, 0.05])
@pytest.mark.parametrize("c", [0.0, 300.0])
@pytest.mark.parametrize("phi", [20.0, 30.0, 38.0])
def test_full_pressure_is_the_integral_over_the_buried_segment(patch, h, c, phi):
    """Strips of the disc push wedges and what stands on them; the heap is half the rut's sand and all that is swept.

    The depth of the segment at x along the chord is that of the circle.
    """
    half, slope, X = math.sqrt(0.0625**2 - (0.0625 - h) ** 2), math.tan(math.radians(phi)), math.radians(45 - phi / 2)

    def depth(x):
        return math.sqrt(0.0625**2 - x * x) - (0.0625 - h)

    swept = quad(depth, -half, half)[0]
    u = math.sqrt(2 * slope * (swept + 0.06 * h / 2))

    def pressure(x):
        long = depth(x) / math.tan(X)
        area = depth(x) * long / 2 + long * (u + u - long * slope) / 2
        return (1 / math.tan(X) + math.tan(X + math.radians(phi))) * (c * depth(x) + 13000.0 * area)

    most = quad(pressure, -half, half)[0]
    found = side_force(patch, 1e3, h, c, share=1.0, k_f=0.01, gamma=13000.0, phi_f=math.radians(phi))
    assert found == pytest.approx(-most, rel=1e-4)


def test_it_opposes_the_sideways_motion_and_builds_up_with_it(patch):
    assert side_force(patch, 0.0) == 0.0
    assert side_force(patch, 0.2) == pytest.approx(-side_force(patch, -0.2))
    some, more, most = (side_force(patch, S_y) for S_y in (0.05, 0.3, 10.0))
    assert most < more < some < 0.0
    chord, same_heap = 2 * math.sqrt(0.0625**2 - 0.0425**2), beside(patch, 0.05)._replace(S_y=10.0)
    full = float(FlankPressure().load(same_heap, Load(), ()).f_y)
    assert some == pytest.approx(full * 0.05 / 0.05 * chord, rel=0.1)


@pytest.mark.parametrize("rim", [0.0, 0.01, 0.5])
def test_sand_rubs_along_the_disc(patch, rim):
    """tan phi of the side force, less 5 % of the full one, against v - q r omega; the torque has the same arm q r."""
    soil = patch().soil.replace(phi=math.radians(20.0), c=0.0)
    contact = patch(S=0.0, S_y=0.5, h=0.02, v_x=0.03, v_y=0.04, rim=rim, wheel=WHEEL, soil=soil)
    load = FlankPressure(v_0=1e-6).load(contact, Load(), ())
    q = 1 - 0.43 * 0.02 / 0.0625
    slides = 0.03 - q * rim
    full = float(FlankPressure(v_0=1e-6).load(contact._replace(S_y=1e3), Load(), ()).f_y)
    rubs = full * (math.hypot(float(load.f_y) / full, 0.05) - 0.05)
    expected = math.tan(math.radians(20.0)) * rubs * slides / math.hypot(slides, 0.04)
    assert float(load.f_t) == pytest.approx(expected, rel=1e-3)
    assert float(load.torque) == pytest.approx(float(load.f_t) * q * 0.0625)
