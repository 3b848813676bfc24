"""A braked wheel: the sand that is left to carry, the heap, the rear that is lost; nothing while driving."""

import math

import pytest

from rover_pin.contact import Load, Soil, Wheel
from rover_pin.discrepancy.candidate import plain_candidate
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
    content = Ploughing(a_b=1.0, gamma=13000.0).load(contact, Load(f_n=9.0), (SKID,))
    assert float(content.f_t) == pytest.approx(-0.4 * 6.0 * 13000.0 * 0.05 * 0.01**2, rel=1e-5)


def test_the_state_is_the_skid_and_comes_over_a_length_of_travel(patch):
    rate = lambda **speeds: float(Ploughing().rate(patch(**speeds), Load(), (0.0,))[0])  # noqa: E731
    assert rate(S=-0.4, v_x=0.05, rim=0.0) == pytest.approx(SKID * 0.05 / 0.066)
    assert rate(S=0.7) == 0.0
    assert math.isfinite(rate(S=-1.0))


@pytest.mark.parametrize("v", [0.005, 5.0, -0.01])
@pytest.mark.parametrize(("x", "S"), [(1.2, -0.4), (0.2, -0.4), (0.9, 0.3), (0.0, -0.4)])
def test_ploughing_pushes_by_its_heap_and_lifts_as_the_skid_ends(patch, v, x, S):
    """f_t = -(B p b p_wall + f_n h a_b max(x + ln(1 + S), 0) / ((n + 1/2) L)) v / sqrt(v^2 + u^2); phi = 0."""
    effect = Ploughing(a_b=0.8, share=1.4, gamma=13000.0, phi_f=0.0, length=0.05, v_0=0.005)
    soil, wheel = Soil(c=200.0, n=1.2), Wheel(r=0.06, b=0.04)
    content = effect.load(patch(S=S, h=0.01, v_x=v, rim=0.012, wheel=wheel, soil=soil), Load(f_n=9.0), (x,))
    heap = 1.4 * (1 - math.exp(-0.8 * x)) * 0.04 * (2 * 200.0 * 0.01 + 13000.0 * 0.01**2)
    lift = 9.0 * 0.01 * 0.8 * max(x + math.log(1 + min(S, 0.0)), 0.0) / (1.7 * 0.05)
    assert float(content.f_t) == pytest.approx(-(heap + lift) * v / math.hypot(v, 0.005 * 5 / 13), rel=1e-8, abs=1e-15)
    assert tuple(content[1:]) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("v", [0.005, 0.05, -0.02])
def test_a_ploughed_rut_is_paid_for_where_the_form_leaves_it_out(patch, v):
    """Bekker's b int p dz at h in what is left of the sand, less that of the shallower rut in whole sand."""
    effect, soil, x, decay = Ploughing(a_b=0.7, share=0.0, e_b=0.0), Soil(c=0.0, n=1.0), 0.9, math.exp(-0.63)
    contact = patch(S=-0.7, h=0.004, v_x=v, rim=0.0, soil=soil, uncompacted=1.0)
    content = effect.load(effect.amend(contact, (x,)), Load(f_n=9.0), (x,))
    shallow = 0.004 * decay ** (1 / 1.5)  # W as h^(n + 1/2) at a small sinkage
    work = [soil.k_1 * share * (h * (1 - soil.exit_ratio**2)) ** 2 / 2 for share, h in ((decay, 0.004), (1.0, shallow))]
    assert float(content.f_t) == pytest.approx(-(work[0] - work[1]) * v / math.hypot(v, 0.001), rel=0.02)


@pytest.mark.parametrize("locked", [0.1, 0.2, 0.5])
def test_a_locked_wheel_rests_on_the_part_of_the_sand_that_passes_below_it(patch, locked):
    """The settled state is -ln m at S = -1, and -ln(1 + S) where more than m is rolled."""
    effect = Ploughing(locked=locked, length=0.05)

    def settled(S):
        return float(effect.rate(patch(S=S, v_x=0.05, rim=0.0), Load(), (0.0,))[0])

    assert settled(-1.0) == pytest.approx(-math.log(locked), rel=1e-3)
    rolled = min(1.6 * locked, 0.9)
    assert settled(rolled - 1.0) == pytest.approx(-math.log(rolled), rel=2e-3)
    assert settled(0.3) == 0.0


def test_what_a_locked_wheel_rests_on_is_uncertain_in_a_search():
    cause = plain_candidate(Ploughing()).cause
    (number,) = (parameter for parameter in cause.parameters if parameter.name == "Ploughing.locked")
    assert number.prior
    assert number.value(1.0) / number.value(-1.0) > 2.0, "an order of magnitude is known, not more"
