"""Accelerations of a rover by other physics engines, which share no code with the package: MuJoCo, and Drake where it
is installed.

    python tests/oracle/engines.py        makes tests/oracle/nexus6_accelerations.npz

Each engine computes its own mass matrix and bias. The differential is then imposed as a hard constraint by a dense KKT
system in NumPy, because the engines' own couplings are soft (MuJoCo's equality constraint is off by 4e-3) and cannot
serve as a reference.

Conventions of the file, which differ from those of all engines: position of the base and quaternion (w x y z), velocity
of the base's origin in world axes, angular velocity in base axes, then joints by name. Accelerations are the time
derivatives of these velocities, so that the acceleration of the origin is the classical one. Efforts: force at the
base's origin in world axes, moment in base axes, then joint torques. Wrenches: force and moment at the wheels' centres
in world axes.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

import numpy as np

HERE = Path(__file__).parent
NEXUS6 = HERE.parents[1] / "urdf" / "nexus6.urdf"
FILE = HERE / "nexus6_accelerations.npz"
ROCKERS = ("rocker_l", "rocker_r")
GRAVITY = 9.81


class States(NamedTuple):
    """Random states, one row for each state."""

    joints: list[str]
    wheels: list[str]
    position: np.ndarray
    quaternion: np.ndarray
    angles: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    wrench: np.ndarray
    armature: np.ndarray


def random_states(text: str, count: int, seed: int) -> States:
    """Return states with a fast base, fast wheels and forces on all wheels. Angles and rates fulfil the
    differential.
    """
    rng = np.random.default_rng(seed)
    joints = [joint.get("name") for joint in ET.fromstring(text).findall("joint")]
    wheels = [name for name in joints if name.startswith("wheel")]
    quaternion = rng.normal(size=(count, 4))
    angles, rates = rng.uniform(-1.0, 1.0, (count, len(joints))), rng.normal(0.0, 2.0, (count, len(joints)))
    left, right = map(joints.index, ROCKERS)
    for name in wheels:
        rates[:, joints.index(name)] *= 10.0
    angles[:, right], rates[:, right] = -angles[:, left], -rates[:, left]
    return States(
        joints,
        wheels,
        rng.normal(size=(count, 3)),
        quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True),
        angles,
        np.hstack([rng.normal(0.0, 2.0, (count, 6)), rates]),
        rng.normal(0.0, 2.0, (count, 6 + len(joints))),
        np.concatenate([rng.normal(0.0, 10.0, (count, len(wheels), 3)), rng.normal(size=(count, len(wheels), 3))], 2),
        np.array([1e-3 if name in wheels else 2e-4 for name in joints]),
    )


def mjcf(text: str) -> str:
    """Return the MuJoCo XML of a URDF without fixed joints. MuJoCo's own importer merges links and discards
    inertias.
    """
    robot = ET.fromstring(text)
    links = {link.get("name"): link for link in robot.findall("link")}
    joints = robot.findall("joint")
    root = (set(links) - {joint.find("child").get("link") for joint in joints}).pop()
    top = ET.Element("mujoco")
    ET.SubElement(top, "compiler", angle="radian", eulerseq="XYZ", balanceinertia="false", boundmass="0")
    ET.SubElement(top, "option", gravity=f"0 0 {-GRAVITY}")
    base = ET.SubElement(ET.SubElement(top, "worldbody"), "body", name=root)
    ET.SubElement(base, "freejoint", name="base")
    _fill(base, links, joints, root)
    return ET.tostring(top, encoding="unicode")


def _fill(body: ET.Element, links: dict, joints: list, link: str) -> None:
    inertial = links[link].find("inertial")
    origin, inertia = inertial.find("origin"), inertial.find("inertia")
    turn = rotation(_vector(origin, "rpy"))
    I = np.array([[float(inertia.get("i" + "".join(sorted(a + b)))) for b in "xyz"] for a in "xyz"])  # noqa: E741
    I = turn @ I @ turn.T  # noqa: E741
    six = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
    ET.SubElement(
        body, "inertial", pos=_text(_vector(origin, "xyz")), mass=inertial.find("mass").get("value"),
        fullinertia=_text(six),
    )  # fmt: skip
    for joint in joints:
        if joint.find("parent").get("link") != link:
            continue
        child, origin = joint.find("child").get("link"), joint.find("origin")
        inner = ET.SubElement(
            body,
            "body",
            name=child,
            pos=_text(_vector(origin, "xyz")),
            quat=_text(quaternion_of(_vector(origin, "rpy"))),
        )
        ET.SubElement(inner, "joint", name=joint.get("name"), type="hinge", axis=joint.find("axis").get("xyz"))
        _fill(inner, links, joints, child)


def _vector(element: ET.Element | None, key: str) -> np.ndarray:
    return np.array([float(word) for word in ("0 0 0" if element is None else element.get(key, "0 0 0")).split()])


def _text(values: np.ndarray | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def rotation(rpy: np.ndarray) -> np.ndarray:
    """Return Rz(yaw) Ry(pitch) Rx(roll)."""
    w, x, y, z = quaternion_of(rpy)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(rpy: np.ndarray) -> np.ndarray:
    """Return the quaternion (w x y z) of roll, pitch and yaw in a URDF."""
    (a, b, c), (s, t, u) = np.cos(np.asarray(rpy) / 2), np.sin(np.asarray(rpy) / 2)
    return np.array([a * b * c + s * t * u, s * b * c - a * t * u, a * t * c + s * b * u, a * b * u - s * t * c])


def constrained(H: np.ndarray, force: np.ndarray, left: int, right: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the free acceleration, the acceleration under the differential, and the torque of the differential, by a
    dense KKT system.
    """
    G = np.zeros(len(H))
    G[[left, right]] = 1.0
    saddle = np.block([[H, -G[:, None]], [G[None, :], np.zeros((1, 1))]])
    solution = np.linalg.solve(saddle, np.append(force, 0.0))
    return np.linalg.solve(H, force), solution[:-1], float(solution[-1])


