"""A rover as MJCF: bodies, motors, servos, differential and couplings, set down where it starts; no soil."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError
from rover_pin.effects.effect import BodyEffect
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of
from rover_pin.simulation.compiled.rover_numbers import SERVO_GAIN
from rover_pin.simulation.compiled.suspension import joint_strength
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.start.place import Start, settled_state
from rover_pin.simulation.state import DriveState
from rover_pin.terrain.terrain import Terrain

AROUND, CELLS = 5.0, 200
"""Half the width of the ground that is drawn [m], and its cells along either side."""

TIMESTEP = 0.005
"""MuJoCo's step [s]: half of a drive's, since it is of first order."""

DRIVE = """import mujoco
from pathlib import Path
from rover_pin import scenario
from rover_pin.control.mujoco.soil_forces import SoilForces

chosen = scenario({name!r}, **{settings!r})
model = mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("rover.xml")))
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
soil = SoilForces(chosen.model, model, chosen.start)
mujoco.set_mjcb_passive(soil)
data.ctrl[:{wheels}] = {duty}  # and the steering's targets after them
while data.time < 5.0:
    mujoco.mj_step(model, data)
mujoco.set_mjcb_passive(None)
x, y, z = data.qpos[:3]
print(f"t = {{data.time:.2f}} s: x = {{x:.4f}} m, y = {{y:.4f}} m, mean slip {{soil.of_wheels('slip').mean():.3f}}")
"""
"""A program that drives `rover.xml` beside it."""


def mjcf(model: Model, start: Start = Start(), timestep: float = TIMESTEP) -> str:
    """Return a model's rover as MJCF, with a key frame `start` in which it is set down at rest.

    Bodies and joints have the names of the rover's joints, the base `root_joint`. `ctrl` are the duties of the wheels
    (`duty_fl` ...), torque = stall_torque (duty - rate / no_load_rate), then the targets of the steering (`steer_fl`
    ...) [rad]. The ground is drawn, and touches nothing: what carries the rover is `SoilForces`.

    Raises ParameterError: effects in the motors or on the body, which MuJoCo would not have.
    Raises SimulationError: the rover cannot be set down there.
    """
    refuse_others(model)
    rover, state = model.built, settled_state(model, start)
    top = ET.Element("mujoco", model=rover.name)
    ET.SubElement(top, "compiler", angle="radian", autolimits="true")
    ET.SubElement(
        top, "option", timestep=repr(timestep), gravity=_text(rover.model.gravity.linear), integrator="implicitfast"
    )
    ET.SubElement(top, "statistic", center=_text(state.q[:3]), extent=repr(2.0 * base_of(rover).length))
    world = ET.SubElement(top, "worldbody")
    _draw(top, world, model.ground, start)
    places: list[float] = []
    _add_body(world, model, state, 1, places)
    _add_constraints(top, rover, timestep)
    ctrl = "0 " * _add_actuators(top, model)
    ET.SubElement(ET.SubElement(top, "keyframe"), "key", name="start", qpos=_text(places), ctrl=ctrl)
    ET.indent(top)
    return ET.tostring(top, encoding="unicode") + "\n"


def drive_text(name: str, settings: Mapping[str, Any], wheels: int) -> str:
    """Return a Python program that drives the MJCF of a scenario on its soil."""
    return DRIVE.format(name=name, settings=dict(settings), wheels=wheels, duty=CRUISE_DUTY)


def refuse_others(model: Model) -> None:
    """Refuse a model with effects that neither the MJCF nor the soil has.

    Raises ParameterError: it has such effects.
    """
    pushing = [e for e in model.body_effects if type(e).push is not BodyEffect.push or e.frees_differential]
    names = [type(effect).__name__ for effect in (*model.motor_effects, *pushing)]
    if names:
        raise ParameterError(
            f"MuJoCo would not have the model's effects {', '.join(names)}: take them out of the model, and write what "
            "stands for them into the MJCF (joints' stiffness, damping, frictionloss)."
        )


def _add_body(parent: ET.Element, model: Model, state: DriveState, joint: int, places: list[float]) -> None:
    """Add the body that a joint moves and all beyond it; `places` takes the coordinates in MuJoCo's order."""
    pin_model = model.built.model
    name, place, inertia = pin_model.names[joint], pin_model.jointPlacements[joint], pin_model.inertias[joint]
    q = state.q[pin_model.joints[joint].idx_q :][: pin_model.joints[joint].nq]
    body = ET.SubElement(parent, "body", name=name, pos=_text(place.translation), quat=_quaternion(place.rotation))
    J = inertia.inertia
    six = [*np.diag(J), J[0, 1], J[0, 2], J[1, 2]]
    ET.SubElement(body, "inertial", pos=_text(inertia.lever), mass=repr(inertia.mass), fullinertia=_text(six))
    if joint == 1:
        ET.SubElement(body, "freejoint", name=name)
        places += [*q[:3], q[6], *q[3:6]]
    else:
        places.append(float(q[0]) if len(q) == 1 else float(np.arctan2(q[1], q[0])))
        _add_hinge(body, model, joint)
    for child in pin_model.children[joint]:
        _add_body(body, model, state, child, places)


