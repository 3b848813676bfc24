"""The rover's own shapes, link by link: boxes, cylinders, spheres and meshes of its URDF, as triangles."""

import io
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import trimesh
import yourdfpy

from rover_pin.base.errors import DataError
from rover_pin.rover.description.meshes import MOST_CORNERS, mesh_file, read_mesh
from rover_pin.rover.rover import Rover, WheelMount

log = logging.getLogger(__name__)

PLAIN = (0.62, 0.64, 0.67)
"""Colour of a shape without one."""
ROD = 0.006
"""Radius [m] of the rods that stand for links without shapes, as a share of what they span at most a tenth."""


class Shape(NamedTuple):
    """A shape of a link: vertices (V, 3) [m] in the link's frame, triangles (F, 3), colour (r, g, b) in 0..1."""

    link: str
    vertices: np.ndarray
    faces: np.ndarray
    colour: tuple[float, float, float]
    wheel: str = ""
    "the wheel whose rim this is, which shows its slip"


def shapes_of(rover: Rover, folder: Path | None = None) -> list[Shape]:
    """Return the rover's shapes; wheels are drawn as they roll, and links without shapes as rods to their joints.

    Meshes are read from `folder`, that of the rover's TOML, or its package; one that is not there or cannot be read is
    left out, with a word.
    """
    robot = yourdfpy.URDF.load(io.BytesIO(rover.urdf.encode()), load_meshes=False, build_scene_graph=False).robot
    palette = {material.name: material.color for material in robot.materials}
    rims = {_link_of(rover, mount): mount for mount in rover.wheels}
    shapes, missing = list[Shape](), set[str]()
    for link in robot.links:
        link_shapes: list[Shape] = []
        for visual in link.visuals:
            full = 3 * sum(len(shape.faces) for shape in (*shapes, *link_shapes)) > MOST_CORNERS
            link_shapes += _shape(link.name, visual, palette, None if full else folder, missing)
        if link.name in rims:
            link_shapes = list(_wheel(link.name, rims[link.name], link_shapes, rover))
        shapes += link_shapes or list(_rods(rover, link.name))
    return shapes


def _shape(link: str, visual: Any, palette: dict[str, Any], folder: Path | None, missing: set[str]) -> Iterator[Shape]:
    if (mesh := _mesh(visual.geometry, folder, missing)) is None:
        return
    mesh.apply_transform(np.eye(4) if visual.origin is None else visual.origin)
    yield Shape(link, np.asarray(mesh.vertices), np.asarray(mesh.faces), _colour(visual.material, palette))


def _mesh(geometry: Any, folder: Path | None, missing: set[str]) -> Any:
    """Return a shape of the URDF as triangles, or None for a mesh that is not to be had, which is said once."""
    if geometry.box is not None:
        return trimesh.creation.box(extents=geometry.box.size)
    if geometry.sphere is not None:
        return trimesh.creation.icosphere(subdivisions=2, radius=geometry.sphere.radius)
    if geometry.cylinder is not None:
        return trimesh.creation.cylinder(radius=geometry.cylinder.radius, height=geometry.cylinder.length, sections=32)
    file = None if folder is None else mesh_file(geometry.mesh.filename, folder)
    if file is None:
        if geometry.mesh.filename not in missing:
            log.warning("the mesh %s is not in the rover's package, or one too many", geometry.mesh.filename)
        missing.add(geometry.mesh.filename)
        return None
    try:
        scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
        return trimesh.Trimesh(*read_mesh(file, scale), process=False)
    except DataError as error:
        log.warning("%s It is left out.", error)
        return None


def _colour(material: Any, palette: dict[str, Any]) -> tuple[float, float, float]:
    colour = None if material is None else material.color or palette.get(material.name)
    if colour is None:
        return PLAIN
    r, g, b = (float(value) for value in colour.rgba[:3])
    return r, g, b


def _wheel(link: str, mount: WheelMount, link_shapes: list[Shape], rover: Rover) -> Iterator[Shape]:
    """Yield a wheel's own shapes, or a cylinder of its radius and width; one alone gets a bar that shows it turn."""
    r, b = float(mount.wheel.r), float(mount.wheel.b)
    to_axle = _axle(rover, mount, link)
    if not link_shapes:
        rim = trimesh.creation.cylinder(radius=r, height=b, sections=48)
        rim.apply_transform(to_axle)
        link_shapes = [Shape(link, np.asarray(rim.vertices), np.asarray(rim.faces), PLAIN)]
    rim_of, *others = sorted(link_shapes, key=lambda shape: -float(np.prod(np.ptp(shape.vertices, axis=0))))
    yield rim_of._replace(wheel=mount.name)
    if others:  # it shows by itself how it turns
        yield from others
        return
    bar = trimesh.creation.box(extents=(1.8 * r, 0.16 * r, 1.04 * b))
    bar.apply_transform(to_axle)
    yield Shape(link, np.asarray(bar.vertices), np.asarray(bar.faces), (0.12, 0.12, 0.13))


def _rods(rover: Rover, link: str) -> Iterator[Shape]:
    """Yield rods from a link without shapes to the joints that hang on it."""
    frame = rover.model.frames[rover.model.getFrameId(link, pin.FrameType.BODY)]
    for joint in range(1, rover.model.njoints):
        end = np.array(frame.placement.actInv(rover.model.jointPlacements[joint]).translation)
        length = float(np.linalg.norm(end))
        if rover.model.parents[joint] == frame.parentJoint and joint > 1 and length > 1e-6:
            rod = trimesh.creation.cylinder(radius=min(ROD, length / 10.0), segment=np.array([np.zeros(3), end]))
            yield Shape(link, np.asarray(rod.vertices), np.asarray(rod.faces), PLAIN)


def _link_of(rover: Rover, mount: WheelMount) -> str:
    """Return the link that turns with a wheel."""
    for frame in rover.model.frames:
        if frame.type == pin.FrameType.BODY and frame.parentJoint == mount.joint:
            return str(frame.name)
    return ""


def _axle(rover: Rover, mount: WheelMount, link: str) -> np.ndarray:
    """Return the frame of a wheel in its link, whose z is the axis about which it turns [4, 4]."""
    data = rover.model.createData()
    pin.computeJointJacobians(rover.model, data, pin.neutral(rover.model))
    axis = pin.getJointJacobian(rover.model, data, mount.joint, pin.LOCAL)[3:, mount.dof]
    frame = rover.model.frames[rover.model.getFrameId(link, pin.FrameType.BODY)]
    return np.array(frame.placement.inverse().homogeneous @ trimesh.geometry.align_vectors([0.0, 0.0, 1.0], axis))
