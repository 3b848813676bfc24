"""A drive as an animation (GIF or MP4). It shows the rover from the side, from above if the rover turns, and a plot of
slip against time.

A second drive of this rover, called the ghost, can be drawn over the first drive in blue outlines.
"""

import io
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from PIL import Image, ImageSequence

from rover_pin.base.encode import figure_text, missing_glyphs_allowed
from rover_pin.base.files.whole_file import replace_file
from rover_pin.simulation.trace.draw import wheel_lines
from rover_pin.simulation.trace.poses import PathExtent, around, footprint, of_side
from rover_pin.view.colours import draw_heights, slip_colour
from rover_pin.view.film import Film

PICTURES_PER_SECOND, MAX_PICTURES = 10, 100
"""Number of pictures per second of an animation, and maximum number of pictures in it. A drive that would need more
pictures is played faster than in reality, and the title states how much faster; the limit keeps the file small."""
COLOURS = 64
"""Number of colours of a GIF. All pictures share one palette of these colours. A GIF may have 256 colours; fewer
colours keep the file small."""
GHOST = "#0072b2"
"""Colour of the outlines of the ghost, the second drive."""

Draw = Callable[[int], None]
"""Type of a function that changes one plot of the figure so that it shows a frame of the film; the argument is the
index of the frame."""


def write_animation(file: Path, film: Film, name: str, ghost: Film | None = None) -> Path:
    """Write a drive as an animation, and return the path of the file.

    Parameters
    ----------
    file : Path
        The suffix decides the format: `.mp4` (needs ffmpeg), or a GIF for any other suffix.
    film, ghost : Film
        The drive, and optionally a second drive of its rover that is drawn over it.
    name : str
        Title of the figure.

    Raises
    ------
    DataError
        The ghost belongs to another rover, or the file cannot be written.
    """
    # The ghost is drawn with the shapes of this rover, so it must have the same wheels.
    if ghost is not None:
        film.refuse_other(ghost)
    span = float(film.t[-1] - film.t[0])
    # A long drive gets fewer pictures for each second, and the title states how much faster it runs.
    count = min(film.t.size, MAX_PICTURES, int(span * PICTURES_PER_SECOND) + 2)
    frames = np.unique(np.linspace(0, film.t.size - 1, count).astype(int))
    faster = span * PICTURES_PER_SECOND / len(frames)
    figure, draws = _figure(film, ghost)

    def show(frame: int) -> None:
        for draw in draws:
            draw(frame)
        speed = f"   ({faster:.2g} times as fast)" if faster > 1.15 else ""
        figure.axes[0].set_title(f"{figure_text(name)}   t = {film.t[frame]:.1f} s{speed}", fontsize=10)

    # The layout is computed once and then kept, so that nothing jumps between pictures. Two passes are needed: the
    # first one changes the ticks, and only the second one leaves room for the changed ticks.
    show(0)
    with missing_glyphs_allowed():
        for _ in range(2):
            figure.draw_without_rendering()
    figure.set_layout_engine("none")
    moving = FuncAnimation(figure, show, frames=[int(frame) for frame in frames], init_func=lambda: None)
    writer = (FFMpegWriter if file.suffix == ".mp4" else PillowWriter)(fps=PICTURES_PER_SECOND)
    with tempfile.TemporaryDirectory() as folder, missing_glyphs_allowed():
        rendered = Path(folder) / f"made{file.suffix}"
        moving.save(rendered, writer=writer, dpi=100)
        if file.suffix == ".mp4":
            return replace_file(file, rendered.read_bytes())
        # All pictures of a GIF get the same palette of colours, that of the picture in the middle of the drive. Parts
        # of a picture that do not change then take no space.
        with Image.open(rendered) as gif:
            pictures, lasts = [frame.convert("RGB") for frame in ImageSequence.Iterator(gif)], gif.info["duration"]
        palette = pictures[len(pictures) // 2].quantize(COLOURS)
        first, *others = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures)
        small = io.BytesIO()
        first.save(small, "GIF", save_all=True, append_images=others, duration=lasts, loop=0, optimize=True)
        return replace_file(file, small.getvalue())


