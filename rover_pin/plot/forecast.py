"""The figure of the on-board monitor's forecasts during a recorded drive."""

import numpy as np
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
from rover_pin.onboard.monitor.monitor import CAUSES, Forecast
from rover_pin.onboard.monitor.source import ALARM
from rover_pin.plot.sheet import new_figure
from rover_pin.simulation.trace.draw import COLOURS


def forecast_figure(forecasts: list[Forecast], title: str) -> Figure:
    """Return the figure of the monitor's forecast probabilities against time.

    The upper panel shows the probabilities of getting stuck and of getting buried, and the lower panel shows the
    probabilities of the causes. The times of alarms are shaded grey.
    """
    figure, (upper, lower) = new_figure(2, size=(9.0, 5.0), sharex=True)
    t = np.array([forecast.t for forecast in forecasts])
    upper.plot(t, [forecast.p_stuck for forecast in forecasts], color=COLOURS[0], lw=1.2, label="stuck within 4 s")
    upper.plot(t, [forecast.p_buried for forecast in forecasts], color=COLOURS[4], lw=1.2, label="buried within 4 s")
    upper.axhline(ALARM, color="0.6", lw=0.8, ls=":")
    # The first three causes sum to P(stuck), so their areas are stacked; the two faults are stacked on top.
    lower.stackplot(t, np.array([forecast.causes for forecast in forecasts]).T, labels=CAUSES, colors=COLOURS)
    for axis, label in ((upper, "probability"), (lower, "cause")):
        # Grey for the times of alarms, behind the lines.
        axis.fill_between(
            t, 0.0, 1.0, where=[forecast.alarm for forecast in forecasts], color="0.85", step="post", zorder=0
        )
        axis.set(ylabel=label, ylim=(0.0, 1.02))
        axis.legend(fontsize=7, loc="upper left", ncols=3)
    lower.set_xlabel("t [s]")
    upper.set_title(figure_text(title), fontsize=9)
    return figure
