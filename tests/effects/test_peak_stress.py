"""Moved peak: traction and effect together are Wong and Reece's forces, and a peak in front costs pull."""

import pytest

from rover_pin.contact import Load
from rover_pin.effects.peak_stress import PeakStress
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.peak_stress import PeakAngle, peak_stress_forces
from rover_pin.soil.traction import NetTraction, TorqueTraction, wheel_forces


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


def test_half_a_share_is_half_way(patch):
    paper, half = both(patch(), NetTraction(), SinkageAngles(), share=0.5)
    _, whole = both(patch(), NetTraction(), SinkageAngles())
    for name in ("f_n", "f_t", "torque"):
        between = (float(getattr(paper, name)) + float(getattr(whole, name))) / 2
        assert float(getattr(half, name)) == pytest.approx(between)


def test_fixed_angles_give_the_factor_at_the_soil_s_angles(patch):
    contact = patch()
    soil, theta_m = contact.soil, PeakAngle().at(contact.S, contact.soil.theta_1)
    fixed = peak_stress_forces(contact.S, (soil.theta_1, theta_m, soil.theta_2), contact.wheel, soil)
    _, load = both(contact, TorqueTraction(), FixedAngles())
    assert float(load.f_t / load.f_n) == pytest.approx(float(fixed.torque / (contact.wheel.r * fixed.f_n)), rel=1e-4)


def test_a_peak_further_in_front_pulls_less(patch):
    pull = []
    for a_0 in (0.2, 0.4, 0.6):
        _, load = both(patch(), NetTraction(), SinkageAngles(), a_0=a_0, a_1=0.0)
        pull.append(float(load.f_t / load.f_n))
    assert pull[0] > pull[1] > pull[2]


def test_the_peak_stays_within_the_arc(patch):
    contact = patch(S=1.0)
    theta_1, theta_2 = SinkageAngles().angles(contact.h, contact.wheel, contact.soil)
    _, load = both(contact, NetTraction(), SinkageAngles(), a_0=1.0, a_1=1.0)
    flat = wheel_forces(1.0, theta_1, theta_2, contact.wheel, contact.soil)
    assert 0.0 < float(load.f_n) < float(flat.f_n)
