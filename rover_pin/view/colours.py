"""Heights as shades, and colours of slip: blue where a wheel brakes, pale where it rolls, to dark red where it spins.

They differ in lightness too, so that they are distinct without colours.
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
"""Slip -> red, green, blue in 0..1; linear in between."""
UNKNOWN = (0.45, 0.47, 0.50)
STEPS = 20
"""Colours of a unit of slip: a wheel's is sent anew only where it changes by one."""


def slip_colour(slip: float) -> tuple[float, float, float]:
    """Return the colour of a slip; grey where it is not known."""
    if not np.isfinite(slip):
        return UNKNOWN
    at = [stop[0] for stop in STOPS]
    rounded = round(slip * STEPS) / STEPS
    r, g, b = (float(np.interp(rounded, at, [stop[1][i] for stop in STOPS])) for i in range(3))
    return r, g, b


def in_bytes(colour: tuple[float, float, float]) -> tuple[int, int, int]:
    """Return a colour as three whole numbers from 0 to 255."""
    r, g, b = (round(255.0 * channel) for channel in colour)
    return r, g, b


def css_gradient() -> str:
    """Return the colours from slip -1 to 1 as a CSS gradient."""
    stops = (f"rgb{in_bytes(colour)} {50.0 * (at + 1.0):g}%" for at, colour in STOPS)
    return f"linear-gradient(to right, {', '.join(stops)})"


def draw_heights(axes: Axes, terrain: Terrain, box: tuple[float, float, float, float]) -> None:
    """Colour the ground by its height, where it is not level, and draw what the colours mean beside it."""
    x, y = np.linspace(*box[:2], 400), np.linspace(*box[2:], 300)
    z = terrain.height(*np.meshgrid(x, y))
    if np.ptp(z) > 1e-6:
        ground = axes.pcolormesh(x, y, z, cmap="YlOrBr", alpha=0.5, shading="nearest", rasterized=True)
        bar = axes.inset_axes((1.01, 0.0, 0.02, 1.0))
        bar.set_title("z [m]", fontsize=9)
        axes.get_figure(root=True).colorbar(ground, cax=bar)
