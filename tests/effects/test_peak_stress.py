"""Moved peak: traction and effect together are Wong and Reece's forces, and a peak in front costs pull."""

import pytest

from rover_pin.contact import Load
from rover_pin.effects.peak_stress import PeakStress
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.peak_stress import PeakAngle, peak_stress_forces
from rover_pin.soil.traction import NetTraction, TorqueTraction


def both(contact, form, angles, **changes):
    load = SoilTraction(form, angles).load(contact, Load(), ())
    return load, load.plus(PeakStress(form=form, angles=angles, **changes).load(contact, load, ()))


def test_together_they_are_wong_and_reece_s_forces(patch):
    contact = patch()
    theta_1, theta_2 = SinkageAngles().angles(contact.h, contact.wheel, contact.soil)
    theta_m = PeakAngle().at(contact.S, theta_1)
    exact = peak_stress_forces(contact.S, (theta_1, theta_m, theta_2), contact.wheel, contact.soil, 16)
    _, load = both(contact, NetTraction(), SinkageAngles())
    assert [float(part) for part in (load.f_n, load.f_t, load.torque)] == pytest.approx(
        [float(part) for part in (exact.f_n, exact.f_t, exact.torque)], rel=1e-4
    )


def test_fixed_angles_give_the_factor_at_the_soil_s_angles(patch):
    contact = patch()
    soil, theta_m = contact.soil, PeakAngle().at(contact.S, contact.soil.theta_1)
    fixed = peak_stress_forces(contact.S, (soil.theta_1, theta_m, soil.theta_2), contact.wheel, soil)
    _, load = both(contact, TorqueTraction(), FixedAngles())
    assert float(load.f_t / load.f_n) == pytest.approx(float(fixed.torque / (contact.wheel.r * fixed.f_n)), rel=1e-4)
