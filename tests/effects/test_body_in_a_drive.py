"""Effects on the body and of the ground, each in a drive; what the rover weighs and where down is: statics by hand."""

import functools
import math
import re

import numpy as np
import pinocchio as pin
import pytest

from rover_pin import ConstantDuty, load_rover, scenario, simulate
from rover_pin.base.errors import ParameterError, SimulationError
from rover_pin.effects.bent_ground import BentGround
from rover_pin.effects.differential_compliance import DifferentialCompliance
from rover_pin.effects.effect import BodyEffect, Push
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.pivot_friction import PivotFriction
from rover_pin.effects.point_mass import PointMass
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.wheel_scale import WheelScale
from rover_pin.rover.statics import wheel_loads
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.plain.step import PlainStepper
from rover_pin.simulation.start import Start, settled_state
from rover_pin.terrain import shapes

BUMP = scenario("one-sided-bump").model
EFFECTS = {
    "pivot friction, tether, ballast": (PivotFriction(), TetherDrag(), PointMass(m=0.3, shift_x=0.02, shift_z=0.03)),
    "stiff pivots, larger wheels": (PivotFriction(tau_c=1.0, w_s=0.002), WheelScale(e=0.05)),
    "soft differential, tilt": (DifferentialCompliance(), GravityTilt(rise_x=0.01, rise_y=-0.03)),
    "play alone, bent ground, hard patch": (
        DifferentialCompliance(compliance=0.0, backlash=0.02),
        BentGround(s_1=0.05, s_3=-0.04, x_from=-0.1, length=0.6),
        HardPatch(x_from=0.1),
    ),
}
"""Together, as each set of laws takes seconds to compile."""


def with_all(name):
    return functools.reduce(lambda model, effect: model.having(effect), EFFECTS[name], BUMP)


