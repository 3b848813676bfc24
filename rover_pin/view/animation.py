"""A drive as a moving picture, GIF or MP4: from the side, and from above where it turns; slip against time below.

Another drive is drawn through it in blue outlines, as the ghost of the page in 3D.
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

from rover_pin.base.files.whole_file import replace_file
from rover_pin.simulation.trace.draw import wheel_lines
from rover_pin.simulation.trace.poses import Turned, around, footprint, of_side
from rover_pin.view.colours import draw_heights, slip_colour
from rover_pin.view.film import Film

PICTURES_PER_SECOND, MOST_PICTURES = 10, 100
"""Of the moving picture; a longer drive is shown faster than it was, which its title says."""
COLOURS = 64
"""Of a GIF, the same for all pictures: a third of the size that matplotlib's writer gives."""
GHOST = "#0072b2"

Draw = Callable[[int], None]
"""Sets an axes to a frame of the film."""


def write_animation(file: Path, film: Film, name: str, ghost: Film | None = None) -> Path:
    """Write a film as `.gif`, or as `.mp4` by ffmpeg; return its path.

    Raises DataError: the ghost is of another rover.
    """
    if ghost is not None:
        film.refuse_other(ghost)
    span = float(film.t[-1] - film.t[0])
    count = min(film.t.size, MOST_PICTURES, int(span * PICTURES_PER_SECOND) + 2)
    frames = np.unique(np.linspace(0, film.t.size - 1, count).astype(int))
    faster = span * PICTURES_PER_SECOND / len(frames)
    figure, draws = _figure(film, ghost)

    def show(frame: int) -> None:
        for draw in draws:
            draw(frame)
        speed = f"   ({faster:.2g} times as fast)" if faster > 1.15 else ""
        figure.axes[0].set_title(f"{name}   t = {film.t[frame]:.1f} s{speed}", fontsize=10)

    show(0)
    for _ in range(2):  # the second time with ticks that fit
        figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the same for all pictures, and laid out once
    moving = FuncAnimation(figure, show, frames=[int(frame) for frame in frames], init_func=lambda: None)
    writer = (FFMpegWriter if file.suffix == ".mp4" else PillowWriter)(fps=PICTURES_PER_SECOND)
    with tempfile.TemporaryDirectory() as place:
        rendered = Path(place) / f"made{file.suffix}"
        moving.save(rendered, writer=writer, dpi=100)
        return replace_file(file, rendered.read_bytes() if file.suffix == ".mp4" else _small(rendered))


def _small(gif: Path) -> bytes:
    """Return a GIF whose pictures share one palette, so that what stands still costs nothing."""
    with Image.open(gif) as picture:
        pictures, lasts = [frame.convert("RGB") for frame in ImageSequence.Iterator(picture)], picture.info["duration"]
    palette = pictures[len(pictures) // 2].quantize(COLOURS)
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in pictures)
    small = io.BytesIO()
    first.save(small, "GIF", save_all=True, append_images=others, duration=lasts, loop=0, optimize=True)
    return small.getvalue()


def _figure(film: Film, ghost: Film | None) -> tuple[Figure, list[Draw]]:
    """Return the figure and what sets it to a frame: from the side unless it turns far, from above if at all; slip."""
    turned = Turned.of(film.trace)
    views: list[tuple[Callable[[Axes, Film, Film | None], Draw], float]] = []
    if turned.side_tells:
        views.append((_side, _share(film, 2)))
    if turned.from_above:
        views.append((_above, _share(film, 1)))
    if film.slip is not None:
        views.append((_slip, 0.3))
    heights = [min(max(height, 0.16), 0.6) for _, height in views]
    figure = Figure(figsize=(6.0, 6.0 * sum(heights) + 0.9), layout="constrained")
    axes = figure.subplots(len(views), 1, height_ratios=heights, squeeze=False)[:, 0]
    return figure, [view(panel, film, ghost) for (view, _), panel in zip(views, axes, strict=True)]


def _share(film: Film, axis: int) -> float:
    """Return height over width of what a view shows, at equal scales."""
    box = film.box
    high = film.centres[..., axis].max() - film.centres[..., axis].min() + (0.3 if axis == 2 else 0.8)
    return float(high / (box.x_high - box.x_low))


def _side(axes: Axes, film: Film, ghost: Film | None) -> Draw:
    """Draw the left side and the ground under its wheels at every moment; dashed is that under the right ones."""
    box, floor = film.box, float(film.tracks[..., 2].min()) - 0.06
    x = np.linspace(box.x_low, box.x_high, 600)
    sides = {side: of_side(film.rover, side) for side in "lr"}
    high = float(film.centres[..., 2].max() + 0.2)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="z [m]", xlim=(box.x_low, box.x_high), ylim=(floor, high))
    sand = axes.add_patch(Polygon(np.zeros((3, 2)), fc="#d9c9a5", ec="#8a7340", lw=1))
    right_ground = axes.plot([], [], color="#8a7340", lw=0.9, ls="--")[0]
    rovers = [_rover(axes, film, sides["l"], None)]
    if ghost is not None:
        rovers.append(_as_ghost(film, ghost, _rover(axes, ghost, sides["l"], GHOST)))

    def draw(frame: int) -> None:
        under, under_right = (
            film.terrain.height(x, np.full(x.size, film.centres[frame, wheels, 1].mean())) for wheels in sides.values()
        )
        sand.set_xy(np.column_stack([[x[0], *x, x[-1]], [floor - 1.0, *under, floor - 1.0]]))
        right_ground.set_data(x, np.where(np.abs(under - under_right) > 1e-6, under_right, np.nan))
        for draw_rover in rovers:
            draw_rover(frame)

    return draw


