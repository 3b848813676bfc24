"""Laws of effects that have no file of their own here, by hand: closed forms, limits, and what must not change."""

import math

import casadi as ca
import numpy as np
import pytest

from rover_pin.contact import Load, Soil, Wheel
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.effects.effect import Drive
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.post_peak import PostPeak
from rover_pin.effects.rate_dependence import RateDependence
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.slip import SIDEWAYS_SHARE, AlgebraicSlip, RelaxedSlip, sliding_speed
from rover_pin.effects.soil_traction import NODES, SoilTraction
from rover_pin.effects.velocity_filter import VelocityFilter
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import GrossTraction, NetTraction, TorqueTraction, wheel_forces

BEFORE = Load(f_t=1.3, f_y=0.4, f_n=8.0, torque=0.09)


# --- PostPeak --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("times", [0.0, 0.5, 1.0, 2.0, -1.0])
def test_shear_loss_of_failed_sand_grows_with_the_square_of_slip(patch, times):
    """B (1 - e^-x^2) at x = S / S_w: 63 % of the loss at S_w, alike forwards and back; load and resistance stay."""
    effect = PostPeak(fraction=0.35, S_w=0.45)
    contact = patch(S=0.45 * times, wheel=Wheel(r=0.06))
    lost = 0.35 * (1 - math.exp(-times * times))
    left = BEFORE.plus(effect.load(contact, BEFORE, ()))
    assert left.torque == pytest.approx(0.09 * (1 - lost))
    assert left.f_y == pytest.approx(0.4 * (1 - lost))
    paid = 1.0 + min(contact.S, 0.0)
    assert left.f_t == pytest.approx(1.3 - paid * 0.09 / 0.06 * lost)
    assert left.f_n == 8.0


# --- RateDependence, Bulldozing --------------------------------------------------------------------------------------


def test_shear_grows_by_the_logarithm_of_the_sliding_speed(patch):
    before = BEFORE._replace(moment_z=0.02)
    left = before.plus(RateDependence(c_r=0.05, v_0=0.01).load(patch(rim=0.05, v_x=0.01), before, ()))
    more = 0.05 * math.log(5.0)
    assert list(left) == pytest.approx([1.3 + 2.0 * more, 0.4 * (1 + more), 8.0, 0.09 * (1 + more), 0.02 * (1 + more)])


def test_bulldozing_by_hand(patch):
    """phi = 30 deg: X = 30 deg, D_1 = D_2 = 2 sqrt 3, so R = b (2 sqrt 3 c h + 6 gamma h^2), against the travel."""
    contact = patch(h=0.006, v_x=5.0, soil=patch().soil.replace(c=100.0))
    effect = Bulldozing(share=1.0, gamma=15700.0)
    by_hand = 0.05 * (2 * 3**0.5 * 100.0 * 0.006 + 6.0 * 15700.0 * 0.006**2)
    for v, sense in ((5.0, -1.0), (-5.0, 1.0), (0.0, 0.0)):
        added = effect.load(contact._replace(v_x=v), Load(), ())
        assert [float(part) for part in added] == pytest.approx([sense * by_hand, 0.0, 0.0, 0.0, 0.0], rel=1e-5)


# --- MotionResistance, NormalDamping ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("q", "u"), [(0.0, 3e-3), (0.5, 3e-3 * 0.6**0.5), (1.0, 1.8e-3), (2.0, 1.08e-3)])
def test_resistance_fades_the_later_the_faster_the_rim(q, u):
    """v_0 = 3 mm/s under a rim at 4 mm/s: v_0 / sqrt(v_0^2 + rim^2) = 0.6, of which the q-th power is taken."""
    assert MotionResistance(v_0=3e-3, q=q).fading(4e-3) == pytest.approx(u)
    assert MotionResistance(v_0=3e-3, q=q).fading(0.0) == pytest.approx(3e-3)


@pytest.mark.parametrize("v", [0.05, 0.005, 0.0, -0.05])
def test_resistance_is_a_share_of_the_load_against_travel(patch, v):
    push = MotionResistance(R=0.03, v_0=0.005).load(patch(v_x=v, rim=0.012), BEFORE, ())
    assert push.f_t == pytest.approx(-0.03 * 8.0 * v / math.hypot(v, 0.005 * 5 / 13)), "u = v_0^2 / sqrt(v_0^2 + rim^2)"
    assert (push.f_y, push.f_n, push.torque) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("speed", "factor"), [(0.0, 1.0), (0.02, 1.2), (-0.03, 0.7), (-0.2, 0.0)])
