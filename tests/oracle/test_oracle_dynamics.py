"""Equation (8) is compared with MuJoCo and Drake: 100 random states, free and under the differential."""

from __future__ import annotations

import dataclasses
import importlib.util
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.rover.description.layout import read_layout, shipped_toml
from rover_pin.rover.forward_dynamics import Dynamics, mass_matrix
from rover_pin.rover.rover import assemble

HERE = Path(__file__).parent
_spec = importlib.util.spec_from_file_location("engines_oracle", HERE / "engines.py")
engines = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(engines)

AGREE = 1e-9
"""Relative, per state. The engines agree to 2e-14; mistakes (no differential, wrong frames) show at 9e-6 or more."""


@pytest.fixture(scope="module")
def stored():
    with np.load(engines.FILE) as file:
        return {key: file[key] for key in file.files}


def rover_of(text: str, states):
    rover = assemble(dataclasses.replace(read_layout(shipped_toml("nexus6")), text=text))
    armature = np.zeros(rover.model.nv)
    for name, value in zip(states.joints, states.armature, strict=True):
        armature[rover.model.joints[rover.model.getJointId(str(name))].idx_v] = value
    rover.model.armature = armature
    return rover


def state_of(rover, states, i: int):
    """Return q, v, torques and wheel forces in Pinocchio's conventions, and the function that converts accelerations
    back.
    """
    model = rover.model
    dofs = [model.joints[model.getJointId(str(name))].idx_v for name in states.joints]
    turn = engines.rotation_of(states.quaternion[i])
    step, v, torques = np.zeros(model.nv), np.zeros(model.nv), np.zeros(model.nv)
    step[dofs] = states.angles[i]
    q = pin.integrate(model, pin.neutral(model), step)
    q[:3], q[3:7] = states.position[i], np.roll(states.quaternion[i], -1)
    for mine, theirs in ((v, states.velocity[i]), (torques, states.effort[i])):
        mine[:3], mine[3:6], mine[dofs] = turn.T @ theirs[:3], theirs[3:6], theirs[6:]
    by_name = dict(zip(map(str, states.wheels), states.wrench[i], strict=True))
    wrenches = np.array([by_name[f"wheel_{wheel.name}"] for wheel in rover.wheels])

    def back(a: np.ndarray) -> np.ndarray:
        return np.concatenate([turn @ (a[:3] + np.cross(v[3:6], v[:3])), a[3:6], a[dofs]])

    return (q, v, torques, wrenches), back


def worst(rover, states, reference, route: str, is_held: bool) -> float:
    dynamics = Dynamics(rover if is_held else dataclasses.replace(rover, differential=None))
    off = []
    for i in range(len(states.position)):
        state, back = state_of(rover, states, i)
        acceleration = getattr(dynamics, route)(*state)
        expected = reference["constrained" if is_held else "free"][i]
        off.append(np.max(np.abs(back(acceleration.a) - expected)) / np.max(np.abs(expected)))
        if is_held:
            torque = reference["torque"][i]
            off.append(abs(acceleration.differential_torque - torque) / max(abs(torque), 1.0))
    return max(off)


@pytest.mark.parametrize("route", ["accelerate", "accelerate_aba"])
@pytest.mark.parametrize("is_held", [True, False])
@pytest.mark.parametrize("engine", ["", "drake_"])
def test_both_routes_agree_with_the_stored_engines(stored, route, is_held, engine):
    states = engines.States(**{name: stored[name] for name in engines.States._fields})
    reference = {name: stored[engine + name] for name in ("free", "constrained", "torque")}
    assert len(states.position) == 100
    assert worst(rover_of(str(stored["urdf"]), states), states, reference, route, is_held) < AGREE


def test_the_engine_was_given_all_the_mass(stored):
    assert stored["mass"].sum() == pytest.approx(5.8, abs=1e-12)


def test_the_shipped_urdf_agrees_with_mujoco():
    pytest.importorskip("mujoco", minversion="4.0")
    text = engines.NEXUS6.read_text()
    states = engines.random_states(text, 20, seed=7)
    reference = engines.by_mujoco(text, states)
    rover = rover_of(text, states)
    assert worst(rover, states, reference, "accelerate", is_held=True) < AGREE
    dofs = [rover.model.joints[rover.model.getJointId(name)].idx_v for name in states.joints]
    state, _ = state_of(rover, states, 0)
    ours = mass_matrix(rover, state[0])[np.ix_(dofs, dofs)]
    assert np.allclose(ours, reference["mass_matrix"][0][6:, 6:], atol=1e-12)


def shaken(text: str, seed: int) -> str:
    """Return the URDF with rotated and shifted frames, unusual axes, and full inertias."""
    rng = np.random.default_rng(seed)
    robot = ET.fromstring(text)
    for joint in robot.findall("joint"):
        old = np.array([float(word) for word in joint.find("origin").get("xyz").split()])
        joint.find("origin").set("xyz", engines._text(old + rng.normal(0.0, 0.02, 3)))
        joint.find("origin").set("rpy", engines._text(rng.normal(0.0, 1.0, 3)))
        axis = rng.normal(size=3)
        joint.find("axis").set("xyz", engines._text(axis / np.linalg.norm(axis)))
    for inertial in robot.iter("inertial"):
        inertial.find("origin").set("xyz", engines._text(rng.normal(0.0, 0.02, 3)))
        inertial.find("origin").set("rpy", engines._text(rng.normal(0.0, 1.0, 3)))
        turn = engines.rotation(rng.normal(size=3))
        a, b = rng.uniform(1.0, 2.0, 2) * 1e-3
        inertia = turn @ np.diag([a, b, 0.8 * (a + b)]) @ turn.T
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            inertial.find("inertia").set("i" + "xyz"[i] + "xyz"[j], repr(float(inertia[i, j])))
    return ET.tostring(robot, encoding="unicode")


@pytest.mark.parametrize("seed", range(3))
def test_shaken_trees_agree_with_mujoco(seed):
    pytest.importorskip("mujoco", minversion="4.0")
    text = shaken(engines.NEXUS6.read_text(), seed)
    states = engines.random_states(text, 10, seed)
    reference = engines.by_mujoco(text, states)
    for route in ("accelerate", "accelerate_aba"):
        assert worst(rover_of(text, states), states, reference, route, is_held=True) < AGREE


def test_a_wrong_differential_would_be_seen(stored):
    states = engines.States(**{name: stored[name] for name in engines.States._fields})
    rover = rover_of(str(stored["urdf"]), states)
    assert worst(dataclasses.replace(rover, differential=None), states, stored, "accelerate", is_held=True) > 1e-6
