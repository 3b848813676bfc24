"""One contact law from locked to spinning, from straight to sideways: what it reduces to, keeps and takes."""

import math

import numpy as np
import pytest

from rover_pin.contact import Contact, Load, Soil, Wheel
from rover_pin.effects.combined_shear import CombinedShear
from rover_pin.effects.flank_pressure import FlankPressure
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.effects.lug_grip import LugGrip
from rover_pin.effects.ploughing import Ploughing
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.simulation.compiled.laws import amend_subject, load_and_rates
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.slip import against_travel, pushed_aside
from rover_pin.soil.wheel_forces import NetTraction, wheel_forces

SAND, WHEEL, V = Soil(c=0.0, phi=0.33, k=0.0065, k_1=1.3e5, n=1.5, exit_ratio=0.1), Wheel(0.0625, 0.06), 0.05
BASE = (SoilTraction(NetTraction(), SinkageAngles()), CombinedShear(1.0, NetTraction(), SinkageAngles()))
BESIDE = (FlankPressure(), SlipSoftening(), Ploughing(), LugExcavation(h_l=0.005), LugGrip())
U = (0.0, 0.3, 0.8, 0.99, 1.0, 1.01, 2.0, 20.0)
"""r omega / V: locked, braked, rolling, spinning."""


def contact_at(u, degrees, h=0.02):
    """A patch as a rig has it: Eq (1) along the heading, v_y over the faster of rim and heading."""
    beta = math.radians(degrees)
    v, v_y, rim = V * math.cos(beta), V * math.sin(beta), u * V
    faster = max(rim, v)
    S_y = v_y / max(faster, 1e-3 * abs(v_y))
    return Contact((rim - v) / faster, S_y, h, v, v_y, 0.0, rim, 0.0, 0.0, WHEEL, SAND)


def settled(effects, contact):
    """States where rates vanish: each rate is linear in its own state."""
    contact = amend_subject(effects, contact, [tuple(0.0 for _ in effect.states) for effect in effects])
    states = []
    for effect in effects:
        rates = [effect.rate(contact, Load(), (at,)) if effect.states else () for at in (0.0, 1.0)]
        states.append(tuple(zero / (zero - rate_at_one) for zero, rate_at_one in zip(*rates, strict=True)))
    return states


def pushed(u, degrees, effects=(*BASE, *BESIDE), h=0.02):
    """The load of the whole law at its settled states."""
    contact = contact_at(u, degrees, h)
    states = settled(effects, contact)
    load, _ = load_and_rates(effects, amend_subject(effects, contact, states), states)
    return Load(*(float(part) for part in load))


@pytest.mark.parametrize("u", U)
def test_straight_it_is_equations_1_to_7(u):
    """To 1e-12, with the flank beside it; S' and S_y' of a straight wheel are S and 0 to the last digit."""
    S = contact_at(u, 0.0).S
    assert tuple(map(float, against_travel(S, 0.0))) == pytest.approx((S, 0.0), rel=1e-15, abs=1e-15)
    expected = wheel_forces(S, *SinkageAngles().angles(0.02, WHEEL, SAND), WHEEL, SAND, 12)
    forces = pushed(u, 0.0, (*BASE, FlankPressure()))
    assert forces.f_t == pytest.approx(min(float(expected.f_t), (1 + min(S, 0)) * expected.torque / 0.0625), rel=1e-12)
    assert (forces.f_n, forces.torque) == pytest.approx((float(expected.f_n), float(expected.torque)), rel=1e-12)
    assert (forces.f_y, forces.moment_z) == (0.0, 0.0)


@pytest.mark.parametrize("u", U)
@pytest.mark.parametrize("degrees", [3.0, 30.0, 60.0, 85.0, 90.0])
def test_a_mirror_turns_the_side_force_and_nothing_else(u, degrees):
    left, right = pushed(u, degrees), pushed(u, -degrees)
    assert (left.f_y, left.moment_z) == pytest.approx((-right.f_y, -right.moment_z), rel=1e-12)
    assert (left.f_t, left.f_n, left.torque) == pytest.approx((right.f_t, right.f_n, right.torque), rel=1e-12)
    assert left.f_y < 0.0