def _figure(film: Film, ghost: Film | None) -> tuple[Figure, list[Draw]]:
    """Return the figure of an animation, and for each of its plots the function that makes the plot show a frame.

    The side view is omitted if the rover turns so far that this view would be useless. The view from above is omitted
    if the rover drives straight on. Slip is drawn if the trace contains it.
    """
    extent, box = PathExtent.of(film.trace), film.box
    length = box.x_high - box.x_low
    # Each entry is a function that draws a view, and the height of this view divided by its width.
    views: list[tuple[Callable[[Axes, Film, Film | None], Draw], float]] = []
    # Each view has equal scales along both axes, so its height follows from what the drive spans, plus a margin [m].
    if extent.from_the_side:
        views.append((_side, float(np.ptp(film.centres[..., 2]) + 0.3) / length))
    if extent.from_above:
        views.append((_above, float(np.ptp(film.centres[..., 1]) + 0.8) / length))
    if film.slip is not None:
        views.append((_slip, 0.3))
    heights = [min(max(height, 0.16), 0.6) for _, height in views]
    figure = Figure(figsize=(6.0, 6.0 * sum(heights) + 0.9), layout="constrained")
    axes = figure.subplots(len(views), 1, height_ratios=heights, squeeze=False)[:, 0]
    return figure, [view(panel, film, ghost) for (view, _), panel in zip(views, axes, strict=True)]


def _side(axes: Axes, film: Film, ghost: Film | None) -> Draw:
    """Draw the rover from its left side, on the terrain under its left wheels; return the function that makes the plot
    show a frame.

    The terrain under the right wheels is a dashed line where its height differs.
    """
    box, floor = film.box, float(film.tracks[..., 2].min()) - 0.06
    x = np.linspace(box.x_low, box.x_high, 600)
    sides = {side: of_side(film.rover, side) for side in "lr"}
    top = float(film.centres[..., 2].max() + 0.2)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="z [m]", xlim=(box.x_low, box.x_high), ylim=(floor, top))
    sand = axes.add_patch(Polygon(np.zeros((3, 2)), fc="#d9c9a5", ec="#8a7340", lw=1))
    right_ground = axes.plot([], [], color="#8a7340", lw=0.9, ls="--")[0]
    # The links and the wheels of the left side; the ghost is drawn over them as an outline.
    rovers = [_rover_from_side(axes, film, sides["l"], None)]
    if ghost is not None:
        rovers.append(_at_time_of(film, ghost, _rover_from_side(axes, ghost, sides["l"], GHOST)))

    def draw(frame: int) -> None:
        # On a slope across the path the two sides are at different heights, which change as the rover moves.
        under, under_right = (
            film.terrain.height(x, np.full(x.size, film.centres[frame, wheels, 1].mean())) for wheels in sides.values()
        )
        sand.set_xy(np.column_stack([[x[0], *x, x[-1]], [floor - 1.0, *under, floor - 1.0]]))
        right_ground.set_data(x, np.where(np.abs(under - under_right) > 1e-6, under_right, np.nan))
        for draw_rover in rovers:
            draw_rover(frame)

    return draw


def _rover_from_side(axes: Axes, film: Film, wheels: list[int], outline: str | None) -> Draw:
    """Draw the links and wheels of one side of a rover; return the function that makes the drawing show a frame.

    The wheels have the colour of their slip. If `outline` is a colour, everything is drawn as outlines of this colour.
    `wheels` are the indices of the wheels to draw.
    """
    rods = axes.plot([], [], color=outline or "#333333", lw=1.0 if outline else 1.8)[0]
    radii = {n: float(film.rover.wheels[n].wheel.r) for n in wheels}
    rims = {n: axes.add_patch(Circle((0, 0), r, ec=outline or "k", fc="none", lw=1)) for n, r in radii.items()}

    def draw(frame: int) -> None:
        # Side view: x to the right and z upwards.
        rods.set_data(film.rods[frame, :, 0], film.rods[frame, :, 2])
        for n, rim in rims.items():
            rim.center = (float(film.centres[frame, n, 0]), float(film.centres[frame, n, 2]))
            if outline is None:
                rim.set_facecolor(_colour(film, frame, n))

    return draw


