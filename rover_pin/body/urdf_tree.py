"""The links and joints that a URDF states, as plain records: what can be judged before any library reads it."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rover_pin.errors import UrdfError


class Body(NamedTuple):
    """Mass [kg], centre of mass in the link [m], and inertia about it [kg m^2] in the axes of the inertial frame."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray


class Link(NamedTuple):
    """A link; `reach` is how far its primitive shapes go from its centre of mass [m], 0 where it has none."""

    name: str
    body: Body | None
    reach: float
    meshes: tuple[str, ...]


class Mimic(NamedTuple):
    """angle = multiplier * (angle of `joint`) + offset."""

    joint: str
    multiplier: float
    offset: float


class Joint(NamedTuple):
    """A joint as it is written."""

    name: str
    kind: str
    parent: str
    child: str
    axis: np.ndarray
    limited: bool
    limits: tuple[float, float]
    mimic: Mimic | None
    lossy: bool
    "has <dynamics> with damping or friction"

    @property
    def moves(self) -> bool:
        """Whether it is anything but fixed."""
        return self.kind != "fixed"


@dataclass(frozen=True)
class UrdfTree:
    """A URDF as written."""

    file: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]

    @property
    def roots(self) -> list[str]:
        """The links that are no joint's child."""
        children = {joint.child for joint in self.joints}
        return [link.name for link in self.links if link.name not in children]

    def rigid_group(self, link: str) -> list[str]:
        """Return the link and those fixed to it, outwards."""
        group = [link]
        for name in group:
            group += [joint.child for joint in self.joints if joint.parent == name and not joint.moves]
        return group


def read_tree(text: str, file: str) -> UrdfTree:
    """Return the links and joints of a URDF's text.

    Raises
    ------
    UrdfError
        Not XML, not a robot, or an element whose name or number cannot be read.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UrdfError(f"{file}: has a <!DOCTYPE> or <!ENTITY>, which can name other files; take it out.")
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise UrdfError(f"{file}: not well-formed XML ({error}); mend it there.") from error
    if root.tag != "robot":
        hint = " expand it with xacro first." if "xacro" in text[:2000] else " a URDF begins with <robot>."
        raise UrdfError(f"{file}: its outermost element is <{root.tag}>, not <robot>:{hint}")
    if any("xacro" in element.tag for element in root.iter()):
        raise UrdfError(f"{file}: holds xacro macros; expand it first, as in `xacro rover.xacro > rover.urdf`.")
    links = tuple(_link(element, file) for element in root.findall("link"))
    return UrdfTree(file, links, tuple(_joint(element, file) for element in root.findall("joint")))


def _link(element: ET.Element, file: str) -> Link:
    name = _name(element, file)
    where = f"{file}: link '{name}'"
    inertial = element.find("inertial")
    body = None if inertial is None else _body(inertial, where)
    centre = np.zeros(3) if body is None else body.centre
    shapes = [*element.findall("visual"), *element.findall("collision")]
    reaches = [_reach(shape, centre, where) for shape in shapes]
    meshes = tuple(mesh.get("filename", "") for shape in shapes for mesh in shape.iter("mesh"))
    return Link(name, body, max(reaches, default=0.0), meshes)


def _body(inertial: ET.Element, where: str) -> Body:
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise UrdfError(f"{where}: its <inertial> needs both <mass value='...'/> and <inertia ixx='...' .../>.")
    entries = {key: _number(inertia.get(key, "missing"), f"{where}: inertia {key}") for key in INERTIA}
    xx, xy, xz, yy, yz, zz = (entries[key] for key in INERTIA)
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Body(_number(mass.get("value", "missing"), f"{where}: mass"), _origin(inertial, where), matrix)


INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def _reach(shape: ET.Element, centre: np.ndarray, where: str) -> float:
    away = float(np.linalg.norm(_origin(shape, where) - centre))
    return max((away + half for half in _half_diagonals(shape, where)), default=0.0)


def _half_diagonals(shape: ET.Element, where: str) -> Iterator[float]:
    for box in shape.iter("box"):
        yield float(np.linalg.norm(_vector(box.get("size", "missing"), f"{where}: box size"))) / 2.0
    for sphere in shape.iter("sphere"):
        yield _number(sphere.get("radius", "missing"), f"{where}: sphere radius")
    for cylinder in shape.iter("cylinder"):
        radius = _number(cylinder.get("radius", "missing"), f"{where}: cylinder radius")
        yield math.hypot(radius, _number(cylinder.get("length", "missing"), f"{where}: cylinder length") / 2.0)


def _joint(element: ET.Element, file: str) -> Joint:
    name = _name(element, file)
    where = f"{file}: joint '{name}'"
    ends = [element.find(end) for end in ("parent", "child")]
    if any(end is None or end.get("link") is None for end in ends):
        raise UrdfError(f"{where} needs <parent link='...'/> and <child link='...'/>.")
    _origin(element, where)
    axis, limit, dynamics = element.find("axis"), element.find("limit"), element.find("dynamics")
    return Joint(
        name=name,
        kind=element.get("type", ""),
        parent=str(ends[0].get("link")),  # type: ignore[union-attr]
        child=str(ends[1].get("link")),  # type: ignore[union-attr]
        axis=np.array([1.0, 0.0, 0.0]) if axis is None else _vector(axis.get("xyz", "missing"), f"{where}: axis"),
        limited=limit is not None,
        limits=(_attribute(limit, "lower", where), _attribute(limit, "upper", where)),
        mimic=_mimic(element.find("mimic"), where),
        lossy=_attribute(dynamics, "damping", where) != 0.0 or _attribute(dynamics, "friction", where) != 0.0,
    )


def _mimic(element: ET.Element | None, where: str) -> Mimic | None:
    if element is None:
        return None
    offset = _attribute(element, "offset", where)
    return Mimic(element.get("joint", ""), _attribute(element, "multiplier", where, 1.0), offset)


def _attribute(element: ET.Element | None, key: str, where: str, default: float = 0.0) -> float:
    if element is None or element.get(key) is None:
        return default
    return _number(str(element.get(key)), f"{where}: {key}")


def _name(element: ET.Element, file: str) -> str:
    name = element.get("name")
    if not name:
        raise UrdfError(f"{file}: a <{element.tag}> has no name; give it one.")
    return name


def _origin(element: ET.Element, where: str) -> np.ndarray:
    origin = element.find("origin")
    if origin is None:
        return np.zeros(3)
    _vector(origin.get("rpy", "0 0 0"), f"{where}: origin rpy")
    return _vector(origin.get("xyz", "0 0 0"), f"{where}: origin xyz")


def _vector(text: str, where: str) -> np.ndarray:
    numbers = [_number(word, where) for word in text.split()]
    if len(numbers) != 3:
        raise UrdfError(f"{where} = '{text}' must be three numbers, as in '0 1 0'.")
    return np.array(numbers)


def _number(text: str, where: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UrdfError(f"{where} = '{text}' is not a number; write one in SI units, with a decimal point.")
    return number
