"""Triangles for the 3D views: the terrain, with one mesh for each soil, and the links of a rover with their shapes.

Lanes are drawn with their lips and walls. The shapes of the links are the boxes, cylinders, spheres and meshes of the
URDF.
"""

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
from rover_pin.terrain.terrain import Extent, HeightGrid, Lanes, Profile, Terrain

MAX_POINTS = 400
"""Approximate maximum number of points along each axis of the drawn terrain. A height grid with more points is drawn
with every second, third, ... point, because a page with more triangles would be slow."""
RULED = 0.1
"""Distance along x [m] between the lines that are drawn across the terrain. The lines show its shape and the rover's
progress. The distance is one to two wheel radii of a small rover."""


class SoilMesh(NamedTuple):
    """The part of the terrain that has one soil, as triangles for a 3D view: index of the soil, positions of V vertices
    (V, 3) [m], and F triangles (F, 3), each given by the indices of its vertices.
    """

    soil: int
    vertices: np.ndarray
    faces: np.ndarray


def patches(terrain: Terrain, box: Extent) -> list[SoilMesh]:
    """Return the terrain within a rectangle as triangles, one patch for each soil."""
    # The terrain is first divided into Q quadrilaterals (Q, 4, 3) [m], each with its soil index (Q,).
    if isinstance(terrain, Lanes):
        # Lanes are strips of ground along x whose height does not change across them. The borders of the strips are
        # those of the lanes that lie within the rectangle, and its own two sides.
        edges = [box.y_low, *(y for y in terrain.borders if box.y_low < y < box.y_high), box.y_high]
        strips, strip_soils = [], []
        for low, high in zip(edges, edges[1:], strict=False):
            profile = terrain.profiles[int(terrain.lane(0.5 * (low + high)))]
            x = _corners((profile,), box)
            z = profile.height(x)
            strips.append(_strip(x, z, z, low, high))
            strip_soils.append(profile.ground[profile.piece(0.5 * (x[1:] + x[:-1]))])
        for y in edges[1:-1]:
            # The wall between two lanes of different height has the soil of the higher lane.
            right, left = (terrain.profiles[int(terrain.lane(y + side * 1e-9))] for side in (-1, 1))
            x = _corners((right, left), box)
            middle = 0.5 * (x[1:] + x[:-1])
            strips.append(_strip(x, right.height(x), left.height(x), y, y))
            right_soil, left_soil = (profile.ground[profile.piece(middle)] for profile in (right, left))
            strip_soils.append(np.where(right.height(middle) > left.height(middle), right_soil, left_soil))
        quads, soils = np.concatenate(strips), np.concatenate(strip_soils)
    else:
        # The grid has at most about MAX_POINTS points along each axis. For a height grid they are its own points, for
        # other terrain they are evenly spaced.
        axes = [np.linspace(low, high, MAX_POINTS) for low, high in (box[:2], box[2:])]
        if isinstance(terrain, HeightGrid):
            for axis, (start, spacing) in enumerate(((terrain.x0, terrain.dx), (terrain.y0, terrain.dy))):
                low, high = axes[axis][[0, -1]]
                ticks = start + spacing * np.arange(terrain.z.shape[axis])
                ticks = ticks[(ticks > low) & (ticks < high)]
                axes[axis] = np.concatenate([[low], ticks[:: max(1, ticks.size // MAX_POINTS)], [high]])
        X, Y = np.meshgrid(*axes, indexing="ij")
        points = np.stack([X, Y, terrain.height(X, Y)], axis=-1)
        quads = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2)
        # The soil is the one in the middle of a quadrilateral.
        centres = 0.25 * quads.sum(axis=2)
        quads = quads.reshape(-1, 4, 3)
        soils = np.asarray(terrain.ground_at(centres[..., 0], centres[..., 1])).ravel()
    soil_patches = []
    for soil in np.unique(soils):
        corners = quads[soils == soil]
        # A quad (4, 3) becomes the triangles of its corners 0 1 2 and 0 2 3.
        first = 4 * np.arange(len(corners))[:, None]
        faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
        soil_patches.append(SoilMesh(int(soil), corners.reshape(-1, 3), faces))
    return soil_patches


def _corners(profiles: tuple[Profile, ...], box: Extent) -> np.ndarray:
    """Return the x [m] at which the drawn profiles need a point, ascending: the points of all profiles within the
    rectangle, and its two ends.
    """
    x = np.concatenate([[box.x_low, box.x_high], *(profile.x for profile in profiles)])
    return np.unique(np.clip(x, box.x_low, box.x_high))


def _strip(x: np.ndarray, z_low: np.ndarray, z_high: np.ndarray, y_low: float, y_high: float) -> np.ndarray:
    """Return the quadrilaterals (N-1, 4, 3) [m] between two polylines over common x (N,): one with the heights `z_low`
    at y = `y_low`, the other with the heights `z_high` at y = `y_high`.
    """
    low, high = (np.column_stack([x, np.full(x.size, y), z]) for y, z in ((y_low, z_low), (y_high, z_high)))
    return np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)


def ruled_lines(terrain: Terrain, box: Extent) -> np.ndarray:
    """Return the segments (N, 2, 3) [m] of lines that are drawn across the terrain along y, at distances of RULED along
    x. They show the shape of the terrain and the rover's progress.
    """
    # A point on either side of a border makes a line follow the wall between two lanes.
    borders = terrain.borders if isinstance(terrain, Lanes) else ()
    seams = [y + side for y in borders if box.y_low < y < box.y_high for side in (-1e-6, 1e-6)]
    y = np.array(sorted({box.y_low, box.y_high, *np.linspace(box.y_low, box.y_high, 25), *seams}))
    lines = []
    for x in np.arange(np.ceil(box.x_low / RULED), np.floor(box.x_high / RULED) + 1) * RULED:
        # Lines are drawn 1 mm above the terrain, which would otherwise hide them.
        points = np.column_stack([np.full(y.size, x), y, terrain.height(np.full(y.size, x), y) + 1e-3])
        lines.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(lines) if lines else np.zeros((0, 2, 3))


log = logging.getLogger(__name__)

PLAIN = (0.62, 0.64, 0.67)
"""Colour of a shape without a colour in the URDF: grey, as bare metal."""
ROD = 0.006
"""Largest radius [m] of the rods that are drawn for links without shapes. The radius of a short rod is a tenth of its
length."""


class LinkShape(NamedTuple):
    """A shape of a link as triangles: positions of V vertices (V, 3) [m] in the link's frame, F triangles (F, 3), each
    given by the indices of its vertices, and the colour (red, green, blue from 0 to 1).
    """

    link: str
    vertices: np.ndarray
    faces: np.ndarray
    colour: tuple[float, float, float]
    wheel: str = ""
    "name of the wheel whose slip this shape shows by its colour; empty for any other shape"


def shapes_of(rover: Rover, folder: Path | None = None) -> list[LinkShape]:
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
    shapes, missing = list[LinkShape](), set[str]()
    for link in robot.links:
        link_shapes: list[LinkShape] = []
        for visual in link.visuals:
            # Meshes are no longer read when the picture has its maximum number of corners: many links may name one.
            is_full = 3 * sum(len(shape.faces) for shape in (*shapes, *link_shapes)) > MAX_CORNERS
            mesh = _triangles(visual.geometry, None if is_full else folder, missing)
            if mesh is not None:
                mesh.apply_transform(np.eye(4) if visual.origin is None else visual.origin)
                # A material without a colour refers by its name to the palette, the materials of the whole URDF.
                material = visual.material
                colour = None if material is None else material.color or palette.get(material.name)
                r, g, b = PLAIN if colour is None else map(float, colour.rgba[:3])
                link_shapes.append(LinkShape(link.name, np.asarray(mesh.vertices), np.asarray(mesh.faces), (r, g, b)))
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
                    link_shapes.append(LinkShape(link.name, np.asarray(rod.vertices), np.asarray(rod.faces), PLAIN))
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


def _wheel(link: str, mount: WheelMount, link_shapes: list[LinkShape], rover: Rover) -> Iterator[LinkShape]:
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
        link_shapes = [LinkShape(link, np.asarray(cylinder.vertices), np.asarray(cylinder.faces), PLAIN)]
    # The largest shape is the rim, which gets the colour of the slip.
    rim, *others = sorted(link_shapes, key=lambda shape: -float(np.prod(np.ptp(shape.vertices, axis=0))))
    yield rim._replace(wheel=mount.name)
    if others:
        yield from others
        return
    # A bar on a wheel without further shapes shows that the wheel turns.
    bar = trimesh.creation.box(extents=(1.8 * r, 0.16 * r, 1.04 * b))
    bar.apply_transform(to_axle)
    yield LinkShape(link, np.asarray(bar.vertices), np.asarray(bar.faces), (0.12, 0.12, 0.13))