def _rover(axes: Axes, film: Film, wheels: list[int], outline: str | None) -> Draw:
    """Draw rods and wheels of a side, coloured by slip, or in one colour's outlines."""
    rods = axes.plot([], [], color=outline or "#333333", lw=1.0 if outline else 1.8)[0]
    radii = {n: float(film.rover.wheels[n].wheel.r) for n in wheels}
    rims = {n: axes.add_patch(Circle((0, 0), r, ec=outline or "k", fc="none", lw=1)) for n, r in radii.items()}

    def draw(frame: int) -> None:
        rods.set_data(film.rods[frame, :, 0], film.rods[frame, :, 2])
        for n, rim in rims.items():
            rim.center = (float(film.centres[frame, n, 0]), float(film.centres[frame, n, 2]))
            if outline is None:
                rim.set_facecolor(_colour(film, frame, n))

    return draw


def _as_ghost(film: Film, ghost: Film, draw: Draw) -> Draw:
    """Return what draws the ghost at the time that a frame of the film has."""
    return lambda frame: draw(ghost.frame_at(float(film.t[frame])))


def _above(axes: Axes, film: Film, ghost: Film | None) -> Draw:
    """Draw the drive from above: the ground by its height, the tracks so far, the wheels as they are turned."""
    box = film.box
    draw_heights(axes, film.terrain, (box.x_low, box.x_high, box.y_low, box.y_high))
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", xlim=(box.x_low, box.x_high), ylim=(box.y_low, box.y_high))
    rovers = [_rover_above(axes, film, None)]
    if ghost is not None:
        rovers.append(_as_ghost(film, ghost, _rover_above(axes, ghost, GHOST)))

    def draw(frame: int) -> None:
        for draw_rover in rovers:
            draw_rover(frame)

    return draw


def _rover_above(axes: Axes, film: Film, outline: str | None) -> Draw:
    """Draw wheels, the line around them and their tracks, coloured by slip, or in one colour's outlines."""
    wheels = range(len(film.rover.wheels))
    lines = [axes.plot([], [], color=outline or "#8a7340", lw=0.6 if outline else 1.0)[0] for _ in wheels]
    rims = [axes.add_patch(Polygon(np.zeros((4, 2)), ec=outline or "k", fc="none", lw=0.8)) for _ in wheels]
    hull = axes.add_patch(Polygon(np.zeros((3, 2)), fc="none", ec=outline or "#333333", lw=1))

    def draw(frame: int) -> None:
        for n, mount in enumerate(film.rover.wheels):
            lines[n].set_data(film.centres[: frame + 1, n, 0], film.centres[: frame + 1, n, 1])
            rims[n].set_xy(footprint(mount, film.centres[frame, n], film.left[frame, n]))
            if outline is None:
                rims[n].set_facecolor(_colour(film, frame, n))
        hull.set_xy(film.centres[frame][around(film.rover), :2])

    return draw


def _slip(axes: Axes, film: Film, ghost: Film | None) -> Draw:
    """Draw slip against time, a cursor, and beside it the colours that wheels have at each slip."""
    assert film.slip is not None
    wheel_lines(axes, film.trace, "slip")
    handles, labels = axes.get_legend_handles_labels()
    if ghost is not None:
        handles, labels = [*handles, Line2D([], [], color=GHOST, lw=1)], [*labels, "outlines: the ghost"]
    axes.legend(handles, labels, fontsize=8.5, ncols=7, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    axes.set(xlabel="t [s]", ylabel="slip S [-]", xlim=(film.t[0], film.t[-1]))
    axes.grid(alpha=0.3)
    _key(axes)
    cursor = axes.axvline(film.t[0], color="k", lw=1)

    def draw(frame: int) -> None:
        cursor.set_xdata([film.t[frame]] * 2)

    return draw


def _key(axes: Axes) -> None:
    """Draw the colours of slip along the slip's own axis."""
    low, high = axes.get_ylim()
    edges = np.linspace(low, high, 101)
    colours = np.array([[slip_colour(float(slip))] for slip in 0.5 * (edges[1:] + edges[:-1])])
    strip = axes.inset_axes((1.005, 0.0, 0.02, 1.0))
    strip.imshow(colours, extent=(0.0, 1.0, low, high), origin="lower", aspect="auto")
    strip.set(xticks=[], yticks=[], ylim=(low, high))
    strip.set_ylabel("wheels' colour", fontsize=8.5)
    strip.yaxis.set_label_position("right")


def _colour(film: Film, frame: int, n: int) -> tuple[float, float, float]:
    return slip_colour(np.nan if film.slip is None else float(film.slip[frame, n]))
