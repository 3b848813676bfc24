"""The figure of a drive's channels against time: one panel for each kind of channel that changes.

Channels that stay constant are stated in the title.
"""

import textwrap
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
from rover_pin.plot.sheet import in_lines, sheet
from rover_pin.plot.snapshots import title_of
from rover_pin.simulation.trace.draw import COLOURS, draw_lines, group_overlapping_lines, wheel_lines
from rover_pin.simulation.trace.trace import Trace

Panel = Callable[[Axes], None]
"""Type of a function that draws one panel of the figure on the given axes."""


class WheelChannel(NamedTuple):
    """A channel that each wheel has: the beginning of its name in a trace, its name on a label, and its unit on the
    label.

    `scale` is the factor that converts the channel from SI to this unit.
    """

    channel: str
    name: str
    unit: str
    scale: float = 1.0

    @property
    def label(self) -> str:
        """The name of the channel with its unit, as the label of a panel."""
        return f"{self.name} [{self.unit or '-'}]"


SLIP = WheelChannel("slip", "slip S", "")
SINKAGE = WheelChannel("sinkage", "sinkage", "mm", 1e3)
DUTY = WheelChannel("duty", "duty", "")
"""The channels of the wheels that have a panel of the figure."""
SPEED, ANGLES, HEADING = "speed [mm/s]", "angle [deg]", "heading [deg]"
"""Labels of the panels that show the motion of the body instead of a channel of the wheels."""
MIN_CHANGE = 1e-3
"""Smallest change of a wheel's channel that is drawn, in the unit of its label. A channel that changes less would be a
level line; it counts as constant, and the title states its value."""
MIN_TURN = 0.05
"""Smallest change of an angle that is drawn [deg]. An angle that changes less counts as constant and is omitted,
because the scale of its panel would enlarge a motion that is too small to matter."""
MIN_SIDE_SPEED = 0.03
"""Smallest speed to the left that is drawn, as a fraction of the forward speed. A smaller speed is omitted: a rover
that drives straight on also wobbles a little."""
SIZE, LEGEND = (9.8, 1.9), 1.3
"""Width of the figure and height of a panel (SIZE), and width of the legends (LEGEND) [in]. The legends are next to the
panels, so that they hide no line."""


def history(trace: Trace) -> Figure:
    """Return the figure of slip, speed, sinkage, angles, heading and duty of a drive against time.

    A channel that stays constant is stated in the title instead of being drawn.
    """
    # Each label of a panel, with the function that draws the panel, and a phrase for each channel that is constant.
    drawn: dict[str, Panel] = {}
    constant = []
    for signal in (SLIP, SINKAGE, DUTY):
        # A channel is drawn if it changes at one wheel at least; otherwise its value is stated in the title.
        names = {wheel: f"{signal.channel}_{wheel}" for wheel in trace.wheels}
        scaled = {wheel: signal.scale * trace[name] for wheel, name in names.items() if name in trace}
        values = {wheel: series for wheel, series in scaled.items() if np.any(np.isfinite(series))}
        if any(np.nanmax(series) - np.nanmin(series) > MIN_CHANGE for series in values.values()):
            drawn[signal.label] = lambda axes, signal=signal: wheel_lines(axes, trace, signal.channel, signal.scale)  # type: ignore[misc]
        elif values:
            # A phrase such as "duty 0.55 (fr, rr), 0.4 (fl, rl)": wheels with the same value are named together.
            groups = [(float(np.nanmean(values[group[0]])), group) for group in group_overlapping_lines(values)]
            unit = f" {signal.unit}" if signal.unit else ""
            phrases = [
                f"{value:.3g}{unit}" + (f" ({', '.join(group)})" if len(groups) > 1 else "") for value, group in groups
            ]
            constant.append(f"{signal.name} {', '.join(phrases)}")
    if {"body_vx", "body_vy"} <= trace.channels.keys():
        # The velocity in the world's axes is turned by the yaw into the rover's axes. The speed to the left is drawn
        # only if it is larger than MIN_SIDE_SPEED.
        yaw = trace.get("body_yaw", np.zeros(trace.t.size))
        ahead = 1e3 * (np.cos(yaw) * trace["body_vx"] + np.sin(yaw) * trace["body_vy"])
        leftward = 1e3 * (np.cos(yaw) * trace["body_vy"] - np.sin(yaw) * trace["body_vx"])
        speeds = {"ahead": ahead}
        if np.nanmax(np.abs(leftward)) > MIN_SIDE_SPEED * np.nanmax(np.abs(ahead)):
            speeds["to the left"] = leftward
        colours = {name: {"color": COLOURS[n]} for n, name in enumerate(speeds)}
        drawn[SPEED] = lambda axes: draw_lines(axes, trace.t, speeds, colours)
    # The heading has a separate panel: on the scale of a turn of 90 deg, suspension angles would look constant.
    for label, starts in {ANGLES: ("rocker", "bogie", "body_pitch", "body_roll"), HEADING: ("body_yaw",)}.items():
        angles = {name.replace("_", " "): np.degrees(trace[name]) for name in trace.channels if name.startswith(starts)}
        moving = {name: series for name, series in angles.items() if np.nanmax(series) - np.nanmin(series) > MIN_TURN}
        if moving:
            # When all colours have been used once, further lines are dotted.
            looks = {
                name: {"color": COLOURS[n % len(COLOURS)], "ls": "-" if n < len(COLOURS) else ":"}
                for n, name in enumerate(moving)
            }
            drawn[label] = lambda axes, lines=moving, looks=looks: draw_lines(axes, trace.t, lines, looks)  # type: ignore[misc]
    # A figure needs at least one panel, even if nothing changes.
    if not drawn:
        drawn[SLIP.label] = lambda axes: wheel_lines(axes, trace, SLIP.channel)
    order = (SLIP.label, SPEED, SINKAGE.label, ANGLES, HEADING, DUTY.label)
    panels = {label: drawn[label] for label in order if label in drawn}
    size = (SIZE[0], 1.0 + SIZE[1] * len(panels))
    figure, axes = sheet(len(panels), size=size, sharex=True, squeeze=False)
    # The legends are to the right of the panels.
    figure.subplots_adjust(right=1.0 - LEGEND / SIZE[0])
    for (label, draw), panel in zip(panels.items(), axes[:, 0], strict=True):
        draw(panel)
        handles, labels = panel.get_legend_handles_labels()
        wrapped = [textwrap.fill(text, 20) for text in labels]
        panel.legend(handles, wrapped, fontsize=7, loc="upper left", bbox_to_anchor=(1.003, 1.0), borderaxespad=0.0)
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
    axes[0, 0].set_title(figure_text(in_lines([*title_of(trace), *constant])), fontsize=8)
    axes[-1, 0].set_xlabel("t [s]")
    return figure
