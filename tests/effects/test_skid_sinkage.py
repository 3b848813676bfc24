"""Skid sinkage: the mirror of slip-sinkage, for braking only."""

import pytest

from rover_pin.effects.skid_sinkage import SkidSinkage
from rover_pin.effects.slip_sinkage import SlipSinkage


def test_exponent_grows_with_skid_only(patch):
    effect = SkidSinkage(n_s=0.5)
    assert float(effect.amend(patch(S=-0.6), ()).soil.n) == pytest.approx(1.3)
    assert float(effect.amend(patch(S=0.6), ()).soil.n) == 1.0


def test_with_slip_sinkage_either_side_has_its_own_size(patch):
    for S, n in ((0.5, 1.4), (0.0, 1.0), (-0.5, 1.1)):
        contact = SkidSinkage(n_s=0.2).amend(SlipSinkage(n_1=0.8).amend(patch(S=S), ()), ())
        assert float(contact.soil.n) == pytest.approx(n)
