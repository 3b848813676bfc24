"""Figures: a drive's snapshots and histories, traction curves. Files are written whole or not at all."""

from pathlib import Path

from rover_pin.plot.history import history
from rover_pin.plot.sheet import new_figure, save, sheet, write_csv
from rover_pin.plot.side import draw_rover, ground_line
from rover_pin.plot.snapshots import snapshots, title_of
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
    """Write snapshots.png and history.png of a drive into `out`; return their paths: none where nothing was driven."""
    if len(trace["t_s"]) < 2:
        return []
    return [save(snapshots(trace, model), out / "snapshots.png"), save(history(trace), out / "history.png")]
