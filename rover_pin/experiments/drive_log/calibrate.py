"""A drive log's model with its uncertain numbers fitted: from where the loop looks for what is missing.

Currents of which only the shape is known, counts of a converter or amperes of motors that nobody declared, get a scale
and a zero that are fitted with the rest.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np

from rover_pin.base.jobs.cluster import Workers
from rover_pin.discrepancy.question import Progress
from rover_pin.effects.raw_current import RawCurrent
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.drive_log.experiment import DriveExperiment, experiment_of
from rover_pin.experiments.drive_log.features import TELL_GROUND, LoggedRun, logged_runs
from rover_pin.experiments.drive_log.model import has_current_scale, nuisances
from rover_pin.experiments.drive_log.parameters import parameter
from rover_pin.experiments.drive_log.resume import Memory
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


PULL = 0.03
"""Pull of a wheel as a share of its load to which a channel's spread may belong at the least: the scale's SD is that
spread over this pull's current, several times what pulls on slopes and soft ground make of it."""


def experiment_on(
    log: DriveLog, model: Model, jobs: Workers = 1, progress: Progress = lambda message: None, memory: Memory = Memory()
) -> tuple[DriveExperiment, Model, tuple[Parameter, ...]]:
    """Return a log as an experiment, every run replayed from where the rover stood at its start, model and numbers."""
    model = with_raw_currents(log, model)
    progress("setting the rover down at every start")
    experiment = experiment_of(runs_on_estimated_ground(log, model, jobs), model, jobs, memory, log.noise_sd)
    return experiment, model, (*nuisances(log, model), *raw_current_numbers(log, model))


def with_raw_currents(log: DriveLog, model: Model) -> Model:
    """Return the model with a scale and a zero for every current that is a count, both unknown.

    Amperes count so too where the wheels are held to their rates and no torque constant is declared: the torque that
    they stand for is then unknown by as much.
    """
    for wheel, channel, values in _unscaled_currents(log):
        have = [
            effect for effect in model.sensor_effects if isinstance(effect, RawCurrent) and effect.channel == channel
        ]
        zero = float(np.nanmedian(values))
        model = model if have else model.having(RawCurrent(scale=0.0, offset=zero, motor=wheel, channel=channel))
    return model


def raw_current_numbers(log: DriveLog, model: Model) -> Iterator[Parameter]:
    """Yield scale and zero of each of the model's raw currents, with priors that say nothing but their order."""
    load = model.rover.mass * abs(model.gravity) / len(model.rover.wheels)
    current = PULL * load * float(np.mean(model.rover.radii)) / float(model.motor.constant)
    for _, channel, values in _unscaled_currents(log):
        spread = max(float(np.nanstd(values)), 1e-9)
        source = "only the order that the channel's spread tells"
        yield parameter(model, f"RawCurrent[{channel}].scale", spread / current, source=source)
        yield parameter(model, f"RawCurrent[{channel}].offset", 3.0 * spread, source=source)


def _unscaled_currents(log: DriveLog) -> Iterator[tuple[str, str, np.ndarray]]:
    """Yield wheel, channel and all values of the currents whose scale is unknown."""
    is_scaled = has_current_scale(log)
    for wheel in log.metadata.wheels:
        names = (f"raw_current_{wheel}", f"current_{wheel}_A")
        for name, unknown in zip(names, (True, not is_scaled), strict=True):
            values = np.concatenate([run[name] for run in log.runs if name in run] or [np.zeros(0)])
            if unknown and np.isfinite(values).any():
                yield wheel, name, values
