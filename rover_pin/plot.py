"""Figures: a drive's snapshots and histories, traction curves. Files are written whole or not at all."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from rover_pin.body.rover import Rover
from rover_pin.body.terrain import Terrain
from rover_pin.columns import replace_file
from rover_pin.control.steering import wheel_places
from rover_pin.motion.model import Model
from rover_pin.motion.poses import configuration
from rover_pin.motion.trace import Trace
from rover_pin.soil.curves import TractionCurves

COLOURS = tuple(matplotlib.colormaps["tab10"].colors)
STYLES = {"l": "-", "r": "--"}
FURTHEST_APART = 0.5
"""Way [m] between two snapshots of a rover, about."""
MARGINS = (0.75, 0.15, 0.5, 0.3)
"""Left, right, bottom and top of the axes [in]: a layout that measures every text costs as much as the drawing."""
WHEEL_COLOUR = {"f": COLOURS[0], "m": COLOURS[1], "r": COLOURS[2]}


def save(figure: Figure, file: Path) -> Path:
    """Write a figure as PNG, atomically; return its path."""
    content = io.BytesIO()
    figure.savefig(content, dpi=130, format="png")
    return replace_file(file, content.getvalue())


def new_figure(
    rows: int, columns: int = 1, size: tuple[float, float] = (8.0, 6.0), **options: Any
) -> tuple[Figure, Any]:
    """Return a figure and its axes, laid out around their texts, without any window."""
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def sheet(rows: int, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:
    """Return a figure of this size [in] and its axes one above the other, within `MARGINS`."""
    (left, right, bottom, top), (width, height) = MARGINS, size
    figure = Figure(figsize=size)
    figure.subplots_adjust(left / width, bottom / height, 1.0 - right / width, 1.0 - top / height, hspace=0.08)
    return figure, figure.subplots(rows, **options)


def drive_figures(trace: Trace, model: Model, out: Path) -> list[Path]:
    """Write snapshots.png and history.png of a drive into `out`; return their paths: none where nothing was driven."""
    if len(trace["t_s"]) < 2:
        return []
    return [save(snapshots(trace, model), out / "snapshots.png"), save(history(trace), out / "history.png")]


def draw_rover(axes: Axes, rover: Rover, q: np.ndarray, colour: Any) -> None:
    """Draw the left side of the rover: links between joints, wheels, and the body's axis."""
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, q)
    left = {wheel.joint for wheel in rover.wheels if wheel.side == "l"}
    shown = {joint for wheel in left for joint in rover.model.supports[wheel]}
    for joint in sorted(shown - {0, 1}):
        parent = rover.model.parents[joint]
        start, end = data.oMi[parent].translation, data.oMi[joint].translation
        axes.plot([start[0], end[0]], [start[2], end[2]], color=colour, lw=1.4, solid_capstyle="round")
    for wheel in rover.wheels:
        if wheel.side == "l":
            x, _, z = data.oMi[wheel.joint].translation
            axes.add_patch(Circle((x, z), float(wheel.wheel.r), fill=False, color=colour, lw=1.4))


