"""Larger wheels: the slip of the true rim, its lever, and a rover that goes faster than it should."""

import pytest

from rover_pin.contact import Load
from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.slip import AlgebraicSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.wheel_scale import WheelScale
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate


def test_it_comes_before_the_slip(patch):
    model = scenario("flat").model.having(WheelScale(e=0.1))
    assert [type(each).__name__ for each in model.contact_effects][:2] == ["WheelScale", "RelaxedSlip"]
    contact = AlgebraicSlip().amend(WheelScale(e=0.1).amend(patch(rim=0.05, v_x=0.033), ()), ())
    assert float(contact.S) == pytest.approx(1.0 - 0.033 / 0.055)


def test_the_lever_is_the_true_one(patch):
    """Torque over tangential force of the torque form is the radius."""
    larger = WheelScale(e=0.1).amend(patch(), ())
    load = SoilTraction().load(larger, Load(), ())
    assert float(load.torque / load.f_t) == pytest.approx(1.1 * 0.045, rel=1e-9)


@pytest.mark.parametrize("e", [0.04, -0.04])
def test_speed_follows_the_rim(e):
    """On the flat, v = (1 + e) r omega (1 - S) with the slip that the soil asks for, near that of the plain wheel."""
    flat = scenario("flat").model
    plain, scaled = (simulate(each, ConstantDuty(0.55), 6.0) for each in (flat, flat.having(WheelScale(e=e))))
    rim = (1.0 + e) * 0.045 * scaled["wheel_rate_ml"][-1]
    assert scaled["body_vx"][-1] == pytest.approx(rim * (1.0 - scaled["slip_ml"][-1]), rel=1e-4)
    assert scaled["slip_ml"][-1] == pytest.approx(plain["slip_ml"][-1], abs=0.2 * abs(e))
