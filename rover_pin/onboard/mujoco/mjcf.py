"""Write a rover at its start as MJCF, the model file of MuJoCo: bodies, motors, servos, differential and couplings.

The forces of the soil are not in the file; `SoilForces` in `soil_forces.py` adds them in every step of MuJoCo.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.base.encode import xml_text
from rover_pin.base.errors import ParameterError
from rover_pin.effects.effect import BodyEffect
from rover_pin.rover.wheel_base import base_of
from rover_pin.simulation.compiled.drive_fields import SERVO_GAIN, joint_strength
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.start import Start, settled_state
from rover_pin.simulation.state import DriveState

GROUND_HALF_WIDTH, GROUND_CELLS = 5.0, 200
"""MuJoCo draws a square of ground around the start, of the half width GROUND_HALF_WIDTH [m], with GROUND_CELLS cells
along each side. A cell is then 5 cm wide, so that waves and steps can be seen. The soil's forces use the exact terrain
and do not depend on this drawing."""

TIMESTEP = 0.005
"""Default time step of MuJoCo [s], half of the usual step of a drive, because MuJoCo's integrator is of first order."""

DRIVE = """import mujoco
from pathlib import Path
from rover_pin import scenario
from rover_pin.onboard.mujoco.soil_forces import SoilForces

chosen = scenario({name!r}, **{settings!r})
model = mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("rover.xml")))
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
soil = SoilForces(chosen.model, model, chosen.start)
mujoco.set_mjcb_passive(soil)
data.ctrl[:{wheels}] = {duty}  # the target angles of the steering follow after them
while data.time < 5.0:
    mujoco.mj_step(model, data)
mujoco.set_mjcb_passive(None)
x, y, z = data.qpos[:3]
print(f"t = {{data.time:.2f}} s: x = {{x:.4f}} m, y = {{y:.4f}} m, mean slip {{soil.of_wheels('slip').mean():.3f}}")
"""
"""Text of a Python program that drives the rover of the file `rover.xml`, in the program's folder, on the soil of a
scenario."""


def mjcf(model: Model, start: Start = Start(), timestep: float = TIMESTEP) -> str:
    """Return a model's rover as the text of an MJCF file, with a key frame `start` of the rover at rest.

    Bodies and joints have the names of the rover's joints; the base is `root_joint`. The entries of MuJoCo's control
    vector `ctrl` are the duties of the wheels (`duty_fl` ...), with torque = stall_torque (duty - rate / no_load_rate),
    and then the target angles of the steering (`steer_fl` ...) [rad]. The ground is only drawn and has no contacts,
    because `SoilForces` supports the rover.

    Parameters
    ----------
    model : Model
        Rover, ground and motors.
    start : Start
        Position and heading at which the rover is set down.
    timestep : float
        Time step of MuJoCo [s].

    Raises
    ------
    ParameterError
        The model has effects in the motors or on the body, which MuJoCo would not simulate.
    SimulationError
        The rover cannot be set down at `start`.
    """
    refuse_others(model)
    rover, state = model.built, settled_state(model, start)
    top = ET.Element("mujoco", model=xml_text(rover.name))
    ET.SubElement(top, "compiler", angle="radian", autolimits="true")
    ET.SubElement(
        top, "option", timestep=repr(timestep), gravity=_text(rover.model.gravity.linear), integrator="implicitfast"
    )
    ET.SubElement(top, "statistic", center=_text(state.q[:3]), extent=repr(2.0 * base_of(rover).length))
    world = ET.SubElement(top, "worldbody")
    # The ground around the start is sampled on a square grid, as a height field that is drawn and has no contacts. Its
    # elevations are from 0 to 1; MuJoCo reads their rows from the largest y to the smallest.
    steps = np.linspace(-GROUND_HALF_WIDTH, GROUND_HALF_WIDTH, GROUND_CELLS + 1)
    heights = np.asarray(model.ground.height(*np.meshgrid(start.x + steps, start.y + steps)), dtype=float)
    low, span = float(heights.min()), max(float(np.ptp(heights)), 1e-3)
    elevation = " ".join(f"{height:.4g}" for height in (heights[::-1] - low).ravel() / span)
    size, sides = _text([GROUND_HALF_WIDTH, GROUND_HALF_WIDTH, span, 0.1]), str(GROUND_CELLS + 1)
    ET.SubElement(
        ET.SubElement(top, "asset"), "hfield", name="ground", nrow=sides, ncol=sides, size=size, elevation=elevation
    )
    _draw_geom(world, type="hfield", hfield="ground", pos=_text([start.x, start.y, low]), rgba="0.8 0.7 0.5 1")
    places: list[float] = []
    # The bodies are nested as the joints are. `places` collects their coordinates at the start, in MuJoCo's order.
    _add_body(world, model, state, 1, places)
    # The couplings between joints are equality constraints. A differential is the coupling right = -left of the two
    # rockers. The time constant of the constraints is two time steps, the smallest that MuJoCo allows.
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
    # A motor has the torque stall_torque (duty - rate / no_load_rate). A servo is a spring with a damper, of the same
    # stiffness and damping as in the simulation.
    actuators, strength = ET.SubElement(top, "actuator"), joint_strength(model.rover)
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
    ctrl = "0 " * len(actuators)
    ET.SubElement(ET.SubElement(top, "keyframe"), "key", name="start", qpos=_text(places), ctrl=ctrl)
    ET.indent(top)
    return ET.tostring(top, encoding="unicode") + "\n"


