"""Shear along and across on a load, and earth pressure on the disc: closed forms, signs, energy is taken."""

import math

import pytest
from scipy.integrate import quad

from rover_pin.contact import Load, Soil, Wheel
from rover_pin.effects.combined_shear import CombinedShear
from rover_pin.effects.flank_pressure import FlankPressure
from rover_pin.effects.soil_traction import NODES, SoilTraction
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.combined import combined_forces
from rover_pin.soil.wheel_forces import FORMS, NetTraction


def whole(contact, form, angles):
    base = SoilTraction(form, angles).load(contact, Load(), ())
    return base.plus(CombinedShear(form=form, angles=angles).load(contact, base, ()))


@pytest.mark.parametrize("angles", [FixedAngles(), SinkageAngles()])
@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_straight_running_is_left_alone(patch, form, angles):
    contact = patch(S_y=0.0)
    base = SoilTraction(form, angles).load(contact, Load(), ())
    assert [float(v) for v in whole(contact, form, angles)] == pytest.approx([float(v) for v in base], rel=1e-9)


def test_a_slipping_wheel_slides_sideways_more_easily(patch):
    rolling, spinning = (float(whole(patch(S=S, S_y=0.1), NetTraction(), SinkageAngles()).f_y) for S in (0.05, 0.9))
    assert rolling < spinning < 0.0


@pytest.mark.parametrize("share", [1.0, 0.3])
@pytest.mark.parametrize("angles", [FixedAngles(), SinkageAngles()], ids=lambda angles: type(angles).__name__)
@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_combined_shear_replaces_a_share_of_the_straight_forces(patch, form, angles, share):
    """Forces (1 - w) straight + w combined, whatever side force was there; fixed angles hold f_n to the sinkage's.

    Pressing the rut costs less by (0.2 v_y)^2 / (v^2 + (0.2 v_y)^2), v = 1 and v_y = 0.25.
    """
    wheel, soil = Wheel(r=0.06, b=0.04), Soil(c=200.0, k=0.008, exit_ratio=0.2)
    contact = patch(S=-0.3, S_y=0.25, h=0.009, wheel=wheel, soil=soil)
    straight = SoilTraction(form, angles).load(contact, Load(), ()).plus(Load(f_y=0.7, moment_z=0.03))
    total = straight.plus(CombinedShear(share=share, form=form, angles=angles).load(contact, straight, ()))
    arc = angles.angles(0.009, wheel, soil)
    sheared = combined_forces(-0.3, 0.25 / 0.7, arc, wheel, soil, NODES)
    f_n = straight.f_n if isinstance(angles, FixedAngles) else sheared.along.f_n
    along = sheared.along._replace(f_t=sheared.along.f_t + sheared.along.compaction * 0.0025 / 1.0025)
    per_load = (form.factor(along, wheel, -0.3), sheared.f_y / sheared.along.f_n, 1.0)
    turning = (sheared.along.torque / sheared.along.f_n, sheared.moment / sheared.along.f_n)
    combined = [f_n * component for component in (*per_load, *turning)]
    expected = [
        (1 - share) * straight_part + share * combined_part
        for straight_part, combined_part in zip(straight, combined, strict=True)
    ]
    assert list(total) == pytest.approx(expected, rel=1e-9)


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
    force = side_force(patch, 1e3, h, c, share=1.0, k_f=0.01, gamma=13000.0, phi_f=math.radians(phi))
    assert force == pytest.approx(-most, rel=1e-4)


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
