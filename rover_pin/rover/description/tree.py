"""Read the links and joints of a URDF as plain Python objects. They can be checked before another library reads the
file.
"""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import UrdfError
from rover_pin.base.files import bounded

FULL_TURN = 2.0 * math.pi - 0.1
"""Smallest distance between two stops of a joint that counts as a full turn [rad]. It is below 2 pi, because files
round pi to 3.14 or 3.1."""
WORLDS = re.compile(r"(?:world|map|odom|earth|ground|inertial)(?:_?(?:link|frame))?", re.IGNORECASE)
"""Pattern of the names of root links that represent the world of a simulator and are no part of the rover."""
MAX_URDF = 4 * bounded.MIB
"""Largest number of characters of a URDF. A longer text is refused. The limit is eight times the length of the URDFs of
large robots, which have half a million characters."""
MAX_LINKS = 1000
"""Largest number of links, and of joints, of a URDF.

A larger URDF is refused, because the time of checks that compare pairs of links grows with the square of this number.
Large robots have some hundred links."""
MAX_MOVING = 100
"""Largest number of joints in a URDF that move.

A URDF with more is refused, because Pinocchio's memory for one model grows with the cube of this number. Rovers have 10
to 40 moving joints."""
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Attributes of an `<inertia>`: the upper triangle of the symmetric matrix, row by row."""


class Body(NamedTuple):
    """Mass, centre of mass and inertia of a link, as its `<inertial>` states them."""

    mass: float
    "mass [kg]"
    centre: np.ndarray
    "centre of mass in the link's frame [3] (m)"
    inertia: np.ndarray
    "inertia about the centre of mass, in the axes of the inertial frame [3, 3] (kg m^2)"
    axes: np.ndarray
    "rotation from the inertial frame to the link's frame [3, 3]"


class Shape(NamedTuple):
    """One shape that a link draws: a box, a sphere, a cylinder along its own z axis, or a mesh."""

    kind: str
    "box, sphere, cylinder or mesh"
    placement: np.ndarray
    "homogeneous transform from the shape to the link's frame [4, 4]"
    size: tuple[float, ...]
    "box: three edges; sphere: radius; cylinder: radius and length [m]; mesh: scale factors along x, y and z"
    mesh: str = ""
    "file name of a mesh"
    drawn: str = "visual"
    """"visual" or "collision": the element of the link that contains the shape"""


class Link(NamedTuple):
    """One link of the URDF: its name, mass properties and shapes."""

    name: str
    body: Body | None
    reach: float
    """largest distance of a point of the link's boxes, spheres and cylinders from its centre of mass [m]; 0 without
    such shapes"""
    shapes: tuple[Shape, ...]

    @property
    def meshes(self) -> tuple[str, ...]:
        """Return the file names of the link's meshes, as the URDF states them."""
        return tuple(shape.mesh for shape in self.shapes if shape.kind == "mesh")


class Mimic(NamedTuple):
    """The relation that a joint's `<mimic>` states: its angle = multiplier * (angle of `joint`) + offset."""

    joint: str
    multiplier: float
    offset: float


class Joint(NamedTuple):
    """One joint of the URDF, with the values that the file states."""

    name: str
    kind: str
    "the URDF's type: fixed, revolute, continuous, prismatic, floating or planar"
    parent: str
    child: str
    origin: np.ndarray
    "homogeneous transform from the child's frame to the parent's frame at zero angle [4, 4]"
    axis: np.ndarray
    "axis in the child's frame [3], not normalised"
    limited: bool
    "whether the file has a <limit>"
    limits: tuple[float, float]
    """lower and upper stop [rad or m]; both are 0 if the file has no <limit>"""
    mimic: Mimic | None
    lossy: bool
    """whether the file states damping or friction of the joint in a <dynamics> element"""
    axis_written: bool = True
    """whether the file states the axis; a joint without <axis> turns about x"""

    @property
    def moves(self) -> bool:
        """Return whether the joint can move, which means that its type is not fixed."""
        return self.kind != "fixed"

    @property
    def turns_fully(self) -> bool:
        """Return whether the joint can turn by a full turn: it has no stops, or its stops are a full turn apart, such
        as -3.14 and 3.14 rad.

        Only such a joint can carry a wheel.
        """
        if self.kind == "continuous":
            return True
        low, high = self.limits
        return self.kind == "revolute" and high - low >= FULL_TURN


