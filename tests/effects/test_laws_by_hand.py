"""Laws of effects away from their defaults: slow, negative, shallow, half-way, at their limits; each by hand."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from rover_pin.base.quantity import quantities
from rover_pin.contact import Load, Soil, Wheel
from rover_pin.effects.combined_shear import CombinedShear
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.effect import Ballast, Body, BodyEffect, Drive, Push, SensorEffect
from rover_pin.effects.flank_pressure import FlankPressure
from rover_pin.effects.grousers import Grousers
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.effects.ploughing import Ploughing
from rover_pin.effects.slip_sinkage import HIGHEST_EXPONENT, LOWEST_EXPONENT
from rover_pin.effects.slip_softening import SlipSoftening
from rover_pin.effects.soil_traction import NODES, SoilTraction
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.effects.winding_heating import WindingHeating
from rover_pin.simulation.model.effect_files import package_effects
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.combined import combined_forces
from rover_pin.soil.traction import FORMS


@pytest.mark.parametrize("share", [1.0, 0.3])
@pytest.mark.parametrize("angles", [FixedAngles(), SinkageAngles()], ids=lambda angles: type(angles).__name__)
@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_combined_shear_replaces_a_share_of_the_straight_forces(patch, form, angles, share):
    """Forces (1 - w) straight + w combined, whatever side force was there; fixed angles hold f_n to the sinkage's.

    Pressing the rut costs less by (0.2 v_y)^2 / (v^2 + (0.2 v_y)^2), v = 1 and v_y = 0.25.
    """
    wheel, soil = Wheel(r=0.06, b=0.04), Soil(c=200.0, k=0.008, exit_ratio=0.2)
    contact = patch(S=-0.3, S_y=0.25, h=0.009, wheel=wheel, soil=soil)
    straight = SoilTraction(form, angles).load(contact, Load(), ()).plus(Load(f_y=0.7, moment_z=0.03))
    found = straight.plus(CombinedShear(share=share, form=form, angles=angles).load(contact, straight, ()))
    arc = angles.angles(0.009, wheel, soil)
    sheared = combined_forces(-0.3, 0.25 / 0.7, arc, wheel, soil, NODES)
    f_n = straight.f_n if isinstance(angles, FixedAngles) else sheared.along.f_n
    along = sheared.along._replace(f_t=sheared.along.f_t + sheared.along.compaction * 0.0025 / 1.0025)
    per_load = (form.factor(along, wheel, -0.3), sheared.f_y / sheared.along.f_n, 1.0)
    turning = (sheared.along.torque / sheared.along.f_n, sheared.moment / sheared.along.f_n)
    combined = [f_n * each for each in (*per_load, *turning)]
    expected = [(1 - share) * one + share * other for one, other in zip(straight, combined, strict=True)]
    assert list(found) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("effect", [DiggingMemory(c_d=0.1), LugExcavation(h_l=0.002, filled=0.8)])
def test_rim_digs_by_contact_depth_up_to_a_tenth_of_a_millimetre(patch, effect):
    rates = [float(effect.rate(patch(h=h, rim=0.08, v_x=0.03), Load(), (0.0,))[0]) for h in (0.5e-4, 1e-4, 1e-3)]
    assert rates[0] == pytest.approx(rates[2] / 2)
    assert rates[1] == rates[2] > 0.0


@pytest.mark.parametrize("v", [0.005, -0.02])
@pytest.mark.parametrize("cut", [0.0, 0.003])
def test_trench_is_cut_by_lug_pockets_and_fades_with_travel(patch, v, cut):
    """L dD/dt = E h_l max(r omega - v, 0) (1 - 2 D / r) - D |v|, and the lift f_n max(-dD/dt, 0) is paid at any v."""
    effect = LugExcavation(h_l=0.002, filled=0.8, length=0.05)
    contact = patch(rim=0.01, v_x=v)
    expected = (0.8 * 0.002 * max(0.01 - v, 0.0) * (1 - 2 * cut / 0.045) - cut * abs(v)) / 0.05
    assert float(effect.rate(contact, Load(), (cut,))[0]) == pytest.approx(expected)
    paid = -float(effect.load(contact, Load(f_n=9.0), (cut,)).f_t) * v
    assert paid == pytest.approx(9.0 * max(-expected, 0.0), rel=1e-3)


def test_lift_stays_finite_at_vanishing_travel_speed(patch):
    """-dD/dt over v, halved at 0.1 mm/s and nothing at rest."""
    for v, share in ((1e-4, 0.5), (0.0, 0.0)):
        lift = float(LugExcavation(length=0.05).load(patch(rim=0.0, v_x=v), Load(f_n=9.0), (0.003,)).f_t)
        assert lift == pytest.approx(-share * 9.0 * 0.003 / 0.05)


def test_lugs_add_the_shear_between_rim_and_their_own_radius(patch):
    """f_t gains (q - 1) of the shear torque / r, torque q^2 - 1 of itself."""
    wheel, q = Wheel(r=0.06), 1 + 0.4 * 0.005 / 0.06
    before = Load(f_t=1.3, f_y=0.4, f_n=8.0, torque=0.09)
    found = Grousers(h_s=0.005, lambda_s=0.4).load(patch(wheel=wheel), before, ())
    assert list(found) == pytest.approx([(q - 1) * 0.09 / 0.06, 0.0, 0.0, (q * q - 1) * 0.09, 0.0])


@pytest.mark.parametrize("S", [0.3, -0.4])
@pytest.mark.parametrize("S_y", [0.02, -0.1])
def test_the_pressure_on_a_disc_builds_up_with_its_way_sideways(patch, S, S_y):
    """1 - exp(-|j_y| / k_f), j_y = 2 r sin theta_1 v_y / v, of the pressure by quadrature, less exp(-l S)."""
    wheel, soil = Wheel(r=0.06, b=0.04), Soil(c=300.0, exit_ratio=0.3)
    effect = FlankPressure(share=1.5, k_f=0.02, gamma=14000.0, phi_f=0.0)
    found = float(effect.load(patch(S=S, S_y=S_y, h=0.015, wheel=wheel, soil=soil), Load(f_n=9.0), ()).f_y)
    theta_1 = math.acos(1 - 0.015 / 0.06)
    way = 2 * 0.06 * math.sin(theta_1) * abs(S_y) / math.hypot(1 - max(S, 0.0), 0.02)

    def pressure(at):  # a wall without friction: 2 c h + gamma h^2
        h = 0.06 * (math.cos(at) - math.cos(theta_1))
        return 2 * (300.0 * h + 14000.0 * h * h / 2) * 0.06 * math.cos(at)

    kept = math.exp(-1.3 * max(S, 0.0))
    expected = 1.5 * kept * (1 - math.exp(-way / 0.02)) * quad(pressure, -theta_1, theta_1)[0]
    assert found == pytest.approx(-math.copysign(expected, S_y), rel=4e-3), "the corner at S = 0 is rounded"


# --- ploughing and softening -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("v", [0.005, 5.0, -0.01])
@pytest.mark.parametrize(("x", "S"), [(1.2, -0.4), (0.2, -0.4), (0.9, 0.3), (0.0, -0.4)])
def test_ploughing_pushes_by_its_heap_and_lifts_as_the_skid_ends(patch, v, x, S):
    """f_t = -(B p b p_wall + f_n h a_b max(x + ln(1 + S), 0) / ((n + 1/2) L)) v / sqrt(v^2 + u^2); phi = 0."""
    effect = Ploughing(a_b=0.8, share=1.4, gamma=13000.0, phi_f=0.0, length=0.05, v_0=0.005)
    soil, wheel = Soil(c=200.0, n=1.2), Wheel(r=0.06, b=0.04)
    found = effect.load(patch(S=S, h=0.01, v_x=v, rim=0.012, wheel=wheel, soil=soil), Load(f_n=9.0), (x,))
    heap = 1.4 * (1 - math.exp(-0.8 * x)) * 0.04 * (2 * 200.0 * 0.01 + 13000.0 * 0.01**2)
    lift = 9.0 * 0.01 * 0.8 * max(x + math.log(1 + min(S, 0.0)), 0.0) / (1.7 * 0.05)
    assert float(found.f_t) == pytest.approx(-(heap + lift) * v / math.hypot(v, 0.005 * 5 / 13), rel=1e-8, abs=1e-15)
    assert tuple(found[1:]) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("x", "e_b"), [(0.3, 0.4), (0.3, 2.0), (3.0, 2.0), (-0.2, 0.4)])
def test_ploughing_wheel_loses_its_rear_arc_up_to_nine_tenths(patch, x, e_b):
    soil = Soil(exit_ratio=0.2, theta_1=0.7, theta_2=-0.1)
    found = Ploughing(a_b=0.8, e_b=e_b).amend(patch(S=-0.4, soil=soil), (x,)).soil
    lost = e_b * max(1 - math.exp(-0.8 * x), 0.0)
    assert float(found.exit_ratio) == pytest.approx(max(0.2 - lost, -0.9))
    assert float(found.theta_2) == pytest.approx(min(-0.1 + lost * 0.7, 0.9 * 0.7))
    assert float(found.k_1) == pytest.approx(soil.k_1 * math.exp(-0.8 * x))


@pytest.mark.parametrize("v", [0.005, -0.02])
def test_loosened_sand_lifts_at_any_speed_by_its_sense(patch, v):
    contact = patch(S=0.2, v_x=v, rim=0.0, soil=Soil(n=0.8))
    found = SlipSoftening(a=1.4, length=0.05, v_0=0.005).load(contact, Load(f_n=9.0), (0.9,))
    lift = 9.0 * 0.006 * 1.4 * (0.9 - 0.36) / (1.3 * 0.05)
    assert float(found.f_t) == pytest.approx(-lift * v / math.hypot(v, 0.005))


@pytest.mark.parametrize(("x", "S", "z"), [(0.2, 0.5, 0.75), (0.9, 0.5, 0.75)])
def test_rim_turning_on_the_spot_loosens_a_fiftieth_of_its_way(patch, x, S, z):
    for effect, state in ((SlipSoftening(length=0.05), z), (Ploughing(length=0.05), 0.0)):
        rate = float(effect.rate(patch(S=S, v_x=0.0, rim=-0.08), Load(), (x,))[0])
        assert rate == pytest.approx(0.02 * 0.08 * max(state - x, 0.0) / 0.05)


@pytest.mark.parametrize(("S", "ahead"), [(-0.4, -math.log(0.6)), (-1.0, -math.log(0.2)), (0.3, 0.0)])
@pytest.mark.parametrize("x", [0.0, 0.2])
def test_skid_memory_follows_travel_or_a_twentieth_of_rolling(patch, S, ahead, x):
    rate = float(Ploughing(length=0.05).rate(patch(S=S, v_x=-0.03, rim=0.0), Load(), (x,))[0])
    assert rate == pytest.approx((ahead - x) * 0.03 / 0.05)


@pytest.mark.parametrize("v", [0.005, 0.05, -0.02])
def test_a_ploughed_rut_is_paid_for_where_the_form_leaves_it_out(patch, v):
    """Bekker's b int p dz at h in what is left of the sand, less that of the shallower rut in whole sand."""
    effect, soil, x, rest = Ploughing(a_b=0.7, share=0.0, e_b=0.0), Soil(c=0.0, n=1.0), 0.9, math.exp(-0.63)
    contact = patch(S=-0.7, h=0.004, v_x=v, rim=0.0, soil=soil, uncompacted=1.0)
    found = effect.load(effect.amend(contact, (x,)), Load(f_n=9.0), (x,))
    shallow = 0.004 * rest ** (1 / 1.5)  # W as h^(n + 1/2) at a small sinkage
    work = [soil.k_1 * share * (h * (1 - soil.exit_ratio**2)) ** 2 / 2 for share, h in ((rest, 0.004), (1.0, shallow))]
    assert float(found.f_t) == pytest.approx(-(work[0] - work[1]) * v / math.hypot(v, 0.001), rel=0.02)


