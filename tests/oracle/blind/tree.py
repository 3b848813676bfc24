"""A URDF as arrays, level by level from the base: all links of one depth together."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Tree:
    """Link 0 is the base; joint j carries link j + 1."""

    joints: list
    links: list
    parent: np.ndarray
    "link above each joint"
    levels: list
    "slices of joints of one depth"
    place: np.ndarray
    "[3, joints] in the parent link"
    turned: np.ndarray
    "[3, 3, joints]"
    axis: np.ndarray
    limits: np.ndarray
    "[2, joints], infinite where the URDF has none"
    mass: np.ndarray
    com: np.ndarray
    "[3, links]"
    inertia: np.ndarray
    "[3, 3, links] about the centre of mass"
    names: list
    "of the independent angles"
    collect: np.ndarray
    "[joints, angles]: joint angles of independent ones"
    above: np.ndarray
    "[links, joints]: 1 where the joint moves the link"


def read(text, rigid_differential=True):
    """Return the tree of a URDF. With a compliant differential, both rockers are independent joints."""
    root = ElementTree.fromstring(text)
    links = {element.get("name"): element for element in root.findall("link")}
    joints = {element.get("name"): element for element in root.findall("joint")}
    children = {element.find("child").get("link") for element in joints.values()}
    order, levels, front = [], [], [name for name in links if name not in children]
    names = list(front)
    while front:
        below = [key for key, element in joints.items() if element.find("parent").get("link") in front]
        if below:
            levels.append(slice(len(order), len(order) + len(below)))
        order += below
        front = [joints[key].find("child").get("link") for key in below]
        names += front
    ordered = [joints[key] for key in order]
    parent = np.array([names.index(element.find("parent").get("link")) for element in ordered])
    above = np.zeros((len(names), len(order)))
    for j in range(len(order)):
        above[j + 1] = above[parent[j]]
        above[j + 1, j] = 1.0
    leads = {}
    for key, element in zip(order, ordered, strict=True):
        mimic = element.find("mimic") if rigid_differential else None
        leads[key] = (key, 1.0) if mimic is None else (mimic.get("joint"), float(mimic.get("multiplier")))
    free = [key for key in order if leads[key][0] == key]
    collect = np.zeros((len(order), len(free)))
    for j, key in enumerate(order):
        collect[j, free.index(leads[key][0])] = leads[key][1]
    places, turns = zip(*(origin(element) for element in ordered), strict=True)
    masses, centres, inertias = zip(*(massive(links[name]) for name in names), strict=True)
    return Tree(
        joints=order,
        links=names,
        parent=parent,
        levels=levels,
        place=np.stack(places, axis=-1),
        turned=np.stack(turns, axis=-1),
        axis=np.stack([vector(element.find("axis").get("xyz")) for element in ordered], axis=-1),
        limits=np.stack([limits(element) for element in ordered], axis=-1),
        mass=np.array(masses),
        com=np.stack(centres, axis=-1),
        inertia=np.stack(inertias, axis=-1),
        names=free,
        collect=collect,
        above=above,
    )


def vector(text):
    return np.array([float(word) for word in (text or "0 0 0").split()])


def turn(rpy):
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return z @ y @ x


def origin(element):
    at = element.find("origin")
    return (np.zeros(3), np.eye(3)) if at is None else (vector(at.get("xyz")), turn(vector(at.get("rpy"))))


def massive(link):
    inertial = link.find("inertial")
    centre, R = origin(inertial)
    ixx, ixy, ixz, iyy, iyz, izz = (
        float(inertial.find("inertia").get(key)) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    inertia_matrix = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    return float(inertial.find("mass").get("value")), centre, R @ inertia_matrix @ R.T


def limits(joint):
    limit = joint.find("limit")
    return np.array([-np.inf, np.inf] if limit is None else [float(limit.get("lower")), float(limit.get("upper"))])
