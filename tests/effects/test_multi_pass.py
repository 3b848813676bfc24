"""Multi-pass: the first wheel meets fresh soil, those that follow a stiffer one."""

import pytest

from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.soil_traction import SoilTraction


def test_each_pass_adds_its_share(patch):
    soil = patch().soil.replace(k_2=1e5)
    for axle in (0.0, 1.0, 2.0):
        pressed = MultiPass(stiffening=0.3, shear_stiffening=0.5).amend(patch(axle=axle, soil=soil), ()).soil
        assert (pressed.k_1, pressed.k_2) == pytest.approx(((1 + 0.3 * axle) * soil.k_1, (1 + 0.3 * axle) * soil.k_2))
        assert pressed.k == pytest.approx(soil.k / (1 + 0.5 * axle))


def test_a_following_wheel_is_borne_and_driven_better(patch):
    first, last = (SoilTraction().load(MultiPass().amend(patch(axle=axle), ()), None, ()) for axle in (0.0, 2.0))
    assert float(last.f_n) == pytest.approx(1.6 * float(first.f_n), rel=0.02)
    assert float(last.f_t) / float(last.f_n) > float(first.f_t) / float(first.f_n)