@dataclass(frozen=True)
class UrdfTree:
    """All links and joints of a URDF, in the order of the file."""

    file: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]

    @property
    def roots(self) -> list[str]:
        """Return the names of the links that are no joint's child; a URDF without faults has exactly one such link."""
        children = {joint.child for joint in self.joints}
        return [link.name for link in self.links if link.name not in children]

    @property
    def placements(self) -> dict[str, np.ndarray]:
        """Return name of a link -> transform [4, 4] from the link's frame to the frame of the first root link, with all
        joints at zero.

        Links that are not connected to the first root link are missing from the result.
        """
        placements = {self.roots[0]: np.eye(4)} if self.roots else {}
        for joint in self.outwards():
            placements[joint.child] = placements[joint.parent] @ joint.origin
        return placements

    @property
    def world_joints(self) -> list[Joint]:
        """Return the joints between a `world` link and the rover, from the root outwards; usually there are none.

        In a URDF for a simulator, a chain of joints can connect a `world` link to the rover, so that the rover is
        fixed, slides or floats in the world. Each joint of the chain is the only child joint of a link without mass,
        which is no part of the rover. A fixed joint counts only if the link above it has a name such as `world` or
        `map`. The link `base_footprint`, for example, is fixed to `base_link`, but is a frame of the rover.
        """
        chain: list[Joint] = []
        # The chain continues from the root as long as a link has a single child joint and no mass, and, above a fixed
        # joint, the name of a world.
        link = self.roots[0] if self.roots else ""
        while True:
            below = [joint for joint in self.joints if joint.parent == link]
            massless = all(
                record.body is None or record.body.mass == 0.0 for record in self.links if record.name == link
            )
            if len(below) != 1 or not massless or below[0] in chain:
                return chain
            if not below[0].moves and not WORLDS.fullmatch(link):
                return chain
            chain.append(below[0])
            link = below[0].child

    def outwards(self) -> list[Joint]:
        """Return the joints that are connected to the first root link, ordered such that each joint comes after the
        joint that leads to its parent link.
        """
        joints, reached = list[Joint](), {*self.roots[:1]}
        # The list of names grows during the loop by the children of each link that is reached.
        for name in (names := self.roots[:1]):
            for joint in self._joints_of.get(name, ()):
                if joint.child not in reached:
                    joints.append(joint)
                    reached.add(joint.child)
                    names.append(joint.child)
        return joints

    @cached_property
    def _joints_of(self) -> dict[str, list[Joint]]:
        """Return name of a parent link -> its joints to child links, in the order of the file."""
        joints: dict[str, list[Joint]] = {}
        for joint in self.joints:
            joints.setdefault(joint.parent, []).append(joint)
        return joints

    def joint(self, name: str) -> Joint | None:
        """Return the joint with this name, or None if there is no such joint."""
        return next((joint for joint in self.joints if joint.name == name), None)

    def followers(self, differential: tuple[str, str] | None) -> Iterator[tuple[str, Mimic]]:
        """Yield the name of each joint that follows another joint by a `<mimic>`, and this relation.

        `differential` are the names of the two rockers that a differential joins, or None. The relation between the
        rockers is not returned, because the equation of motion (Eq (8) of the paper) has a separate constraint row for
        it.
        """
        for joint in self.joints:
            if joint.mimic is not None and joint.moves and {joint.name, joint.mimic.joint} != set(differential or ()):
                yield joint.name, joint.mimic

    def rigid_group(self, link: str) -> list[str]:
        """Return the names of the links that move with a link as one rigid body, from the inside outwards.

        These are the link itself and all links below it that fixed joints connect to it.
        """
        group = [link]
        # The list grows during the loop by the fixed children of each link.
        for name in group:
            group += [joint.child for joint in self._joints_of.get(name, ()) if not joint.moves]
        return group


def urdf_text(path: Path) -> str:
    """Return the text of a URDF file.

    Raises UrdfError: the file is missing, too large (see `base.files.bounded`), or not in UTF-8.
    """
    try:
        return bounded.text(path)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or f"it is no text in UTF-8 ({error})"
        raise UrdfError(f"{path.name}: the file cannot be read: {reason}.") from error


