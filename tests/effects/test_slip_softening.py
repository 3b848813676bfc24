"""Slip that sinks and loosens: how much, over what way, in every direction, and what the way out of the rut costs."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from rover_pin.contact import Load
from rover_pin.effects.skid_sinkage import SkidSinkage
from rover_pin.effects.slip_sinkage import SlipSinkage, rut_cost
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.scenarios.scenario import scenario
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.compaction import sinking_resistance
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.soil.traction import FORMS, NetTraction


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
    here = float(effect.load(contact, Load(f_n=9.0), ()).f_t)
    assert once > 0.05
    assert here == pytest.approx(0.0 if (form.name, angles) == ("net", SinkageAngles()) else -once, rel=1e-5)
    backwards = contact._replace(v_x=-5.0)
    assert float(effect.load(backwards, Load(f_n=9.0), ()).f_t) == pytest.approx(-here, rel=1e-5, abs=1e-12)


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
