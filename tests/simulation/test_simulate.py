"""What a drive must do whatever the numbers: energy, rest, convergence, reasons of a stop, nothing lost."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin import ConstantDuty, RoverPinError, scenario, simulate
from rover_pin.base.errors import ParameterError, SimulationError
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.sensor_bias import SensorBias
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.simulation.command import Command
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.engines import ENGINES
from rover_pin.simulation.simulate import Timing
from rover_pin.simulation.start import Start, settled_state

DEG = math.pi / 180.0


def made(name, **settings):
    return scenario(name, soil="table-1", **settings).model


def test_tangential_force_is_the_factor_times_the_normal_force():
    """f_t = F(S) f_n on a slope, with the factor evaluated on its own."""
    from rover_pin.contact import Wheel
    from rover_pin.effects.motion_resistance import MotionResistance
    from rover_pin.soil.wheel_forces import TorqueTraction, load_traction_factor

    model = made("incline", **{"terrain.angle_deg": 5.0, "terrain.start": -3.0})
    resistance = model.effect(MotionResistance)
    trace = simulate(model, ConstantDuty(0.55), 15.0)
    for wheel in trace.wheels:
        S = float(trace[f"slip_{wheel}"][-1])
        factor = float(load_traction_factor(S, model.soils[0], Wheel(), TorqueTraction()))
        v = float(trace[f"travel_{wheel}"][-1])
        factor -= resistance.R * v / math.hypot(v, resistance.fading(float(trace[f"wheel_rate_{wheel}"][-1]) * 0.045))
        assert trace[f"tangential_{wheel}"][-1] == pytest.approx(factor * trace[f"normal_{wheel}"][-1], rel=1e-3)
    assert trace.stack("tangential")[-1].sum() == pytest.approx(5.8 * 9.81 * math.sin(5 * DEG), rel=1e-3)
    assert trace.stack("normal")[-1].sum() == pytest.approx(5.8 * 9.81 * math.cos(5 * DEG), rel=1e-3)


@pytest.mark.parametrize("name", ["flat", "incline", "ditch", "bump", "one-sided-bump", "hills", "turn"])
def test_energy_closes(name):
    trace = scenario(name, soil="table-1", duration=8.0).drive()
    assert trace.energy_error() < 0.01


@pytest.mark.parametrize("angle", [3.0, 6.0])
def test_a_parked_rover_stays(angle):
    """Creep below 0.01 mm/s on the slope, once the sand has taken the load up."""
    model = scenario("park", soil="table-1", **{"terrain.angle_deg": angle}).model
    trace = simulate(model, ConstantDuty(0.0), 20.0)
    late = trace["t_s"] > 15.0
    creep = np.ptp(trace["body_x"][late]) / np.ptp(trace["t_s"][late])
    assert creep < 1e-5
    assert np.abs(trace["body_vx"][late]).max() < 1e-5


@pytest.mark.parametrize("k", [0.001, 0.003])
@pytest.mark.parametrize("dt", [0.01, 0.005])
def test_a_parked_rover_on_grippy_sand_does_not_chatter(k, dt):
    """A resistance that turns round within a few mm/s must not make the wheels flip from step to step."""
    model = scenario("park", soil="table-1", **{"terrain.angle_deg": 6.0, "soil.k": k, "cruise_slip": 0.05}).model
    fine, coarse = (simulate(model, ConstantDuty(0.0), 4.0, timing=Timing(step, 0.05, 0.01)) for step in (0.0025, dt))
    late = coarse["t_s"] > 2.0
    for wheel in coarse.wheels:
        name = f"wheel_rate_{wheel}"
        assert np.abs(coarse[name][late] - fine[name][late]).max() < 1e-4


@pytest.mark.parametrize(("friction", "angle"), [(0.3, 20.0), (1.0, 18.0), (10.0, 20.0)])
@pytest.mark.parametrize("dt", [0.005, 0.00125])
def test_locked_wheels_that_slide_do_not_ring_on_their_gears(friction, angle, dt):
    """At 107 Hz they did, for ever and at any step (7 Hz in rows of 10 ms), with rims at 0.3 to 0.7 mm/s."""
    model = scenario("park", soil="table-1", gear_friction=friction, **{"terrain.angle_deg": angle}).model
    trace = simulate(model, ConstantDuty(0.0), 6.0, timing=Timing(dt, 0.05, 0.05))
    late = trace["t_s"] > 4.0
    assert 0.045 * np.abs(np.diff(trace.stack("wheel_rate")[late], axis=0)).max() < 1e-5
    assert np.all(trace["body_vx"][late] < 0.0)


@pytest.mark.parametrize("name", ["one-sided-bump", "rocks"])
def test_a_rover_may_drift_across_a_lanes_edge(name):
    """Both turn until a wheel meets the side of what it passes; an edge had no side, and that wheel was "buried"."""
    drive = scenario(name, soil="table-1")
    trace = drive.drive()
    assert trace.attrs["stop"] == "duration"
    assert np.degrees(np.abs(trace["body_yaw"]).max()) > 10.0
    assert trace.stack("sinkage").max() < 0.25 * drive.model.rover.wheel.r
    assert trace.energy_error() < 1e-3


@pytest.mark.parametrize("name", ["one-sided-bump", "rocks"])
def test_a_drive_across_a_lanes_edge_converges(name):
    drive = scenario(name, soil="table-1")
    coarse = drive.drive()
    fine = dataclasses.replace(drive, timing=Timing(drive.timing.dt / 4)).drive()
    for channel in ("body_x", "body_y", "body_z"):
        assert np.abs(coarse[channel] - fine[channel]).max() < 1e-3


def test_the_step_is_of_second_order_under_way():
    """On a slope, with the duty changing; near rest and at corners the forces have kinks, and the order falls."""
    drive = scenario("incline", soil="table-1", **{"soil.k": 0.01, "terrain.start": -3.0})
    state = settled_state(drive.model, drive.start, symmetric=True)
    kernel = Kernel(drive.model, state, 0.001, symmetric=True)
    kernel.duty[:] = 0.5
    for _ in range(2000):
        kernel.step()

    def x(dt):
        return simulate(drive.model, lambda reading: 0.5 + 0.1 * reading.t, 1.5, state, Timing(dt), symmetric=True)[
            "body_x"
        ]

    reference = x(0.05 / 640)
    errors = [np.abs(x(dt) - reference).max() for dt in (0.005, 0.0025, 0.00125)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)


def test_a_drop_settles_with_damping():
    model = made("flat")
    state = settled_state(model, Start())
    rest_height = state.q[2]
    state.q[2] += 0.012
    trace = simulate(model, ConstantDuty(0.0), 2.0, state)
    assert np.ptp(trace["body_z"][trace["t_s"] > 1.0]) < 1e-5
    assert trace["body_z"][-1] == pytest.approx(rest_height, abs=1e-4)
    bouncing = simulate(model.having(NormalDamping(d=0.0)), ConstantDuty(0.0), 2.0, state)
    assert np.ptp(bouncing["body_z"][bouncing["t_s"] > 1.0]) > 1e-3


def test_a_buried_wheel_stops_the_drive():
    model = made("flat", **{"soil.k_1": 8e3})
    with pytest.raises(SimulationError, match=r"settle|sinks"):
        simulate(made("flat", **{"soil.k_1": 1.0}), ConstantDuty(0.3), 2.0)
    trace = simulate(model, ConstantDuty(0.3), 2.0)
    assert str(trace.attrs["stop"]).startswith("buried: wheel")
    assert ", over 0.5 r at" in trace.attrs["stop"]
    assert trace.attrs["buried"] == 0.5


def test_how_deep_a_buried_wheel_is_can_be_set():
    """The same drive, only longer: it goes on where the usual cut ended it."""
    digging = {"add": "DiggingMemory.c_d=0.2", "terrain.angle_deg": 9.0, "terrain.start": -5.0, "duration": 20.0}
    trace, deep = (scenario("incline", soil="table-1", **digging, **cut).drive() for cut in ({}, {"buried": 0.9}))
    rows = len(trace.t)
    assert trace.attrs["stop"].startswith("buried")
    assert deep.attrs["stop"] == "duration"
    assert np.array_equal(trace["body_x"], deep["body_x"][:rows])
    assert deep.stack("sinkage").max() > 0.5 * 0.045
    for wrong in (0.0, 0.99, float("nan")):
        with pytest.raises(ParameterError, match="buried ="):
            scenario("incline", soil="table-1", buried=wrong)


def test_commands_are_checked():
    model = made("flat")
    with pytest.raises(SimulationError, match=r"\[-1, 1\].*6"):
        simulate(model, lambda reading: np.array([0.5, 0.5]), 1.0)
    with pytest.raises(SimulationError, match=r"returned.*duty"):
        simulate(model, lambda reading: math.nan, 1.0)
    with pytest.raises(SimulationError, match="steered wheel"):
        simulate(model, lambda reading: Command(0.5, np.zeros(3)), 1.0)
    with pytest.raises(SimulationError, match="steered wheel"):
        simulate(model, lambda reading: Command(0.5, np.array([0.0, math.nan, 0.0, 0.0])), 1.0)
    with pytest.raises(SimulationError, match=r"6 such numbers.*wheel"):
        simulate(model, lambda reading: np.array([0.5, math.inf, 0.5, 0.5, 0.5, 0.5]), 1.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: simulate(made("flat"), ConstantDuty(), -1.0), "duration = -1"),
        (lambda: simulate(made("one-sided-bump"), ConstantDuty(), 1.0, symmetric=True), "same.*right"),
        (lambda: made("flat").replace(terain=1), "'terrain'"),
        (lambda: made("flat").effect(GearFriction), "GearFriction"),
    ],
)
def test_a_refusal_names_the_value(call, words):
    with pytest.raises(RoverPinError, match=words):
        call()


def test_having_replaces_one_of_the_same_class_and_adds_another():
    model = made("flat")
    assert len(model.having(NormalDamping(d=3.0)).effects) == len(model.effects)
    assert model.having(NormalDamping(d=3.0)).effect(NormalDamping).d == 3.0
    assert len(model.having(GearFriction()).motor_effects) == 1
    assert len(model.without(NormalDamping).effects) == len(model.effects) - 1


def test_model_holds_one_effect_per_class_wheel_and_channel():
    model = made("flat").having(WeakMotor(g=0.1, wheel=0)).having(WeakMotor(g=0.2, wheel=3))
    assert [motor_effect.g for motor_effect in model.having(WeakMotor(g=0.3, wheel=3)).motor_effects] == [0.1, 0.3]
    for wheel in ("fl", "mr"):
        model = model.having(TachoScale(wheel=wheel))
    model = model.having(SensorBias(channel="body_roll")).having(SensorBias(channel="body_pitch"))
    assert len(model.sensor_effects) == 4
    assert model.effect(TachoScale).wheel == "fl"
    assert model.without(TachoScale).without(WeakMotor).all_effects[-2:] == model.sensor_effects[2:]


@pytest.mark.parametrize("radius", [0.6, 1.0])
def test_a_turn_has_about_its_radius(radius):
    """Within 7 % at low slip on grippy soil (0.935 m of 1 m), and the mirror image the other way round."""
    traces = {}
    for sign in (1, -1):
        drive = scenario("turn", soil="table-1", duration=20.0, **{"soil.k": 0.001, "control.radius": sign * radius})
        traces[sign] = drive.drive()
    trace = traces[1]
    late = trace["t_s"] > 5.0
    rate = np.polyfit(trace["t_s"][late], trace["body_yaw"][late], 1)[0]
    speed = np.hypot(trace["body_vx"][late], trace["body_vy"][late]).mean()
    assert speed / rate == pytest.approx(radius, rel=0.07)
    assert traces[-1]["body_y"] == pytest.approx(-trace["body_y"], abs=2e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_drive_shorter_than_half_a_step_takes_one(engine):
    """It has no row yet, and can go on."""
    case = made("flat")
    trace = simulate(case, ConstantDuty(), 0.001, engine=engine)
    assert (len(trace.t), trace.attrs["stop"]) == (0, "duration")
    assert trace.end.checkpoint.steps == 1
