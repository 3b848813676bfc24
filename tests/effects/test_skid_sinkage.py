"""Skid sinkage: the mirror of slip-sinkage, for braking only."""

import pytest

from rover_pin.effects.skid_sinkage import SkidSinkage


def test_exponent_grows_with_skid_only(patch):
    effect = SkidSinkage(n_s=0.5)
    assert float(effect.amend(patch(S=-0.6), ()).soil.n) == pytest.approx(1.3)
    assert float(effect.amend(patch(S=0.6), ()).soil.n) == 1.0