def test_soil_that_is_pushed_in_bears_more_and_never_pulls(patch, speed, factor):
    left = BEFORE.plus(NormalDamping(d=10.0).load(patch(v_n=speed), BEFORE, ()))
    assert list(left) == pytest.approx([factor * part for part in BEFORE])


# --- SideShear -------------------------------------------------------------------------------------------------------


def arc(h, r, ratio):
    theta_1 = math.acos(1 - h / r)
    return theta_1 * (1 + ratio)


@pytest.mark.parametrize("S_y", [0.3, -0.3, 0.02, 0.0])
@pytest.mark.parametrize("f_t", [0.0, 2.0])
def test_side_force_is_the_remaining_strength_by_janosis_law(patch, S_y, f_t):
    wheel, soil = Wheel(r=0.06, b=0.04), Soil(c=300.0, phi=0.5, k=0.004, exit_ratio=0.2)
    before = Load(f_t=f_t, f_n=8.0, torque=0.1)
    push = SideShear(scale=0.8).load(patch(S_y=S_y, h=0.007, wheel=wheel, soil=soil), before, ())
    length = 0.06 * arc(0.007, 0.06, 0.2)
    strength = 300.0 * 0.04 * length + 8.0 * math.tan(0.5)
    share = 1 - math.exp(-abs(S_y) * length / 2 / 0.004)
    expected = -math.copysign(0.8 * math.sqrt(strength**2 - f_t**2) * share, S_y) if S_y else 0.0
    assert push.f_y == pytest.approx(expected, rel=1e-9, abs=1e-15)
    ahead = 0.06 * math.sin(math.acos(1 - 0.007 / 0.06) * (1 - 0.2) / 2)
    assert push.moment_z == pytest.approx(expected * ahead, rel=1e-9, abs=1e-15)
    assert (push.f_t, push.f_n, push.torque) == (0.0, 0.0, 0.0)


def test_a_wheel_in_the_air_has_no_side_force_and_finite_slopes(patch):
    f_n, S_y = ca.SX.sym("f_n"), ca.SX.sym("S_y")
    contact = patch(S_y=S_y, soil=Soil(c=0.0))
    f_y = SideShear().load(contact, Load(f_n=f_n), ()).f_y
    slopes = ca.Function("slopes", [f_n, S_y], [f_y, ca.jacobian(f_y, ca.vertcat(f_n, S_y))])
    for slope in slopes(0.0, 0.2):
        assert all(math.isfinite(value) for value in slope.full().ravel())
    assert float(slopes(0.0, 0.2)[0]) == pytest.approx(0.0, abs=1e-10)


# --- slip ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rim", "v", "S"),
    [
        (0.05, 0.03, 0.4),
        (0.03, 0.05, -0.4),
        (-0.05, -0.03, -0.4),
        (0.002, 0.0, 0.2),
        (0.0, 0.003, -0.3),
        (0.05, -0.05, 1.0),
        (-0.05, 0.05, -1.0),
    ],
)
def test_algebraic_slip_is_eq_1_but_for_the_least_speed(patch, rim, v, S):
    assert pytest.approx(S) == AlgebraicSlip(v_0=0.01).amend(patch(rim=rim, v_x=v), ()).S


def test_sideways_slip_is_side_speed_over_the_faster_motion(patch):
    slip = AlgebraicSlip(v_0=0.01)
    assert slip.amend(patch(rim=0.05, v_x=0.03, v_y=0.02), ()).S_y == pytest.approx(0.4)
    assert slip.amend(patch(rim=0.03, v_x=-0.05, v_y=-0.02), ()).S_y == pytest.approx(-0.4)
    assert slip.amend(patch(rim=0.0, v_x=0.0, v_y=0.002), ()).S_y == pytest.approx(0.2)
    assert slip.amend(patch(rim=0.0, v_x=0.0, v_y=0.5), ()).S_y == pytest.approx(1 / SIDEWAYS_SHARE)
    assert sliding_speed(patch(rim=0.0, v_x=0.0, v_y=-0.5)) == pytest.approx(0.05 * 0.5)


