"""What changes during a drive, against time: a panel for each kind of channel that does change."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.motion.draw import COLOURS, draw_lines, wheel_lines
from rover_pin.motion.trace import Trace
from rover_pin.plot.sheet import in_lines, sheet
from rover_pin.plot.snapshots import title_of

Panel = Callable[[Axes], None]
OF_WHEELS = (("slip", "slip S [-]", 1.0), ("sinkage", "sinkage [mm]", 1e3), ("duty", "duty [-]", 1.0))
"""Channel, label, and what it is multiplied by."""
STILL = 1e-3
"""Change of an angle [deg] or a duty [-] below which it is said in words instead of being drawn."""


def history(trace: Trace) -> Figure:
    """Return slip, speed, sinkage, suspension angles, heading and duty against time; what stays as it is, is said."""
    panels, constant = _panels(trace)
    figure, axes = sheet(len(panels), size=(9.0, 1.0 + 1.9 * len(panels)), sharex=True, squeeze=False)
    for (label, draw), each in zip(panels.items(), axes[:, 0], strict=True):
        draw(each)
        each.set_ylabel(label)
        each.grid(alpha=0.3)
    axes[0, 0].set_title(in_lines([*title_of(trace), *constant]), fontsize=8)
    axes[-1, 0].set_xlabel("t [s]")
    return figure


def _panels(trace: Trace) -> tuple[dict[str, Panel], list[str]]:
    """Return the panels by their label, and what is constant in words."""
    drawn: dict[str, Panel] = {}
    constant = []
    for channel, label, scale in (
        ("slip", "slip S [-]", 1.0),
        ("sinkage", "sinkage [mm]", 1e3),
        ("duty", "duty [-]", 1.0),
    ):
        values = [trace[f"{channel}_{wheel}"] for wheel in trace.wheels if f"{channel}_{wheel}" in trace]
        if values and np.nanmax(values) - np.nanmin(values) > STILL / scale:
            drawn[label] = lambda axes, channel=channel, scale=scale: _wheels(axes, trace, channel, scale)  # type: ignore[misc]
        elif values:
            constant.append(f"{channel} {scale * float(np.nanmean(values)):.3g}")
    if {"body_vx", "body_vy"} <= trace.channels.keys():
        drawn["speed [mm/s]"] = lambda axes: _speed(axes, trace)
    if _angles(trace):
        drawn["angle [deg]"] = lambda axes: _draw_angles(axes, trace)
    if not drawn:
        drawn["slip S [-]"] = lambda axes: _wheels(axes, trace, "slip", 1.0)
    order = ("slip S [-]", "speed [mm/s]", "sinkage [mm]", "angle [deg]", "duty [-]")
    return {label: drawn[label] for label in order if label in drawn}, constant


def _wheels(axes: Axes, trace: Trace, channel: str, scale: float) -> None:
    wheel_lines(axes, trace, channel, scale)


def _speed(axes: Axes, trace: Trace) -> None:
    yaw = trace.get("body_yaw", np.zeros(trace.t.size))
    ahead = 1e3 * (np.cos(yaw) * trace["body_vx"] + np.sin(yaw) * trace["body_vy"])
    left = 1e3 * (np.cos(yaw) * trace["body_vy"] - np.sin(yaw) * trace["body_vx"])
    lines = {
        "ahead": ahead,
        **({"to the left": left} if np.nanmax(np.abs(left)) > 0.03 * np.nanmax(np.abs(ahead)) else {}),
    }
    draw_lines(axes, trace.t, lines, {name: {"color": COLOURS[n]} for n, name in enumerate(lines)})


def _angles(trace: Trace) -> dict[str, np.ndarray]:
    names = [
        name for name in trace.channels if name.startswith(("rocker", "bogie")) or name[5:] in ("pitch", "roll", "yaw")
    ]
    degrees = {name.replace("_", " "): np.degrees(trace[name]) for name in names}
    return {name: values for name, values in degrees.items() if np.nanmax(values) - np.nanmin(values) > 50 * STILL}


def _draw_angles(axes: Axes, trace: Trace) -> None:
    lines = _angles(trace)
    looks = {
        name: {"color": COLOURS[n % len(COLOURS)], "ls": "-" if n < len(COLOURS) else ":"}
        for n, name in enumerate(lines)
    }
    draw_lines(axes, trace.t, lines, looks)