def test_a_warm_winding_resists_as_copper_does(drive):
    """3.93 per mille a kelvin, IEC 60028: 2 W through 25 K/W are 50 K."""
    found = WindingHeating(R_th=25.0).amend(drive(resistance=24.0), (2.0,))
    assert float(found.resistance) == pytest.approx(24.0 * (1 + 0.00393 * 50.0))


# --- the differential ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("compliance", "backlash"), [(0.005, 0.0), (0.004, 0.02), (0.0, 0.02)])
@pytest.mark.parametrize("twist", [0.03, -0.03, 0.011, 0.005])
def test_a_twisted_differential_gives_back_what_it_holds(compliance, backlash, twist):
    """The torque on either rocker is -dE/d(twist) of what is stored beyond half the play, and damps besides."""
    effect = DifferentialCompliance(compliance=compliance, backlash=backlash, relaxation=0.02)
    made = lambda e, rate=0.0: Body(*[0.0] * 12, (), (), (), twist=e, twist_rate=rate)  # noqa: E731
    stiffness, over = 1 / max(compliance, 1e-6), max(abs(twist) - backlash / 2, 0.0)
    assert float(effect.stored(made(twist))) == pytest.approx(over**2 * stiffness / 2)
    slope = (float(effect.stored(made(twist + 1e-7))) - float(effect.stored(made(twist - 1e-7)))) / 2e-7
    assert float(effect.push(made(twist)).differential) == pytest.approx(-slope, rel=1e-4, abs=1e-9)
    damping = float(effect.push(made(twist, 0.3)).differential) - float(effect.push(made(twist)).differential)
    assert damping == pytest.approx(-0.02 * 0.3 * stiffness * (over > 0.0))


