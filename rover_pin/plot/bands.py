"""A drive on several equally probable models: what they agree on, and how far apart they are."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from rover_pin.simulation.trace.draw import COLOURS


def bands_figure(t: np.ndarray, panels: Mapping[str, np.ndarray], title: str) -> Figure:
    """Return rows (models, T) by their label against time: the median, the middle half, and the range of all models."""
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True)
    for panel, (label, rows) in zip(axes, panels.items(), strict=True):
        low, quarter, middle, upper, high = np.quantile(rows, (0.0, 0.25, 0.5, 0.75, 1.0), axis=0)
        colour = COLOURS[0]
        panel.fill_between(t, low, high, color=colour, alpha=0.15, lw=0, label=f"all {len(rows)} models")
        panel.fill_between(t, quarter, upper, color=colour, alpha=0.3, lw=0, label="middle half")
        panel.plot(t, middle, color=colour, lw=1.4, label="median")
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
    axes[0].set_title(title, fontsize=9, loc="left")
    axes[-1].set_xlabel("t [s]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure
