"""The reduced model and what an effect does to it, against the full rover, statics, and finite differences."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from rover_pin import ConstantDuty, SlipControl, load_rover, scenario, simulate
from rover_pin.control.slip_control import Gains
from rover_pin.control.slip_estimate import SpeedTable, TableEstimate, TrueSlip
from rover_pin.control.torque_check import NoLimit, TorqueLimit
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.point_mass import PointMass
from rover_pin.effects.post_peak import PostPeak
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.parameters import TABLE_1
from rover_pin.rover.statics import wheel_loads
from rover_pin.simulation.model.defaults import own_soil
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.tuning.reduced_model.drive import ContinuousControl, ReducedDrive, as_column
from rover_pin.tuning.reduced_model.effects import BodyPlace, omitted_effects, pull_along
from rover_pin.tuning.reduced_model.load_transfer import axle_loads

HELD = Gains(k_p=0.0, k_i=0.0)
OPEN = ContinuousControl(TrueSlip(), NoLimit())


def test_axle_loads_at_rest_are_those_of_the_wheels():
    rover = load_rover()
    assert axle_loads(rover, 9.81).at_rest == pytest.approx(wheel_loads(rover, 0.0).reshape(3, 2).sum(axis=1))


def test_push_moves_load_backwards_by_the_centre_of_mass_height():
    """No load appears or vanishes, and the moment about the ground is the inertia's: sum x_i dW_i = -h per newton."""
    rover = load_rover()
    loads, q = axle_loads(rover, 9.81), pin.neutral(rover.model)
    data = rover.model.createData()
    centre = pin.centerOfMass(rover.model, data, q)[2]
    bottom = data.oMi[rover.wheels[0].joint].translation[2] - rover.wheel.r
    assert loads.shift.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
    assert loads.place @ loads.shift == pytest.approx(np.full(3, bottom - centre))


@pytest.mark.parametrize(
    ("name", "settings", "slip", "speed"),
    [
        ("flat", {}, 0.01, 2e-3),
        ("incline", {"soil.k": 0.02, "terrain.angle_deg": 8, "terrain.start": 0.3}, 0.02, 3.5e-3),
        ("bump", {"soil.k": 0.01}, 0.1, 8e-3),
    ],
)
def test_reduced_drive_is_near_the_full_one(name, settings, slip, speed):
    """RMSE over 12 s; the bump's is what the suspension's own motion, left out, is worth."""
    scene = scenario(name, soil="table-1", **settings, duration=12.0)
    trace = simulate(scene.model, ConstantDuty(), 12.0, symmetric=True)
    driven = ReducedDrive(scene.model, OPEN, 12.0).drive(HELD, trace.t)
    assert np.sqrt(np.mean((driven["v"] - trace["body_vx"]) ** 2)) < speed
    assert np.sqrt(np.mean((driven["slip"] - trace.stack("slip")[:, ::2]) ** 2)) < slip


@pytest.mark.parametrize("rover", ["nexus6", "cart"])
@pytest.mark.parametrize("degrees", [-6, 0, 8])
def test_each_axle_carries_its_full_drive_load_on_a_slope(rover, degrees):
    """Uphill the load moves to the rear: at 8 deg the rear wheels stood 1.1 mm too high, the front ones 0.7 too low."""
    slope = {"terrain.angle_deg": degrees, "terrain.start": -2.0, "duration": 8.0}
    soil = TABLE_1.replace(k=0.02) if rover == "nexus6" else own_soil(load_rover(rover)).value
    scene = scenario("incline", rover=rover, soil=soil, **slope)
    trace = simulate(scene.model, ConstantDuty(), 8.0, scene.start, scene.timing, symmetric=True)
    driven = ReducedDrive(scene.model, OPEN, 8.0, scene.start.x).drive(HELD, trace.t)
    assert driven["sinkage"][-1] == pytest.approx(trace.stack("sinkage")[-1, ::2], rel=0.04)
    assert driven["slip"][-1] == pytest.approx(trace.stack("slip")[-1, ::2], abs=0.02)


def test_reduced_drive_under_control_is_near_the_full_one():
    """Post-peak loss, gear friction, torque limit and Eq (9) at once: every branch of the reduced loop."""
    scene = scenario("incline", soil="table-1", **{"soil.k": 0.01, "terrain.angle_deg": 5, "terrain.start": 0.2})
    model = scene.model.having(PostPeak(fraction=0.2)).having(GearFriction(tau_c=0.05))
    estimate = TableEstimate(SpeedTable((0.0, 0.1, 1.0), (0.0, 0.003, 0.092)), 0.045)
    limit, gains = TorqueLimit.saturation(model), Gains(k_p=0.2, k_i=0.3, delta_max=0.7)
    trace = simulate(model, SlipControl(gains, estimate, limit), 12.0, symmetric=True)
    driven = ReducedDrive(model, ContinuousControl(estimate, limit), 12.0).drive(gains, trace.t)
    assert driven["x"][-1] == pytest.approx(trace["body_x"][-1], rel=0.03)