def ground_line(terrain: Terrain, low: float, high: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Return x and height of the terrain along a track."""
    x = np.linspace(low, high, 2000)
    return x, np.asarray(terrain.height(x, y))


def snapshots(trace: Trace, model: Model, count: int = 6) -> Figure:
    """Return the rover's left side at evenly spaced instants, more than `count` on a long way; later ones are darker.

    The ground is that under the left wheels, as at the start; where it is another under the right ones, that is dashed.
    """
    low, high = float(np.min(trace["body_x"])) - 0.3, float(np.max(trace["body_x"])) + 0.3
    count = max(count, round((high - low) / FURTHEST_APART))
    y = max(place[1] for place in wheel_places(model.rover).values())
    x, z = ground_line(model.terrain, low, high, y)
    highest = max(float(np.max(trace["body_z"])), float(np.max(z))) + 0.1
    figure, axes = sheet(1, size=(10.0, min(3.8, 1.2 + 9.0 * (highest - float(np.min(z)) + 0.05) / (high - low))))
    axes.fill_between(x, z, np.min(z) - 0.05, color="#d9c9a5", lw=0)
    axes.plot(x, z, color="#8a7340", lw=1)
    if not model.terrain.mirror_symmetric:
        axes.plot(*ground_line(model.terrain, low, high, -y), color="#8a7340", lw=0.8, ls="--")
    rows = np.linspace(0, len(trace["t_s"]) - 1, count).astype(int)
    top, labelled = float(np.max(trace["body_z"])) + 0.05, -np.inf
    for shade, row in zip(np.linspace(0.65, 0.0, count), rows, strict=True):
        draw_rover(axes, model.rover, configuration(model.rover, trace, row), str(shade))
        at = float(trace["body_x"][row])
        if abs(at - labelled) > 0.07:
            axes.text(at, top, f"{trace['t_s'][row]:.1f} s", ha="center", fontsize=8, color=str(shade))
            labelled = at
    axes.set(
        aspect="equal",
        xlabel="x [m]",
        ylabel="z [m]",
        xlim=(low, high),
        ylim=(None, top + max(0.04, 0.02 * (high - low))),
    )
    axes.set_title(title_of(trace), fontsize=9)
    return figure


def title_of(trace: Trace) -> str:
    """Return what a figure says of its drive."""
    attrs = trace.attrs
    words = [
        str(attrs.get("scenario", "drive")),
        f"control: {attrs.get('control', '-')}",
        f"traction form: {attrs.get('traction_form', '-')}",
        f"g = {float(attrs.get('gravity_mps2', float('nan'))):.2f} m/s²",
        f"stop: {attrs.get('stop', '-')}",
    ]
    return "   ".join(words)


def wheel_lines(axes: Axes, trace: Trace, channel: str) -> None:
    """Draw a channel of all wheels against time; those that look the same are one line, and its label says so."""
    values = {wheel: trace[f"{channel}_{wheel}"] for wheel in trace.wheels if f"{channel}_{wheel}" in trace}
    span = max((float(np.nanmax(each) - np.nanmin(each)) for each in values.values()), default=0.0)
    groups: list[list[str]] = []
    for wheel, own in values.items():
        for group in groups:
            if np.allclose(values[group[0]], own, rtol=0.0, atol=max(2e-3 * span, 1e-9), equal_nan=True):
                group.append(wheel)
                break
        else:
            groups.append([wheel])
    for group in groups:
        look = {"color": WHEEL_COLOUR.get(group[0][0], "grey"), "ls": STYLES.get(group[0][-1], "-"), "lw": 1.2}
        axes.plot(trace.t, values[group[0]], label=" = ".join(group), **look)
    axes.legend(fontsize=7, ncols=3, loc="best")


def history(trace: Trace) -> Figure:
    """Return slip, speed, suspension angles and duty against time."""
    figure, axes = sheet(4, size=(9.0, 9.0), sharex=True)
    t = trace["t_s"]
    for wheel in trace.wheels:
        look = {
            "color": WHEEL_COLOUR.get(wheel[0], "grey"),
            "ls": STYLES.get(wheel[-1], "-"),
            "lw": 1.2,
            "label": wheel,
        }
        axes[0].plot(t, trace[f"slip_{wheel}"], **look)
        axes[3].plot(t, trace[f"duty_{wheel}"], **look)
    speed = np.hypot(trace["body_vx"], trace["body_vy"])
    axes[1].plot(t, 1e3 * trace["body_vx"], color="black", lw=1.2, label="forward (world x)")
    if np.max(np.abs(trace["body_vy"])) > 1e-4:
        axes[1].plot(t, 1e3 * speed, color="grey", lw=1.0, label="over the ground")
    angles = [name for name in trace.channels if name.startswith(("rocker", "bogie"))]
    for i, name in enumerate([*angles, "body_pitch"]):
        axes[2].plot(t, np.degrees(trace[name]), lw=1.2, color=COLOURS[i], label=name.replace("_", " "))
    for each, label in zip(axes, ("slip S [-]", "speed [mm/s]", "angle [deg]", "duty [-]"), strict=True):
        each.set_ylabel(label)
        each.grid(alpha=0.3)
        each.legend(fontsize=7, ncols=3, loc="best")
    axes[0].set_ylim(-1.05, 1.05)
    axes[0].set_title(title_of(trace), fontsize=9)
    axes[-1].set_xlabel("t [s]")
    return figure


def traction_figure(table: TractionCurves, name: str, out: Path) -> list[Path]:
    """Write traction.csv and traction.png into `out`; return their paths."""
    import pandas as pd

    figure, axes = sheet(1, size=(7.5, 5.0))
    styles = dict(zip(("net", "torque", "gross"), ("-", "--", ":"), strict=True))
    values = sorted({k for _, k in table.curves})
    for (form, k), curve in table.curves.items():
        colour = COLOURS[values.index(k) % len(COLOURS)]
        axes.plot(table.S, curve, styles[form], color=colour, label=f"{form}, k = {1e3 * k:g} mm")
    axes.axhline(0.0, color="black", lw=0.6)
    axes.set(xlabel="slip S [-]", ylabel="load-traction factor F [-]", title=f"soil: {name}", xlim=(0.0, 1.0))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    columns = {f"{form}_k{1e3 * k:g}mm": curve for (form, k), curve in table.curves.items()}
    csv = write_csv(pd.DataFrame({"S": table.S, **columns}), out / "traction.csv")
    return [csv, save(figure, out / "traction.png")]


def write_csv(frame: Any, file: Path) -> Path:
    """Write a table as CSV, atomically; return its path."""
    return replace_file(file, frame.to_csv(index=False))
