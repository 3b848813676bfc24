"""What changes during a drive, against time: a panel for each kind of channel that does change."""

import textwrap
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.plot.sheet import in_lines, sheet
from rover_pin.plot.snapshots import title_of
from rover_pin.simulation.trace.draw import COLOURS, draw_lines, group_overlapping_lines, wheel_lines
from rover_pin.simulation.trace.trace import Trace

Panel = Callable[[Axes], None]


class OfWheels(NamedTuple):
    """A channel of the wheels: its name, unit, and what it is multiplied by."""

    channel: str
    name: str
    unit: str
    scale: float = 1.0

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit or '-'}]"


SLIP = OfWheels("slip", "slip S", "")
SINKAGE = OfWheels("sinkage", "sinkage", "mm", 1e3)
DUTY = OfWheels("duty", "duty", "")
STILL = 1e-3
"""Change [label's unit] below which a wheel's channel is said in words instead of being drawn."""
STILL_DEG = 0.05
"""The same of an angle [deg]."""
SIZE, LEGEND = (9.8, 1.9), 1.3
"""Width, height of a panel, and width of the legends beside them [in], which so hide no line."""


def history(trace: Trace) -> Figure:
    """Return slip, speed, sinkage, angles, heading and duty against time; what stays as it is, is said."""
    panels, constant = _panels(trace)
    size = (SIZE[0], 1.0 + SIZE[1] * len(panels))
    figure, axes = sheet(len(panels), size=size, sharex=True, squeeze=False)
    figure.subplots_adjust(right=1.0 - LEGEND / SIZE[0])
    for (label, draw), panel in zip(panels.items(), axes[:, 0], strict=True):
        draw(panel)
        _legend_beside(panel)
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
    axes[0, 0].set_title(in_lines([*title_of(trace), *constant]), fontsize=8)
    axes[-1, 0].set_xlabel("t [s]")
    return figure


def _legend_beside(axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    wrapped = [textwrap.fill(label, 20) for label in labels]
    axes.legend(handles, wrapped, fontsize=7, loc="upper left", bbox_to_anchor=(1.003, 1.0), borderaxespad=0.0)


def _panels(trace: Trace) -> tuple[dict[str, Panel], list[str]]:
    """Return the panels by their label, and what is constant in words."""
    drawn: dict[str, Panel] = {}
    constant = []
    for signal in (SLIP, SINKAGE, DUTY):
        values = _values(trace, signal)
        if any(np.nanmax(series) - np.nanmin(series) > STILL for series in values.values()):
            drawn[signal.label] = lambda axes, signal=signal: wheel_lines(axes, trace, signal.channel, signal.scale)  # type: ignore[misc]
        elif values:
            constant.append(_in_words(signal, values))
    if {"body_vx", "body_vy"} <= trace.channels.keys():
        drawn["speed [mm/s]"] = lambda axes: _speed(axes, trace)
    for label, angles in _angles(trace).items():
        drawn[label] = lambda axes, angles=angles: _draw_angles(axes, trace, angles)  # type: ignore[misc]
    if not drawn:
        drawn[SLIP.label] = lambda axes: wheel_lines(axes, trace, SLIP.channel)
    order = (SLIP.label, "speed [mm/s]", SINKAGE.label, ANGLES, HEADING, DUTY.label)
    return {label: drawn[label] for label in order if label in drawn}, constant


def _values(trace: Trace, signal: OfWheels) -> dict[str, np.ndarray]:
    """Return what was recorded of a channel by wheel, in the label's unit."""
    names = {wheel: f"{signal.channel}_{wheel}" for wheel in trace.wheels}
    scaled = {wheel: signal.scale * trace[name] for wheel, name in names.items() if name in trace}
    return {wheel: values for wheel, values in scaled.items() if np.any(np.isfinite(values))}


def _in_words(signal: OfWheels, values: Mapping[str, np.ndarray]) -> str:
    """Return what is constant as "duty 0.55", or as "duty 0.55 (fr, rr), 0.4 (fl, rl)" where wheels differ."""
    groups = [(float(np.nanmean(values[group[0]])), group) for group in group_overlapping_lines(values)]
    unit = f" {signal.unit}" if signal.unit else ""
    phrases = [f"{value:.3g}{unit}" + (f" ({', '.join(group)})" if len(groups) > 1 else "") for value, group in groups]
    return f"{signal.name} {', '.join(phrases)}"


def _speed(axes: Axes, trace: Trace) -> None:
    yaw = trace.get("body_yaw", np.zeros(trace.t.size))
    ahead = 1e3 * (np.cos(yaw) * trace["body_vx"] + np.sin(yaw) * trace["body_vy"])
    leftward = 1e3 * (np.cos(yaw) * trace["body_vy"] - np.sin(yaw) * trace["body_vx"])
    lines = {
        "ahead": ahead,
        **({"to the left": leftward} if np.nanmax(np.abs(leftward)) > 0.03 * np.nanmax(np.abs(ahead)) else {}),
    }
    draw_lines(axes, trace.t, lines, {name: {"color": COLOURS[n]} for n, name in enumerate(lines)})


ANGLES, HEADING = "angle [deg]", "heading [deg]"


def _angles(trace: Trace) -> dict[str, dict[str, np.ndarray]]:
    """Return the angles that change [deg], by panel: a turn would flatten what the suspension does."""
    kinds = {ANGLES: ("rocker", "bogie", "body_pitch", "body_roll"), HEADING: ("body_yaw",)}
    panels: dict[str, dict[str, np.ndarray]] = {}
    for label, starts in kinds.items():
        angles = {name.replace("_", " "): np.degrees(trace[name]) for name in trace.channels if name.startswith(starts)}
        angles = {name: values for name, values in angles.items() if np.nanmax(values) - np.nanmin(values) > STILL_DEG}
        panels |= {label: angles} if angles else {}
    return panels


def _draw_angles(axes: Axes, trace: Trace, lines: Mapping[str, np.ndarray]) -> None:
    looks = {
        name: {"color": COLOURS[n % len(COLOURS)], "ls": "-" if n < len(COLOURS) else ":"}
        for n, name in enumerate(lines)
    }
    draw_lines(axes, trace.t, lines, looks)