@pytest.mark.parametrize(("k", "degrees", "c_d"), [(0.05, 5, 0.1), (0.025, 9, 0.1)])
def test_a_wheel_digs_in_as_deep_as_in_the_full_drive(k, degrees, c_d):
    """Its own sinkage and the hole that it digs, until it is buried: slip to 0.1, sinkage to 1 mm of up to 23."""
    settings = {"soil.k": k, "terrain.angle_deg": degrees, "add": DiggingMemory(c_d=c_d), "duration": 25.0}
    scene = scenario("incline", soil="table-1", **settings)
    for S_d in (0.3, 1.0):
        control, gains = TrueSlip(), Gains(S_d=S_d, k_p=0.3)
        trace = simulate(scene.model, SlipControl(gains, control), 25.0, symmetric=True)
        driven = ReducedDrive(scene.model, OPEN, 25.0).drive(gains, trace.t)
        assert np.sqrt(np.mean((driven["slip"] - trace.stack("slip")[:, ::2]) ** 2)) < (0.05 if S_d < 1.0 else 0.1)
        assert np.sqrt(np.mean((driven["sinkage"] - trace.stack("sinkage")[:, ::2]) ** 2)) < 1e-3
        assert driven["x"][-1] == pytest.approx(trace["body_x"][-1], abs=0.05)


@pytest.mark.parametrize("d", [0.0, 10.0])
def test_at_rest_the_wheels_stand_as_deep_as_their_loads_ask(d):
    """From the mean load's sinkage to each axle's own, on damped soil and on soil without damping."""
    scene = scenario("flat", soil="table-1", **{"effect.NormalDamping.d": d, "control.delta": 0.0})
    model = scene.model
    still = ReducedDrive(model, OPEN, 2.0).drive(
        Gains(k_p=0.0, k_i=0.0, delta_0=0.0, delta_min=0.0), np.array([1.0, 2.0])
    )
    loads = wheel_loads(model.rover, 0.0)[::2]
    expected = [sinkage(entry_angle(load, 0.0, model.rover.wheel, model.soils[0]), model.rover.wheel) for load in loads]
    assert still["sinkage"][-1] == pytest.approx(np.array(expected, dtype=float), rel=0.02)


def test_a_stuck_drive_stays_finite():
    """The clamped slip: a rover that rolls back on too steep a slope must not blow up."""
    scene = scenario("incline", soil="table-1", **{"terrain.angle_deg": 20, "terrain.start": 0.2})
    out = np.array(ReducedDrive(scene.model, OPEN, 20.0).outcome()(as_column(HELD))).ravel()
    assert np.all(np.isfinite(out))
    assert abs(out[0]) < 1.0


DURATION = 8.0


@pytest.fixture(scope="module")
def slope():
    return scenario(
        "incline", **{"soil.k": 0.01, "cruise_slip": 0.05, "terrain.angle_deg": 8, "terrain.start": 0.3}
    ).model


@pytest.fixture(scope="module")
def plain(slope):
    return ends(slope)


def ends(model):
    """Return the end place [m] of the full and of the reduced drive."""
    trace = simulate(model, ConstantDuty(), DURATION)
    return trace["body_x"][-1], ReducedDrive(model, OPEN, DURATION).drive(HELD, trace.t)["x"][-1]


@pytest.mark.parametrize(
    "effects",
    [
        (SupplySag(R_b=15.0),),
        (WeakMotor(g=0.5, wheel=2), WeakMotor(g=0.5, wheel=3)),
        (HardPatch(g=5.0, g_k=5.0, x_from=0.3, length=5.0),),
        (MultiPass(stiffening=1.0, shear_stiffening=2.0),),
        (SlipSinkage(n_1=1.5),),
        (TetherDrag(f_0=3.0, f_1=1.0),),
        (GravityTilt(rise_x=0.1),),
        (PointMass(m=2.0, shift_x=0.05),),
    ],
    ids=lambda effects: type(effects[0]).__name__,
)
def test_an_effect_is_worth_as_much_to_the_reduced_model(slope, plain, effects):
    """The supply's current, a wheel's number, a place, the axle, weight and pushes all reach the reduced model."""
    model = slope
    for effect in effects:
        model = model.having(effect)
    full, reduced = (after - before for after, before in zip(ends(model), plain, strict=True))
    assert abs(full) > 5e-4
    assert reduced == pytest.approx(full, rel=0.35, abs=1e-4)


def test_one_weak_wheel_of_an_axle_counts_by_its_share(slope, plain):
    """The yaw that it makes is left out, so that the reduced rover loses less than the full one, but not nothing."""
    full, reduced = (before - after for after, before in zip(ends(slope.having(WeakMotor(g=0.8))), plain, strict=True))
    assert 0.3 * full < reduced < full


def test_effects_on_joints_and_sideways_are_named_as_left_out(slope):
    for effect in (PivotFriction(), DifferentialCompliance(), GravityTilt(rise_y=0.05)):
        assert omitted_effects(slope.having(effect)) == (type(effect).__name__,)
    for effect in (TetherDrag(), PointMass(), GravityTilt(), PivotFriction(tau_c=0.0, b=0.0), SupplySag()):
        assert omitted_effects(slope.having(effect)) == ()


def test_tether_pulls_by_its_length_and_a_rise_by_its_sine(slope):
    at = BodyPlace(2.0, 0.05, 0.0, 0.0)
    tether = TetherDrag(f_0=1.0, f_1=0.5, x_0=1.0, v_0=1e-5)
    assert float(pull_along(slope.having(tether), at)) == pytest.approx(-1.5, rel=1e-3)
    leaning = slope.having(GravityTilt(rise_x=0.1))
    weight = slope.rover.mass * 9.81
    assert float(pull_along(leaning, at)) == pytest.approx(-weight * float(ca.sin(0.1)), rel=1e-6)


def test_gravity_tilted_along_the_path_moves_no_load_by_itself(slope):
    """Its share along the path accelerates the rover and is taken up by inertia at the same point."""
    level, leaning = (axle_loads(model.built, 9.81).at_rest for model in (slope, slope.having(GravityTilt(rise_x=0.2))))
    assert leaning == pytest.approx(level * float(ca.cos(0.2)), rel=1e-6)
