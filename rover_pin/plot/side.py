"""A rover and its ground from the side and from above."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from rover_pin.rover.rover import Rover
from rover_pin.simulation.trace.poses import around, configuration, footprint, place_links
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain

SAND, EDGE = "#d9c9a5", "#8a7340"


class Pose(NamedTuple):
    """A rover at one moment."""

    t: float
    q: np.ndarray
    centres: np.ndarray
    "of the wheels [m] (W, 3)"
    axles: np.ndarray
    "of the wheels, to the left, as they are steered (W, 3)"
    left: np.ndarray
    "direction to the left of the base, seen from above (2,)"


def poses(trace: Trace, rover: Rover, rows: Sequence[int] | np.ndarray) -> list[Pose]:
    """Return the rover at rows of a trace."""
    data, rover_poses = rover.model.createData(), []
    for row in rows:
        q = configuration(rover, trace, int(row))
        rover_poses.append(
            Pose(float(trace.t[row]), q, *place_links(rover, data, q), np.array(data.oMi[1].rotation[:2, 1]))
        )
    return rover_poses


def draw_rover(axes: Axes, rover: Rover, q: np.ndarray, colour: Any, side: str = "l") -> None:
    """Draw a side of the rover: links between joints, wheels, and the body's axis."""
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, q)
    wheel_joints = {wheel.joint for wheel in rover.wheels if wheel.side == side}
    joints = {joint for wheel in wheel_joints for joint in rover.model.supports[wheel]}
    for joint in sorted(joints - {0, 1}):
        parent = rover.model.parents[joint]
        start, end = data.oMi[parent].translation, data.oMi[joint].translation
        axes.plot([start[0], end[0]], [start[2], end[2]], color=colour, lw=1.4, solid_capstyle="round")
    for wheel in rover.wheels:
        if wheel.side == side:
            x, _, z = data.oMi[wheel.joint].translation
            axes.add_patch(Circle((x, z), float(wheel.wheel.r), fill=False, color=colour, lw=1.4))


def ground_line(terrain: Terrain, low: float, high: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Return x and height of the terrain along a track."""
    x = np.linspace(low, high, 2000)
    return x, np.asarray(terrain.height(x, y))


def draw_ground(axes: Axes, terrain: Terrain, span: tuple[float, float], under: float, other_y: float) -> float:
    """Draw the ground under the wheels that are drawn, at y = `under`; dashed under the others; return its lowest z."""
    x, z = ground_line(terrain, *span, under)
    low = float(np.min(z))
    axes.fill_between(x, z, low - 0.05, color=SAND, lw=0)
    axes.plot(x, z, color=EDGE, lw=1)
    beside = ground_line(terrain, *span, other_y)[1]
    if np.max(np.abs(beside - z)) > 1e-6:
        axes.plot(x, beside, color=EDGE, lw=0.8, ls="--")
    return low


def draw_above(axes: Axes, rover: Rover, pose: Pose, colour: Any) -> None:
    """Draw a rover from above: its wheels as they are steered, and the line around them."""
    axes.add_patch(Polygon(pose.centres[around(rover), :2], fc="none", ec=colour, lw=0.8))
    for wheel, centre, axle in zip(rover.wheels, pose.centres, pose.axles, strict=True):
        axes.add_patch(Polygon(footprint(wheel, centre, axle), fc="none", ec=colour, lw=1.2))
