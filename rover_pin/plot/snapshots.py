"""Figures of a rover on its terrain: at a few moments of a drive, from the side, and from above if the rover turns."""

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from rover_pin.base.encode import figure_text
from rover_pin.plot.sheet import MARGINS, in_lines, sheet
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.poses import (
    PathExtent,
    around,
    configuration,
    footprint,
    of_side,
    on_the_ground,
    place_links,
)
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain
from rover_pin.view.colours import draw_heights

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


SPACING = 0.5
"""Approximate distance between two snapshots on a long path [m]. It is about the length of a small rover, so that the
drawn rovers hardly overlap."""
WIDTH, BAR = 7.5, 0.8
"""Width of the figure (WIDTH), and width of the margin for the colour bar of the heights (BAR) [in]. A page of the site
shows a figure at about 690 pixels, so that a letter of the size FONT has a height of 11 pixels there."""
FONT, TITLE_LENGTH, LINE = 9.0, 84, 0.16
"""FONT is the size of the letters of titles and labels [pt]. A line of the title has at most TITLE_LENGTH characters,
which fit into WIDTH at this size, and LINE is the height of such a line [in]."""
PAPER = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1.0}
"""Style of the background of a label. The background is nearly white, so that lines behind the label do not disturb."""
LABEL = (0.6, 0.2)
"""Approximate width and height of the largest label [in]. Labels whose distance is smaller would overlap, and are
joined to one label."""
SAME_PLACE = 0.02
"""In the side view, two rovers share a label if their distance is below this fraction of the drawn length. At this
distance, the drawn rovers coincide nearly."""


def snapshots(trace: Trace, model: Model, count: int = 6) -> Figure:
    """Return the figure of a rover at evenly spaced moments of a drive. Later moments are darker.

    The side view shows the side with the less even terrain; the terrain under the other side is a dashed line. If the
    rover turns, or its wheels move sideways, so far that a single profile does not represent the terrain under the
    wheels, the figure has no side view. The view from above is drawn if the rover turns, or if there is no side view.

    Parameters
    ----------
    trace : Trace
        The drive.
    model : Model
        The model that was driven, for its rover and terrain.
    count : int
        Minimum number of moments; a long path gets one moment for each SPACING.
    """
    trace = on_the_ground(trace, model.rover, model.terrain)
    x, y = (trace.get(f"body_{name}", np.zeros(trace.t.size)) for name in "xy")
    # A long path gets more moments, so that the distance between two drawn rovers is about SPACING.
    distance = float(np.nansum(np.hypot(np.diff(x), np.diff(y))))
    rows = np.linspace(0, trace.t.size - 1, max(count, round((0.6 + distance) / SPACING))).astype(int)
    instants = poses(trace, model.rover, rows)
    extent, side = PathExtent.of(trace), _SideView(instants, model)
    # The side view is drawn only if it is true; the view from above if the rover turns or nothing else is drawn.
    views: list[_SideView | _AboveView] = [side] if extent.from_the_side and side.shows_ground_under_wheels else []
    if not views or extent.from_above:
        views.append(_AboveView(instants, model, trace))
    heights = [view.height for view in views]
    title = figure_text(in_lines(title_of(trace), TITLE_LENGTH))
    # The margin above the axes has room for two lines of the title; each further line makes the figure higher.
    top = MARGINS[3] + LINE * max(title.count("\n") - 1, 0)
    height = sum(heights) + MARGINS[2] + top + 0.5 * (len(views) - 1)
    figure, axes = sheet(len(views), (WIDTH, height), squeeze=False, height_ratios=heights)
    right = BAR if isinstance(views[-1], _AboveView) else MARGINS[1]
    figure.subplots_adjust(hspace=0.25, right=1.0 - right / WIDTH, top=1.0 - top / height)
    for view, panel in zip(views, axes[:, 0], strict=True):
        view.draw(panel)
    axes[0, 0].set_title(title, fontsize=FONT)
    return figure


