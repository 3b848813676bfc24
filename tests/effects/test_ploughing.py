"""A braked wheel: the sand that is left to carry, the heap, the rear that is lost; nothing while driving."""

import math

import pytest

from rover_pin.contact import Load
from rover_pin.effects.ploughing import Ploughing

SKID = -math.log(0.6)
"""The state of a wheel that has long been braked at S = -0.4."""


def test_what_is_left_carries(patch):
    contact = patch(S=-0.4)
    soil = Ploughing(a_b=1.0, e_b=0.5).amend(contact, (SKID,)).soil
    assert float(soil.k_1) == pytest.approx(0.6 * contact.soil.k_1)
    assert float(soil.exit_ratio) == pytest.approx(1 / 7 - 0.2)
    assert float(soil.theta_2) == pytest.approx(math.radians(-5.0) + 0.2 * math.radians(35.0))


def test_the_heap_by_hand(patch):
    """phi = 30 deg: D_1 = D_2 = 2 sqrt 3, so the wall's force is 6 gamma b h^2, of which the share p = 0.4 pushes."""
    contact = patch(S=-0.4, h=0.01, v_x=5.0, rim=3.0, soil=patch().soil.replace(c=0.0))
    found = Ploughing(a_b=1.0, gamma=13000.0).load(contact, Load(f_n=9.0), (SKID,))
    assert float(found.f_t) == pytest.approx(-0.4 * 6.0 * 13000.0 * 0.05 * 0.01**2, rel=1e-5)


def test_the_state_is_the_skid_and_comes_over_a_length_of_travel(patch):
    rate = lambda **speeds: float(Ploughing().rate(patch(**speeds), Load(), (0.0,))[0])  # noqa: E731
    assert rate(S=-0.4, v_x=0.05, rim=0.0) == pytest.approx(SKID * 0.05 / 0.066)
    assert rate(S=0.7) == 0.0
    assert math.isfinite(rate(S=-1.0))
