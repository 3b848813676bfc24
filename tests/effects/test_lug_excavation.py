"""The trench of lugs: its depth by the volume that they carry, nothing at no slip, the way out paid for."""

import pytest

from rover_pin.contact import Load
from rover_pin.effects.lug_excavation import LugExcavation

EFFECT = LugExcavation(h_l=0.002)


def deep(patch, S, v=0.02):
    contact, D = patch(S=S, v_x=v, rim=v / (1 - S), h=0.02), 0.0
    for _ in range(20000):
        D += 0.005 * float(EFFECT.rate(contact, Load(), (D,))[0])
    return contact, D


@pytest.mark.parametrize("S", [0.0, 0.2, 0.6, 0.9])
def test_the_trench_is_what_the_pockets_carry_off(patch, S):
    """h_l (r omega - v) = D v, levelling off as 1 - 2 D / r."""
    contact, D = deep(patch, S)
    carried = 0.002 * S / (1 - S)
    assert pytest.approx(carried / (1 + 2 * carried / 0.045), rel=1e-6, abs=1e-15) == D
    assert float(EFFECT.amend(contact, (D,)).h) == pytest.approx(0.02 - D)
    assert float(EFFECT.load(contact, Load(f_n=9.0), (D,)).f_t) == pytest.approx(0.0, abs=1e-9)


def test_the_way_out_costs_the_lift(patch):
    contact = patch(S=0.0, v_x=0.03, rim=0.03)
    added, rate = EFFECT.load(contact, Load(f_n=9.0), (0.004,)), float(EFFECT.rate(contact, Load(), (0.004,))[0])
    assert rate < 0.0
    assert -float(added.f_t) * 0.03 == pytest.approx(-9.0 * rate, rel=1e-4)


def test_a_wheel_that_spins_in_place_digs_to_half_its_radius(patch):
    contact, D = patch(S=1.0, v_x=0.0, rim=0.05, h=0.02), 0.0
    for _ in range(20000):
        D += 0.01 * float(EFFECT.rate(contact, Load(), (D,))[0])
    assert pytest.approx(0.0225, rel=1e-3) == D
    assert float(EFFECT.load(contact, Load(f_n=9.0), (D,)).f_t) == 0.0
    assert float(EFFECT.rate(patch(S=1.0, v_x=0.0, h=0.0), Load(), (0.0,))[0]) == 0.0
