"""Plots of channels against time. Lines differ in style and in colour; the colour-blind can distinguish the colours
too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Trace = Any
"""A `simulation.trace.trace.Trace`. That class draws its plots with this module, so that this module cannot import the
class."""

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#999999", "#000000", "#f0e442")
"""Colours of lines, the palette of Okabe and Ito, which the colour-blind can distinguish: blue, orange, green, pink,
vermilion, sky, grey, black, yellow."""
STYLES = {"l": "-", "r": "--"}
"""Side of a wheel (l: left, r: right) -> style of its line."""
OVERLAP_TOLERANCE = 2e-3
"""Largest distance between two lines that look like one line, as a fraction of the range of all values in the plot: 0.2
% is less than the width of a line. Such lines are drawn once, with both names."""


def draw(trace: Trace, names: Sequence[str], axes: Axes) -> Axes:
    """Draw channels of a trace against time, and return the axes.

    Parameters
    ----------
    trace : Trace
        A simulated or measured drive.
    names : sequence of str
        Names of channels. A name may also be the common part of the names of a channel of all wheels, such as `slip`.
    axes : Axes
        Matplotlib's axes to draw into.
    """
    # A name that is no channel itself stands for the channels of all wheels.
    lines: dict[str, np.ndarray] = {}
    for name in names:
        channels = [
            channel
            for wheel in trace.wheels
            for channel in (f"{name}_{wheel}", f"{name}_{wheel}_A")
            if channel in trace
        ]
        lines |= {channel: trace[channel] for channel in (channels if channels and name not in trace else [name])}
    units = {trace.unit(name) for name in lines}
    draw_lines(axes, trace.t, lines, {name: _look(trace, name, n) for n, name in enumerate(lines)})
    axes.legend(fontsize=7, ncols=3, loc="best")
    axes.set(xlabel="t [s]", ylabel=f"{', '.join(names)} [{' or '.join(sorted(units))}]")
    axes.grid(alpha=0.3)
    return axes


def wheel_lines(axes: Axes, trace: Trace, channel: str, scale: float = 1.0) -> None:
    """Draw a channel of all wheels against time, multiplied by `scale`. The lines are labelled by the wheels' names; no
    legend is drawn, because several plots of a figure may share one.
    """
    names = [wheel for wheel in trace.wheels if f"{channel}_{wheel}" in trace]
    lines = {wheel: scale * trace[f"{channel}_{wheel}"] for wheel in names}
    draw_lines(axes, trace.t, lines, {wheel: _look(trace, wheel, n) for n, wheel in enumerate(names)})


def draw_lines(
    axes: Axes, t: np.ndarray, lines: Mapping[str, np.ndarray], looks: Mapping[str, Mapping[str, Any]]
) -> None:
    """Draw lines against time, without a legend. If lines are too close to be distinguished, only one of them is drawn,
    with a label that contains all their names.

    Parameters
    ----------
    axes : Axes
        Matplotlib's axes to draw into.
    t : array (T,)
        Times [s].
    lines : mapping
        Name of a line -> its values (T,).
    looks : mapping
        Name of a line -> matplotlib's options for its colour and style.
    """
    for group in group_overlapping_lines(lines):
        axes.plot(t, lines[group[0]], lw=1.2, label=" = ".join(group), **looks[group[0]])


def group_overlapping_lines(lines: Mapping[str, np.ndarray]) -> list[list[str]]:
    """Return the names of the lines in groups. The lines of a group are too close to be distinguished in a plot
    (OVERLAP_TOLERANCE).
    """
    all_values = np.concatenate([line[np.isfinite(line)] for line in lines.values()]) if lines else np.zeros(0)
    tolerance = max(OVERLAP_TOLERANCE * float(np.ptp(all_values)) if all_values.size else 0.0, 1e-9)
    # Each line joins the first group whose first line it equals.
    groups: list[list[str]] = []
    for name, values in lines.items():
        matches = (
            group for group in groups if np.allclose(lines[group[0]], values, rtol=0.0, atol=tolerance, equal_nan=True)
        )
        first_match = next(matches, None)
        groups.append([name]) if first_match is None else first_match.append(name)
    return groups


def _look(trace: Trace, name: str, number: int) -> dict[str, Any]:
    """Return matplotlib's options for a line: for the line of a wheel, the colour of its axle and the style of its
    side; for every other line, the next colour. `number` is the position of the line in the plot.
    """
    wheel = next((wheel_name for wheel_name in trace.wheels if name == wheel_name or f"_{wheel_name}" in name), None)
    if wheel is None:
        return {"color": COLOURS[number % len(COLOURS)]}
    axles = list(dict.fromkeys(wheel_name[:-1] for wheel_name in trace.wheels))
    return {"color": COLOURS[axles.index(wheel[:-1]) % len(COLOURS)], "ls": STYLES.get(wheel[-1], "-")}
