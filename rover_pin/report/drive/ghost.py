"""The worst run in 3D: what was measured, and the free simulations before and after as its ghosts."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from importlib.util import find_spec

import numpy as np

from rover_pin.base.errors import RoverPinError
from rover_pin.base.jobs.cluster import results
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.free_runs import extra_of
from rover_pin.logs.drive_log import DriveLog
from rover_pin.report.drive.runs import Sides
from rover_pin.report.page import Section
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.trace import Trace
from rover_pin.view.page import page_of
from rover_pin.view.subject import Subject, mesh_folder


def ghosts(verdict: Verdict, log: DriveLog, sides: Sides | None) -> Callable[[], Section | None]:
    """Begin the scene of the run on which the base model diverges furthest; return what makes a section of it.

    Where the loop has other processes, one of them makes the scene meanwhile. None where nothing was driven.
    """
    free = [free_run for free_run in extra_of(verdict).free if np.isfinite(free_run.before)]
    if sides is None or not free:
        return lambda: None
    run = max(free, key=lambda free_run: free_run.before).run
    return partial(_section, run, sides.added, _begin_pages(log, sides, run) if find_spec("viser") else None)


def _section(run: str, added: bool, pages: Iterator[str] | None) -> Section | None:
    """Return the scene as a page within the page; without viser, how to get it."""
    try:
        page = "" if pages is None else next(pages)
    except RoverPinError:  # a run without the places that a scene needs
        return None
    return Section("Seen in 3D", "drive/ghost.html", {"run": run, "added": added, "page": page})


def _begin_pages(log: DriveLog, sides: Sides, run: str) -> Iterator[str]:
    model, experiment = sides.before.model, sides.experiment
    measured = Subject(run, log.run(run), model.rover, model.ground, mesh_folder(log.rover))
    others = [(free_drive(experiment, model, run, measured, "base model"), "orange")]
    if sides.added:
        others.append((free_drive(experiment, sides.after.model, run, measured, "with what was added"), "blue"))
    processes = experiment.jobs if isinstance(experiment.jobs, int) else 1
    return results(page_of, [(replace(measured, name=f"{run}, as measured"), others)], processes)


def free_drive(experiment: DriveExperiment, model: Model, run: str, beside: Subject, name: str) -> Subject:
    """Return the free simulation of a run as something to be seen beside what was measured."""
    alone = experiment.free.alone(run)
    commands, (replay,) = alone.runs[0].commands, alone.replays(model)
    channels = {name: values for name, values in replay.channels.items() if len(values) == len(commands.t)}
    return replace(
        beside, name=name, trace=Trace({"t_s": commands.t, **channels}, attrs={"wheels": beside.trace.wheels})
    )
