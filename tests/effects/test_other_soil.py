"""Effects that change the soil at a wheel, by place, by its peak and by slip that sinks and loosens it."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from rover_pin import ConstantDuty, scenario, simulate
from rover_pin.contact import Load
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.interface_friction import InterfaceFriction
from rover_pin.effects.load_exponent import LoadExponent
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.peak_stress import PeakStress
from rover_pin.effects.skid_sinkage import SkidSinkage
from rover_pin.effects.slip_sinkage import SlipSinkage, rut_cost
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.compaction import sinking_resistance
from rover_pin.soil.peak_stress import PeakAngle, peak_stress_forces
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.soil.wheel_forces import FORMS, NetTraction, TorqueTraction


def test_exit_ratio_and_exit_angle_move_alike(patch):
    soil = ExitAngle(e_1=0.3).amend(patch(S=0.5), ()).soil
    assert float(soil.exit_ratio) == pytest.approx(1.0 / 7.0 + 0.15)
    assert float(soil.theta_2) == pytest.approx(-math.radians(5.0) - 0.15 * math.radians(35.0))
    assert float(-soil.theta_2 / soil.theta_1) == pytest.approx(float(soil.exit_ratio))


def test_the_rim_s_angle_replaces_that_of_the_sand(patch):
    m = math.tan(math.radians(20.0)) / math.tan(math.radians(30.0))
    soil = InterfaceFriction(m=m).amend(patch(soil=patch().soil.replace(c=100.0)), ()).soil
    assert float(soil.phi) == pytest.approx(math.radians(20.0))
    assert float(soil.c) == pytest.approx(100.0 * m)


def test_an_exponent_follows_the_depth(patch):
    assert float(LoadExponent(n_h=0.5).amend(patch(h=0.01), ()).soil.n) == pytest.approx(1.0 + 0.5 * 0.01 / 0.05)


def test_each_pass_adds_its_share(patch):
    soil = patch().soil.replace(k_2=1e5)
    for axle in (0.0, 1.0, 2.0):
        pressed = MultiPass(stiffening=0.3, shear_stiffening=0.5).amend(patch(axle=axle, soil=soil), ()).soil
        assert (pressed.k_1, pressed.k_2) == pytest.approx(((1 + 0.3 * axle) * soil.k_1, (1 + 0.3 * axle) * soil.k_2))
        assert pressed.k == pytest.approx(soil.k / (1 + 0.5 * axle))


def test_inside_and_outside(patch):
    effect, soil = HardPatch(g=0.5, g_k=1.0, dphi=0.03, x_from=1.0, length=0.4), patch().soil
    inside, outside = (effect.amend(patch(x=x), ()).soil for x in (1.2, 0.9))
    assert [float(v) for v in outside.values().values()] == pytest.approx([float(v) for v in soil.values().values()])
    assert float(inside.k_1) == pytest.approx(1.5 * soil.k_1)
    assert float(inside.k) == pytest.approx(0.5 * soil.k)
    assert float(inside.phi) == pytest.approx(soil.phi + 0.03)
    assert float(effect.share(1.0)) == pytest.approx(0.5)
    assert float(effect.share(1.01) - effect.share(0.99)) == pytest.approx(math.tanh(2.0), rel=1e-6)


@pytest.mark.parametrize(("sign", "effect"), [(-1, HardPatch(0.5, 1.0, 0.05)), (1, HardPatch(-0.2, -0.4, -0.05))])
def test_a_drive_slips_otherwise_inside_only(sign, effect):
    """Less on firm ground, more on loose ground, of a wheel that is inside while the rover climbs through."""
    base = scenario("incline", **{"terrain.angle_deg": 4.0, "terrain.start": -3.0}).model
    plain, patched = (
        simulate(model, ConstantDuty(0.6), 20.0)
        for model in (base, base.having(effect.replace(x_from=0.3, length=0.2)))
    )

    def at(trace, x):
        front = trace["body_x"] + 0.15
        return float(np.interp(x, front, trace["slip_fl"])), float(np.interp(x, front, trace["sinkage_fl"]))

    before, inside = at(patched, 0.25)[0] - at(plain, 0.25)[0], at(patched, 0.4)[0] - at(plain, 0.4)[0]
    assert abs(before) < 1e-3
    assert sign * inside > 0.01
    assert sign * (at(patched, 0.4)[1] - at(plain, 0.4)[1]) > 1e-4


def both(contact, form, angles, **changes):
    load = SoilTraction(form, angles).load(contact, Load(), ())
    return load, load.plus(PeakStress(form=form, angles=angles, **changes).load(contact, load, ()))


def test_together_they_are_wong_and_reece_s_forces(patch):
    contact = patch()
    theta_1, theta_2 = SinkageAngles().angles(contact.h, contact.wheel, contact.soil)
    theta_m = PeakAngle().at(contact.S, theta_1)
    exact = peak_stress_forces(contact.S, (theta_1, theta_m, theta_2), contact.wheel, contact.soil, 16)
    _, load = both(contact, NetTraction(), SinkageAngles())
    assert [float(part) for part in (load.f_n, load.f_t, load.torque)] == pytest.approx(
        [float(part) for part in (exact.f_n, exact.f_t, exact.torque)], rel=1e-4
    )


def test_fixed_angles_give_the_factor_at_the_soil_s_angles(patch):
    contact = patch()
    soil, theta_m = contact.soil, PeakAngle().at(contact.S, contact.soil.theta_1)
    fixed = peak_stress_forces(contact.S, (soil.theta_1, theta_m, soil.theta_2), contact.wheel, soil)
    _, load = both(contact, TorqueTraction(), FixedAngles())
    assert float(load.f_t / load.f_n) == pytest.approx(float(fixed.torque / (contact.wheel.r * fixed.f_n)), rel=1e-4)


@pytest.mark.parametrize(("effect", "S"), [(SlipSinkage(n_1=0.5), 0.6), (SkidSinkage(n_s=0.5), -0.6)])
def test_exponent_grows_with_driving_slip_or_with_skid_alone(patch, effect, S):
    assert float(effect.amend(patch(S=S), ()).soil.n) == pytest.approx(1.3)
    assert float(effect.amend(patch(S=-S), ()).soil.n) == 1.0


def test_a_slipping_wheel_stands_deeper_under_its_load(patch):
    """Without shear Eq (6) is r b k_1 (r / b)^n int (cos theta - cos theta_1)^n cos theta, integrated by hand."""
    base = patch(S=0.6, soil=patch().soil.replace(phi=0.0, c=0.0, exit_ratio=0.0))
    dug = SlipSinkage(n_1=0.5).amend(base, ())
    entries = []
    for contact, n in ((base, 1.0), (dug, 1.3)):
        soil = contact.soil.replace(n=float(contact.soil.n))
        theta_1 = entry_angle(9.5, 0.6, contact.wheel, soil)
        arc = quad(lambda at, n=n, entry=theta_1: (math.cos(at) - math.cos(entry)) ** n * math.cos(at), 0.0, theta_1)
        assert 0.045 * 0.05 * 54207.3 * 0.9**n * arc[0] == pytest.approx(9.5, rel=1e-5)
        entries.append(theta_1)
    assert entries[0] < entries[1]


@pytest.mark.parametrize(("effect", "S"), [(SlipSinkage(n_1=0.5), 0.6), (SkidSinkage(n_s=0.5), -0.6)])
@pytest.mark.parametrize("angles", [FixedAngles(), SinkageAngles()])
@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_the_deeper_rut_is_paid_for_once(patch, effect, S, angles, form):
    """In the net form whose angles follow the sinkage Eq (7) has it already; everywhere else the effect brings it."""
    contact = effect.amend(SoilTraction(form, angles).amend(patch(S=S, v_x=5.0), ()), ())
    soil = patch().soil
    once = float(sinking_resistance(0.006, contact.wheel, soil.replace(n=1.3), soil))
    value = float(effect.load(contact, Load(f_n=9.0), ()).f_t)
    assert once > 0.05
    assert value == pytest.approx(0.0 if (form.name, angles) == ("net", SinkageAngles()) else -once, rel=1e-5)
    backwards = contact._replace(v_x=-5.0)
    assert float(effect.load(backwards, Load(f_n=9.0), ()).f_t) == pytest.approx(-value, rel=1e-5, abs=1e-12)


def test_wheel_that_sinks_with_slip_climbs_no_better():
    """In the torque form a deeper wheel had no cost, and its longer arc even some gain."""
    settings = {"soil.k": 0.01, "terrain.angle_deg": 9.0, "terrain.start": 0.0, "duration": 8.0}
    plain, sinking = (scenario("incline", add=add, **settings).drive() for add in ((), (SlipSinkage(n_1=1.0),)))
    assert np.mean(sinking.stack("sinkage")[-1]) > 1.1 * np.mean(plain.stack("sinkage")[-1])
    assert sinking["body_x"][-1] < plain["body_x"][-1]


EFFECT = SlipSoftening(a=1.2)


def settled(patch, **speeds):
    """Drive the state until it stays."""
    contact, x = patch(**speeds), 0.0
    for _ in range(4000):
        x += 0.01 * float(EFFECT.rate(contact, Load(), (x,))[0])
    return contact, x


def test_the_stiffness_of_a_settled_wheel(patch):
    contact, x = settled(patch, S=0.5, v_x=0.05, rim=0.1)
    assert x == pytest.approx(0.75, rel=1e-6)
    soil = EFFECT.amend(contact, (x,)).soil
    assert float(soil.k_1) == pytest.approx(contact.soil.k_1 * math.exp(-1.2 * 0.75), rel=1e-6)
    assert settled(patch, S=-0.5, v_x=0.1, rim=0.05)[1] == pytest.approx(0.0, abs=1e-12)


def test_slip_and_drift_loosen_as_the_sides_of_a_right_angle(patch):
    """Drift alone 1 - exp(-(d / 0.4)^2), d = v_y / v, as much as slip can at most; S = 0.5 alone 0.75."""
    for d, alone in ((0.2, 1 - math.exp(-0.25)), (0.8, 1 - math.exp(-4.0)), (20.0, 1.0)):
        assert settled(patch, S=0.0, S_y=d)[1] == pytest.approx(math.hypot(0.005, alone), rel=1e-3)
        assert settled(patch, S=0.5, S_y=0.5 * d)[1] == pytest.approx(math.hypot(0.75, alone), rel=3e-3)
        assert settled(patch, S=0.5, S_y=-0.5 * d)[1] == settled(patch, S=0.5, S_y=0.5 * d)[1]


def test_it_takes_a_contact_length_of_travel(patch):
    """1 - exp(-x / L) of the way at any speed; a wheel that stands digs on by its rim, and is not lifted again."""
    for v in (0.01, 0.08):
        rate = float(EFFECT.rate(patch(S=0.5, v_x=v, rim=0.0), Load(), (0.25,))[0])
        assert rate == pytest.approx((0.75 - 0.25) * v / 0.066)
    assert float(EFFECT.rate(patch(S=1.0, v_x=0.0, rim=0.05), Load(), (0.25,))[0]) > 0.0
    assert float(EFFECT.rate(patch(S=0.0, v_x=0.0, rim=0.05), Load(), (0.25,))[0]) == 0.0


def test_the_way_up_costs_what_it_lifts(patch):
    """Under a given load dh/dx of the softening that is lost, by the balanced sinkage itself."""
    wheel, soil, load = patch().wheel, patch().soil.replace(phi=0.0, c=0.0), 9.5
    x, dx = 0.5, 1e-4

    def depth(state):
        factor = math.exp(-1.2 * state)
        return sinkage(entry_angle(load, 0.0, wheel, soil.replace(k_1=factor * soil.k_1)), wheel)

    slope = (depth(x + dx) - depth(x - dx)) / (2 * dx)
    contact = patch(S=0.0, v_x=5.0, rim=5.0, h=depth(x), soil=soil)
    paid = -float(EFFECT.load(contact, Load(f_n=load), (x,)).f_t)
    assert paid == pytest.approx(load * slope * x / 0.066, rel=0.06)


def test_the_deeper_rut_is_paid_for_where_the_form_leaves_it_out(patch):
    for traction, times in ((SoilTraction(), 1.0), (SoilTraction(NetTraction(), SinkageAngles()), 0.0)):
        contact = traction.amend(patch(S=0.5, v_x=5.0), ())
        loose = EFFECT.amend(contact, (0.75,))
        expected = float(rut_cost(loose._replace(uncompacted=1.0), contact.soil))
        assert expected > 0.05
        assert -float(EFFECT.load(loose, Load(f_n=9.0), (0.75,)).f_t) == pytest.approx(times * expected, abs=1e-9)
