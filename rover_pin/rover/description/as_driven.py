"""The URDF as it is driven: held joints fixed, axes the right way round, joints that follow all follow one leader.

Everything after this, Pinocchio, viewers and drives alike, reads the text that comes out. A URDF that needs none of it
stays as it is, byte for byte; else each change is one sentence.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError, UrdfError, closest
from rover_pin.base.quantity import refuse_strange, to_si, value_and_unit
from rover_pin.rover.description.following import follow_one_leader
from rover_pin.rover.description.tree import Joint, UrdfTree, read_tree, turn

ALONG = 0.95
"""Least cosine between an axis and where it must point (18 deg: wheels may be cambered)."""
OF_MOTION = ("axis", "limit", "mimic", "dynamics", "safety_controller", "calibration")
"""What a joint that is fixed does not have."""


@dataclass(frozen=True)
class Forms:
    """What a rover's TOML says of the form that its joints take."""

    base: str
    wheels: tuple[str, ...] = ()
    steering: tuple[str, ...] = ()
    pivots: tuple[str, ...] = ()
    differential: tuple[str, str] | None = None
    "the two rockers, left and right"
    sides: tuple[tuple[str, ...], ...] = ()
    "wheels that are tied together, front ones first"
    held_joints: Mapping[str, Any] = field(default_factory=dict)
    "joint -> angle [rad] or travel [m], or { value, unit }"
    coupled: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    "joint -> the joint that it follows, and by how much"
    cut: tuple[str, ...] = ()
    base_rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    "roll, pitch, yaw [rad] of the base link in axes x forward, y left, z up"


class Driven(NamedTuple):
    """The text, and what was changed in it."""

    text: str
    changes: tuple[str, ...]


def as_driven(text: str, file: str, forms: Forms) -> Driven:
    """Return the URDF's text with its joints in the forms that drives know.

    Raises UrdfError: text that is no URDF, or a form that a joint cannot take.
    """
    robot = _Robot(ET.fromstring(text) if read_tree(text, file) else ET.Element("robot"), file)
    changes = [
        *_cut_joints(robot, forms),
        *_remove_floating_joint(robot),
        *_couple_joints(robot, forms),
        *_hold_joints(robot, forms),
        *_endless(robot, forms),
        *_add_base_frame(robot, forms),
        *_turn_axes(robot, forms),
        *_tie_wheels(robot, forms),
        *follow_one_leader(robot.joints, forms.differential, file),
    ]
    return Driven(robot.text if changes else text, tuple(changes))


@dataclass
class _Robot:
    """A URDF that is changed."""

    element: ET.Element
    file: str

    @property
    def joints(self) -> dict[str, ET.Element]:
        return {str(joint.get("name")): joint for joint in self.element.findall("joint")}

    @property
    def text(self) -> str:
        return ET.tostring(self.element, encoding="unicode")

    @property
    def tree(self) -> UrdfTree:
        return read_tree(self.text, self.file)

    def joint_element(self, joint: str, key: str) -> ET.Element:
        if joint not in self.joints:
            raise UrdfError(
                f"{self.file}: there is no joint '{joint}', which the TOML's {key} names: {closest(joint, self.joints)}"
            )
        return self.joints[joint]


def _cut_joints(robot: _Robot, forms: Forms) -> Iterator[str]:
    for name in forms.cut:
        robot.element.remove(robot.joint_element(name, "cut"))
        yield f"joint '{name}' is cut."


def _remove_floating_joint(robot: _Robot) -> Iterator[str]:
    """Take out the floating joint between a massless world and the base: the free base is added when it is read."""
    tree = robot.tree
    for joint in tree.joints:
        bare = [link.name for link in tree.links if link.body is None or link.body.mass == 0.0]
        alone = [
            neighbour.name for neighbour in tree.joints if joint.parent in (neighbour.parent, neighbour.child)
        ] == [joint.name]
        if joint.kind == "floating" and joint.parent in bare and alone:
            robot.element.remove(robot.joints[joint.name])
            (world,) = (link for link in robot.element.findall("link") if link.get("name") == joint.parent)
            robot.element.remove(world)
            yield f"the floating joint '{joint.name}' and its link '{joint.parent}' are left out: the base is free."