def by_mujoco(text: str, states: States) -> dict[str, np.ndarray]:
    """Return MuJoCo's mass matrices, free and constrained accelerations and constraint torques, and its masses."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf(text))
    data = mujoco.MjData(model)
    dofs = [int(model.joint(name).dofadr[0]) for name in states.joints]
    places = [int(model.joint(name).qposadr[0]) for name in states.joints]
    model.dof_armature[dofs] = states.armature
    order = [*range(6), *dofs]
    carriers = {joint: model.joint(joint).bodyid[0] for joint in states.wheels}
    left, right = (6 + states.joints.index(name) for name in ROCKERS)
    out: dict[str, list] = {"mass_matrix": [], "free": [], "constrained": [], "torque": []}
    for i in range(len(states.position)):
        data.qpos[:3], data.qpos[3:7] = states.position[i], states.quaternion[i]
        data.qpos[places], data.qvel[order] = states.angles[i], states.velocity[i]
        mujoco.mj_forward(model, data)
        H, push = np.zeros((model.nv, model.nv)), np.zeros(model.nv)
        mujoco.mj_fullM(model, data, H)
        for name, wrench in zip(states.wheels, states.wrench[i], strict=True):
            body = carriers[name]
            mujoco.mj_applyFT(model, data, wrench[:3], wrench[3:], data.xpos[body].copy(), body, push)
        H = H[np.ix_(order, order)]
        force = states.effort[i] + push[order] - data.qfrc_bias[order]
        _append(out, H, *constrained(H, force, left, right))
    return {**{key: np.array(value) for key, value in out.items()}, "mass": np.array(model.body_mass[1:])}


def _append(out: dict[str, list], *values: object) -> None:
    for row, value in zip(out.values(), values, strict=True):
        row.append(value)


def by_drake(text: str, states: States) -> dict[str, np.ndarray]:
    """Return the results of `by_mujoco` from Drake, whose generalised velocity begins with the angular velocity in
    world axes.
    """
    from pydrake.math import RigidTransform
    from pydrake.multibody.math import SpatialForce
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import MultibodyForces

    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(_plain(text), "urdf")
    plant.gravity_field().set_gravity_vector([0.0, 0.0, -GRAVITY])
    plant.Finalize()
    context = plant.CreateDefaultContext()
    base = plant.GetBodyByName(_root(text))
    start = base.floating_velocities_start_in_v()
    dofs = [plant.GetJointByName(name).velocity_start() for name in states.joints]
    order = [*range(start + 3, start + 6), *range(start, start + 3), *dofs]
    left, right = (6 + states.joints.index(name) for name in ROCKERS)
    out: dict[str, list] = {"mass_matrix": [], "free": [], "constrained": [], "torque": []}
    for i in range(len(states.position)):
        turn = rotation_of(states.quaternion[i])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn, states.position[i]
        plant.SetFreeBodyPose(context, base, RigidTransform(pose))
        for name, angle in zip(states.joints, states.angles[i], strict=True):
            plant.GetJointByName(name).set_angle(context, angle)
        speed = np.zeros(plant.num_velocities())
        speed[order] = states.velocity[i]
        speed[start : start + 3] = turn @ states.velocity[i, 3:6]
        plant.SetVelocities(context, speed)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        for name, wrench in zip(states.wheels, states.wrench[i], strict=True):
            wheel = plant.GetJointByName(name).child_body()
            wheel.AddInForceInWorld(context, SpatialForce(wrench[3:], wrench[:3]), forces)
        zero = np.zeros(plant.num_velocities())
        H = plant.CalcMassMatrix(context)
        against = plant.CalcInverseDynamics(context, zero, forces)
        back = np.eye(len(H))
        back[3:6, 3:6] = turn
        H, against = back.T @ H[np.ix_(order, order)] @ back, back.T @ against[order]
        H[np.arange(6, len(H)), np.arange(6, len(H))] += states.armature
        _append(out, H, *constrained(H, states.effort[i] - against, left, right))
    return {key: np.array(value) for key, value in out.items()}


def _plain(text: str) -> str:
    robot = ET.fromstring(text)
    for element in robot.iter("joint"):
        for mimic in element.findall("mimic"):
            element.remove(mimic)
    for link in robot.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    return ET.tostring(robot, encoding="unicode")


def _root(text: str) -> str:
    robot = ET.fromstring(text)
    children = {joint.find("child").get("link") for joint in robot.findall("joint")}
    return ({link.get("name") for link in robot.findall("link")} - children).pop()


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of (w x y z)."""
    w, v = quaternion[0], np.asarray(quaternion[1:])
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def main() -> None:
    """Make the reference file."""
    import mujoco

    text = NEXUS6.read_text()
    states = random_states(text, 100, seed=2002)
    accelerations = by_mujoco(text, states)
    keep = {key: accelerations[key] for key in ("free", "constrained", "torque", "mass")}
    try:
        drake = by_drake(text, states)
    except ImportError:
        print("Drake is not installed")
    else:
        keep.update({f"drake_{key}": drake[key] for key in ("free", "constrained", "torque")})
        for key in ("free", "constrained"):
            off = np.abs(drake[key] - accelerations[key]).max(1) / np.abs(accelerations[key]).max(1)
            print(f"Drake against MuJoCo, {key}: {off.max():.1e}")
    np.savez_compressed(FILE, **states._asdict(), **keep, urdf=text, made_by=f"mujoco {mujoco.__version__}")


if __name__ == "__main__":
    main()
