"""Load-dependent exponent: it follows the depth, and softens or stiffens what lies deeper."""

import pytest

from rover_pin.effects.load_exponent import LoadExponent
from rover_pin.effects.soil_traction import SoilTraction


def test_exponent_follows_the_depth(patch):
    assert float(LoadExponent(n_h=0.5).amend(patch(h=0.01), ()).soil.n) == pytest.approx(1.0 + 0.5 * 0.01 / 0.05)


@pytest.mark.parametrize(("n_h", "softer"), [(1.0, True), (-0.5, False)])
def test_deeper_soil_is_softer_for_a_positive_slope(patch, n_h, softer):
    def force(h, effect):
        return float(SoilTraction().load(effect.amend(patch(h=h), ()), None, ()).f_n)

    ratios = [force(h, LoadExponent(n_h=n_h)) / force(h, LoadExponent(n_h=0.0)) for h in (0.001, 0.012)]
    assert (ratios[1] < ratios[0] < 1.0) if softer else (ratios[1] > ratios[0] > 1.0)
    assert force(0.012, LoadExponent(n_h=n_h)) > force(0.006, LoadExponent(n_h=n_h))
