"""Slip-sinkage: the exponent grows with driving slip, and the wheel stands deeper under its load."""

import math

import pytest
from scipy.integrate import quad

from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.soil.sinkage import entry_angle


def test_exponent_grows_with_driving_slip_only(patch):
    effect = SlipSinkage(n_1=0.5)
    assert float(effect.amend(patch(S=0.6), ()).soil.n) == pytest.approx(1.3)
    assert float(effect.amend(patch(S=-0.6), ()).soil.n) == 1.0


def test_exponent_stays_within_its_bound(patch):
    soil = patch().soil.replace(n=2.5)
    assert float(SlipSinkage(n_1=2.0).amend(patch(S=0.9, soil=soil), ()).soil.n) == 3.0


def test_a_slipping_wheel_stands_deeper_under_its_load(patch):
    """Without shear Eq (6) is r b k_1 (r / b)^n int (cos theta - cos theta_1)^n cos theta, integrated by hand."""
    base = patch(S=0.6, soil=patch().soil.replace(phi=0.0, c=0.0, exit_ratio=0.0))
    dug = SlipSinkage(n_1=0.5).amend(base, ())
    entries = []
    for contact, n in ((base, 1.0), (dug, 1.3)):
        soil = contact.soil.replace(n=float(contact.soil.n))
        theta_1 = entry_angle(9.5, 0.6, contact.wheel, soil)
        arc = quad(lambda at, n=n, entry=theta_1: (math.cos(at) - math.cos(entry)) ** n * math.cos(at), 0.0, theta_1)
        assert 0.045 * 0.05 * 54207.3 * 0.9**n * arc[0] == pytest.approx(9.5, rel=1e-5)
        entries.append(theta_1)
    assert entries[0] < entries[1]
