"""Slip-sinkage: the exponent grows with driving slip, and the wheel stands deeper under its load."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from rover_pin.contact import Load
from rover_pin.effects.skid_sinkage import SkidSinkage
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.scenarios.scenario import scenario
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.compaction import sinking_resistance
from rover_pin.soil.sinkage import entry_angle
from rover_pin.soil.traction import FORMS


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
