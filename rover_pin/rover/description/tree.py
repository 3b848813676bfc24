"""The links and joints that a URDF states, as plain records: what can be judged before any library reads it."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import UrdfError
from rover_pin.base.files import bounded


class Body(NamedTuple):
    """Mass [kg], centre of mass in the link [m], and inertia about it [kg m^2] in the axes of its inertial frame."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    axes: np.ndarray
    "of the inertial frame in the link [3, 3]"


class Shape(NamedTuple):
    """A shape of a link: a box (its three sizes), sphere (radius), cylinder (radius, length; along its z) or mesh."""

    kind: str
    placement: np.ndarray
    "in the link [4, 4]"
    size: tuple[float, ...]
    "[m]; of a mesh its scale along x, y, z"
    mesh: str = ""


class Link(NamedTuple):
    """A link; `reach` is how far its primitive shapes go from its centre of mass [m], 0 where it has none."""

    name: str
    body: Body | None
    reach: float
    shapes: tuple[Shape, ...]

    @property
    def meshes(self) -> tuple[str, ...]:
        """The files of its meshes."""
        return tuple(shape.mesh for shape in self.shapes if shape.kind == "mesh")


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
    origin: np.ndarray
    "of the child in the parent at zero [4, 4]"
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

    @property
    def placements(self) -> dict[str, np.ndarray]:
        """Where each link below the first root lies in it, all joints at zero [4, 4]."""
        placements = {self.roots[0]: np.eye(4)} if self.roots else {}
        reached = list(placements)
        for name in reached:
            for joint in self.joints:
                if joint.parent == name and joint.child not in placements:
                    placements[joint.child] = placements[name] @ joint.origin
                    reached.append(joint.child)
        return placements

    def joint(self, name: str) -> Joint | None:
        """Return the joint of this name, or None."""
        return next((joint for joint in self.joints if joint.name == name), None)

    def followers(self, differential: tuple[str, str] | None) -> Iterator[tuple[str, Mimic]]:
        """Yield what follows what by a <mimic>, but for the two joints of the differential."""
        for joint in self.joints:
            if joint.mimic is not None and joint.moves and {joint.name, joint.mimic.joint} != set(differential or ()):
                yield joint.name, joint.mimic

    def rigid_group(self, link: str) -> list[str]:
        """Return the link and those fixed to it, outwards."""
        group = [link]
        for name in group:
            group += [joint.child for joint in self.joints if joint.parent == name and not joint.moves]
        return group


def urdf_text(path: Path) -> str:
    """Return the text of a URDF's file; an UrdfError where it is not there, too large, or not in UTF-8."""
    try:
        return bounded.text(path)
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or f"it is no text in UTF-8 ({error})"
        raise UrdfError(f"{path.name}: the file cannot be read: {why}.") from error


def read_tree(text: str, file: str) -> UrdfTree:
    """Return the links and joints of a URDF's text.

    Raises UrdfError: not XML, not a robot, or an element whose name or number cannot be read.
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
    drawn = [*element.findall("visual"), *element.findall("collision")]
    shapes = tuple(shape for geometry in drawn for shape in _shapes(geometry, where))
    return Link(name, body, max((_reach(shape, centre) for shape in shapes), default=0.0), shapes)


def _body(inertial: ET.Element, where: str) -> Body:
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise UrdfError(f"{where}: its <inertial> needs both <mass value='...'/> and <inertia ixx='...' .../>.")
    entries = {key: _number(inertia.get(key, "missing"), f"{where}: inertia {key}") for key in INERTIA}
    xx, xy, xz, yy, yz, zz = (entries[key] for key in INERTIA)
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    placement = _placement(inertial, where)
    mass_value = _number(mass.get("value", "missing"), f"{where}: mass")
    return Body(mass_value, placement[:3, 3], matrix, placement[:3, :3])


INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def _reach(shape: Shape, centre: np.ndarray) -> float:
    if shape.kind == "mesh":
        return 0.0
    half = {"box": math.hypot(*shape.size) / 2.0, "sphere": shape.size[0]}
    away = float(np.linalg.norm(shape.placement[:3, 3] - centre))
    return away + half.get(shape.kind, math.hypot(shape.size[0], shape.size[-1] / 2.0))


def _shapes(element: ET.Element, where: str) -> Iterator[Shape]:
    placement = _placement(element, where)
    for box in element.iter("box"):
        yield Shape("box", placement, tuple(_vector(box.get("size", "missing"), f"{where}: box size")))
    for sphere in element.iter("sphere"):
        yield Shape("sphere", placement, (_number(sphere.get("radius", "missing"), f"{where}: sphere radius"),))
    for cylinder in element.iter("cylinder"):
        dimensions = [_number(cylinder.get(key, "missing"), f"{where}: cylinder {key}") for key in ("radius", "length")]
        yield Shape("cylinder", placement, tuple(dimensions))
    for mesh in element.iter("mesh"):
        scale = _vector(mesh.get("scale", "1 1 1"), f"{where}: mesh scale")
        yield Shape("mesh", placement, tuple(scale), mesh.get("filename", ""))


def _joint(element: ET.Element, file: str) -> Joint:
    name = _name(element, file)
    where = f"{file}: joint '{name}'"
    ends = [element.find(end) for end in ("parent", "child")]
    if any(end is None or end.get("link") is None for end in ends):
        raise UrdfError(f"{where} needs <parent link='...'/> and <child link='...'/>.")
    axis, limit, dynamics = element.find("axis"), element.find("limit"), element.find("dynamics")
    return Joint(
        name=name,
        kind=element.get("type", ""),
        parent=str(ends[0].get("link")),  # type: ignore[union-attr]
        child=str(ends[1].get("link")),  # type: ignore[union-attr]
        origin=_placement(element, where),
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


def _placement(element: ET.Element, where: str) -> np.ndarray:
    placement, origin = np.eye(4), element.find("origin")
    if origin is not None:
        roll, pitch, yaw = _vector(origin.get("rpy", "0 0 0"), f"{where}: origin rpy")
        placement[:3, :3] = turn("z", yaw) @ turn("y", pitch) @ turn("x", roll)
        placement[:3, 3] = _vector(origin.get("xyz", "0 0 0"), f"{where}: origin xyz")
    return placement


def turn(axis: str, angle: float) -> np.ndarray:
    """Return the rotation by an angle [rad] about x, y or z [3, 3]."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    rotation = np.eye(3)
    rotation[j, j] = rotation[k, k] = math.cos(angle)
    rotation[k, j] = math.sin(angle)
    rotation[j, k] = -rotation[k, j]
    return rotation


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