def test_a_rigid_differential_holds_by_itself():
    effect, body = DifferentialCompliance(compliance=0.0, backlash=0.0), Body(*[0.0] * 12, (), (), (), twist=0.1)
    assert (float(effect.stored(body)), float(effect.push(body).differential)) == (0.0, 0.0)
    assert not effect.frees_differential
    for size in ("compliance", "backlash"):
        assert DifferentialCompliance(**{"compliance": 0.0, "backlash": 0.0, size: 1e-3}).frees_differential


# --- what hangs on the kind alone ------------------------------------------------------------------------------------


def test_a_tether_begins_where_the_drive_begins():
    begun = TetherDrag(f_0=0.5, f_1=0.2, x_0=1.0, y_0=2.0).begun(3.0, -5.0)
    assert (begun.x_0, begun.y_0) == (4.0, -3.0)
    body = Body(7.0, 1.0, *[0.0] * 10, (), (), ())._replace(v_x=1.0)
    assert float(begun.push(body).f_x) == pytest.approx(-(0.5 + 0.2 * 5.0), rel=1e-5)


def test_what_a_sensor_misreads_can_be_undone():
    t = np.arange(0.0, 1.0, 0.1)
    channels = {"wheel_rate_fl": 1.0 + t, "wheel_rate_ml": 2.0 - t, "body_x": t}
    for sensor in (TachoScale(e=0.3), TachoScale(e=-0.2, wheel="ml")):
        read = channels | sensor.read(t, channels)
        assert {name: list(values) for name, values in sensor.undone(t, read).items()} == {
            name: pytest.approx(channels[name]) for name in sensor.read(t, channels)
        }