@pytest.mark.parametrize("name", EFFECTS)
def test_the_compiled_step_is_the_plain_one(name):
    model = with_all(name)
    state = settled_state(model, Start(x=0.1, yaw=0.2))
    kernel = Kernel(model, state, 0.005, symmetric=False)
    kernel.duty[:], kernel.servo_target[:] = np.linspace(0.5, 0.9, 6), [0.1, 0.12, -0.1, -0.12]
    for k in range(1200):
        if k % 60:
            assert kernel.step() == 0
            continue
        plain_state = state.copy()
        plain = PlainStepper(model, plain_state, 0.005, symmetric=False)
        plain.duty[:], plain.servo_target[:], plain.energy[:] = kernel.duty, kernel.servo_target, kernel.energy
        plain.record[:] = kernel.record
        assert (plain.step(), kernel.step()) == (0, 0)
        assert plain_state.q == pytest.approx(state.q, abs=1e-11)
        assert plain_state.v == pytest.approx(state.v, abs=1e-9)
        assert plain.record == pytest.approx(kernel.record, rel=1e-8, abs=1e-8)
        assert plain.energy == pytest.approx(kernel.energy, rel=1e-9, abs=1e-10)
        assert plain.differential == pytest.approx(kernel.differential, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("duty", [0.55, -0.5])
def test_energy_closes(name, duty):
    trace = simulate(with_all(name), ConstantDuty(duty), 8.0, Start(x=0.5, yaw=0.1))
    assert trace.attrs["stop"] == "duration"
    assert trace.energy_error() < 1e-3


def test_only_what_pushes_the_body_has_a_channel_of_energy():
    for effect in (HardPatch(), TetherDrag()):
        trace = simulate(BUMP.having(effect), ConstantDuty(0.5), 0.5)
        assert ("energy_body" in trace) == isinstance(effect, BodyEffect)
        assert type(effect).__name__ in trace.attrs["effects"]


class Crowd(BodyEffect):
    """Pushes joints that are not there."""

    def push(self, body):
        """Return three torques."""
        return Push(joints=(0.0, 0.0, 0.0))


def test_a_refusal_names_the_value():
    with pytest.raises(ParameterError, match=r"3.*suspension.*4"):
        simulate(BUMP.having(Crowd()), ConstantDuty(0.5), 0.1)
    with pytest.raises(ParameterError, match=r"differential,.*'cart'"):
        BUMP.replace(rover=load_rover("cart")).having(DifferentialCompliance())
    flat = scenario("flat").model.having(GravityTilt(rise_x=0.0, rise_y=0.01))
    with pytest.raises(SimulationError, match="gravity without"):
        simulate(flat, ConstantDuty(0.5), 0.1, symmetric=True)


def test_a_rover_without_a_suspension_can_be_dragged():
    """The cart has no joints but its wheels'."""
    flat = scenario("flat").model
    cart = flat.replace(rover=load_rover("cart"))
    free, dragged = (simulate(model, ConstantDuty(0.6), 2.0) for model in (cart, cart.having(TetherDrag(f_0=3.0))))
    assert dragged["body_x"][-1] < free["body_x"][-1]
    assert dragged.energy_error() < 1e-3


NEXUS6 = load_rover()
FLAT = scenario("flat").model


def centre(rover):
    return pin.centerOfMass(rover.model, rover.model.createData(), pin.neutral(rover.model))


def test_static_loads_change_as_statics_says():
    """The moments about the base's origin grow by the shifted weight, and what the simulator rests on is the same."""
    effect = PointMass(m=0.5, shift_x=0.02)
    plain, loaded = wheel_loads(NEXUS6, 0.0), wheel_loads(NEXUS6.carrying(*effect.ballast()), 0.0)
    places = np.repeat([0.15, 0.0, -0.15], 2)
    assert loaded.sum() - plain.sum() == pytest.approx(0.5 * 9.81)
    assert places @ loaded - places @ plain == pytest.approx(
        9.81 * (6.3 * (centre(NEXUS6)[0] + 0.02) - 5.8 * centre(NEXUS6)[0])
    )
    trace = simulate(FLAT.having(effect), ConstantDuty(0.0), 0.5)
    assert trace.stack("normal")[-1] == pytest.approx(loaded, rel=0.02)


def test_a_tilt_is_a_slope():
    """On a bed tilted by a, all is as on the flat bed's slope of a: loads, slip, sinkage, speed, power."""
    angle = math.radians(4.0)
    slope = FLAT.replace(terrain=shapes.incline(angle, -3.0))
    traces = [simulate(model, ConstantDuty(0.6), 10.0) for model in (slope, FLAT.having(GravityTilt(rise_x=angle)))]
    for name in ("slip_fl", "normal_rl", "normal_fr", "tangential_ml", "sinkage_rr", "wheel_rate_fl", "current_mr_A"):
        assert traces[1][name][-1] == pytest.approx(traces[0][name][-1], rel=2e-3), name
    along = [trace["body_x"][-1] - trace["body_x"][0] for trace in traces]
    assert along[0] / math.cos(angle) == pytest.approx(along[1], rel=2e-3)
    risen = [trace["energy_potential"][-1] - trace["energy_potential"][0] for trace in traces]
    assert risen[1] == pytest.approx(risen[0], rel=5e-3)
    assert risen[1] == pytest.approx(5.8 * 9.81 * along[1] * math.sin(angle), rel=2e-2)


def test_a_side_tilt_loads_the_lower_wheels_as_statics_says():
    tilted = FLAT.having(GravityTilt(rise_x=0.0, rise_y=0.1))
    trace = simulate(tilted, ConstantDuty(0.0), 0.5, settled_state(tilted, Start()))
    loads = wheel_loads(NEXUS6, 0.0, 0.1)
    assert wheel_loads(NEXUS6.rising(0.0, 0.1), 0.0) == pytest.approx(loads, rel=1e-9)
    assert loads[1] > loads[0]
    right = trace.stack("normal")[-1][1::2].sum()
    assert right == pytest.approx(loads[1::2].sum(), rel=0.03)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: NEXUS6.carrying(-2.9), "'nexus6'.*2.9"),
        (lambda: NEXUS6.carrying(-2.85), "inertia.*body"),
        (lambda: NEXUS6.rising(1.0, 1.0), "90 deg"),
        (lambda: NEXUS6.rising(2.0, 0.0), "90 deg"),
    ],
)
def test_masses_that_cannot_be_are_refused(call, words):
    with pytest.raises(ParameterError, match=words):
        call()


@pytest.mark.parametrize(("size", "axis"), [("shift_z=124mm", "z = 2"), ("shift_x=-0.15", "x = -"), ("m=1.5", "")])
def test_a_centre_of_mass_outside_the_rover_is_said(run, size, axis):
    code, out, _ = run("drive", "flat", "--add", f"PointMass.{size}", "--set", "duration=0.2", "--out", "here")
    assert code == 0
    assert bool(re.search(rf"PointMass .*centre of mass.*{axis}", out)) == bool(axis)
