"""The worst run in 3D: what was measured, and the free simulations before and after as its ghosts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.errors import RoverPinError
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.motion.drive_log import DriveLog
from rover_pin.motion.model import Model
from rover_pin.motion.trace import Trace
from rover_pin.report.drive.runs import Sides
from rover_pin.report.section import Section
from rover_pin.view.page import page_of
from rover_pin.view.subject import Subject, mesh_folder


@dataclass(frozen=True, eq=False)
class Ghosts(Section):
    """The run on which the base model strays furthest, as a scene within the page; without viser, how to get it."""

    verdict: Verdict
    log: DriveLog
    sides: Sides | None
    title: ClassVar[str] = "Seen in 3D"
    template: ClassVar[str] = "drive/ghost.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return the scene as a page, empty without viser; None where nothing was driven."""
        free = [one for one in extra_of(self.verdict).free if np.isfinite(one.before)]
        if self.sides is None or not free:
            return None
        worst = max(free, key=lambda one: one.before)
        shown = {"run": worst.run, "added": self.sides.added}
        if find_spec("viser") is None:
            return {**shown, "page": ""}
        try:
            return {**shown, "page": self._page(self.sides, worst.run)}
        except RoverPinError:  # a run without the places that a scene needs
            return None

    def _page(self, sides: Sides, run: str) -> str:
        model = sides.before.model
        measured = Subject(run, self.log.run(run), model.rover, model.terrain, mesh_folder(self.log.rover))
        others = [(driven(sides.experiment, sides.before.model, run, measured, "base model"), "orange")]
        if sides.added:
            others.append((driven(sides.experiment, sides.after.model, run, measured, "with what was added"), "blue"))
        return page_of(replace(measured, name=f"{run}, as measured"), others)


def driven(experiment: DriveExperiment, model: Model, run: str, beside: Subject, name: str) -> Subject:
    """Return the free simulation of a run as something to be seen beside what was measured."""
    at = [one.name for one in experiment.runs].index(run)
    replay, commands = experiment.free.replays(model)[at], experiment.runs[at].commands
    channels = {name: values for name, values in replay.channels.items() if len(values) == len(commands.t)}
    return replace(
        beside, name=name, trace=Trace({"t_s": commands.t, **channels}, attrs={"wheels": beside.trace.wheels})
    )
