"""Figures of drives, maps, traction curves, studies and tunings.

No window is opened, and each file is written in one step, so that a stop never leaves half a picture.
"""

from pathlib import Path

from rover_pin.plot.history import history
from rover_pin.plot.sheet import new_figure, save, sheet, write_csv
from rover_pin.plot.snapshots import draw_rover, ground_line, snapshots, title_of
from rover_pin.plot.traction import traction_figure
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.draw import COLOURS
from rover_pin.simulation.trace.poses import configuration
from rover_pin.simulation.trace.trace import Trace

__all__ = [
    "COLOURS",
    "configuration",
    "draw_rover",
    "drive_figures",
    "ground_line",
    "history",
    "new_figure",
    "save",
    "sheet",
    "snapshots",
    "title_of",
    "traction_figure",
    "write_csv",
]


def drive_figures(trace: Trace, model: Model, out: Path) -> list[Path]:
    """Write the figures snapshots.png and history.png of a drive into a folder, and return their paths.

    If the trace has only one row, because the drive never began, no figure is written, and the list is empty.
    """
    if len(trace["t_s"]) < 2:
        return []
    return [save(snapshots(trace, model), out / "snapshots.png"), save(history(trace), out / "history.png")]
