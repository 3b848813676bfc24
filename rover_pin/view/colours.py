"""Colours of slip (blue: the wheel brakes, pale: it rolls, dark red: it spins) and of the height of the terrain in
views.

The colours of slip also differ in lightness, so that readers who cannot distinguish the colours can read them.
"""

import numpy as np
from matplotlib.axes import Axes

from rover_pin.terrain.terrain import Terrain

STOPS: tuple[tuple[float, tuple[float, float, float]], ...] = (
    (-1.0, (0.13, 0.30, 0.62)),
    (0.0, (0.93, 0.93, 0.86)),
    (0.5, (0.95, 0.62, 0.18)),
    (1.0, (0.55, 0.05, 0.10)),
)
"""Pairs of a slip and its colour (red, green, blue in 0..1); colours of slips between two pairs are interpolated. The
lightness falls from slip 0 to both ends, so that the colours can also be read in black and white."""
UNKNOWN = (0.45, 0.47, 0.50)
"""Colour of a wheel whose slip is not known: grey, which is not a colour of any slip."""
COLOURS_PER_SLIP = 20
"""Number of different colours for one unit of slip. Slip is rounded to these colours, because the page stores the
colour of a wheel only when it changes."""


def slip_colour(slip: float) -> tuple[float, float, float]:
    """Return the colour of a slip, as red, green and blue in 0..1; grey if the slip is not finite."""
    if not np.isfinite(slip):
        return UNKNOWN
    slips = [slip_at_stop for slip_at_stop, _ in STOPS]
    rounded = round(slip * COLOURS_PER_SLIP) / COLOURS_PER_SLIP
    r, g, b = (float(np.interp(rounded, slips, [colour[i] for _, colour in STOPS])) for i in range(3))
    return r, g, b


def in_bytes(colour: tuple[float, float, float]) -> tuple[int, int, int]:
    """Return a colour, given as red, green and blue from 0 to 1, as three whole numbers from 0 to 255."""
    r, g, b = (round(255.0 * channel) for channel in colour)
    return r, g, b


def css_gradient() -> str:
    """Return the colours of slip from -1 to 1 as a gradient in CSS, for the legend of a page."""
    stops = (f"rgb{in_bytes(colour)} {50.0 * (slip + 1.0):g}%" for slip, colour in STOPS)
    return f"linear-gradient(to right, {', '.join(stops)})"


def draw_heights(axes: Axes, terrain: Terrain, box: tuple[float, float, float, float]) -> None:
    """Draw the terrain in a view from above, coloured by height, with a colour bar. Level terrain is not coloured.

    Parameters
    ----------
    axes : Axes
        A view from above, x to the right and y upwards.
    terrain : Terrain
        The ground.
    box : tuple
        Smallest and largest x, smallest and largest y of the coloured part [m].
    """
    x, y = np.linspace(*box[:2], 400), np.linspace(*box[2:], 300)
    z = terrain.height(*np.meshgrid(x, y))
    if np.ptp(z) > 1e-6:
        ground = axes.pcolormesh(x, y, z, cmap="YlOrBr", alpha=0.5, shading="nearest", rasterized=True)
        bar = axes.inset_axes((1.01, 0.0, 0.02, 1.0))
        bar.set_title("z [m]", fontsize=9)
        axes.get_figure(root=True).colorbar(ground, cax=bar)
