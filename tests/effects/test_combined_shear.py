"""Combined shear on a load: nothing when straight, energy is taken in every direction of slip."""

import math

import numpy as np
import pytest

from rover_pin.contact import Load
from rover_pin.effects.combined_shear import CombinedShear
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.soil.angles import FixedAngles, SinkageAngles
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


def test_the_soil_takes_the_work_of_slip_in_every_direction(patch):
    """T omega - f_t v - f_y v_y >= 0, with the speeds that the slips stand for."""
    net, angles = NetTraction(), SinkageAngles()
    for S in np.linspace(-0.9, 0.95, 12):
        for slip_angle in np.radians([-70.0, -20.0, 5.0, 45.0, 80.0]):
            rim, v = (0.05, 0.05 * (1 - S)) if S >= 0 else (0.05 * (1 + S), 0.05)
            v_y = v * math.tan(slip_angle)
            contact = patch(S=float(S), S_y=v_y / max(rim, v), v_x=v, v_y=v_y, rim=rim)
            load = whole(contact, net, angles)
            taken = float(load.torque) * rim / 0.045 - float(load.f_t) * v - float(load.f_y) * v_y
            assert taken >= 0.0


def test_a_slipping_wheel_slides_sideways_more_easily(patch):
    rolling, spinning = (float(whole(patch(S=S, S_y=0.1), NetTraction(), SinkageAngles()).f_y) for S in (0.05, 0.9))
    assert rolling < spinning < 0.0