def _couple_joints(robot: _Robot, forms: Forms) -> Iterator[str]:
    for name, (leader, ratio) in forms.coupled.items():
        joint = robot.joint_element(name, "[coupled]")
        robot.joint_element(leader, "[coupled]")
        _follow(joint, leader, ratio)
        yield f"joint '{name}' follows '{leader}' {ratio:+g} : 1, as the TOML says."


def _follow(joint: ET.Element, leader: str, ratio: float) -> None:
    for old in joint.findall("mimic"):
        joint.remove(old)
    ET.SubElement(joint, "mimic", joint=leader, multiplier=repr(ratio), offset="0")


def _hold_joints(robot: _Robot, forms: Forms) -> Iterator[str]:
    """Fix the joints that are held, and those that follow them, where they then stand."""
    for name in forms.held_joints:
        robot.joint_element(name, "[held]")
    tree = robot.tree
    values = {name: _value(tree.joint(name), entry, robot.file) for name, entry in forms.held_joints.items()}
    for _ in tree.joints:
        for joint in tree.joints:
            if joint.mimic is not None and joint.mimic.joint in values and joint.name not in values:
                values[joint.name] = joint.mimic.multiplier * values[joint.mimic.joint] + joint.mimic.offset
    for name, value in values.items():
        held_joint = tree.joint(name)
        if held_joint is not None and held_joint.moves:
            _fix(robot.joints[name], held_joint, value)
    if values:
        yield f"{len(values)} joints are held: " + ", ".join(f"'{name}' at {at:.3g}" for name, at in values.items())


def _value(joint: Joint | None, entry: Any, file: str) -> float:
    assert joint is not None
    unit, where = "m" if joint.kind == "prismatic" else "rad", f"{file}: held joint '{joint.name}'"
    try:
        if isinstance(entry, Mapping):
            refuse_strange(entry, where)
        value = to_si(*value_and_unit(entry, unit), unit, where)
    except ParameterError as error:
        raise UrdfError(str(error)) from error
    low, high = joint.limits
    if joint.limited and joint.kind != "continuous" and not low - 1e-6 <= value <= high + 1e-6:
        raise UrdfError(f"{where} = {value:g} {unit} is beyond its stops; hold it within [{low:g}, {high:g}] {unit}.")
    return value


def _fix(element: ET.Element, joint: Joint, value: float) -> None:
    if joint.kind in ("floating", "planar"):
        value = 0.0
    motion, length = np.eye(4), float(np.linalg.norm(joint.axis))
    axis = joint.axis / length if length > 0.0 else joint.axis
    if joint.kind == "prismatic":
        motion[:3, 3] = value * axis
    else:
        motion[:3, :3] = pin.AngleAxis(value, axis).toRotationMatrix()
    _place(element, joint.origin @ motion)
    element.set("type", "fixed")
    for tag in OF_MOTION:
        for part in element.findall(tag):
            element.remove(part)


def _place(element: ET.Element, placement: np.ndarray) -> None:
    origin = element.find("origin")
    origin = ET.SubElement(element, "origin") if origin is None else origin
    origin.set("xyz", " ".join(repr(float(number)) for number in placement[:3, 3]))
    origin.set("rpy", " ".join(repr(float(number)) for number in pin.rpy.matrixToRpy(placement[:3, :3])))


def _endless(robot: _Robot, forms: Forms) -> Iterator[str]:
    """Make wheels turn without end; give pivots and steering that turn without end the stops of a full turn."""
    for name, joint in robot.joints.items():
        if joint.get("type") == "fixed" and (mimic := joint.find("mimic")) is not None:
            joint.remove(mimic)
            yield f"joint '{name}' is fixed: its <mimic> is left out."
        if name in forms.wheels and joint.get("type") == "revolute":
            joint.set("type", "continuous")
            yield f"wheel joint '{name}' is revolute: its stops are left out, a wheel turns without end."
        elif name in (*forms.pivots, *forms.steering) and joint.get("type") == "continuous":
            joint.set("type", "revolute")
            for old in joint.findall("limit"):
                joint.remove(old)
            ET.SubElement(joint, "limit", lower=repr(-math.pi), upper=repr(math.pi), effort="0", velocity="0")
            yield f"joint '{name}' is continuous: it gets stops half a turn to either side."