class _View:
    """One view of the rover and the terrain, with equal scales of both axes.

    `low` and `high` are the smallest and the largest values of the two drawn coordinates [m]. `height` is the height of
    the panel [in], which follows from them.
    """

    def __init__(self, low: tuple[float, float], high: tuple[float, float]):
        self.low, self.high = low, high
        # The height of the panel follows from equal scales, within 1.0 to 5.5 in.
        inner = WIDTH - MARGINS[0] - MARGINS[1]
        self.height = min(max(inner * (high[1] - low[1]) / (high[0] - low[0]), 1.0), 5.5)

    def frame(self, axes: Axes, names: tuple[str, str]) -> None:
        """Set the limits of the axes, their labels and their equal scales. `names` are the names of the two
        coordinates.
        """
        limits = {"xlim": (self.low[0], self.high[0]), "ylim": (self.low[1], self.high[1])}
        axes.set(aspect="equal", xlabel=f"{names[0]} [m]", ylabel=f"{names[1]} [m]", **limits)


class _SideView(_View):
    """The view of the rover from one side, with the terrain under the wheels of this side."""

    def __init__(self, instants: list[Pose], model: Model):
        self.instants, self.model = instants, model
        centres, r = np.array([pose.centres for pose in instants]), _radius(model.rover)
        self.span = float(centres[..., 0].min()) - 3 * r, float(centres[..., 0].max()) + 3 * r
        self.y = {side: float(np.mean(centres[:, of_side(model.rover, side), 1])) for side in "lr"}
        ground = {side: model.terrain.height(np.linspace(*self.span, 500), y) for side, y in self.y.items()}
        # The side with the less even terrain is drawn; if both are equally even, the left side.
        self.side = max("lr", key=lambda side: (float(np.ptp(ground[side])), side == "l"))
        tops = [float(pose.q[2]) for pose in instants] + [float(centres[..., 2].max()) + r]
        self.top = max(tops) + 0.3 * r
        # The times stand in two lines above the rover. The distance of the lines is at least the height of a letter.
        metres_per_inch = (self.span[1] - self.span[0]) / (WIDTH - MARGINS[0] - MARGINS[1])
        self.line = max(0.9 * r, LINE * metres_per_inch)
        lowest = min(float(profile.min()) for profile in ground.values())
        # The drawing is true only if the profile at the mean y is close to the ground under the wheels everywhere.
        drawn = centres[:, of_side(model.rover, self.side)]
        under = model.terrain.height(drawn[..., 0], drawn[..., 1])
        profile = model.terrain.height(drawn[..., 0], np.full(drawn.shape[:-1], self.y[self.side]))
        self.shows_ground_under_wheels = bool(np.max(np.abs(under - profile)) < 0.25 * r)
        super().__init__((self.span[0], lowest - 0.05), (self.span[1], self.top + 2.2 * self.line + 0.05))

    def draw(self, axes: Axes) -> None:
        """Draw the terrain, the rover at each moment, and the times of the moments."""
        rover, far_side = self.model.rover, "r" if self.side == "l" else "l"
        draw_ground(axes, self.model.terrain, self.span, self.y[self.side], self.y[far_side])
        # Earlier moments are light and the last moment is black.
        for shade, pose in zip(np.linspace(0.65, 0.0, len(self.instants)), self.instants, strict=True):
            draw_rover(axes, rover, pose.q, str(shade), self.side)
        # Consecutive moments at almost one position share one label of their times.
        width = self.span[1] - self.span[0]
        groups: list[list[Pose]] = []
        for pose in self.instants:
            if groups and abs(pose.q[0] - groups[-1][-1].q[0]) < SAME_PLACE * width:
                groups[-1].append(pose)
            else:
                groups.append([pose])
        last, line = -math.inf, 0
        for group in sorted(groups, key=lambda members: float(members[0].q[0])):
            x, end = float(np.mean([pose.q[0] for pose in group])), f"{group[-1].t:.1f} s"
            # Labels alternate between two lines where they are closer than 9 % of the width.
            line = 1 - line if abs(x - last) < 0.09 * width else 0
            last = x
            when = end if len(group) == 1 else f"{group[0].t:.1f} to {end}"
            axes.text(x, self.top + self.line * line, when, ha="center", va="bottom", fontsize=FONT)
        self.frame(axes, ("x", "z"))
        side_name = "left" if self.side == "l" else "right"
        axes.text(
            0.995, 0.03, f"{side_name} wheels", transform=axes.transAxes, ha="right", fontsize=FONT, color="#555555"
        )


