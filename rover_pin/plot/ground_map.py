"""The figure of a terrain map: heights, slope, roughness, and predicted slip, energy and probability of being stuck."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
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
"""Column of a map that is drawn -> label of its panel."""
FRACTIONS = ("slip", "stuck", "p_stuck")
"""Columns of a map whose colours span 0 to 1. A slip outside this range (the rover slides back) has the colour of the
nearer end."""
NOWHERE = "#9c9c9c"
"""Grey, the colour of places on a map that have no finite number."""


def map_figure(
    terrain: Terrain, x: np.ndarray, y: np.ndarray, spacing: float, bands: Mapping[str, np.ndarray], title: str
) -> Figure:
    """Return the figure of a terrain map: the heights, and one panel for each column of LABELS that the map has.

    Parameters
    ----------
    terrain : Terrain
        The terrain whose heights are drawn.
    x, y : arrays (nx,), (ny,)
        Coordinates of the map's places [m], `spacing` [m] apart.
    bands : mapping of name -> array (nx, ny)
        Name of a column of the map -> its values at the places; places with a missing or infinite value are grey.
    title : str
        Title of the figure.
    """
    (left, right), (low, high) = ((axis[0] - 0.5 * spacing, axis[-1] + 0.5 * spacing) for axis in (x, y))
    tall = min(max((high - low) / (right - left), 0.25), 1.2)
    # Panels keep the proportions of the map, within limits that leave room for their labels. Two panels side by side
    # are 8 in wide, so that the labels can be read on a page of 690 pixels.
    figure, axes = new_figure(3, 2, (8.0, 2.4 + 8.4 * tall), sharex=True, sharey=True)
    draw_heights(axes[0, 0], terrain, (left, right, low, high))
    axes[0, 0].set(title="height", aspect="equal")
    drawn = [(name, label) for name, label in LABELS.items() if name in bands]
    for panel, (name, label) in zip(axes.flat[1:], drawn, strict=True):
        # Places without a finite number are masked, so that the grey of the panel shows through.
        values = np.ma.masked_invalid(bands[name].T)
        # Energy grows without bound towards places where the rover gets stuck.
        norm = "log" if name.startswith("energy") and np.ma.min(values) > 0.0 else "linear"
        image = panel.imshow(values, cmap="cividis", norm=norm, origin="lower", extent=(left, right, low, high))
        if name in FRACTIONS:
            image.set_clim(0.0, 1.0)
        panel.set(title=label, facecolor=NOWHERE)
        figure.colorbar(image, cax=panel.inset_axes((1.02, 0.0, 0.03, 1.0)))
    for panel in axes[-1]:
        panel.set_xlabel("x [m]")
    for panel in axes[:, 0]:
        panel.set_ylabel("y [m]")
    figure.suptitle(figure_text(title), fontsize=10)
    return figure
