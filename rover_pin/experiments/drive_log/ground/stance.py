"""The ground under runs that tell it themselves: their level, less how the model's rover stands on such ground.

A body is not level with its ground. Up a slope and by the reaction to its own traction the wheels behind carry more and
sink deeper: a cart of 20 kg stands .3 to .5 deg nose up. Taken for ground, that is a slope which turns with the
direction of travel, and a wheel's scale or a tachogenerator's was named for it.
"""

import dataclasses

import numpy as np

from rover_pin.base.jobs.cluster import Workers
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import TELL_GROUND, LoggedRun, logged_runs
from rover_pin.logs.drive_log import DriveLog
from rover_pin.logs.run_terrain import level_on
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import Replay
from rover_pin.simulation.trace.trace import Trace


def runs_on_estimated_ground(log: DriveLog, model: Model, jobs: Workers = 1) -> tuple[LoggedRun, ...]:
    """Return all runs of a log; where a run tells its ground, on that under the model's rover, not under a rigid plank.

    The model drives over the ground of the level as it was measured; by as much as its own level differs from that
    ground the measured one differs from the true: less that, the ground is estimated anew. What is left is of second
    order, and what another soil lets it sink otherwise. Where the model does not drive to the end, the first stands.
    """
    runs = logged_runs(log, model.rover)
    estimated_indices = [at for at, trace in enumerate(log.runs) if log.is_estimated(trace)]
    if not estimated_indices:
        return runs
    replays = experiment_of([runs[at] for at in estimated_indices], model, jobs).replays(model)
    corrected_runs = {
        at: _standing(log, log.runs[at], runs[at], replay)
        for at, replay in zip(estimated_indices, replays, strict=True)
    }
    return tuple(corrected_runs.get(at, run) for at, run in enumerate(runs))


def _standing(log: DriveLog, trace: Trace, run: LoggedRun, driven: Replay) -> LoggedRun:
    """Return a run on the ground of its level, less how far a replay's own level differs from its ground."""
    if driven.stop or run.commands.terrain is None:
        return run
    under = level_on(run.commands.terrain, log.load_rover(), run.commands.place)
    stance = {name: driven.channels[name] - under[name] for name in TELL_GROUND if name in trace}
    finite = np.all(np.isfinite(list(stance.values())), axis=0) if stance else np.zeros(0, dtype=bool)
    if not finite.any():
        return run
    less = {name: trace[name] - np.interp(trace.t, run.commands.t[finite], row[finite]) for name, row in stance.items()}
    ground = log.terrain_of(Trace({**trace.channels, **less}, dict(trace.units), dict(trace.attrs)))
    return dataclasses.replace(run, commands=dataclasses.replace(run.commands, terrain=ground))