@pytest.mark.parametrize(("rim", "v_x"), [(0.05, 0.03), (0.03, 0.05), (-0.05, -0.02), (-0.02, -0.05)])
def test_relaxed_slip_settles_at_eq_1_over_its_length(patch, rim, v_x):
    """Its steady state, and by how much it moves off it: the rate is max(speeds) (S - s) / L; S leads it by T."""
    slip, contact = RelaxedSlip(length=0.03, damping=0.1), patch(rim=rim, v_x=v_x, v_y=0.01)
    fastest = max(abs(rim), abs(v_x))
    steady = ((rim - v_x) / fastest, 0.01 / fastest)
    assert slip.rate(contact, Load(), steady) == pytest.approx((0.0, 0.0), abs=1e-15)
    for off in (0.1, -0.2):
        x = (steady[0] - off, steady[1] - off)
        assert slip.rate(contact, Load(), x) == pytest.approx((fastest * off / 0.03, fastest * off / 0.03))
        amended = slip.amend(contact, x)
        assert pytest.approx(min(1.0, max(-1.0, x[0] + 0.1 * fastest * off / 0.03))) == amended.S
        assert amended.S_y == pytest.approx(x[1] + 0.1 * fastest * off / 0.03)


# --- GearFriction ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("omega", [0.5, -2.0])
def test_a_bristle_winds_up_over_its_angle(omega):
    """After the angle theta the bristle has wound up by sgn(omega) (1 - exp(-|theta| / theta_c))."""
    friction, drive = GearFriction(tau_c=0.07, theta_c=0.03), Drive(0.0, omega, 7.2, 24.0, 3.3)
    for turned in (0.0, 0.01, 0.05):
        z = math.copysign(1 - math.exp(-turned / 0.03), omega)
        (rate,) = friction.rate(drive, 0.2, (z,))
        assert rate == pytest.approx(omega / 0.03 * math.exp(-turned / 0.03))
        assert friction.torque(drive, 0.2, (z,)) == pytest.approx(-0.07 * z)


# --- SoilTraction ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", [NetTraction(), TorqueTraction(), GrossTraction()], ids=lambda form: form.name)
@pytest.mark.parametrize("angles", [FixedAngles(), SinkageAngles()], ids=lambda angles: type(angles).__name__)
def test_paper_traction_is_a_share_of_the_load_by_sinkage(patch, form, angles):
    contact = patch(S=0.3, h=0.008, soil=Soil(c=200.0, k=0.01))
    wheel, soil = contact.wheel, contact.soil
    push = SoilTraction(form, angles).load(contact, Load(), ())
    theta_1 = math.acos(1 - 0.008 / wheel.r)
    sunk = wheel_forces(0.3, theta_1, -soil.exit_ratio * theta_1, wheel, soil, NODES)
    acting = (
        sunk if isinstance(angles, SinkageAngles) else wheel_forces(0.3, soil.theta_1, soil.theta_2, wheel, soil, NODES)
    )
    pull = {"net": acting.f_t, "torque": acting.torque / wheel.r, "gross": acting.thrust}[form.name]
    assert push.f_n == pytest.approx(sunk.f_n)
    assert push.f_t == pytest.approx(pull / acting.f_n * sunk.f_n)
    assert push.torque == pytest.approx(acting.torque / acting.f_n * sunk.f_n)
    assert push.f_y == 0.0


# --- sensors ---------------------------------------------------------------------------------------------------------


def test_filtered_velocity_is_exact_for_linear_pieces():
    """tau dy/dt = v - y, y(0) = v(0), on a ramp of slope a from v_0: y = v - a tau (1 - exp(-t / tau))."""
    t = np.array([0.0, 0.1, 0.4, 1.0])
    v = 0.5 + 2.0 * t
    read = VelocityFilter(tau=0.3).read(t, {"body_vx": v, "body_x": v})
    assert set(read) == {"body_vx"}
    assert read["body_vx"] == pytest.approx(v - 2.0 * 0.3 * (1 - np.exp(-t / 0.3)))
    assert VelocityFilter(tau=0.0).read(t, {"body_vx": v}) == {}