def _above(axes: Axes, film: Film, ghost: Film | None) -> Draw:
    """Draw the drive from above, and return the function that makes the plot show a frame.

    The plot shows the terrain coloured by height, the tracks of the wheels up to the frame, and the wheels with their
    steering angles.
    """
    box = film.box
    draw_heights(axes, film.terrain, (box.x_low, box.x_high, box.y_low, box.y_high))
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", xlim=(box.x_low, box.x_high), ylim=(box.y_low, box.y_high))
    rovers = [_rover_from_above(axes, film, None)]
    if ghost is not None:
        rovers.append(_at_time_of(film, ghost, _rover_from_above(axes, ghost, GHOST)))

    def draw(frame: int) -> None:
        for draw_rover in rovers:
            draw_rover(frame)

    return draw


def _rover_from_above(axes: Axes, film: Film, outline: str | None) -> Draw:
    """Draw a rover from above, with the tracks of its wheels; return the function that makes the drawing show a frame.

    The wheels have the colour of their slip. If `outline` is a colour, everything is drawn as outlines of this
    colour.
    """
    wheels = range(len(film.rover.wheels))
    lines = [axes.plot([], [], color=outline or "#8a7340", lw=0.6 if outline else 1.0)[0] for _ in wheels]
    rims = [axes.add_patch(Polygon(np.zeros((4, 2)), ec=outline or "k", fc="none", lw=0.8)) for _ in wheels]
    hull = axes.add_patch(Polygon(np.zeros((3, 2)), fc="none", ec=outline or "#333333", lw=1))

    def draw(frame: int) -> None:
        # The track of a wheel is the path of its centre up to this frame.
        for n, mount in enumerate(film.rover.wheels):
            lines[n].set_data(film.centres[: frame + 1, n, 0], film.centres[: frame + 1, n, 1])
            rims[n].set_xy(footprint(mount, film.centres[frame, n], film.left[frame, n]))
            if outline is None:
                rims[n].set_facecolor(_colour(film, frame, n))
        hull.set_xy(film.centres[frame][around(film.rover), :2])

    return draw


def _at_time_of(film: Film, ghost: Film, draw: Draw) -> Draw:
    """Return a function that takes a frame of the film and draws the ghost at the time of this frame.

    `draw` draws a frame of the ghost. The times of the ghost's frames may differ from the times of the film's frames,
    so that the ghost's last frame up to this time is drawn.
    """
    return lambda frame: draw(ghost.frame_at(float(film.t[frame])))


def _slip(axes: Axes, film: Film, ghost: Film | None) -> Draw:
    """Draw slip against time, with a cursor at the time of the frame; return the function that makes the plot show a
    frame.

    A strip next to the axis shows which colour a wheel has at each slip.
    """
    assert film.slip is not None
    wheel_lines(axes, film.trace, "slip")
    handles, labels = axes.get_legend_handles_labels()
    if ghost is not None:
        handles, labels = [*handles, Line2D([], [], color=GHOST, lw=1)], [*labels, "outlines: the ghost"]
    axes.legend(handles, labels, fontsize=8.5, ncols=7, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    axes.set(xlabel="t [s]", ylabel="slip S [-]", xlim=(film.t[0], film.t[-1]))
    axes.grid(alpha=0.3)

    # The colours are drawn along the limits that the slip axis has now, so that each colour is next to its slip.
    low, high = axes.get_ylim()
    edges = np.linspace(low, high, 101)
    colours = np.array([[slip_colour(float(slip))] for slip in 0.5 * (edges[1:] + edges[:-1])])
    strip = axes.inset_axes((1.005, 0.0, 0.02, 1.0))
    strip.imshow(colours, extent=(0.0, 1.0, low, high), origin="lower", aspect="auto")
    strip.set(xticks=[], yticks=[], ylim=(low, high))
    strip.set_ylabel("wheels' colour", fontsize=8.5)
    strip.yaxis.set_label_position("right")
    cursor = axes.axvline(film.t[0], color="k", lw=1)

    def draw(frame: int) -> None:
        cursor.set_xdata([film.t[frame]] * 2)

    return draw


def _colour(film: Film, frame: int, n: int) -> tuple[float, float, float]:
    """Return the colour (red, green, blue) of wheel number `n` at a frame; grey if the trace has no slip."""
    return slip_colour(np.nan if film.slip is None else float(film.slip[frame, n]))
