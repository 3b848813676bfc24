"""The ground from above, by colours of its height."""

import numpy as np
from matplotlib.axes import Axes

from rover_pin.terrain.terrain import Terrain


def draw_heights(axes: Axes, terrain: Terrain, box: tuple[float, float, float, float]) -> None:
    """Colour the ground by its height, where it is not level, and draw what the colours mean beside it."""
    x, y = np.linspace(*box[:2], 400), np.linspace(*box[2:], 300)
    z = terrain.height(*np.meshgrid(x, y))
    if np.ptp(z) > 1e-6:
        ground = axes.pcolormesh(x, y, z, cmap="YlOrBr", alpha=0.5, shading="nearest", rasterized=True)
        bar = axes.inset_axes((1.01, 0.0, 0.02, 1.0))
        bar.set_title("z [m]", fontsize=9)
        axes.get_figure(root=True).colorbar(ground, cax=bar)
