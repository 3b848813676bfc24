"""The picture of a proposed rover: side view and plan view with the names of the joints. It shows wrong guesses to the
user.
"""

import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import pinocchio as pin
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.transforms import Bbox

from rover_pin.base.encode import figure_text, missing_glyphs_allowed
from rover_pin.base.files.whole_file import replace_file
from rover_pin.rover.rover import Rover

FONT_SIZE, GAP, ROW = 8, 4.0, 11.0
"""Size of the letters (FONT_SIZE), distance of a name from the point that it labels (GAP), and height of a row of names
(ROW) [pt]. A row must be higher than a letter, so that names do not touch."""
MAX_ROWS = 12
"""Largest distance between a name and the point that it labels, in rows of names. If no position within this distance
is free, the name is written directly above its point. A reader could hardly follow a longer line from a name to its
point."""


class Name(NamedTuple):
    """A name in a figure, and the point that it labels."""

    text: str
    at: tuple[float, float]
    "the point, in the units of the plot's axes"
    colour: str


def place_names(axes: Sequence[Axes], names: Sequence[Sequence[Name]]) -> None:
    """Write names into plots. Each name is drawn close to its point, without covering another name or a point.

    Positions are tried row by row, above and below the point, to its right, to its left and centred. A name that is not
    directly next to its point gets a line to the point. All names stay inside the plot. If no position is free, the
    name is written directly above its point. Call this function last, because it fixes the layout of the figure.

    Parameters
    ----------
    axes : sequence of Axes
        The plots of one figure.
    names : sequence of sequences of Name
        The names of each plot.
    """
    figure = axes[0].get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    # Names avoid all points, and all names that were written before them.
    for panel, panel_names in zip(axes, names, strict=True):
        points = panel.transData.transform([name.at for name in panel_names])
        taken = [Bbox.from_extents(*(point - GAP), *(point + GAP)) for point in points]
        for name in panel_names:
            taken.append(_write_name(panel, name, taken))


def _write_name(axes: Axes, name: Name, taken: Sequence[Bbox]) -> Bbox:
    """Write a name at the first free position, and return the box of the name [pixels].

    `taken` are the boxes that the name must not cover [pixels].
    """
    note = axes.annotate(figure_text(name.text), name.at, color=name.colour, fontsize=FONT_SIZE, xytext=(GAP, GAP),
                         textcoords="offset points", in_layout=False)  # fmt: skip
    note.set_path_effects([patheffects.withStroke(linewidth=2.0, foreground="white")])
    # One pixel has the size `point` [pt].
    first, point = note.get_window_extent(), 72.0 / axes.figure.dpi
    width, outer = first.width * point, axes.bbox
    # Offsets of the name's lower left corner from its point [pt], the nearest first: above and below, then to the
    # right, to the left, and centred.
    offsets = [
        (row, across, up)
        for row in range(MAX_ROWS)
        for up in (GAP + row * ROW, -GAP - ROW * (row + 0.75))
        for across in (GAP, -GAP - width, -0.5 * width)
    ]
    for row, across, up in offsets:
        box = first.translated((across - GAP) / point, (up - GAP) / point)
        inside = outer.x0 < box.x0 and outer.y0 < box.y0 and box.x1 < outer.x1 and box.y1 < outer.y1
        if not inside or any(box.overlaps(occupied) for occupied in taken):
            continue
        note.set_position((across, up))
        if row > 0:
            # A line from the point to the nearest point of the box shows to which point the name belongs.
            x, y = axes.transData.transform(name.at)
            end = min(max(x, box.x0), box.x1), min(max(y, box.y0), box.y1)
            (x, y), (at_x, at_y) = name.at, axes.transData.inverted().transform(end)
            axes.plot([x, at_x], [y, at_y], color=name.colour, lw=0.5, scalex=False, scaley=False)
        return box
    return first


GREY, BLUE, RED = "#555555", "#1f5fa8", "#b03030"
"""Colours of links, of wheels and of the centre of mass."""


def write_picture(rover: Rover, file: Path) -> Path:
    """Write the picture of a rover (side view and plan view with joint names) as a PNG file; return the path of the
    file.
    """
    content = io.BytesIO()
    with missing_glyphs_allowed():
        picture(rover).savefig(content, dpi=110, format="png")
    return replace_file(file, content.getvalue())


def picture(rover: Rover) -> Figure:
    """Return a figure of a rover at zero angles: the left side view and the plan view, with the names of the joints."""
    figure = Figure(figsize=(11.0, 10.0), layout="constrained")
    side, plan = figure.subplots(2, 1)
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, pin.neutral(rover.model))
    # Wheels are drawn as circles in the side view, which shows the left side only, and as rectangles in the plan view.
    for wheel in rover.wheels:
        (x, y, z), r, b = data.oMi[wheel.joint].translation, float(wheel.wheel.r), float(wheel.wheel.b)
        if wheel.side == "l":
            side.add_patch(Circle((x, z), r, fill=False, color=BLUE, lw=1.5))
        plan.add_patch(Rectangle((x - r, y - b / 2), 2 * r, b, fill=False, color=BLUE, lw=1.5))
    names = [
        _joints(side, rover, data, rover.joints_of_side("l"), (0, 2)),
        _joints(plan, rover, data, range(2, rover.model.njoints), (0, 1)),
    ]
    centre = pin.centerOfMass(rover.model, data, pin.neutral(rover.model))
    for axes, panel_names, (i, k), words in ((side, names[0], (0, 2), "z [m]"), (plan, names[1], (0, 1), "y [m]")):
        axes.plot(centre[i], centre[k], "x", color=RED, ms=9, mew=2)
        panel_names.append(Name("centre of mass", (centre[i], centre[k]), RED))
        axes.set(aspect="equal", xlabel="x, forward [m]", ylabel=words)
        axes.grid(alpha=0.3)
        axes.margins(0.15)
    side.set_title(
        f"{figure_text(rover.name)}: {rover.mass:.3g} kg, {len(rover.wheels)} wheels; left side", fontsize=10
    )
    place_names((side, plan), names)
    return figure


def _joints(axes: Axes, rover: Rover, data: pin.Data, joints: Iterable[int], plane: tuple[int, int]) -> list[Name]:
    """Draw joints and the lines between them into a plot, and return the names of the joints with their positions.

    Parameters
    ----------
    axes : Axes
        The plot.
    rover, data : Rover, pin.Data
        The rover, and Pinocchio's data with the positions of its joints.
    joints : iterable of int
        Indices of the joints in Pinocchio's model.
    plane : tuple of int
        Indices of the horizontal and the vertical axis of the plot among x, y, z, for example (0, 2) for x and z.
    """
    wheels, names = {wheel.joint for wheel in rover.wheels}, []
    for joint in joints:
        start, end = (data.oMi[index].translation[list(plane)] for index in (rover.model.parents[joint], joint))
        colour = BLUE if joint in wheels else GREY
        axes.plot(*zip(start, end, strict=True), color=GREY, lw=1.5)
        axes.plot(*end, "o", color=colour, ms=4)
        names.append(Name(rover.model.names[joint], tuple(end), colour))
    return names