def test_a_wheel_pushed_along_its_axle_is_braked_neither_way():
    """Locked at 90 deg it reverses into itself: f_t = 0, and the flank bears nearly all; just beside, nearly so."""
    across = pushed(0.0, 90.0)
    assert abs(across.f_t) < 2e-3 * abs(across.f_y)
    assert abs(pushed(0.0, 89.99).f_t) < 0.02 * abs(across.f_y)
    assert float(pushed_aside(*against_travel(0.0, 1e6))) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("u", [0.0, 0.3, 0.9, 1.0, 1.1, 3.0, 30.0])
@pytest.mark.parametrize("h", [0.003, 0.02, 0.05])
def test_sand_gives_no_energy(u, h):
    for degrees in np.linspace(0.0, 90.0, 31):
        for effects in ((*BASE, *BESIDE), (*BASE, FlankPressure())):
            load, contact = pushed(u, degrees, effects, h), contact_at(u, degrees)
            power = load.torque * u * V / 0.0625 - load.f_t * contact.v_x - load.f_y * contact.v_y
            assert power >= -1e-12, (degrees, effects)


@pytest.mark.parametrize("degrees", [0.0, 10.0, 45.0])
def test_forces_and_their_slopes_go_on_across_rolling(degrees):
    """Across r omega = u of the whole travel: left and right slopes of the shear and the flank agree."""
    u = math.sqrt(math.cos(b := math.radians(degrees)) ** 2 / (math.cos(b) ** 2 + 0.04 * math.sin(b) ** 2))
    d = 1e-4
    for name in ("f_t", "f_y", "torque", "f_n"):
        low, at, high = (getattr(pushed(u + shift, degrees, (*BASE, FlankPressure())), name) for shift in (-d, 0.0, d))
        assert high - at == pytest.approx(at - low, rel=0.05, abs=2e-5)


@pytest.mark.parametrize("u", [0.3, 1.0, 2.0])
def test_forces_and_their_slopes_go_on_across_straight(u):
    """f_t, f_n and torque are even in the slip angle with no corner, f_y and M_z odd with one slope."""
    nearly_straight, straight = pushed(u, 0.05), pushed(u, 0.0)
    assert nearly_straight.f_y == pytest.approx(0.5 * pushed(u, 0.1).f_y, rel=2e-2)
    for name in ("f_t", "f_n", "torque"):
        once, twice = (getattr(pushed(u, degrees), name) - getattr(straight, name) for degrees in (0.05, 0.1))
        assert twice == pytest.approx(4 * once, rel=0.1, abs=1e-6), "a corner would double"


def test_pull_over_load_follows_rim_over_travel_alone():
    """By construction: S' at one r omega / V moves by 6 % of itself up to 60 deg, where Eq (1) turns its sign."""
    for u in (0.3, 0.5, 2.0, 5.0):
        straight = contact_at(u, 0.0).S
        for degrees in (15.0, 30.0, 45.0, 60.0):
            contact = contact_at(u, degrees)
            S, S_y = against_travel(contact.S, contact.S_y)
            assert float(S) == pytest.approx(straight, abs=0.06 * min(u, 1 / u) + 1e-9)
            sine = math.sin(math.radians(degrees)) / max(u, 1.0)
            assert float(S_y) == pytest.approx(sine, rel=0.07)


def test_a_locked_wheel_is_a_plate_that_is_dragged():
    """Its shear is all of the strength, against the travel, and finite: u = 0 is a condition like another."""
    bare, contact = (BASE[0], BASE[1]), contact_at(0.0, 30.0)
    load = pushed(0.0, 30.0, bare)
    assert load.torque / 0.0625 < 0.0
    nearly = pushed(1e-6, 30.0, bare)
    assert tuple(load) == pytest.approx(tuple(nearly), rel=1e-4)
    strength = math.hypot(load.torque / 0.0625, load.f_y)
    straight = -pushed(0.0, 0.0, bare).torque / 0.0625
    assert strength == pytest.approx(straight, rel=0.02)
    assert contact.S == -1.0
