"""Side and plan view of a rover with the names of its parts: to see whether roles were guessed right."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from rover_pin.body.rover import Rover
from rover_pin.columns import replace_file

GREY, BLUE, RED = "#555555", "#1f5fa8", "#b03030"


def write_picture(rover: Rover, file: Path) -> Path:
    """Write side view (left side) and plan view of a rover at zero angles, with the names of its joints, as PNG."""
    figure = Figure(figsize=(11.0, 10.0), layout="constrained")
    side, plan = figure.subplots(2, 1)
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, pin.neutral(rover.model))
    _side(side, rover, data)
    _plan(plan, rover, data)
    centre = pin.centerOfMass(rover.model, data, pin.neutral(rover.model))
    for axes, (i, k), words in ((side, (0, 2), "z [m]"), (plan, (0, 1), "y [m]")):
        axes.plot(centre[i], centre[k], "x", color=RED, ms=9, mew=2)
        axes.annotate("centre of mass", (centre[i], centre[k]), color=RED, fontsize=8, xytext=(6, 6),
                      textcoords="offset points")  # fmt: skip
        axes.set(aspect="equal", xlabel="x, forward [m]", ylabel=words)
        axes.grid(alpha=0.3)
        axes.margins(0.15)
    side.set_title(f"{rover.name}: {rover.mass:.3g} kg, {len(rover.wheels)} wheels; left side", fontsize=10)
    content = io.BytesIO()
    figure.savefig(content, dpi=110, format="png")
    return replace_file(file, content.getvalue())


def _side(axes: Axes, rover: Rover, data: pin.Data) -> None:
    left = [wheel for wheel in rover.wheels if wheel.side == "l"]
    shown = {joint for wheel in left for joint in rover.model.supports[wheel.joint]} - {0, 1}
    for joint in sorted(shown):
        start, end = (data.oMi[each].translation for each in (rover.model.parents[joint], joint))
        axes.plot([start[0], end[0]], [start[2], end[2]], color=GREY, lw=2)
        _named(axes, rover, joint, end[[0, 2]], shown & {wheel.joint for wheel in left})
    for wheel in left:
        x, _, z = data.oMi[wheel.joint].translation
        axes.add_patch(Circle((x, z), float(wheel.wheel.r), fill=False, color=BLUE, lw=1.5))


def _plan(axes: Axes, rover: Rover, data: pin.Data) -> None:
    wheels = {wheel.joint for wheel in rover.wheels}
    for joint in range(2, rover.model.njoints):
        start, end = (data.oMi[each].translation for each in (rover.model.parents[joint], joint))
        axes.plot([start[0], end[0]], [start[1], end[1]], color=GREY, lw=1)
        _named(axes, rover, joint, end[:2], wheels)
    for wheel in rover.wheels:
        (x, y, _), r, b = data.oMi[wheel.joint].translation, float(wheel.wheel.r), float(wheel.wheel.b)
        axes.add_patch(Rectangle((x - r, y - b / 2), 2 * r, b, fill=False, color=BLUE, lw=1.5))


def _named(axes: Axes, rover: Rover, joint: int, at: np.ndarray, wheels: set[int]) -> None:
    colour, aside = (BLUE, (4, -10)) if joint in wheels else (GREY, (4, 5))
    axes.plot(*at, "o", color=colour, ms=4)
    axes.annotate(rover.model.names[joint], tuple(at), color=colour, fontsize=8, xytext=aside,
                  textcoords="offset points")  # fmt: skip