@pytest.mark.parametrize("kind", [kind for kind in package_effects() if issubclass(kind, SensorEffect)])
def test_a_sensor_at_its_neutral_values_reads_what_is(kind):
    t = np.arange(0.0, 1.0, 0.1)
    channels = {name: np.sin(7 * t) for name in ("wheel_rate_fl", "body_x", "body_vx", "body_pitch")}
    for name, values in kind().replace(**kind.neutral).read(t, channels).items():
        assert values == pytest.approx(channels[name], abs=1e-15)


def test_a_weak_motor_is_the_first_unless_it_is_named():
    assert WeakMotor().wheel == 0


@pytest.mark.parametrize("kind", [kind for kind in package_effects() if issubclass(kind, BodyEffect)])
def test_only_what_is_bent_holds_energy(kind):
    body = Body(*[0.1] * 12, (0.2, -0.1), (0.3, 0.0), (0.3, 0.0), twist=0.2, names=("rocker_l", "rocker_r"))
    assert (float(kind().stored(body)) > 0.0) == (kind.__name__ in ("DifferentialCompliance", "SpringDamper"))


@pytest.mark.parametrize("made", [Ballast, Body, Drive, Push, Load])
def test_what_is_not_said_is_nothing(made):
    assert set(made._field_defaults.values()) <= {0.0, ()}


