"""The figure of the slope of growing inclination: every curve of its legend is drawn in every panel."""

import fig8_slope as study
import numpy as np
from matplotlib.colors import same_color

from rover_pin.scenarios.scenario import scenario


def is_in_view(line, axes):
    """Return whether a line has a point inside the axes."""
    x, y = line.get_data(orig=False)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    return bool(np.any((x >= left) & (x <= right) & (y >= low) & (y <= high)))


def test_every_curve_of_the_legend_is_drawn_in_every_panel():
    """With the net form the rover does not reach the slope. Its single point must be drawn, and the legend must state
    this.
    """
    torque, _, net, *_ = study.READINGS
    traces = {
        reading.label: scenario("slope", soil="table-1", duration=14.0, **reading.settings).drive(measure_error=False)
        for reading in (torque, net)
    }
    figure = study.draw(traces)
    (legend,) = figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert names[:2] == [torque.label, f"{net.label} (stays on the flat)"]
    for handle in legend.legend_handles[:2]:
        colour = handle.get_color()
        for axes in figure.axes:
            assert [line for line in axes.lines if same_color(line.get_color(), colour) and is_in_view(line, axes)]
