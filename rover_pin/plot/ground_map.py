"""Ground from above: its heights, how it lies, and what becomes of a rover there."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from rover_pin.plot.sheet import new_figure
from rover_pin.terrain.terrain import Terrain
from rover_pin.view.colours import draw_heights

LABELS = {
    "slope_deg": "slope [deg]",
    "roughness_mm": "roughness [mm]",
    "slip": "slip [-]",
    "energy_J_per_m": "energy [J/m]",
    "stuck": "stuck, by one model's numbers",
    "p_stuck": "P(stuck)",
}
"""Columns of a map that are drawn."""
SHARES = ("slip", "stuck", "p_stuck")
"""Columns whose colours go from 0 to 1; slip is beyond where a rover slides back."""
NOWHERE = "#9c9c9c"


def map_figure(
    terrain: Terrain, x: np.ndarray, y: np.ndarray, spacing: float, bands: Mapping[str, np.ndarray], title: str
) -> Figure:
    """Return heights and the numbers (nx, ny) at places x, y [m]; grey is where a number is missing or infinite."""
    (left, right), (low, high) = ((axis[0] - 0.5 * spacing, axis[-1] + 0.5 * spacing) for axis in (x, y))
    tall = min(max((high - low) / (right - left), 0.25), 1.2)
    figure, axes = new_figure(2, 3, (12.0, 1.8 + 5.8 * tall), sharex=True, sharey=True)
    draw_heights(axes[0, 0], terrain, (left, right, low, high))
    axes[0, 0].set(title="height", aspect="equal")
    drawn = [(name, label) for name, label in LABELS.items() if name in bands]
    for panel, (name, label) in zip(axes.flat[1:], drawn, strict=True):
        values = np.ma.masked_invalid(bands[name].T)
        norm = "log" if name.startswith("energy") and np.ma.min(values) > 0.0 else "linear"
        image = panel.imshow(values, cmap="cividis", norm=norm, origin="lower", extent=(left, right, low, high))
        if name in SHARES:
            image.set_clim(0.0, 1.0)
        panel.set(title=label, facecolor=NOWHERE)
        figure.colorbar(image, cax=panel.inset_axes((1.02, 0.0, 0.03, 1.0)))
    for panel in axes[-1]:
        panel.set_xlabel("x [m]")
    for panel in axes[:, 0]:
        panel.set_ylabel("y [m]")
    figure.suptitle(title, fontsize=9)
    return figure