def test_exponents_end_where_those_of_a_soil_do():
    about = quantities(Soil)["n"]
    assert (about.low, about.high) == (LOWEST_EXPONENT, HIGHEST_EXPONENT)


def test_only_slips_turn_their_sign_with_the_travel():
    """What digs, loosens, ploughs or heats is alike forwards and back."""
    odd = {state.name for kind in package_effects() for state in getattr(kind, "states", ()) if state.odd}
    assert odd == {"S", "S_y"}


def kinds(flag):
    return {kind.__name__ for kind in package_effects() if getattr(kind, flag, False)}


def test_what_kinds_say_of_themselves():
    """Only what resists leaves a rover where it stands; only what changes the bearing without a price is unpaid."""
    assert kinds("only_resists") == {"PivotFriction", "TetherDrag"}
    assert kinds("unpaid") == {"HardPatch", "LoadExponent", "MultiPass"}
    assert kinds("before_slip") == {"WheelScale"}


@pytest.mark.parametrize("kind", [kind for kind in package_effects() if getattr(kind, "states", ()) and kind.neutral])
@pytest.mark.parametrize("S", [0.6, -0.4])
def test_at_its_neutral_values_a_kind_with_a_memory_never_acts(kind, S, patch, drive):
    """Its state may move; what it has come to changes neither contact nor load."""
    effect, x = kind().replace(**kind.neutral), [0.0 for _ in kind.states]
    contact, motor = patch(S=S, v_x=0.03, rim=0.08), drive(bus_current=0.4)
    before = Load(f_t=1.0, f_y=0.1, f_n=8.0, torque=0.05)
    turning = hasattr(effect, "load")
    for _ in range(20):
        rates = effect.rate(contact, before, tuple(x)) if turning else effect.rate(motor, 0.1, tuple(x))
        x = [each + 0.05 * float(rate) for each, rate in zip(x, rates, strict=True)]
    if turning:
        amended = effect.amend(contact, tuple(x))
        assert np.array(amended[:9]) == pytest.approx(np.array(contact[:9]))
        assert list(amended.soil.values().values()) == pytest.approx(list(contact.soil.values().values()))
        back = effect.load(amended._replace(S=-0.2, v_x=0.02), before, tuple(x))
        assert [float(each) for each in back] == pytest.approx([0.0] * 5, abs=1e-12)
    else:
        assert list(effect.amend(motor, tuple(x))) == pytest.approx(list(motor))
        assert float(effect.torque(motor, 0.1, tuple(x))) == 0.0
