"""Rewrite a URDF into the form that drives need.

Joints that the TOML holds become fixed. The axes of wheels, rockers and steering joints get common directions. Each
group of coupled joints gets one leading joint. Pinocchio, viewers and drives all read the text that `normalise_urdf`
returns. If no change is needed, the URDF is returned byte for byte; otherwise each change is reported in one sentence.
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
from rover_pin.rover.description.tree import UrdfTree, read_tree, turn

ALONG = 0.95
"""Smallest cosine of the angle between an axis and its required direction. It allows 18 deg, because wheels may have
camber."""
MOTION_ELEMENTS = ("axis", "limit", "mimic", "dynamics", "safety_controller", "calibration")
"""XML elements that describe the motion of a joint. They are removed if the joint becomes fixed."""


@dataclass(frozen=True)
class JointForms:
    """The statements of a rover's TOML on the joints of its URDF.

    A joint has a role (wheel, steering, pivot), or it is held at an angle, coupled to another joint, or removed.
    """

    base: str
    "link whose frame is the rover's base frame"
    wheels: tuple[str, ...] = ()
    "joints of the wheels"
    steering: tuple[str, ...] = ()
    "joints that steer wheels"
    pivots: tuple[str, ...] = ()
    "joints of the suspension"
    differential: tuple[str, str] | None = None
    """the two rockers that a differential joins, left and right; None: there is no differential"""
    sides: tuple[tuple[str, ...], ...] = ()
    """joints of wheels that belts or gears tie together, one tuple for each side, the front wheel first"""
    held_joints: Mapping[str, Any] = field(default_factory=dict)
    """name of a joint -> angle [rad] or travel [m] at which it is fixed: a number, or { value, unit }"""
    coupled: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    """name of a joint -> the joint that it follows, and the ratio of its angle to the angle of that joint"""
    cut: tuple[str, ...] = ()
    """joints that close a loop, and are removed because a URDF is a tree"""
    base_rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """roll, pitch and yaw [rad] of the base link relative to axes that point x forward, y left, z up"""


class NormalisedUrdf(NamedTuple):
    """The rewritten text of a URDF, and one sentence for each change."""

    text: str
    changes: tuple[str, ...]


@dataclass
class _Robot:
    """The XML elements of a URDF. The steps of `normalise_urdf` change them in place."""

    element: ET.Element
    file: str

    @property
    def joints(self) -> dict[str, ET.Element]:
        """Return a mapping from the name of each joint to its `<joint>` element."""
        return {str(joint.get("name")): joint for joint in self.element.findall("joint")}

    @property
    def text(self) -> str:
        """Return the text of the URDF in its present form."""
        return ET.tostring(self.element, encoding="unicode")

    @property
    def tree(self) -> UrdfTree:
        """Return the links and joints of the URDF in its present form."""
        return read_tree(self.text, self.file)

    def joint_element(self, joint: str, key: str) -> ET.Element:
        """Return the `<joint>` element with this name.

        Parameters
        ----------
        joint : str
            Name of the joint.
        key : str
            Key of the TOML that names the joint, for the error.

        Raises UrdfError: there is no such joint.
        """
        if joint not in self.joints:
            raise UrdfError(
                f"{self.file}: there is no joint '{joint}', which the TOML's {key} names: {closest(joint, self.joints)}"
            )
        return self.joints[joint]


class Relation(NamedTuple):
    """The coupling of two joints: the angle of `joint` is `ratio` times the angle of `leader`."""

    joint: str
    leader: str
    ratio: float


def normalise_urdf(text: str, file: str, forms: JointForms) -> NormalisedUrdf:
    """Return the text of a URDF, rewritten so that drives can use its joints, and one sentence for each change.

    Joints that the TOML holds become fixed, wheels become continuous, the axes of wheels, rockers and steering joints
    are turned in one direction, and each group of coupled joints gets one leading joint.

    Parameters
    ----------
    text, file : str
        Content and name of the URDF file.
    forms : JointForms
        The statements of the rover's TOML on the joints.

    Raises
    ------
    UrdfError
        The text is not a URDF, or a joint cannot be changed as the TOML states.
    """
    read_tree(text, file)  # refuses a text that is no URDF before anything is changed
    robot = _Robot(ET.fromstring(text), file)
    # The order matters: loops are cut before any step walks the tree, and axes are turned before joints follow one
    # leader, because a turned axis changes the sign of every ratio in which its joint occurs.
    changes: list[str] = []
    for name in forms.cut:
        robot.element.remove(robot.joint_element(name, "cut"))
        changes.append(f"joint '{name}' is cut.")
    # A simulator may place or move the rover in its world by joints above the base. The base is free without these
    # joints, because `free_tree` adds six free motions. A TOML that names one of their links as the base, or holds one
    # of these joints, needs them: they stay, and the check reports a fault later.
    chain = robot.tree.world_joints
    moving = [number for number, world_joint in enumerate(chain) if world_joint.moves]
    removed = chain[: moving[-1] + 1] if moving else []
    needed = any(item.parent == forms.base or item.name in forms.held_joints for item in removed)
    if removed and not needed:
        for item in removed:
            robot.element.remove(robot.joints[item.name])
            robot.element.remove(
                next(link for link in robot.element.findall("link") if link.get("name") == item.parent)
            )
        quoted = ", ".join(f"the {item.kind} joint '{item.name}' and its link '{item.parent}'" for item in removed)
        changes.append(f"the base is free without {quoted}, which are therefore removed.")
    for name, (leader, ratio) in forms.coupled.items():
        joint = robot.joint_element(name, "[coupled]")
        robot.joint_element(leader, "[coupled]")
        _follow(joint, leader, ratio)
        changes.append(f"joint '{name}' follows '{leader}' {ratio:+g} : 1, as the TOML states.")
    changes += _hold_joints(robot, forms)
    # Wheels get the type continuous. Pivots and steering joints that are continuous get stops half a turn to either
    # side, because Pinocchio stores a continuous joint as cosine and sine, but the suspension needs an angle.
    for name, joint in robot.joints.items():
        # yourdfpy and Pinocchio disagree on a fixed joint that follows another.
        if joint.get("type") == "fixed" and (mimic := joint.find("mimic")) is not None:
            joint.remove(mimic)
            changes.append(f"joint '{name}' is fixed: its <mimic> is ignored.")
        if name in forms.wheels and joint.get("type") == "revolute":
            joint.set("type", "continuous")
            changes.append(
                f"wheel joint '{name}' is revolute: its stops are ignored, because a wheel turns without end."
            )
        elif name in (*forms.pivots, *forms.steering) and joint.get("type") == "continuous":
            joint.set("type", "revolute")
            for old in joint.findall("limit"):
                joint.remove(old)
            ET.SubElement(joint, "limit", lower=repr(-math.pi), upper=repr(math.pi), effort="0", velocity="0")
            changes.append(f"joint '{name}' is continuous: stops half a turn to either side are added.")
    changes += _add_base_frame(robot, forms)
    changes += _turn_axes(robot, forms)
    # Belts or gears tie the wheels of a side: all of them follow its first wheel.
    for first, *others in forms.sides:
        for name in others:
            _follow(robot.joint_element(name, "[wheels]"), first, 1.0)
        robot.joint_element(first, "[wheels]")
        changes.append(f"wheels '{first}', " + ", ".join(f"'{name}'" for name in others) + " turn together.")
    changes += _follow_one_leader(robot.joints, forms.differential, file)
    return NormalisedUrdf(robot.text if changes else text, tuple(changes))


def _follow(joint: ET.Element, leader: str, ratio: float) -> None:
    """Replace the `<mimic>` of a joint, so that the angle of the joint is `ratio` times the angle of `leader`."""
    for old in joint.findall("mimic"):
        joint.remove(old)
    ET.SubElement(joint, "mimic", joint=leader, multiplier=repr(ratio), offset="0")


def _hold_joints(robot: _Robot, forms: JointForms) -> Iterator[str]:
    """Fix the joints that the TOML holds, and all joints that follow them, at their angles. Yield a sentence about this
    change.
    """
    for name in forms.held_joints:
        robot.joint_element(name, "[held]")
    tree = robot.tree
    # Each held joint gets its angle [rad] or travel [m], which must lie between its stops.
    values: dict[str, float] = {}
    for name, entry in forms.held_joints.items():
        joint = tree.joint(name)
        assert joint is not None
        unit, where = "m" if joint.kind == "prismatic" else "rad", f"{robot.file}: held joint '{name}'"
        try:
            if isinstance(entry, Mapping):
                refuse_strange(entry, where)
            value = to_si(*value_and_unit(entry, unit), unit, where)
        except ParameterError as error:
            raise UrdfError(str(error)) from error
        low, high = joint.limits
        if joint.limited and joint.kind != "continuous" and not low - 1e-6 <= value <= high + 1e-6:
            raise UrdfError(
                f"{where} = {value:g} {unit} is beyond its stops; hold it within [{low:g}, {high:g}] {unit}."
            )
        values[name] = value
    # A joint can follow a joint that follows a held joint, and so on. Each pass fixes at least the next joint of such a
    # chain, so as many passes as there are joints reach its end.
    for _ in tree.joints:
        for joint in tree.joints:
            if joint.mimic is not None and joint.mimic.joint in values and joint.name not in values:
                values[joint.name] = joint.mimic.multiplier * values[joint.mimic.joint] + joint.mimic.offset
    for name, value in values.items():
        held_joint = tree.joint(name)
        if held_joint is None or not held_joint.moves:
            continue
        # The <origin> of the fixed joint includes its motion to the held value. A floating or planar joint has no
        # single coordinate, so it is fixed at its origin.
        element, motion = robot.joints[name], np.eye(4)
        coordinate = 0.0 if held_joint.kind in ("floating", "planar") else value
        length = float(np.linalg.norm(held_joint.axis))
        axis = held_joint.axis / length if length > 0.0 else held_joint.axis
        if held_joint.kind == "prismatic":
            motion[:3, 3] = coordinate * axis
        else:
            motion[:3, :3] = pin.AngleAxis(coordinate, axis).toRotationMatrix()
        _set_origin(element, held_joint.origin @ motion)
        element.set("type", "fixed")
        # A fixed joint has no limits, no axis and no <mimic>.
        for tag in MOTION_ELEMENTS:
            for part in element.findall(tag):
                element.remove(part)
    if values:
        yield f"{len(values)} joints are held: " + ", ".join(
            f"'{name}' at {value:.3g}" for name, value in values.items()
        )


def _set_origin(element: ET.Element, placement: np.ndarray) -> None:
    """Write a transform [4, 4] into the `<origin>` element of a joint, as xyz and rpy."""
    origin = element.find("origin")
    origin = ET.SubElement(element, "origin") if origin is None else origin
    origin.set("xyz", " ".join(repr(float(number)) for number in placement[:3, 3]))
    origin.set("rpy", " ".join(repr(float(number)) for number in pin.rpy.matrixToRpy(placement[:3, :3])))


def _add_base_frame(robot: _Robot, forms: JointForms) -> Iterator[str]:
    """Add a new root link in the base frame of the rover, if the root link of the URDF has another frame. Yield a
    sentence about this change.

    The position and attitude of a drive are the position and attitude of the root link. In the TOML, the base can be
    another link that is fixed to the root link, and base_rpy can turn its axes.
    """
    # Without a single root link there is no tree, and without a turned base nothing needs to change.
    tree = robot.tree
    if len(tree.roots) != 1 or forms.base not in tree.rigid_group(tree.roots[0]):
        return  # `role_faults` reports this
    if forms.base == tree.roots[0] and not any(forms.base_rpy):
        return
    # The new link is fixed above the old root link, so that the base link has the attitude base_rpy at its origin.
    roll, pitch, yaw = forms.base_rpy
    placement = np.eye(4)
    placement[:3, :3] = turn("z", yaw) @ turn("y", pitch) @ turn("x", roll)
    root, name = tree.roots[0], f"{forms.base}_frame"
    ET.SubElement(robot.element, "link", name=name)
    joint = ET.SubElement(robot.element, "joint", name=f"{name}_joint", type="fixed")
    ET.SubElement(joint, "parent", link=name)
    ET.SubElement(joint, "child", link=root)
    _set_origin(joint, placement @ np.linalg.inv(tree.placements[forms.base]))
    turned = f", turned by base_rpy = {list(forms.base_rpy)}" if any(forms.base_rpy) else ""
    yield f"position and attitude refer to link '{forms.base}'{turned}; the URDF's root is '{root}'."


def _turn_axes(robot: _Robot, forms: JointForms) -> Iterator[str]:
    """Reverse each axis that points to -y (wheels, rockers) or to -z (steering), and yield a sentence for each role.

    After this step a positive rate rolls every wheel forward, and a positive steering angle turns every wheel left.
    """
    tree = robot.tree
    places = tree.placements
    for role, names, direction in (
        ("wheel", forms.wheels, 1),
        ("rocker", forms.differential or (), 1),
        ("steering", forms.steering, 2),
    ):
        # An axis that points neither along the direction nor against it is a fault, which `axis_faults` reports.
        wrong = []
        for name in names:
            joint = tree.joint(name)
            if joint is not None and joint.child in places and np.linalg.norm(joint.axis) > 0.0:
                unit = joint.axis / np.linalg.norm(joint.axis)
                if (places[joint.child][:3, :3] @ unit)[direction] <= -ALONG:
                    wrong.append(name)
        # If the axis of a joint is reversed, its stops and the ratios of all <mimic> elements that name it must change
        # too.
        for name in wrong:
            element = robot.joints[name]
            axis = element.find("axis")
            axis = ET.SubElement(element, "axis", xyz="1 0 0") if axis is None else axis
            # 0.0 - x instead of -x, because a negative zero would be written as "-0.0".
            axis.set("xyz", " ".join(repr(0.0 - float(number)) for number in str(axis.get("xyz")).split()))
            # The lower stop becomes the upper stop with the opposite sign, and vice versa.
            limit = element.find("limit")
            if limit is not None:
                low, high = (float(limit.get(end, "0")) for end in ("lower", "upper"))
                limit.set("lower", repr(0.0 - high))
                limit.set("upper", repr(0.0 - low))
            for other_name, other_joint in robot.joints.items():
                mimic = other_joint.find("mimic")
                if mimic is None:
                    continue
                if mimic.get("joint") == name:  # another joint follows this joint
                    mimic.set("multiplier", repr(-float(mimic.get("multiplier", "1"))))
                if other_name == name:  # this joint follows another: both ratio and offset change sign
                    mimic.set("multiplier", repr(-float(mimic.get("multiplier", "1"))))
                    mimic.set("offset", repr(0.0 - float(mimic.get("offset", "0"))))
        if wrong:
            quoted_names = ", ".join(f"'{name}'" for name in wrong)
            sense = "turn left" if direction == 2 else "roll forward" if role == "wheel" else "lower the front wheels"
            points = f"joint '{wrong[0]}' points" if len(wrong) == 1 else f"joints {quoted_names} point"
            yield (
                f"{role} {points} to -{'xyz'[direction]}: the signs of its angles and rates are reversed, "
                f"so that positive values {sense}."
            )


def _follow_one_leader(
    joints: Mapping[str, ET.Element], differential: tuple[str, str] | None, file: str
) -> Iterator[str]:
    """Rewrite the `<mimic>` elements such that all joints of a group follow one leading joint directly. Yield a
    sentence for each change.

    A URDF may chain such relations in any order, but the equation of motion (Eq (8) of the paper) needs one constraint
    row for each follower, with one common leader of the group. The left rocker of the differential leads all joints
    that are connected to it (gear, bar or brace). In every other group, the leader is the joint that follows no other
    joint.

    Raises UrdfError: joints follow each other in a ring, or a joint would have to turn by two ratios at once.
    """
    # Only moving joints with a nonzero ratio make a relation; the differential is a relation of its own.
    relations, has_offset = [], False
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is not None and mimic.get("joint") in joints and joint.get("type") != "fixed":
            ratio, offset = (float(mimic.get(key, default)) for key, default in (("multiplier", "1"), ("offset", "0")))
            if ratio:
                has_offset = has_offset or bool(offset)
                if {name, mimic.get("joint")} != set(differential or ()):
                    relations.append(Relation(name, str(mimic.get("joint")), ratio))
    # `_coupling_faults` refuses offsets later. Nothing is rewritten, so that its message has the names of the file.
    if not relations or has_offset:
        return
    if differential is not None:
        relations.append(Relation(differential[1], differential[0], -1.0))
    # A joint that follows no other joint leads its group; the left rocker leads the group of the differential.
    followers = {relation.joint for relation in relations}
    first = [] if differential is None else [differential[0]]
    free = dict.fromkeys(relation.leader for relation in relations if relation.leader not in followers)
    leaders: list[str] = []
    reached: set[str] = set()
    for leader in [*first, *free]:
        if leader not in reached:
            leaders.append(leader)
            reached |= set(_ratios(leader, relations, file))
    # Joints that no leader reaches follow each other in a ring.
    if lost := sorted({name for relation in relations for name in relation[:2]} - reached):
        raise UrdfError(
            f"{file}: joint '{lost[0]}' follows itself in a ring of <mimic>: let one joint of the ring lead."
        )
    for leader in leaders:
        for name, ratio in _ratios(leader, relations, file).items():
            # Each rocker follows its partner only. A rocker may also be missing from the URDF, which is a fault.
            if name == leader or {name, leader} == set(differential or ()):
                continue
            mimic = joints[name].find("mimic")
            if mimic is None or mimic.get("joint") != leader:
                _follow(joints[name], leader, ratio)
                yield f"joint '{name}' follows '{leader}' {ratio:+g} : 1, as the URDF states by a chain of joints."
        if differential is not None and leader == differential[0]:
            # The rockers follow no other joint than each other, so that a relation to another joint is removed.
            for name, partner in (differential, differential[::-1]):
                mimic = joints[name].find("mimic") if name in joints else None
                if mimic is not None and mimic.get("joint") != partner:
                    joints[name].remove(mimic)
                    yield f"rocker '{name}' leads '{mimic.get('joint')}', where the URDF states the reverse."


def _ratios(leader: str, relations: list[Relation], file: str) -> dict[str, float]:
    """Return the ratios of all joints in a leader's group: name of the joint -> its angle divided by the leader's.

    Raises UrdfError: two chains of relations from the leader to a joint give different ratios.
    """
    ratios = {leader: 1.0}
    # The list of names grows during the loop by the joints that are connected to each of its joints.
    for name in (names := [leader]):
        for joint, lead, ratio in relations:
            # A relation can be followed in both directions, with the ratio or its inverse.
            for start, end, factor in ((joint, lead, 1.0 / ratio), (lead, joint, ratio)):
                if start == name and end not in ratios:
                    ratios[end] = factor * ratios[name]
                    names.append(end)
    for joint, lead, ratio in relations:
        if joint in ratios and not math.isclose(ratios[joint], ratio * ratios[lead], rel_tol=1e-6):
            raise UrdfError(
                f"{file}: joint '{joint}' would follow '{leader}' by {ratio * ratios[lead]:g} and {ratios[joint]:g} at "
                "once; correct its <mimic> or the TOML's [differential] and [coupled]."
            )
    return ratios