def _add_base_frame(robot: _Robot, forms: Forms) -> Iterator[str]:
    """Put a new root with the base's frame, turned as the TOML says, above a root that is not the base's frame."""
    tree = robot.tree
    if len(tree.roots) != 1 or forms.base not in tree.rigid_group(tree.roots[0]):
        return
    if forms.base == tree.roots[0] and not any(forms.base_rpy):
        return
    roll, pitch, yaw = forms.base_rpy
    placement = np.eye(4)
    placement[:3, :3] = turn("z", yaw) @ turn("y", pitch) @ turn("x", roll)
    root, name = tree.roots[0], f"{forms.base}_frame"
    ET.SubElement(robot.element, "link", name=name)
    joint = ET.SubElement(robot.element, "joint", name=f"{name}_joint", type="fixed")
    ET.SubElement(joint, "parent", link=name)
    ET.SubElement(joint, "child", link=root)
    _place(joint, placement @ np.linalg.inv(tree.placements[forms.base]))
    turned = f", turned by base_rpy = {list(forms.base_rpy)}" if any(forms.base_rpy) else ""
    yield f"positions and attitude are those of link '{forms.base}'{turned}; the URDF's root is '{root}'."


def _turn_axes(robot: _Robot, forms: Forms) -> Iterator[str]:
    """Turn round the axes that point the wrong way along y (wheels, rockers) or z (steering)."""
    tree = robot.tree
    places = tree.placements
    for role, names, direction in (
        ("wheel", forms.wheels, 1),
        ("rocker", forms.differential or (), 1),
        ("steering", forms.steering, 2),
    ):
        wrong = [name for name in names if _along(tree.joint(name), places, direction) <= -ALONG]
        for name in wrong:
            _flip(robot, name)
        if wrong:
            quoted_names = ", ".join(f"'{name}'" for name in wrong)
            sense = "turn left" if direction == 2 else "roll forward" if role == "wheel" else "lift the wheels before"
            points = f"joint '{wrong[0]}' points" if len(wrong) == 1 else f"joints {quoted_names} point"
            yield (
                f"{role} {points} to -{'xyz'[direction]}: angles and rates are counted the other way round, "
                f"so that positive ones {sense}."
            )


def _along(joint: Joint | None, places: Mapping[str, np.ndarray], direction: int) -> float:
    if joint is None or joint.child not in places or not np.linalg.norm(joint.axis) > 0.0:
        return 0.0
    return float((places[joint.child][:3, :3] @ joint.axis)[direction] / np.linalg.norm(joint.axis))


def _flip(robot: _Robot, name: str) -> None:
    joint, joints = robot.joints[name], robot.joints
    axis = joint.find("axis")
    axis = ET.SubElement(joint, "axis", xyz="1 0 0") if axis is None else axis
    axis.set("xyz", " ".join(repr(0.0 - float(number)) for number in str(axis.get("xyz")).split()))
    limit = joint.find("limit")
    if limit is not None:
        low, high = (float(limit.get(end, "0")) for end in ("lower", "upper"))
        limit.set("lower", repr(0.0 - high))
        limit.set("upper", repr(0.0 - low))
    for other_name, other_joint in joints.items():
        mimic = other_joint.find("mimic")
        if mimic is None:
            continue
        if mimic.get("joint") == name:
            mimic.set("multiplier", repr(-float(mimic.get("multiplier", "1"))))
        if other_name == name:
            mimic.set("multiplier", repr(-float(mimic.get("multiplier", "1"))))
            mimic.set("offset", repr(0.0 - float(mimic.get("offset", "0"))))


def _tie_wheels(robot: _Robot, forms: Forms) -> Iterator[str]:
    for first, *others in forms.sides:
        for name in others:
            _follow(robot.joint_element(name, "[wheels]"), first, 1.0)
        robot.joint_element(first, "[wheels]")
        yield f"wheels '{first}', " + ", ".join(f"'{name}'" for name in others) + " turn together."
