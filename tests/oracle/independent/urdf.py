"""A URDF as arrays: one link for each joint, parents before children."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Tree:
    """Links in an order in which parents come first. Link 0 is the free base, and link i > 0 is attached to joint i -
    1.
    """

    links: list
    parent: np.ndarray
    mass: np.ndarray
    com: np.ndarray
    inertia: np.ndarray
    joints: list
    place: np.ndarray
    turned: np.ndarray
    axis: np.ndarray
    limits: np.ndarray
    coordinate: np.ndarray
    "which independent angle turns the joint"
    factor: np.ndarray
    "by how much: -1 for a mimic joint of the differential"
    names: list
    "names of the independent angles"


def numbers(text, default):
    return np.array([float(word) for word in text.split()]) if text else np.array(default, dtype=float)


def rotation_rpy(rpy):
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def origin(element):
    at = element.find("origin")
    if at is None:
        return np.zeros(3), np.eye(3)
    return numbers(at.get("xyz"), [0, 0, 0]), rotation_rpy(numbers(at.get("rpy"), [0, 0, 0]))


def mass_of(link):
    """Return mass, centre of mass and inertia about it, in the axes of the link."""
    inertial = link.find("inertial")
    centre, R = origin(inertial)
    mass = float(inertial.find("mass").get("value"))
    value = {name: float(inertial.find("inertia").get(name)) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
    inertia_matrix = np.array([[value["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
    return mass, centre, R @ inertia_matrix @ R.T


def read(path):
    root = ElementTree.parse(path).getroot()
    elements = {link.get("name"): link for link in root.findall("link")}
    by_child = {joint.find("child").get("link"): joint for joint in root.findall("joint")}
    base = next(name for name in elements if name not in by_child)
    order, joints = [base], []
    while len(order) < len(elements):
        for child, joint in by_child.items():
            if child not in order and joint.find("parent").get("link") in order:
                order.append(child)
                joints.append(joint)
    masses, centres, inertias = zip(*(mass_of(elements[name]) for name in order), strict=True)
    places, turns = zip(*(origin(joint) for joint in joints), strict=True)
    leaders, factors = zip(*(leader(joint) for joint in joints), strict=True)
    names = [joint.get("name") for joint in joints if joint.find("mimic") is None]
    return Tree(
        links=order,
        parent=np.array([-1] + [order.index(joint.find("parent").get("link")) for joint in joints]),
        mass=np.array(masses),
        com=np.array(centres),
        inertia=np.array(inertias),
        joints=[joint.get("name") for joint in joints],
        place=np.array(places),
        turned=np.array(turns),
        axis=np.array([numbers(joint.find("axis").get("xyz"), [1, 0, 0]) for joint in joints]),
        limits=np.array([limit(joint) for joint in joints]),
        coordinate=np.array([names.index(name) for name in leaders]),
        factor=np.array(factors),
        names=names,
    )


def leader(joint):
    mimic = joint.find("mimic")
    return (joint.get("name"), 1.0) if mimic is None else (mimic.get("joint"), float(mimic.get("multiplier", "1")))


def limit(joint):
    limit_element = joint.find("limit")
    return (
        [-np.inf, np.inf]
        if limit_element is None
        else [float(limit_element.get("lower")), float(limit_element.get("upper"))]
    )
