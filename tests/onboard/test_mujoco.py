"""A rover in MuJoCo on the soil of rover_pin: MuJoCo moves the bodies with its own integrator, and must arrive where
the package's simulation arrives.
"""

from __future__ import annotations

import dataclasses
import re
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from rover_pin import scenario, simulate
from rover_pin.base.errors import MissingExtraError, ParameterError, SimulationError
from rover_pin.cli.app import app
from rover_pin.onboard.mujoco.mjcf import mjcf
from rover_pin.onboard.mujoco.soil_forces import SoilForces
from rover_pin.simulation.command import Command

mujoco = pytest.importorskip("mujoco", minversion="3.2")
STEER = (0.1, 0.12, -0.1, -0.12)
CASES = {
    "flat": (scenario("flat"), ()),
    "slope of 6 deg": (scenario("incline", **{"terrain.start": -5.0}), ()),
    "the cart on it": (scenario("incline", rover="cart", **{"terrain.start": -5.0}), ()),
    "hills, steered": (scenario("hills"), STEER),
}
DURATION = 2.0


@pytest.fixture(autouse=True)
def no_soil_is_left():
    yield
    mujoco.set_mjcb_passive(None)


def ours(name):
    """Return the drive of the package's simulation, with a sixteenth of its usual time step."""
    case, steer = CASES[name]
    fine = dataclasses.replace(case.timing, dt=case.timing.dt / 16)

    def control(reading):
        return Command(0.55, np.array(steer)) if steer else 0.55

    return simulate(case.model, control, DURATION, case.start, fine, measure_error=False)


def theirs(name, timestep, changed=lambda model: None, disturb=lambda model, data: None):
    """Drive the rover in MuJoCo, and return the motion of the base, one row for each sample, and the soil's forces."""
    case, steer = CASES[name]
    model = mujoco.MjModel.from_xml_string(mjcf(case.model, case.start, timestep))
    changed(model)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    soil = SoilForces(case.model, model, case.start)
    return driven(model, data, soil, len(case.model.rover.wheels), steer, disturb), soil, data


def driven(model, data, soil, wheels, steer, disturb=lambda model, data: None):
    mujoco.set_mjcb_passive(soil)
    data.ctrl[:wheels], rows = 0.55, []
    if steer:
        data.ctrl[wheels:] = steer
    for _ in range(round(DURATION / 0.05)):
        for _ in range(round(0.05 / model.opt.timestep)):
            disturb(model, data)
            mujoco.mj_step(model, data)
        rows.append(data.qpos[:3].copy())
    mujoco.set_mjcb_passive(None)
    return np.array(rows)


@pytest.mark.parametrize("name", CASES)
def test_mujoco_comes_where_our_step_does(name):
    """The distance is within the value that `docs/own-controller.md` states, and falls with finer steps."""
    trace = ours(name)
    way = np.column_stack([trace[f"body_{axis}"] for axis in "xyz"])
    off = []
    for timestep in (0.01, 0.005, 0.0025):
        rows, soil, _ = theirs(name, timestep)
        off.append(float(np.max(np.abs(rows - way))))
        assert soil.of_wheels("sinkage") == pytest.approx(trace.stack("sinkage")[-1], rel=1e-3)
        assert soil.of_wheels("slip") == pytest.approx(trace.stack("slip")[-1], abs=1e-3)
        assert soil.of_wheels("normal") == pytest.approx(trace.stack("normal")[-1], rel=2e-3)
    assert off[2] < 0.6 * off[1] < 0.6 * off[0], off
    assert np.all(np.array(off) < [3e-4, 1.4e-4, 7e-5]), off


def test_a_mass_that_is_wrong_by_a_tenth_shows():
    def heavier(model):
        model.body_mass[:] *= 1.1

    (right, *_), (wrong, *_) = theirs("slope of 6 deg", 0.005), theirs("slope of 6 deg", 0.005, heavier)
    trace = ours("slope of 6 deg")
    away = [abs(float(rows[-1, 0] - trace["body_x"][-1])) for rows in (right, wrong)]
    assert away[1] > 20.0 * away[0]


def test_the_differential_holds_and_joints_move_alike():
    trace, (_, _, data) = ours("hills, steered"), theirs("hills, steered", 0.005)
    left, right = (float(data.joint(f"rocker_{side}").qpos[0]) for side in "lr")
    assert abs(left) > 1e-3
    assert left == pytest.approx(-right, abs=1e-4)
    for joint in ("rocker_l", "bogie_l", "bogie_r"):
        assert float(data.joint(joint).qpos[0]) == pytest.approx(trace[joint][-1], abs=1e-4)
    for wheel, target in zip(("fl", "fr", "rl", "rr"), STEER, strict=True):
        assert float(data.joint(f"steer_{wheel}").qpos[0]) == pytest.approx(trace[f"steer_{wheel}"][-1], abs=1e-3)
        assert float(data.joint(f"steer_{wheel}").qpos[0]) == pytest.approx(target, abs=0.02)


