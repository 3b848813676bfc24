"""Laws of effects away from their defaults: slow, negative, shallow, half-way, at their limits; each by hand."""

import math

import numpy as np
import pytest

from rover_pin.contact import Load, Soil, Wheel
from rover_pin.effects.combined_shear import CombinedShear
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.effect import Body, BodyEffect
from rover_pin.effects.ploughing import Ploughing
from rover_pin.effects.soil_traction import NODES, SoilTraction
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.tracked_point import TrackedPoint
from rover_pin.effects.tracker_scale import TrackerScale
from rover_pin.effects.tracking_delay import TrackingDelay
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


@pytest.mark.parametrize("v", [0.005, 0.05, -0.02])
def test_a_ploughed_rut_is_paid_for_where_the_form_leaves_it_out(patch, v):
    """Bekker's b int p dz at h in what is left of the sand, less that of the shallower rut in whole sand."""
    effect, soil, x, rest = Ploughing(a_b=0.7, share=0.0, e_b=0.0), Soil(c=0.0, n=1.0), 0.9, math.exp(-0.63)
    contact = patch(S=-0.7, h=0.004, v_x=v, rim=0.0, soil=soil, uncompacted=1.0)
    found = effect.load(effect.amend(contact, (x,)), Load(f_n=9.0), (x,))
    shallow = 0.004 * rest ** (1 / 1.5)  # W as h^(n + 1/2) at a small sinkage
    work = [soil.k_1 * share * (h * (1 - soil.exit_ratio**2)) ** 2 / 2 for share, h in ((rest, 0.004), (1.0, shallow))]
    assert float(found.f_t) == pytest.approx(-(work[0] - work[1]) * v / math.hypot(v, 0.001), rel=0.02)


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
    channels = {"wheel_rate_fl": 1.0 + t, "wheel_rate_ml": 2.0 - t, "body_x": 3.0 + t, "body_yaw": t, "body_vx": t**2}
    late = {"body_x": 3.0 + t}
    back = TrackingDelay(d=0.2).undone(t, TrackingDelay(d=0.2).read(t, late))["body_x"]
    assert list(back[:-2]) == pytest.approx(late["body_x"][:-2])
    for sensor in (
        TachoScale(e=0.3),
        TachoScale(e=-0.2, wheel="ml"),
        TrackerScale(e=0.05),
        TrackedPoint(x=-0.2, y=0.1),
    ):
        read = channels | sensor.read(t, channels)
        assert {name: list(values) for name, values in sensor.undone(t, read).items()} == {
            name: pytest.approx(channels[name]) for name in sensor.read(t, channels)
        }


@pytest.mark.parametrize("kind", [kind for kind in package_effects() if issubclass(kind, BodyEffect)])
def test_only_what_is_bent_holds_energy(kind):
    body = Body(*[0.1] * 12, (0.2, -0.1), (0.3, 0.0), (0.3, 0.0), twist=0.2, names=("rocker_l", "rocker_r"))
    assert (float(kind().stored(body)) > 0.0) == (kind.__name__ in ("DifferentialCompliance", "SpringDamper"))


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