def read_tree(text: str, file: str) -> UrdfTree:
    """Return the links and joints of a URDF's text.

    Parameters
    ----------
    text : str
        The content of the file.
    file : str
        The file's name, for messages.

    Raises
    ------
    UrdfError
        The text is not XML or not a robot, or it exceeds MAX_URDF, MAX_LINKS or MAX_MOVING; a name or number of an
        element cannot be read; or an element that is allowed once occurs twice.

    Examples
    --------
    >>> text = "<robot name='box'><link name='base'/></robot>"
    >>> [link.name for link in read_tree(text, "box.urdf").links]
    ['base']
    """
    if len(text) > MAX_URDF:
        raise UrdfError(f"{file}: it has {len(text)} characters, and {MAX_URDF} is the maximum: delete unused parts.")
    # An entity may name other files, or expand to any size.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UrdfError(f"{file}: it has a <!DOCTYPE> or <!ENTITY>, which can name other files; delete it.")
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise UrdfError(f"{file}: it is not well-formed XML ({error}); correct the file at this position.") from error
    if root.tag != "robot":
        hint = " expand it with xacro first." if "xacro" in text[:2000] else " a URDF begins with <robot>."
        raise UrdfError(f"{file}: its outermost element is <{root.tag}>, not <robot>:{hint}")
    # Macros must be expanded first, because their text is no URDF.
    if any("xacro" in element.tag for element in root.iter()):
        raise UrdfError(f"{file}: it has xacro macros; expand it first: `xacro rover.xacro > rover.urdf`.")
    # The numbers of links and joints are limited before the elements are read.
    for part in ("link", "joint"):
        if (count := len(root.findall(part))) > MAX_LINKS:
            raise UrdfError(f"{file}: it has {count} {part}s, and {MAX_LINKS} is the maximum: merge fixed links.")
    links = tuple(_link(element, file) for element in root.findall("link"))
    joints = tuple(_joint(element, file) for element in root.findall("joint"))
    if (count := sum(joint.moves for joint in joints)) > MAX_MOVING:
        raise UrdfError(
            f"{file}: {count} joints move, and {MAX_MOVING} is the maximum: fix joints that are not driven."
        )
    return UrdfTree(file, links, joints)


def _link(element: ET.Element, file: str) -> Link:
    """Return the link of a `<link>` element; raise UrdfError if a number in it cannot be read."""
    name = _name(element, file)
    where = f"{file}: link '{name}'"
    inertial = _single(element, "inertial", where)
    body = None if inertial is None else _body(inertial, where)
    centre = np.zeros(3) if body is None else body.centre
    shapes: list[Shape] = []
    for drawing in (*element.findall("visual"), *element.findall("collision")):
        tag, placement = drawing.tag, _placement(drawing, where)
        for box in drawing.iter("box"):
            sides = tuple(_vector(box.get("size", "missing"), f"{where}: box size"))
            shapes.append(Shape("box", placement, sides, drawn=tag))
        for sphere in drawing.iter("sphere"):
            radius = _number(sphere.get("radius", "missing"), f"{where}: sphere radius")
            shapes.append(Shape("sphere", placement, (radius,), drawn=tag))
        for cylinder in drawing.iter("cylinder"):
            size = [_number(cylinder.get(key, "missing"), f"{where}: cylinder {key}") for key in ("radius", "length")]
            shapes.append(Shape("cylinder", placement, tuple(size), drawn=tag))
        for mesh in drawing.iter("mesh"):
            scale = tuple(_vector(mesh.get("scale", "1 1 1"), f"{where}: mesh scale"))
            shapes.append(Shape("mesh", placement, scale, mesh.get("filename", ""), drawn=tag))
    # `reach` is an upper bound of the distance between the centre of mass and the points of the primitive shapes. Each
    # shape is replaced by the sphere around it, whose radius is half the diagonal of a box, or of the axial section of
    # a cylinder.
    reach = 0.0
    for shape in shapes:
        if shape.kind == "mesh":
            continue
        half = {"box": math.hypot(*shape.size) / 2.0, "sphere": shape.size[0]}
        radius = half.get(shape.kind, math.hypot(shape.size[0], shape.size[-1] / 2.0))
        reach = max(reach, float(np.linalg.norm(shape.placement[:3, 3] - centre)) + radius)
    return Link(name, body, reach, tuple(shapes))


def _body(inertial: ET.Element, where: str) -> Body:
    """Return the mass properties of an `<inertial>` element; raise UrdfError if mass or inertia is missing."""
    mass, inertia = (_single(inertial, tag, where) for tag in ("mass", "inertia"))
    if mass is None or inertia is None:
        raise UrdfError(f"{where}: its <inertial> needs both <mass value='...'/> and <inertia ixx='...' .../>.")
    # The six numbers of the URDF are the upper half of a symmetric matrix.
    entries = {key: _number(inertia.get(key, "missing"), f"{where}: inertia {key}") for key in INERTIA}
    xx, xy, xz, yy, yz, zz = (entries[key] for key in INERTIA)
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    placement = _placement(inertial, where)
    mass_value = _number(mass.get("value", "missing"), f"{where}: mass")
    return Body(mass_value, placement[:3, 3], matrix, placement[:3, :3])


