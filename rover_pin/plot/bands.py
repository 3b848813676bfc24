"""The figure of a drive that several equally probable models predict: median and range of the predictions."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
from rover_pin.simulation.trace.draw import COLOURS


def bands_figure(t: np.ndarray, panels: Mapping[str, np.ndarray], title: str) -> Figure:
    """Return the figure of the predictions of several models against time: their median, middle half and full range.

    Parameters
    ----------
    t : array (T,)
        Time [s].
    panels : mapping of label -> array (models, T)
        For each panel, its label with unit, and the prediction of each model.
    title : str
        Title of the figure.
    """
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True)
    for panel, (label, rows) in zip(axes, panels.items(), strict=True):
        # Quantiles over the models at each time: minimum, lower quartile, median, upper quartile, maximum.
        low, quarter, middle, upper, high = np.quantile(rows, (0.0, 0.25, 0.5, 0.75, 1.0), axis=0)
        colour = COLOURS[0]
        panel.fill_between(t, low, high, color=colour, alpha=0.15, lw=0, label=f"all {len(rows)} models")
        panel.fill_between(t, quarter, upper, color=colour, alpha=0.3, lw=0, label="middle half")
        panel.plot(t, middle, color=colour, lw=1.4, label="median")
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
    axes[0].set_title(figure_text(title), fontsize=9, loc="left")
    axes[-1].set_xlabel("t [s]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure
