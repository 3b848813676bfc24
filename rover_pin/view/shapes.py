"""The shapes of a rover's links as triangles: the boxes, cylinders, spheres and meshes of its URDF."""

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
from rover_pin.rover.description.meshes import MAX_CORNERS, mesh_file, read_mesh
from rover_pin.rover.rover import Rover, WheelMount

log = logging.getLogger(__name__)

PLAIN = (0.62, 0.64, 0.67)
"""Colour of a shape without a colour in the URDF: grey, as bare metal."""
ROD = 0.006
"""Largest radius [m] of the rods that are drawn for links without shapes. The radius of a short rod is a tenth of its
length."""


class Shape(NamedTuple):
    """A shape of a link as triangles: positions of V vertices (V, 3) [m] in the link's frame, F triangles (F, 3), each
    given by the indices of its vertices, and the colour (red, green, blue from 0 to 1).
    """

    link: str
    vertices: np.ndarray
    faces: np.ndarray
    colour: tuple[float, float, float]
    wheel: str = ""
    "name of the wheel whose slip this shape shows by its colour; empty for any other shape"


def shapes_of(rover: Rover, folder: Path | None = None) -> list[Shape]:
    """Return the shapes of all links of a rover.

    Wheels get a mark that shows their rotation. A link without shapes is drawn as rods to the joints that it carries.

    Parameters
    ----------
    rover : Rover
        The rover.
    folder : Path, optional
        Base folder of the relative paths of meshes in the URDF; if missing, no mesh is drawn. A mesh that does not
        exist or cannot be read is skipped, and a warning names it.
    """
    robot = yourdfpy.URDF.load(io.BytesIO(rover.urdf.encode()), load_meshes=False, build_scene_graph=False).robot
    # The URDF is read again here, because Pinocchio's model does not contain the shapes.
    palette = {material.name: material.color for material in robot.materials}
    # The link that turns with each wheel. If several links turn with a wheel, the first is taken.
    bodies = [frame for frame in rover.model.frames if frame.type == pin.FrameType.BODY]
    rims: dict[str, WheelMount] = {}
    for mount in rover.wheels:
        rims[next((str(frame.name) for frame in bodies if frame.parentJoint == mount.joint), "")] = mount
    shapes, missing = list[Shape](), set[str]()
    for link in robot.links:
        link_shapes: list[Shape] = []
        for visual in link.visuals:
            # Meshes are no longer read when the picture has its maximum number of corners: many links may name one.
            is_full = 3 * sum(len(shape.faces) for shape in (*shapes, *link_shapes)) > MAX_CORNERS
            mesh = _triangles(visual.geometry, None if is_full else folder, missing)
            if mesh is not None:
                mesh.apply_transform(np.eye(4) if visual.origin is None else visual.origin)
                colour = _colour(visual.material, palette)
                link_shapes.append(Shape(link.name, np.asarray(mesh.vertices), np.asarray(mesh.faces), colour))
        if link.name in rims:
            link_shapes = list(_wheel(link.name, rims[link.name], link_shapes, rover))
        if not link_shapes:
            # A link without shapes is drawn as rods to the joints that it carries. Joint 0 is the world, and joint 1
            # the free flyer of the body.
            frame = rover.model.frames[rover.model.getFrameId(link.name, pin.FrameType.BODY)]
            for joint in (at for at in range(2, rover.model.njoints) if rover.model.parents[at] == frame.parentJoint):
                end = np.array(frame.placement.actInv(rover.model.jointPlacements[joint]).translation)
                length = float(np.linalg.norm(end))
                if length > 1e-6:
                    segment = np.array([np.zeros(3), end])
                    rod = trimesh.creation.cylinder(radius=min(ROD, length / 10.0), segment=segment)
                    link_shapes.append(Shape(link.name, np.asarray(rod.vertices), np.asarray(rod.faces), PLAIN))
        shapes += link_shapes
    return shapes


def _triangles(geometry: Any, folder: Path | None, missing: set[str]) -> Any:
    """Return a geometry of the URDF as a trimesh object, or None if it is a mesh that cannot be read.

    A warning names each missing mesh once; `missing` collects the names of these meshes.
    """
    if geometry.box is not None:
        return trimesh.creation.box(extents=geometry.box.size)
    if geometry.sphere is not None:
        return trimesh.creation.icosphere(subdivisions=2, radius=geometry.sphere.radius)
    if geometry.cylinder is not None:
        return trimesh.creation.cylinder(radius=geometry.cylinder.radius, height=geometry.cylinder.length, sections=32)
    file = None if folder is None else mesh_file(geometry.mesh.filename, folder)
    # Each missing mesh is reported once.
    if file is None:
        if geometry.mesh.filename not in missing:
            log.warning(
                "The view leaves out the mesh %s: it is not in the rover's package, or the view is full.",
                geometry.mesh.filename,
            )
        missing.add(geometry.mesh.filename)
        return None
    try:
        scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
        return trimesh.Trimesh(*read_mesh(file, scale), process=False)
    except DataError as error:
        log.warning("%s The view is drawn without it.", error)
        return None


def _colour(material: Any, palette: dict[str, Any]) -> tuple[float, float, float]:
    """Return the colour (red, green, blue) of a material of the URDF.

    A material without a colour refers by its name to `palette`, the materials that the URDF defines for all links.
    """
    colour = None if material is None else material.color or palette.get(material.name)
    if colour is None:
        return PLAIN
    r, g, b = (float(value) for value in colour.rgba[:3])
    return r, g, b


def _wheel(link: str, mount: WheelMount, link_shapes: list[Shape], rover: Rover) -> Iterator[Shape]:
    """Yield the shapes of a wheel. If the link of the wheel has no shapes, a cylinder with the radius and width of the
    wheel is drawn.

    The largest shape shows the slip by its colour. A wheel with a single shape also gets a bar, which makes its
    rotation visible.
    """
    r, b = float(mount.wheel.r), float(mount.wheel.b)
    # A cylinder lies along z: it is turned to the axis of the wheel's joint, seen from the link.
    data = rover.model.createData()
    pin.computeJointJacobians(rover.model, data, pin.neutral(rover.model))
    axis = pin.getJointJacobian(rover.model, data, mount.joint, pin.LOCAL)[3:, mount.dof]
    frame = rover.model.frames[rover.model.getFrameId(link, pin.FrameType.BODY)]
    to_axle = frame.placement.inverse().homogeneous @ trimesh.geometry.align_vectors([0.0, 0.0, 1.0], axis)
    if not link_shapes:
        cylinder = trimesh.creation.cylinder(radius=r, height=b, sections=48)
        cylinder.apply_transform(to_axle)
        link_shapes = [Shape(link, np.asarray(cylinder.vertices), np.asarray(cylinder.faces), PLAIN)]
    # The largest shape is the rim, which gets the colour of the slip.
    rim, *others = sorted(link_shapes, key=lambda shape: -float(np.prod(np.ptp(shape.vertices, axis=0))))
    yield rim._replace(wheel=mount.name)
    if others:
        yield from others
        return
    # A bar on a wheel without further shapes shows that the wheel turns.
    bar = trimesh.creation.box(extents=(1.8 * r, 0.16 * r, 1.04 * b))
    bar.apply_transform(to_axle)
    yield Shape(link, np.asarray(bar.vertices), np.asarray(bar.faces), (0.12, 0.12, 0.13))
