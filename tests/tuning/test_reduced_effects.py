"""What an effect does to a drive of the reduced model, against what it does to the full rover's."""

import casadi as ca
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.control.slip_control import Gains
from rover_pin.control.slip_estimate import TrueSlip
from rover_pin.control.torque_check import NoLimit
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.multi_pass import MultiPass
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.point_mass import PointMass
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate
from rover_pin.tuning.reduced_model.drive import Reduced
from rover_pin.tuning.reduced_model.effects import Along, omitted_effects, pull_along
from rover_pin.tuning.reduced_model.load_transfer import axle_loads
from rover_pin.tuning.reduced_model.loop import Loop

HELD, OPEN = Gains(k_p=0.0, k_i=0.0), Loop(TrueSlip(), NoLimit())
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
    return trace["body_x"][-1], Reduced(model, OPEN, DURATION).drive(HELD, trace.t)["x"][-1]


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
    at = Along(2.0, 0.05, 0.0, 0.0)
    tether = TetherDrag(f_0=1.0, f_1=0.5, x_0=1.0, v_0=1e-5)
    assert float(pull_along(slope.having(tether), at)) == pytest.approx(-1.5, rel=1e-3)
    leaning = slope.having(GravityTilt(rise_x=0.1))
    weight = slope.rover.mass * 9.81
    assert float(pull_along(leaning, at)) == pytest.approx(-weight * float(ca.sin(0.1)), rel=1e-6)


def test_gravity_tilted_along_the_path_moves_no_load_by_itself(slope):
    """Its share along the path accelerates the rover and is taken up by inertia at the same point."""
    level, leaning = (axle_loads(model.built, 9.81).at_rest for model in (slope, slope.having(GravityTilt(rise_x=0.2))))
    assert leaning == pytest.approx(level * float(ca.cos(0.2)), rel=1e-6)
