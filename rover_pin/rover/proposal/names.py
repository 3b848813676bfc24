"""Names beside points of a drawing, none over another."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox, BboxBase

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
            taken.append(_written(panel, name, taken))


def _written(axes: Axes, name: Name, taken: Sequence[Bbox]) -> Bbox:
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
                _joined(axes, name, box)
            return box
    return first


def _within(box: Bbox, outer: BboxBase) -> bool:
    return bool(outer.x0 < box.x0 and outer.y0 < box.y0 and box.x1 < outer.x1 and box.y1 < outer.y1)


def _joined(axes: Axes, name: Name, box: Bbox) -> None:
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