class _AboveView(_View):
    """The view of the rover from above, on a terrain whose colour shows its height."""

    def __init__(self, instants: list[Pose], model: Model, trace: Trace):
        self.instants, self.model, self.trace = instants, model, trace
        centres, r = np.array([pose.centres for pose in instants]), _radius(model.rover)
        low, high = centres.min(axis=(0, 1))[:2] - 3 * r, centres.max(axis=(0, 1))[:2] + 3 * r
        super().__init__((float(low[0]), float(low[1])), (float(high[0]), float(high[1])))

    def draw(self, axes: Axes) -> None:
        """Draw the terrain, the path of the body, the rover at each moment, and the times of the moments."""
        draw_heights(axes, self.model.terrain, (self.low[0], self.high[0], self.low[1], self.high[1]))
        axes.plot(self.trace["body_x"], self.trace["body_y"], color="#0072b2", lw=1)
        for shade, pose in zip(np.linspace(0.65, 0.0, len(self.instants)), self.instants, strict=True):
            draw_above(axes, self.model.rover, pose, str(shade))
        for (x, y), when in self._labels():
            axes.text(x, y, when, ha="center", va="center", fontsize=FONT, bbox=PAPER)
        self.frame(axes, ("x", "y"))

    def _labels(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield the position (2,) [m] and the text of each time label in the view from above.

        A label is in the middle of its rover, or ahead of the rover if several rovers overlap. Labels at one position
        are joined to one label.
        """
        # Size of a label in metres of the drawing, at the coarser of the two scales.
        metres_per_inch = max((self.high[0] - self.low[0]) / WIDTH, (self.high[1] - self.low[1]) / self.height)
        spacing = metres_per_inch * np.array(LABEL)
        middles = np.array([pose.centres[:, :2].mean(axis=0) for pose in self.instants])
        overlaps = (np.abs(middles[:, None] - middles) < spacing).all(axis=-1)
        places = []
        # A label must not leave the drawing. At the right, there is room for a joined label, which is wider.
        lowest, highest = np.array(self.low) + 0.5 * spacing, np.array(self.high) - spacing
        for pose, close, middle in zip(self.instants, overlaps, middles, strict=True):
            place = middle
            if close.sum() > 1:
                # The place is on the rover's centre line, 1.6 wheel radii ahead of its foremost wheels. Forward is the
                # left direction turned clockwise by 90 deg, seen from above.
                left = pose.left / max(float(np.linalg.norm(pose.left)), 1e-9)
                ahead = np.array([left[1], -left[0]])
                foremost = float(((pose.centres[:, :2] - middle) @ ahead).max())
                place = middle + ahead * (foremost + 1.6 * _radius(self.model.rover))
            places.append(np.clip(place, lowest, highest))
        # Labels that would overlap become one label, which lists or spans their times.
        groups: list[list[int]] = []
        for number, place in enumerate(places):
            close_groups = [group for group in groups if (np.abs(places[group[-1]] - place) < spacing).all()]
            if close_groups:
                close_groups[0].append(number)
            else:
                groups.append([number])
        for group in groups:
            times = [f"{self.instants[number].t:.1f}" for number in group]
            is_run = group == [*range(group[0], group[-1] + 1)]
            text = f"{times[0]} to {times[-1]}" if is_run else ", ".join(times)
            yield places[group[-1]], f"{text if len(group) > 1 else times[0]} s"


def _radius(rover: Rover) -> float:
    """Return the radius of the rover's largest wheel [m]. The margins of the drawings are multiples of this radius."""
    return max(float(wheel.wheel.r) for wheel in rover.wheels)


def title_of(trace: Trace) -> list[str]:
    """Return the parts of the title of a drive's figure: scenario, outcome, control, gravity and deepest sinkage."""
    attrs = trace.attrs
    parts = [
        str(attrs.get("scenario", "drive")),
        str(attrs.get("outcome") or f"stop: {attrs.get('stop', '-')}"),
        f"control: {re.sub(r'(?<=[a-z])(?=[A-Z])', ' ', str(attrs.get('control', '-'))).lower()}",
        f"g = {float(attrs.get('gravity_mps2', float('nan'))):.2f} m/s²",
    ]
    depths = {wheel: trace[f"sinkage_{wheel}"] for wheel in trace.wheels if f"sinkage_{wheel}" in trace}
    deepest = {wheel: float(np.nanmax(depth)) for wheel, depth in depths.items() if np.any(np.isfinite(depth))}
    if deepest:
        wheel = max(deepest, key=lambda name: deepest[name])
        parts.append(f"deepest sinkage {1e3 * deepest[wheel]:.1f} mm ({wheel})")
    return parts