def test_a_second_call_changes_nothing_and_a_reset_restarts():
    once, _, _ = theirs("slope of 6 deg", 0.005)
    twice, soil, data = theirs("slope of 6 deg", 0.005, disturb=lambda model, data: mujoco.mj_forward(model, data))
    assert np.array_equal(once, twice)
    case, _ = CASES["slope of 6 deg"]
    model = mujoco.MjModel.from_xml_string(mjcf(case.model, case.start, 0.005))
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert np.array_equal(driven(model, data, soil, 6, ()), once)


def test_a_rover_in_a_larger_world_drives_as_alone():
    case, _ = CASES["slope of 6 deg"]
    world = mujoco.MjSpec()
    world.option.timestep, world.option.integrator = 0.005, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    crate = world.worldbody.add_body(name="crate", pos=[0.0, 3.0, 1.0])
    crate.add_freejoint()
    crate.add_geom(size=[0.1, 0.1, 0.1])
    rover = mujoco.MjSpec.from_string(mjcf(case.model, case.start, 0.005))
    world.attach(rover, frame=world.worldbody.add_frame(), prefix="our_")
    model = world.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("our_start").id)
    soil, base = SoilForces(case.model, model, case.start, "our_"), model.joint("our_root_joint").qposadr[0]
    mujoco.set_mjcb_passive(soil)
    for wheel in case.model.rover.wheels:
        data.actuator(f"our_duty_{wheel.name}").ctrl[0] = 0.55
    mujoco.mj_step(model, data, round(DURATION / 0.005))
    mujoco.set_mjcb_passive(None)
    alone, _, _ = theirs("slope of 6 deg", 0.005)
    assert data.qpos[base : base + 3] == pytest.approx(alone[-1], abs=1e-6)
    assert float(data.body("crate").xpos[2]) < -10.0


def test_another_models_steps_are_left_alone():
    case, _ = CASES["flat"]
    ball = "<body><freejoint/><geom size='1'/></body>"
    ball_model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{ball}</worldbody></mujoco>")
    data = mujoco.MjData(ball_model)
    mujoco.set_mjcb_passive(SoilForces(case.model, mujoco.MjModel.from_xml_string(mjcf(case.model))))
    mujoco.mj_step(ball_model, data)
    assert not data.qfrc_passive.any()


def test_the_drawn_ground_is_the_terrain():
    case, _ = CASES["hills, steered"]
    model = mujoco.MjModel.from_xml_string(mjcf(case.model, case.start))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, dtype=np.int32)
    for x, y in np.random.default_rng(3).uniform(1.0, 3.0, (5, 2)):
        way = mujoco.mj_ray(model, data, np.array([x, y, 5.0]), np.array([0.0, 0.0, -1.0]), None, 1, -1, hit)
        assert 5.0 - way == pytest.approx(float(case.model.ground.height(x, y)), abs=2e-3)


def test_effects_that_mujoco_lacks_are_refused():
    model = CASES["flat"][0].model
    sprung = scenario("flat", add=["SpringDamper", "DeadBand"]).model
    with pytest.raises(ParameterError, match="DeadBand, SpringDamper"):
        mjcf(sprung)
    between = mujoco.MjModel.from_xml_string(mjcf(model).replace("implicitfast", "RK4"))
    with pytest.raises(SimulationError, match="RK4"):
        SoilForces(model, between)
    with pytest.raises(SimulationError, match=r"timestep = 0\.1 s"):
        SoilForces(model, mujoco.MjModel.from_xml_string(mjcf(model, timestep=0.1)))


def test_without_mujoco_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtraError, match="mujoco>="):
        SoilForces(CASES["flat"][0].model, None)


def test_the_exported_program_drives(tmp_path):
    command = ["export-mjcf", "incline", "--set", "terrain.start=-5", "--out", str(tmp_path)]
    assert CliRunner().invoke(app, command).exit_code == 0
    done = subprocess.run([sys.executable, tmp_path / "drive.py"], capture_output=True, text=True, check=True)
    x, slip = map(float, re.fullmatch(r"t = 5\.00 s: x = (\S+) m, y = \S+ m, mean slip (\S+)\n", done.stdout).groups())
    trace = scenario("incline", **{"terrain.start": -5.0, "duration": 5.0}).drive(measure_error=False)
    assert x == pytest.approx(trace["body_x"][-1], abs=5e-4)
    assert slip == pytest.approx(trace.stack("slip")[-1].mean(), abs=1e-3)
