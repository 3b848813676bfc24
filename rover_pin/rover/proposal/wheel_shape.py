"""How large a wheel is, from what its link draws: cylinders, spheres, meshes, or its inertia where nothing is drawn."""

import logging
import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.rover.description.meshes import mesh_file, read_mesh
from rover_pin.rover.description.tree import Joint, Link, Shape, UrdfTree

log = logging.getLogger(__name__)

ROUND = 0.2
"""Largest difference of a round shape's two diameters, or of two shapes of a rim, over the larger: treads have lugs."""


class WheelSize(NamedTuple):
    """Radius and width [m], and where they come from."""

    r: float
    b: float
    source: str


def wheel_size(tree: UrdfTree, joint: Joint, folder: Path) -> WheelSize | None:
    """Return the size of what turns about a joint, if round about its axis: of its largest shapes, a cylinder's."""
    links = {link.name: link for link in tree.links}
    group = [links[name] for name in tree.rigid_group(joint.child) if name in links]
    places = tree.placements
    at = np.linalg.inv(places[joint.child]) if joint.child in places else np.eye(4)
    candidates: list[WheelSize] = []
    for link in group:
        placement = at @ places.get(link.name, np.eye(4))
        candidates += _shape_candidates(link, placement, joint.axis, folder)
    if candidates:
        rim = (1.0 - ROUND) * max(size.r for size in candidates)
        return max(candidates, key=lambda size: (size.r >= rim, "cylinder" in size.source, size.r))
    return _of_inertia(links[joint.child], joint.axis)


def _shape_candidates(link: Link, placement: np.ndarray, axis: np.ndarray, folder: Path) -> Iterator[WheelSize]:
    for shape in link.shapes:
        corners = _points(shape, folder)
        if corners is None:
            continue
        place = placement @ shape.placement
        points = corners @ place[:3, :3].T + place[:3, 3]
        size = _about(points, axis)
        if size is not None:
            yield WheelSize(*size, f"the {shape.kind} that link '{link.name}' draws")


def _about(points: np.ndarray, axis: np.ndarray) -> tuple[float, float] | None:
    """Return radius and width of points about an axis through the origin, if they are round about it."""
    unit = axis / np.linalg.norm(axis)
    along = points @ unit
    aside = points - np.outer(along, unit)
    first = np.cross(unit, np.eye(3)[int(np.argmin(np.abs(unit)))])
    first /= np.linalg.norm(first)
    spans = [float(np.ptp(aside @ direction)) for direction in (first, np.cross(unit, first))]
    reach = float(np.max(np.linalg.norm(aside, axis=1)))
    if not min(spans) > (1.0 - ROUND) * max(spans) or not max(spans) > 1.5 * reach:
        return None
    return reach, float(np.ptp(along))


def _points(shape: Shape, folder: Path) -> np.ndarray | None:
    turns = np.linspace(0.0, 2.0 * math.pi, 72, endpoint=False)
    if shape.kind == "cylinder":
        r, length = shape.size
        ring = np.column_stack([r * np.cos(turns), r * np.sin(turns), np.zeros_like(turns)])
        return np.vstack([ring + np.array([0.0, 0.0, end * length / 2.0]) for end in (-1.0, 1.0)])
    if shape.kind == "sphere":
        return shape.size[0] * np.vstack([np.eye(3), -np.eye(3)])
    return _vertices(shape, folder) if shape.kind == "mesh" else None


def _vertices(shape: Shape, folder: Path) -> np.ndarray | None:
    """Return the corners of a mesh that can be found and read [n, 3], else None: meshes may be missing."""
    file = mesh_file(shape.mesh, folder)
    try:
        points = read_mesh(file, shape.size)[0] if file is not None else np.empty((0, 3))
    except DataError as error:
        log.warning("%s", error)
        return None
    return points if len(points) else None


def _of_inertia(link: Link, axis: np.ndarray) -> WheelSize | None:
    """Return the solid cylinder of the link's inertia: I = m r^2 / 2 about the axis, m (3 r^2 + b^2) / 12 across it."""
    if link.body is None or not link.body.mass > 0.0:
        return None
    unit = link.body.axes.T @ (axis / np.linalg.norm(axis))
    axial = float(unit @ link.body.inertia @ unit)
    across = (float(np.trace(link.body.inertia)) - axial) / 2.0
    if not axial > 0.0:
        return None
    r = math.sqrt(2.0 * axial / link.body.mass)
    b = math.sqrt(max(12.0 * across / link.body.mass - 3.0 * r**2, (0.2 * r) ** 2))
    return WheelSize(r, b, f"the inertia of link '{link.name}' as a solid cylinder's, which is a poor measure")
