"""Grousers: Eq (2) and its moment at the shearing radius, integrated once more by hand."""

import math

import pytest
from scipy.integrate import quad

from rover_pin.contact import Load
from rover_pin.effects.grousers import Grousers
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.soil.angles import SinkageAngles

EFFECT = Grousers(h_s=0.006, lambda_s=0.5)
R_S = 0.045 + 0.003


@pytest.mark.parametrize("S", [-0.6, -0.03, 0.0, 0.3, 1.0])
def test_slip_is_that_of_the_lugs(patch, S):
    v_over_omega = 0.045 * ((1 - S) if S >= 0 else 1 / (1 + S))
    expected = (R_S - v_over_omega) / max(R_S, v_over_omega)
    assert float(EFFECT.amend(patch(S=S), ()).S) == pytest.approx(expected)


@pytest.mark.parametrize("S", [0.05, 0.4])
def test_torque_is_the_moment_of_the_shear_at_the_lugs(patch, S):
    contact = patch(S=S)
    r, b, soil, traction = 0.045, 0.05, contact.soil, SoilTraction(angles=SinkageAngles())
    theta_1 = math.acos(1 - contact.h / r)

    def tau(theta):
        sigma = soil.k_1 * (r / b * (math.cos(theta) - math.cos(theta_1)))
        j = R_S * (theta_1 - theta) - r * (1 - S) * (math.sin(theta_1) - math.sin(theta))
        return (soil.c + sigma * math.tan(soil.phi)) * (1 - math.exp(-j / soil.k))

    moment = R_S**2 * b * quad(tau, -soil.exit_ratio * theta_1, theta_1)[0]
    amended = EFFECT.amend(contact, ())
    load = traction.load(amended, Load(), ())
    assert float(load.plus(EFFECT.load(amended, load, ())).torque) == pytest.approx(moment, rel=1e-5)


def test_lugs_pull_more_at_the_same_slip(patch):
    amended = EFFECT.amend(patch(), ())
    plain, lugged = (SoilTraction().load(contact, Load(), ()) for contact in (patch(), amended))
    assert float(lugged.plus(EFFECT.load(amended, lugged, ())).f_t) > 1.05 * float(plain.f_t)
