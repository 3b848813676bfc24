"""Prepare a drive log for a fit: return its experiment, its model and its uncertain numbers, including current scales.

A current is unscaled if it is recorded in counts of a converter, or in amperes of a motor without a declared torque
constant. Its scale and zero are unknown and are fitted together with the other numbers.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np

from rover_pin.base.jobs.cluster import Workers
from rover_pin.discrepancy.question import Progress
from rover_pin.effects.raw_current import RawCurrent
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.drive_log.experiment import DriveExperiment, experiment_of
from rover_pin.experiments.drive_log.features import ATTITUDE, LoggedRun, runs_with_attitude, without_attitude
from rover_pin.experiments.drive_log.model import has_current_scale, nuisances, parameter
from rover_pin.experiments.drive_log.resume import Memory
from rover_pin.logs.drive_log import DriveLog
from rover_pin.logs.run_terrain import level_on, shared_grounds
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.trace import Trace

MIN_PULL = 0.03
"""Smallest pull of a wheel, as a fraction of its load, that may cause the variation of a current with unknown scale.
The prior SD of the scale is this variation divided by the current at this pull, which is several times the scale that
slopes and soft ground would give."""


def experiment_on(
    log: DriveLog, model: Model, jobs: Workers = 1, progress: Progress = lambda message: None, memory: Memory = Memory()
) -> tuple[DriveExperiment, Model, tuple[Parameter, ...]]:
    """Return a drive log as an experiment for fits, with the model to fit and its uncertain numbers.

    Parameters
    ----------
    log : DriveLog
        The log. Each run is replayed from the rover's state of rest at the start of the run.
    model : Model
        The model of the rover. The returned model also has a scale and a zero for each current whose scale is unknown.
    jobs : Workers
        Processes that replay the runs.
    progress : callable
        Gets a message before each long step.
    memory : Memory
        Store of finished replays. A search that was stopped continues from this store.
    """
    model = with_raw_currents(log, model)
    progress("setting the rover down at every start")
    experiment = experiment_of(runs_on_estimated_ground(log, model, jobs), model, jobs, memory, log.noise_sd)
    return experiment, model, (*nuisances(log, model), *raw_current_numbers(log, model))


def runs_on_estimated_ground(log: DriveLog, model: Model, jobs: Workers = 1) -> tuple[LoggedRun, ...]:
    """Return all runs of a log, with an improved terrain for each run whose terrain is estimated from the rover's
    attitude.

    The first estimate takes the measured attitude of the body for the inclination of the ground. The model then drives
    over this terrain, and its body differs in attitude from the ground because of suspension and sinkage. This
    difference is subtracted from the measured attitude, which gives the second estimate. Runs that pass the same place
    then have one terrain (`shared_grounds`). If the model does not drive to the end of a run, nothing is subtracted in
    this run.

    Pitch, roll and height are compared with the log on the estimated terrain. The error of the estimate is a part of
    the noise (`ground_error_columns`), so that pitch, roll and height do not count twice: given them, the error of the
    ground, the rover's own pitch and its sinkage are found together.
    """
    all_runs = runs_with_attitude(log, model.rover)
    # Declared terrains are exact and stay unchanged.
    indices = [index for index, trace in enumerate(log.runs) if log.is_estimated(trace)]
    if not indices:
        return all_runs
    # The model drives over the first estimate, which shows how its body differs in attitude from the ground below it.
    rover, corrected = log.load_rover(), {index: log.runs[index] for index in indices}
    replays = experiment_of([all_runs[index] for index in indices], model, jobs).replays(model)
    for index, replay in zip(indices, replays, strict=True):
        trace, run = log.runs[index], all_runs[index]
        if replay.stop or run.commands.terrain is None:
            continue
        # `level` is the attitude of a rigid rover on the same ground.
        level = level_on(run.commands.terrain, rover, run.commands.place)
        difference = {name: replay.channels[name] - level[name] for name in ATTITUDE if name in trace}
        rows = list(difference.values())
        finite = np.all(np.isfinite(rows), axis=0) if rows else np.zeros(0, dtype=bool)
        if not finite.any():
            continue
        t = run.commands.t[finite]
        # The log and the replay have different times, so the difference is interpolated to the times of the log.
        own = {name: trace[name] - np.interp(trace.t, t, row[finite]) for name, row in difference.items()}
        corrected[index] = Trace({**trace.channels, **own}, dict(trace.units), dict(trace.attrs))
    # A run without pitch and height has no estimate: its ground is flat, and its roll is not compared.
    runs = [without_attitude(run) if index in indices else run for index, run in enumerate(all_runs)]
    for members, ground in shared_grounds([corrected[index] for index in indices], rover):
        for index in (indices[member] for member in members):
            commands = dataclasses.replace(all_runs[index].commands, terrain=ground.terrain)
            runs[index] = dataclasses.replace(all_runs[index], commands=commands, ground=ground)
    return tuple(runs)


def with_raw_currents(log: DriveLog, model: Model) -> Model:
    """Return the model with a sensor effect RawCurrent for each current whose scale and zero are unknown.

    The scale of a current in amperes also counts as unknown if the wheels are held to their measured rates and no
    torque constant is declared, because the torque that belongs to the current is then unknown.
    """
    for wheel, channel, values in _unscaled_currents(log):
        # A model file may already contain the sensor effect, with fitted numbers.
        is_present = any(
            isinstance(effect, RawCurrent) and effect.channel == channel for effect in model.sensor_effects
        )
        if not is_present:
            # The median current is a good initial guess of the zero, because the scale starts at 0.
            zero = float(np.nanmedian(values))
            model = model.having(RawCurrent(scale=0.0, offset=zero, motor=wheel, channel=channel))
    return model


def raw_current_numbers(log: DriveLog, model: Model) -> Iterator[Parameter]:
    """Yield scale and zero of each current whose scale is unknown, as parameters whose priors state only their order of
    magnitude.
    """
    # Current of a motor whose wheel pulls with the fraction MIN_PULL of its load.
    load = model.rover.mass * abs(model.gravity) / len(model.rover.wheels)
    current = MIN_PULL * load * float(np.mean(model.rover.radii)) / float(model.motor.constant)
    for _, channel, values in _unscaled_currents(log):
        sd = max(float(np.nanstd(values)), 1e-9)
        source = "only the order of magnitude, from the channel's spread"
        yield parameter(model, f"RawCurrent[{channel}].scale", sd / current, source=source)
        yield parameter(model, f"RawCurrent[{channel}].offset", 3.0 * sd, source=source)


def _unscaled_currents(log: DriveLog) -> Iterator[tuple[str, str, np.ndarray]]:
    """Yield each current whose scale is unknown, as (wheel, channel, values in all runs)."""
    is_scaled = has_current_scale(log)
    for wheel in log.metadata.wheels:
        # Counts of a converter never have a scale; amperes have one if the motor's constants are known.
        names = (f"raw_current_{wheel}", f"current_{wheel}_A")
        for name, is_unknown in zip(names, (True, not is_scaled), strict=True):
            values = np.concatenate([run[name] for run in log.runs if name in run] or [np.zeros(0)])
            if is_unknown and np.isfinite(values).any():
                yield wheel, name, values
