"""Size of a wheel, found from the cylinders, spheres and meshes that its link draws, or from its inertia."""

import logging
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.rover.description.meshes import mesh_file, read_mesh
from rover_pin.rover.description.tree import Joint, Shape, UrdfTree

log = logging.getLogger(__name__)

ROUNDNESS_TOLERANCE = 0.2
"""Largest difference between two diameters of a shape that counts as round, as a fraction of the larger diameter. Such
a difference is allowed because treads have lugs.

Shapes whose radii differ by at most this fraction belong to one rim."""


class WheelSize(NamedTuple):
    """Radius and width of a wheel, and their source in words."""

    r: float
    "radius [m]"
    b: float
    "width [m]"
    source: str
    "part of the URDF that shows the size, for the comment in the TOML"


def wheel_size(tree: UrdfTree, joint: Joint, folder: Path, *, drawn_only: bool = False) -> WheelSize | None:
    """Return the size of the wheel that turns about a joint; None if the URDF does not show the size.

    The size belongs to the largest shape that is round about the joint's axis. A cylinder of about this radius is
    preferred to a mesh, because the author of the URDF stated its size. If no shape is round, the inertia gives a rough
    size, unless `drawn_only` is true.

    Parameters
    ----------
    tree : UrdfTree
        The URDF.
    joint : Joint
        The joint of the wheel.
    folder : path
        The folder of the URDF, which is searched for its meshes.
    drawn_only : bool
        Whether only the drawn shapes may show the size, and not the inertia.
    """
    # Links that are fixed to the joint's link, such as a tyre on a hub, turn with it and are part of the wheel.
    links = {link.name: link for link in tree.links}
    group = [links[name] for name in tree.rigid_group(joint.child) if name in links]
    places = tree.placements
    to_joint = np.linalg.inv(places[joint.child]) if joint.child in places else np.eye(4)
    candidates: list[WheelSize] = []
    for link in group:
        placement = to_joint @ places.get(link.name, np.eye(4))
        for shape in link.shapes:
            points = _points(shape, folder)
            if points is None:
                continue
            to_axis = placement @ shape.placement
            points = points @ to_axis[:3, :3].T + to_axis[:3, 3]
            # The spans along two directions across the axis must be nearly equal, and about twice the reach. Otherwise
            # the shape is no disc, or its centre lies off the axis.
            axis = joint.axis / np.linalg.norm(joint.axis)
            along = points @ axis
            aside = points - np.outer(along, axis)
            first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
            first /= np.linalg.norm(first)
            spans = [float(np.ptp(aside @ direction)) for direction in (first, np.cross(axis, first))]
            reach = float(np.max(np.linalg.norm(aside, axis=1)))
            if min(spans) > (1.0 - ROUNDNESS_TOLERANCE) * max(spans) and max(spans) > 1.5 * reach:
                source = f"the {shape.kind} that link '{link.name}' draws"
                candidates.append(WheelSize(reach, float(np.ptp(along)), source))
    # Shapes of about the largest radius are the rim; smaller shapes are hubs or motors.
    if candidates:
        rim = (1.0 - ROUNDNESS_TOLERANCE) * max(size.r for size in candidates)
        return max(candidates, key=lambda size: (size.r >= rim, "cylinder" in size.source, size.r))
    link = links[joint.child]
    if drawn_only or link.body is None or not link.body.mass > 0.0:
        return None
    # No shape is round, so the size is that of the solid cylinder with the same inertia. A solid cylinder of mass m,
    # radius r and width b has the moment of inertia m r^2 / 2 about its axis, and m (3 r^2 + b^2) / 12 across its axis.
    # A real wheel has its mass further out or further in, so that the size is rough.
    unit = link.body.axes.T @ (joint.axis / np.linalg.norm(joint.axis))
    axial = float(unit @ link.body.inertia @ unit)
    across = (float(np.trace(link.body.inertia)) - axial) / 2.0
    if not axial > 0.0:
        return None
    r = math.sqrt(2.0 * axial / link.body.mass)
    # For a ring, the formula of the solid cylinder gives no positive width, so a minimum width is set.
    b = math.sqrt(max(12.0 * across / link.body.mass - 3.0 * r**2, (0.2 * r) ** 2))
    return WheelSize(r, b, f"the inertia of link '{link.name}', as if it were a solid cylinder, which is inaccurate")


def _points(shape: Shape, folder: Path) -> np.ndarray | None:
    """Return points on the outline of a shape in the shape's frame [n, 3] (m); None for a box or a missing mesh."""
    turns = np.linspace(0.0, 2.0 * math.pi, 72, endpoint=False)
    if shape.kind == "cylinder":
        r, length = shape.size
        ring = np.column_stack([r * np.cos(turns), r * np.sin(turns), np.zeros_like(turns)])
        return np.vstack([ring + np.array([0.0, 0.0, end * length / 2.0]) for end in (-1.0, 1.0)])
    if shape.kind == "sphere":
        return shape.size[0] * np.vstack([np.eye(3), -np.eye(3)])
    if shape.kind != "mesh":
        return None
    # If a mesh is missing or damaged, other shapes or the inertia must show the size.
    file = mesh_file(shape.mesh, folder)
    try:
        points = read_mesh(file, shape.size)[0] if file is not None else np.empty((0, 3))
    except DataError as error:
        log.warning("%s", error)
        return None
    return points if len(points) else None
