"""Side and plan view of a rover with short names of its parts: to see whether roles were guessed right."""

import io
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pinocchio as pin
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.transforms import Bbox, BboxBase

from rover_pin.base.files.whole_file import replace_file
from rover_pin.rover.rover import Rover

SIZE, GAP, ROW, FAR = 8, 4.0, 11.0, 12
"""Size of the letters, space from a point to its name, height of a row of names [pt], and how many rows off at most."""


class Name(NamedTuple):
    """A name, the point that it is of in the axes' units, and its colour."""

    text: str
    at: tuple[float, float]
    colour: str


def place_names(axes: Sequence[Axes], names: Sequence[Sequence[Name]]) -> None:
    """Write names into each of the axes, each at the nearest place that covers no other name and no point.

    Places are tried row by row from the point up and down, right of it, left of it and about it; a name that is not
    right beside its point has a line to it. Names keep within the axes. Where no place is left, a name is written
    right above its point. Call it when all else is drawn: the layout is settled here, and kept.
    """
    figure = axes[0].get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for panel, its in zip(axes, names, strict=True):
        points = panel.transData.transform([name.at for name in its])
        taken = [Bbox.from_extents(*(point - GAP), *(point + GAP)) for point in points]
        for name in its:
            taken.append(_write_name(panel, name, taken))


def _write_name(axes: Axes, name: Name, taken: Sequence[Bbox]) -> Bbox:
    """Write a name at the first free place; return the place in pixels."""
    note = axes.annotate(name.text, name.at, color=name.colour, fontsize=SIZE, xytext=(GAP, GAP),
                         textcoords="offset points", in_layout=False)  # fmt: skip
    note.set_path_effects([patheffects.withStroke(linewidth=2.0, foreground="white")])
    first, point = note.get_window_extent(), 72.0 / axes.figure.dpi
    for row, across, up in _offsets(first.width * point):
        box = first.translated((across - GAP) / point, (up - GAP) / point)
        if _within(box, axes.bbox) and not any(box.overlaps(occupied) for occupied in taken):
            note.set_position((across, up))
            if row > 0:
                _draw_line(axes, name, box)
            return box
    return first


def _within(box: Bbox, outer: BboxBase) -> bool:
    return bool(outer.x0 < box.x0 and outer.y0 < box.y0 and box.x1 < outer.x1 and box.y1 < outer.y1)


def _draw_line(axes: Axes, name: Name, box: Bbox) -> None:
    """Draw a line from a point to the nearest place of its name's box."""
    x, y = axes.transData.transform(name.at)
    end = min(max(x, box.x0), box.x1), min(max(y, box.y0), box.y1)
    (x, y), (at_x, at_y) = name.at, axes.transData.inverted().transform(end)
    axes.plot([x, at_x], [y, at_y], color=name.colour, lw=0.5, scalex=False, scaley=False)


def _offsets(width: float) -> Iterator[tuple[int, float, float]]:
    """Yield how many rows off, and the offset of a name's lower left corner from its point [pt], the nearest first."""
    for row in range(FAR):
        for up in (GAP + row * ROW, -GAP - ROW * (row + 0.75)):
            for across in (GAP, -GAP - width, -0.5 * width):
                yield row, across, up


GREY, BLUE, RED = "#555555", "#1f5fa8", "#b03030"


def write_picture(rover: Rover, file: Path) -> Path:
    """Write `picture` as PNG."""
    content = io.BytesIO()
    picture(rover).savefig(content, dpi=110, format="png")
    return replace_file(file, content.getvalue())


def picture(rover: Rover) -> Figure:
    """Draw side view (left side) and plan view of a rover at zero angles, with the names of its joints."""
    figure = Figure(figsize=(11.0, 10.0), layout="constrained")
    side, plan = figure.subplots(2, 1)
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, pin.neutral(rover.model))
    names = [_side(side, rover, data), _plan(plan, rover, data)]
    centre = pin.centerOfMass(rover.model, data, pin.neutral(rover.model))
    for axes, panel_names, (i, k), words in ((side, names[0], (0, 2), "z [m]"), (plan, names[1], (0, 1), "y [m]")):
        axes.plot(centre[i], centre[k], "x", color=RED, ms=9, mew=2)
        panel_names.append(Name("centre of mass", (centre[i], centre[k]), RED))
        axes.set(aspect="equal", xlabel="x, forward [m]", ylabel=words)
        axes.grid(alpha=0.3)
        axes.margins(0.15)
    side.set_title(f"{rover.name}: {rover.mass:.3g} kg, {len(rover.wheels)} wheels; left side", fontsize=10)
    place_names((side, plan), names)
    return figure


def _side(axes: Axes, rover: Rover, data: pin.Data) -> list[Name]:
    left = [wheel for wheel in rover.wheels if wheel.side == "l"]
    joints = {joint for wheel in left for joint in rover.model.supports[wheel.joint]} - {0, 1}
    for wheel in left:
        x, _, z = data.oMi[wheel.joint].translation
        axes.add_patch(Circle((x, z), float(wheel.wheel.r), fill=False, color=BLUE, lw=1.5))
    return _joints(axes, rover, data, sorted(joints), (0, 2))


def _plan(axes: Axes, rover: Rover, data: pin.Data) -> list[Name]:
    for wheel in rover.wheels:
        (x, y, _), r, b = data.oMi[wheel.joint].translation, float(wheel.wheel.r), float(wheel.wheel.b)
        axes.add_patch(Rectangle((x - r, y - b / 2), 2 * r, b, fill=False, color=BLUE, lw=1.5))
    return _joints(axes, rover, data, range(2, rover.model.njoints), (0, 1))


def _joints(axes: Axes, rover: Rover, data: pin.Data, joints: Iterable[int], plane: tuple[int, int]) -> list[Name]:
    """Draw joints and the links between them along two axes of the base; return the joints' names."""
    wheels, names = {wheel.joint for wheel in rover.wheels}, []
    for joint in joints:
        start, end = (data.oMi[index].translation[list(plane)] for index in (rover.model.parents[joint], joint))
        colour = BLUE if joint in wheels else GREY
        axes.plot(*zip(start, end, strict=True), color=GREY, lw=1.5)
        axes.plot(*end, "o", color=colour, ms=4)
        names.append(Name(rover.model.names[joint], tuple(end), colour))
    return names
