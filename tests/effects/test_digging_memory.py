"""Digging with a memory: the hole deepens with slip, is left by travel, and holds the wheel back."""

import math

import pytest

from rover_pin.contact import Load
from rover_pin.effects.digging_memory import DiggingMemory


def test_a_wheel_that_spins_on_the_spot_digs_to_half_its_radius(patch):
    effect, depth, dt = DiggingMemory(c_d=0.1), 0.0, 1e-3
    for _ in range(8000):
        depth += dt * float(effect.rate(patch(rim=0.05, v_x=0.0), Load(), (depth,))[0])
    assert depth == pytest.approx(0.0225 * (1 - math.exp(-2 * 0.1 * 0.05 * 8.0 / 0.045)), rel=1e-3)
    assert float(effect.rate(patch(rim=0.05, v_x=0.0), Load(), (0.0225,))[0]) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("deepest", [0.05, 0.5, 1.0])
def test_at_constant_slip_the_hole_levels_off(patch, deepest):
    """What the rim throws balances what falls in and is rolled out: D = d r q / (d r + q), q = c_d L S / (1 - S)."""
    effect, r, v = DiggingMemory(c_d=0.2, length=0.03, deepest=deepest, v_0=1e-6), 0.045, 0.02
    depths = []
    for S in (0.1, 0.5, 0.9, 0.999):
        q = 0.2 * 0.03 * S / (1.0 - S)
        depths.append(deepest * r * q / (deepest * r + q))
        assert float(effect.rate(patch(rim=v / (1.0 - S), v_x=v), Load(), (depths[-1],))[0]) == pytest.approx(
            0.0, abs=1e-8
        )
    assert sorted(depths) == depths
    assert depths[-1] < deepest * r
    rate = float(effect.rate(patch(rim=0.05, v_x=0.0), Load(), (deepest * r,))[0])
    assert rate == pytest.approx(0.0, abs=1e-12)


def test_the_hole_lowers_the_ground_and_holds_the_wheel_back(patch):
    effect, x = DiggingMemory(), (0.0045,)
    assert float(effect.amend(patch(h=0.006), x).h) == pytest.approx(0.0015)
    assert float(effect.amend(patch(h=0.003), x).h) == 0.0
    forward, back, parked = (
        float(effect.load(patch(v_x=v), Load(f_n=9.0, torque=0.1), x).f_t) for v in (5.0, -5.0, 0.0)
    )
    assert forward == pytest.approx(-9.0 * 0.0045 / 0.04, rel=1e-5)
    assert back == pytest.approx(9.0 * 0.0045 / 0.04, rel=1e-5)
    assert parked == 0.0


@pytest.mark.parametrize("v", [-0.05, 0.0005, 0.005, 0.05])
def test_climbing_out_costs_what_it_raises(patch, v):
    """The ground under a load f_n rises by -dD/dt: that lift is the work of the resistance, at any speed."""
    effect, D, f_n = DiggingMemory(length=0.03), 0.006, 9.0
    contact = patch(rim=-1.0, v_x=v)
    lift = -f_n * float(effect.rate(contact, Load(f_n=f_n), (D,))[0])
    taken = -v * float(effect.load(contact, Load(f_n=f_n), (D,)).f_t)
    assert lift > 0.0
    assert taken == pytest.approx(lift, rel=1e-12)
