"""Combined shear on a load: nothing when straight, energy is taken in every direction of slip."""

import pytest

from rover_pin.contact import Load, Soil, Wheel
from rover_pin.effects.combined_shear import CombinedShear
from rover_pin.effects.soil_traction import NODES, SoilTraction
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.combined import combined_forces
from rover_pin.soil.traction import FORMS, NetTraction


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
    found = straight.plus(CombinedShear(share=share, form=form, angles=angles).load(contact, straight, ()))
    arc = angles.angles(0.009, wheel, soil)
    sheared = combined_forces(-0.3, 0.25 / 0.7, arc, wheel, soil, NODES)
    f_n = straight.f_n if isinstance(angles, FixedAngles) else sheared.along.f_n
    along = sheared.along._replace(f_t=sheared.along.f_t + sheared.along.compaction * 0.0025 / 1.0025)
    per_load = (form.factor(along, wheel, -0.3), sheared.f_y / sheared.along.f_n, 1.0)
    turning = (sheared.along.torque / sheared.along.f_n, sheared.moment / sheared.along.f_n)
    combined = [f_n * each for each in (*per_load, *turning)]
    expected = [(1 - share) * one + share * other for one, other in zip(straight, combined, strict=True)]
    assert list(found) == pytest.approx(expected, rel=1e-9)