def drive_text(name: str, settings: Mapping[str, Any], wheels: int) -> str:
    """Return the text of a Python program that drives the rover of an MJCF file on the soil of a scenario for 5 s.

    The name of the scenario and the settings are written as literals of Python, so that no part of their text is
    executed when the user runs the program.
    """
    return DRIVE.format(name=name, settings=dict(settings), wheels=wheels, duty=CRUISE_DUTY)


def refuse_others(model: Model) -> None:
    """Raise ParameterError if a model has effects in the motors or on the body, because MuJoCo would not simulate them.

    The error names these effects.
    """
    pushing = [e for e in model.body_effects if type(e).push is not BodyEffect.push or e.frees_differential]
    # A body effect matters only if it pushes the body, or lets the two rockers move independently.
    names = [type(effect).__name__ for effect in (*model.motor_effects, *pushing)]
    if names:
        raise ParameterError(
            f"MuJoCo would not simulate these effects of the model: {', '.join(names)}. Remove them from the model, "
            "and write a replacement into the MJCF file (stiffness, damping or frictionloss of joints)."
        )


def _add_body(parent: ET.Element, model: Model, state: DriveState, joint: int, places: list[float]) -> None:
    """Add the body that a joint moves, and all bodies that are attached to it, to the XML element of the parent body.

    The coordinates of the joints in the state are appended to `places`, in the order and form of MuJoCo's qpos.
    """
    pin_model = model.built.model
    name, place, inertia = pin_model.names[joint], pin_model.jointPlacements[joint], pin_model.inertias[joint]
    q = state.q[pin_model.joints[joint].idx_q :][: pin_model.joints[joint].nq]
    body = ET.SubElement(parent, "body", name=name, pos=_text(place.translation), quat=_quaternion(place.rotation))
    J = inertia.inertia
    # MuJoCo wants the six entries of the inertia in the order xx, yy, zz, xy, xz, yz.
    six = [*np.diag(J), J[0, 1], J[0, 2], J[1, 2]]
    ET.SubElement(body, "inertial", pos=_text(inertia.lever), mass=repr(inertia.mass), fullinertia=_text(six))
    if joint == 1:
        ET.SubElement(body, "freejoint", name=name)
        # Quaternions: Pinocchio has the order x, y, z, w, MuJoCo w, x, y, z.
        places += [*q[:3], q[6], *q[3:6]]
    else:
        # A joint without limits has the coordinates cos and sin in Pinocchio, and its angle in MuJoCo.
        places.append(float(q[0]) if len(q) == 1 else float(np.arctan2(q[1], q[0])))
        # The column of the joint's Jacobian is its axis, a unit vector in the axes of the body that the joint moves.
        data = pin_model.createData()
        pin.computeJointJacobians(pin_model, data, pin.neutral(pin_model))
        column = pin_model.joints[joint].idx_v
        axis = np.array(pin.getJointJacobian(pin_model, data, joint, pin.LOCAL)[3:, column])
        hinge = ET.SubElement(body, "joint", name=name, type="hinge", axis=_text(axis))
        mount = next((wheel for wheel in model.built.wheels if wheel.joint == joint), None)
        if mount is not None:
            # The joint of a wheel also has the inertia of the motor's rotor. The wheel is drawn as a cylinder, which in
            # MuJoCo lies along z and is turned to the axis of the wheel.
            hinge.set("armature", repr(float(model.motor.armature)))
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
            size = _text([float(mount.wheel.r), float(mount.wheel.b) / 2.0])
            _draw_geom(body, type="cylinder", size=size, quat=_quaternion(turn))
        else:
            # Any other joint has its limits, and its body is drawn as capsules to the next joints.
            at = pin_model.joints[joint].idx_q
            limits = [pin_model.lowerPositionLimit[at], pin_model.upperPositionLimit[at]]
            hinge.set("range", _text(limits))
            ends = [pin_model.jointPlacements[child].translation for child in pin_model.children[joint]]
            for end in (end for end in ends if np.linalg.norm(end) > 0.0):
                _draw_geom(body, type="capsule", size="0.01", fromto=_text([0.0, 0.0, 0.0, *end]))
    for child in pin_model.children[joint]:
        _add_body(body, model, state, child, places)


def _draw_geom(body: ET.Element, **attributes: str) -> None:
    """Add a shape to the XML element of a body that is only drawn: the shape has no contacts and no mass."""
    ET.SubElement(body, "geom", {"contype": "0", "conaffinity": "0", "mass": "0", **attributes})


def _quaternion(rotation: np.ndarray) -> str:
    """Return a rotation matrix (3, 3) as the text of a quaternion in MuJoCo's order w, x, y, z."""
    x, y, z, w = pin.Quaternion(np.asarray(rotation)).coeffs()
    return _text([w, x, y, z])


def _text(values: Iterable[float]) -> str:
    """Return numbers as a text with blanks between them, in full precision."""
    return " ".join(repr(float(value)) for value in values)
