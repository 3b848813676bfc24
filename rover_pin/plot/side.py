"""Functions that draw a rover and its terrain, from the side and from above."""

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
"""Colours of the terrain (SAND) and of its surface line (EDGE) in the side view."""


class Pose(NamedTuple):
    """The pose of a rover with W wheels at one moment: its configuration and the positions of its wheels, for drawing
    it.
    """

    t: float
    "time [s]"
    q: np.ndarray
    "configuration of the rover's model (nq,)"
    centres: np.ndarray
    "centres of the W wheels [m] (W, 3)"
    axles: np.ndarray
    """unit vectors along the wheels' axles (W, 3), pointing to the left; the axle of a steered wheel turns with the
    wheel"""
    left: np.ndarray
    """horizontal part of the unit vector that points to the left of the base (2,)"""


def poses(trace: Trace, rover: Rover, rows: Sequence[int] | np.ndarray) -> list[Pose]:
    """Return the pose of a rover in each of the given rows of a trace."""
    data, rover_poses = rover.model.createData(), []
    for row in rows:
        q = configuration(rover, trace, int(row))
        centres, axles = place_links(rover, data, q)
        left = np.array(data.oMi[1].rotation[:2, 1])  # joint 1 is the free flyer of the base, whose y points left
        rover_poses.append(Pose(float(trace.t[row]), q, centres, axles, left))
    return rover_poses


def draw_rover(axes: Axes, rover: Rover, q: np.ndarray, colour: Any, side: str = "l") -> None:
    """Draw one side of a rover as seen from its right: the links between its joints, and its wheels.

    Parameters
    ----------
    axes : Axes
        Axes with x to the right and z upwards.
    rover : Rover
        The rover.
    q : array (nq,)
        Configuration of the rover's model.
    colour : matplotlib colour
        Colour of the lines.
    side : str
        Side whose wheels are drawn, "l" (left) or "r" (right).
    """
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, q)
    # A line from each joint to its parent joint shows the links of the suspension.
    for joint in rover.joints_of_side(side):
        parent = rover.model.parents[joint]
        start, end = data.oMi[parent].translation, data.oMi[joint].translation
        axes.plot([start[0], end[0]], [start[2], end[2]], color=colour, lw=1.4, solid_capstyle="round")
    for wheel in rover.wheels:
        if wheel.side == side:
            x, _, z = data.oMi[wheel.joint].translation
            axes.add_patch(Circle((x, z), float(wheel.wheel.r), fill=False, color=colour, lw=1.4))


def ground_line(terrain: Terrain, low: float, high: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the profile of the terrain along a line of constant y [m]: x (2000,) and height (2000,) [m].

    The line reaches from x = `low` to x = `high` [m].
    """
    x = np.linspace(low, high, 2000)
    return x, np.asarray(terrain.height(x, y))


def draw_ground(axes: Axes, terrain: Terrain, span: tuple[float, float], under: float, other_y: float) -> float:
    """Draw the terrain from the side, and return the lowest height that is drawn [m].

    Parameters
    ----------
    axes : Axes
        Axes with x to the right and z upwards.
    terrain : Terrain
        The terrain.
    span : tuple of float
        Smallest and largest x [m].
    under : float
        y under the wheels that are drawn [m]; the terrain there is filled.
    other_y : float
        y under the wheels of the other side [m]; the terrain there is a dashed line if its height differs.
    """
    x, z = ground_line(terrain, *span, under)
    low = float(np.min(z))
    axes.fill_between(x, z, low - 0.05, color=SAND, lw=0)
    axes.plot(x, z, color=EDGE, lw=1)
    # The terrain under the wheels of the other side is drawn only if it differs visibly.
    other_z = ground_line(terrain, *span, other_y)[1]
    if np.max(np.abs(other_z - z)) > 1e-6:
        axes.plot(x, other_z, color=EDGE, lw=0.8, ls="--")
    return low


def draw_above(axes: Axes, rover: Rover, pose: Pose, colour: Any) -> None:
    """Draw a rover from above: its wheels, turned by their steering angles, and the polygon through the wheel
    centres.
    """
    axes.add_patch(Polygon(pose.centres[around(rover), :2], fc="none", ec=colour, lw=0.8))
    for wheel, centre, axle in zip(rover.wheels, pose.centres, pose.axles, strict=True):
        axes.add_patch(Polygon(footprint(wheel, centre, axle), fc="none", ec=colour, lw=1.2))