def _joint(element: ET.Element, file: str) -> Joint:
    """Return the joint of a `<joint>` element; raise UrdfError if an end is missing or a number cannot be read."""
    name = _name(element, file)
    where = f"{file}: joint '{name}'"
    ends = [_single(element, end, where) for end in ("parent", "child")]
    if any(end is None or end.get("link") is None for end in ends):
        raise UrdfError(f"{where} needs <parent link='...'/> and <child link='...'/>.")
    axis, limit, dynamics, mimic = (_single(element, tag, where) for tag in ("axis", "limit", "dynamics", "mimic"))
    # A <mimic> without multiplier or offset means 1 and 0, as the URDF format states.
    relation = None
    if mimic is not None:
        multiplier, offset = _attribute(mimic, "multiplier", where, 1.0), _attribute(mimic, "offset", where)
        relation = Mimic(mimic.get("joint", ""), multiplier, offset)
    return Joint(
        name=name,
        kind=element.get("type", ""),
        parent=str(ends[0].get("link")),  # type: ignore[union-attr]
        child=str(ends[1].get("link")),  # type: ignore[union-attr]
        origin=_placement(element, where),
        axis=np.array([1.0, 0.0, 0.0]) if axis is None else _vector(axis.get("xyz", "missing"), f"{where}: axis"),
        limited=limit is not None,
        limits=(_attribute(limit, "lower", where), _attribute(limit, "upper", where)),
        mimic=relation,
        lossy=_attribute(dynamics, "damping", where) != 0.0 or _attribute(dynamics, "friction", where) != 0.0,
        axis_written=axis is not None,
    )


def _single(element: ET.Element, tag: str, where: str) -> ET.Element | None:
    """Return the only element with this tag inside another element, or None if there is none.

    Raises UrdfError: there are two such elements. They may contradict each other, and a reader that used the first
    element would ignore the second without a message.
    """
    elements = element.findall(tag)
    if len(elements) > 1:
        raise UrdfError(f"{where} has {len(elements)} elements <{tag}>; only one is allowed: delete the wrong one.")
    return elements[0] if elements else None


def _attribute(element: ET.Element | None, key: str, where: str, default: float = 0.0) -> float:
    """Return the number of an element's attribute, or the default if the element or the attribute is missing."""
    if element is None or element.get(key) is None:
        return default
    return _number(str(element.get(key)), f"{where}: {key}")


def _name(element: ET.Element, file: str) -> str:
    """Return the name of a `<link>` or `<joint>` element.

    Raises UrdfError: the element has no name.
    """
    name = element.get("name")
    if not name:
        raise UrdfError(f"{file}: a <{element.tag}> has no name; give it one.")
    return name


def _placement(element: ET.Element, where: str) -> np.ndarray:
    """Return the transform of an element's `<origin>` [4, 4], or the identity without `<origin>`.

    roll, pitch and yaw turn about the fixed axes x, then y, then z.
    """
    placement, origin = np.eye(4), _single(element, "origin", where)
    if origin is not None:
        roll, pitch, yaw = _vector(origin.get("rpy", "0 0 0"), f"{where}: origin rpy")
        placement[:3, :3] = turn("z", yaw) @ turn("y", pitch) @ turn("x", roll)
        placement[:3, 3] = _vector(origin.get("xyz", "0 0 0"), f"{where}: origin xyz")
    return placement


def turn(axis: str, angle: float) -> np.ndarray:
    """Return the matrix [3, 3] of a right-handed rotation by an angle [rad] about an axis "x", "y" or "z"."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    rotation = np.eye(3)
    rotation[j, j] = rotation[k, k] = math.cos(angle)
    rotation[k, j] = math.sin(angle)
    rotation[j, k] = -rotation[k, j]
    return rotation


def _vector(text: str, where: str) -> np.ndarray:
    """Return the three numbers of an attribute such as xyz or rpy [3]; raise UrdfError if the text does not consist of
    three numbers.
    """
    numbers = [_number(word, where) for word in text.split()]
    if len(numbers) != 3:
        raise UrdfError(f"{where} = '{text}' must be three numbers, for example '0 1 0'.")
    return np.array(numbers)


def _number(text: str, where: str) -> float:
    """Return the finite number in a text; raise UrdfError if the text is no finite number. `where` states the position
    of the text for the error.
    """
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UrdfError(f"{where} = '{text}' is not a number; write a number in SI units, with a decimal point.")
    return number
