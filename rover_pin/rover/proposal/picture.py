"""Side and plan view of a rover with the names of its parts: to see whether roles were guessed right."""

import io
from collections.abc import Iterable
from pathlib import Path

import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from rover_pin.base.files.columns import replace_file
from rover_pin.rover.proposal.names import Name, place_names
from rover_pin.rover.rover import Rover

GREY, BLUE, RED = "#555555", "#1f5fa8", "#b03030"


def write_picture(rover: Rover, file: Path) -> Path:
    """Write `picture` as PNG."""
    content = io.BytesIO()
    picture(rover).savefig(content, dpi=110, format="png")
    return replace_file(file, content.getvalue())


def picture(rover: Rover) -> Figure:
    """Draw side view (left side) and plan view of a rover at zero angles, with the names of its joints."""
    figure = Figure(figsize=(11.0, 10.0), layout="constrained")
    side, plan = figure.subplots(2, 1)
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, pin.neutral(rover.model))
    names = [_side(side, rover, data), _plan(plan, rover, data)]
    centre = pin.centerOfMass(rover.model, data, pin.neutral(rover.model))
    for axes, panel_names, (i, k), words in ((side, names[0], (0, 2), "z [m]"), (plan, names[1], (0, 1), "y [m]")):
        axes.plot(centre[i], centre[k], "x", color=RED, ms=9, mew=2)
        panel_names.append(Name("centre of mass", (centre[i], centre[k]), RED))
        axes.set(aspect="equal", xlabel="x, forward [m]", ylabel=words)
        axes.grid(alpha=0.3)
        axes.margins(0.15)
    side.set_title(f"{rover.name}: {rover.mass:.3g} kg, {len(rover.wheels)} wheels; left side", fontsize=10)
    place_names((side, plan), names)
    return figure


def _side(axes: Axes, rover: Rover, data: pin.Data) -> list[Name]:
    left = [wheel for wheel in rover.wheels if wheel.side == "l"]
    joints = {joint for wheel in left for joint in rover.model.supports[wheel.joint]} - {0, 1}
    for wheel in left:
        x, _, z = data.oMi[wheel.joint].translation
        axes.add_patch(Circle((x, z), float(wheel.wheel.r), fill=False, color=BLUE, lw=1.5))
    return _joints(axes, rover, data, sorted(joints), (0, 2))


def _plan(axes: Axes, rover: Rover, data: pin.Data) -> list[Name]:
    for wheel in rover.wheels:
        (x, y, _), r, b = data.oMi[wheel.joint].translation, float(wheel.wheel.r), float(wheel.wheel.b)
        axes.add_patch(Rectangle((x - r, y - b / 2), 2 * r, b, fill=False, color=BLUE, lw=1.5))
    return _joints(axes, rover, data, range(2, rover.model.njoints), (0, 1))


def _joints(axes: Axes, rover: Rover, data: pin.Data, joints: Iterable[int], plane: tuple[int, int]) -> list[Name]:
    """Draw joints and the links between them along two axes of the base; return the joints' names."""
    wheels, names = {wheel.joint for wheel in rover.wheels}, []
    for joint in joints:
        start, end = (data.oMi[index].translation[list(plane)] for index in (rover.model.parents[joint], joint))
        colour = BLUE if joint in wheels else GREY
        axes.plot(*zip(start, end, strict=True), color=GREY, lw=1.5)
        axes.plot(*end, "o", color=colour, ms=4)
        names.append(Name(rover.model.names[joint], tuple(end), colour))
    return names
