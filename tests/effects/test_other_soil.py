"""Effects that change the soil at a wheel: its constants by hand, a hard patch, a peak of the stress that moves."""

import math

import numpy as np
import pytest

from rover_pin.contact import Load
from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.interface_friction import InterfaceFriction
from rover_pin.effects.load_exponent import LoadExponent
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.peak_stress import PeakStress
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.peak_stress import PeakAngle, peak_stress_forces
from rover_pin.soil.traction import NetTraction, TorqueTraction


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