def _add_hinge(body: ET.Element, model: Model, joint: int) -> None:
    """Add a joint with its limits; a wheel's with its rotor, and the wheel as a cylinder."""
    pin_model = model.built.model
    axis = _axis(pin_model, joint)
    hinge = ET.SubElement(body, "joint", name=pin_model.names[joint], type="hinge", axis=_text(axis))
    for wheel in model.built.wheels:
        if wheel.joint == joint:
            hinge.set("armature", repr(float(model.motor.armature)))
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
            size = _text([float(wheel.wheel.r), float(wheel.wheel.b) / 2.0])
            _draw_geom(body, type="cylinder", size=size, quat=_quaternion(turn))
            return
    at = pin_model.joints[joint].idx_q
    hinge.set("range", _text([pin_model.lowerPositionLimit[at], pin_model.upperPositionLimit[at]]))
    ends = [pin_model.jointPlacements[child].translation for child in pin_model.children[joint]]
    for end in (end for end in ends if np.linalg.norm(end) > 0.0):
        _draw_geom(body, type="capsule", size="0.01", fromto=_text([0.0, 0.0, 0.0, *end]))


def _axis(pin_model: pin.Model, joint: int) -> np.ndarray:
    """Return the axis of a joint in its own axes."""
    data = pin_model.createData()
    pin.computeJointJacobians(pin_model, data, pin.neutral(pin_model))
    return np.array(pin.getJointJacobian(pin_model, data, joint, pin.LOCAL)[3:, pin_model.joints[joint].idx_v])


def _draw_geom(body: ET.Element, **what: str) -> None:
    ET.SubElement(body, "geom", {"contype": "0", "conaffinity": "0", "mass": "0", **what})


def _draw(top: ET.Element, world: ET.Element, ground: Terrain, start: Start) -> None:
    """Draw the ground around the start as a height field, whose text begins at the greatest y."""
    steps = np.linspace(-AROUND, AROUND, CELLS + 1)
    heights = np.asarray(ground.height(*np.meshgrid(start.x + steps, start.y + steps)), dtype=float)
    low, span = float(heights.min()), max(float(np.ptp(heights)), 1e-3)
    elevation = " ".join(f"{height:.4g}" for height in (heights[::-1] - low).ravel() / span)
    size = _text([AROUND, AROUND, span, 0.1])
    sides = str(CELLS + 1)
    ET.SubElement(
        ET.SubElement(top, "asset"), "hfield", name="ground", nrow=sides, ncol=sides, size=size, elevation=elevation
    )
    _draw_geom(world, type="hfield", hfield="ground", pos=_text([start.x, start.y, low]), rgba="0.8 0.7 0.5 1")


def _add_constraints(top: ET.Element, rover: Rover, timestep: float) -> None:
    """Add the differential and what follows what as equalities, as stiff as MuJoCo takes them."""
    name_at = {joint.idx_v: name for joint, name in zip(rover.model.joints, rover.model.names, strict=True)}
    pairs = [(coupling.follower, coupling.leader, coupling.ratio) for coupling in rover.couplings]
    if rover.differential is not None:
        pairs.append((rover.differential.right, rover.differential.left, -1.0))
    equality = ET.SubElement(top, "equality")
    for follower, leader, ratio in pairs:
        ET.SubElement(
            equality, "joint", joint1=name_at[follower], joint2=name_at[leader], polycoef=_text([0, ratio, 0, 0, 0]),
            solref=_text([2.0 * timestep, 1.0]), solimp="0.9999 0.9999 0.001 0.5 2",
        )  # fmt: skip


def _add_actuators(top: ET.Element, model: Model) -> int:
    """Add motors and steering servos; return how many."""
    rover, actuators, strength = model.built, ET.SubElement(top, "actuator"), joint_strength(model.rover)
    name_at = {joint.idx_v: name for joint, name in zip(rover.model.joints, rover.model.names, strict=True)}
    stall, back = float(model.motor.stall_torque), float(model.motor.stall_torque / model.motor.no_load_rate)
    for wheel in rover.wheels:
        ET.SubElement(
            actuators, "general", name=f"duty_{wheel.name}", joint=name_at[wheel.dof], ctrlrange="-1 1",
            gainprm=repr(stall), biastype="affine", biasprm=_text([0.0, 0.0, -back]),
        )  # fmt: skip
    kp, kv = (repr(float(strength * gain)) for gain in SERVO_GAIN)
    for wheel in (wheel for wheel in rover.wheels if wheel.steer_dof is not None):
        ET.SubElement(
            actuators, "position", name=f"steer_{wheel.name}", joint=name_at[wheel.steer_dof], kp=kp, kv=kv
        )  # fmt: skip
    return len(actuators)


def _quaternion(rotation: np.ndarray) -> str:
    x, y, z, w = pin.Quaternion(np.asarray(rotation)).coeffs()
    return _text([w, x, y, z])


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
