"""Bulldozing: against the travel, with the depth squared, the size by hand."""

import pytest

from rover_pin.contact import Load
from rover_pin.effects.bulldozing import Bulldozing


def test_size_by_hand(patch):
    """phi = 30 deg: X = 30 deg, D_1 = D_2 = 2 sqrt 3, so R = b (2 sqrt 3 c h + 6 gamma h^2)."""
    contact = patch(h=0.006, v_x=5.0, soil=patch().soil.replace(c=100.0))
    added = Bulldozing(share=1.0, gamma=15700.0).load(contact, Load(), ())
    by_hand = 0.05 * (2 * 3**0.5 * 100.0 * 0.006 + 6.0 * 15700.0 * 0.006**2)
    assert by_hand == pytest.approx(0.2735, abs=1e-4)
    assert [float(part) for part in added] == pytest.approx([-by_hand, 0.0, 0.0, 0.0, 0.0], rel=1e-5)


def test_it_opposes_travel_and_spares_a_parked_wheel(patch):
    assert float(Bulldozing().load(patch(v_x=-0.05), Load(), ()).f_t) > 0.0
    assert float(Bulldozing().load(patch(v_x=0.0), Load(), ()).f_t) == 0.0


def test_it_grows_with_the_depth_squared_in_dry_sand(patch):
    soil = patch().soil.replace(c=0.0)
    shallow, deep = (float(Bulldozing().load(patch(h=h, soil=soil), Load(), ()).f_t) for h in (0.004, 0.012))
    assert deep == pytest.approx(9.0 * shallow)
