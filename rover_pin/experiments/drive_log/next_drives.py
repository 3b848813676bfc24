"""The drives that a test bed could make next, each with the log's channels and their noise, and motor currents besides.

The most probable model drives each freely; all others are held to its way, as replays of a log are.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import block_diag

from rover_pin.base.errors import SimulationError
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import Noise
from rover_pin.experiments.drive_log.candidate_runs import CandidateRun, candidate_runs, on_own_ground
from rover_pin.experiments.drive_log.experiment import DriveExperiment, experiment_of_log
from rover_pin.experiments.drive_log.features import WHOLE, LoggedRun, blocks, comparable_rows
from rover_pin.inference.beliefs import Hypothesis
from rover_pin.inference.outlook import Offer
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.replay import replay
from rover_pin.simulation.sensors import Sensors
from rover_pin.simulation.start.place import shared_rest

ROLLS = "rolling"
"""Word of a run in which the motors let the rover roll: wheels that are held to a rate do not."""
MOVING = 0.1
"""Duty above which a rover is driving."""


def next_drives(leading: Sequence[Hypothesis]) -> Iterator[Offer]:
    """Yield what could be driven next, as the first of these sets of causes drives it, where it can."""
    for run in _choice(leading):
        offer = _offer_of_run(run, leading[0].fit)
        if offer is not None:
            yield offer


def _offer_of_run(run: CandidateRun, fit: Fit) -> Offer | None:
    """Return a run as the log's rover would drive it by a fit; None where it stops or cannot start."""
    model, log = run.on(fit.model), experiment_of_log(fit)
    try:
        rest_state = shared_rest(model, run.start)
        free = replay(model, run.commands(model.rover), rest_state=rest_state)
    except SimulationError:
        return None
    if free.stop:
        return None
    place = np.column_stack([free.channels[name] for name in ("body_x", "body_y", "body_yaw")])
    commands = run.commands(model.rover, place)
    compared = comparable_rows(commands, [free.channels[f"wheel_rate_{wheel.name}"] for wheel in model.rover.wheels])
    currents = () if log.rate_driven else tuple(f"current_{wheel.name}_A" for wheel in model.rover.wheels)
    unmeasured = tuple(name for name in currents if name not in log.channels)
    channels = (*log.channels, *unmeasured)
    usable = blocks(compared, commands.period) > WHOLE
    blank = np.zeros((len(channels), len(usable)))
    ahead = LoggedRun(run.description, commands, channels, blank, place[:, 2], {}, compared, compared)
    experiment = DriveExperiment((ahead,), (rest_state,), log.jobs)
    noise = noise_with(fit.task.noise, log.channels, unmeasured, np.broadcast_to(usable, (1, *blank.shape)))
    return Offer(experiment, noise, run.on, unmeasured)


def noise_with(noise: Noise, channels: Sequence[str], unmeasured: Sequence[str], good: np.ndarray) -> Noise:
    """Return the noise of a log's channels with that of motor currents, on blocks (1, channels, blocks) of a run.

    A current that is not logged has the SD of one sample, as much larger as the wheel rates' blocks are above theirs:
    what the ground adds to the one it adds to the other.
    """
    sensors, many = Sensors(), len(unmeasured)
    rates = [sd for name, sd in zip(channels, noise.floor, strict=True) if name.startswith("wheel_rate_")]
    worse = max(1.0, float(np.median(rates)) / float(sensors.rate_sd)) if rates else 1.0
    return Noise(
        np.concatenate([noise.floor, np.full(many, worse * float(sensors.current_sd))]),
        np.concatenate([noise.rho, np.zeros(many)]),
        block_diag(noise.mixing, np.eye(many)),
        good,
        noise.inflation,
    )


def _choice(leading: Sequence[Hypothesis]) -> tuple[CandidateRun, ...]:
    """Return the runs to choose from, at shares of the fastest logged rate where the wheels are held to rates."""
    runs, experiment = _applicable_runs(leading), experiment_of_log(leading[0].fit)
    if not experiment.rate_driven:
        return runs
    rates = [np.abs(run.commands.rate) for run in experiment.runs if run.commands.rate is not None]
    fastest = max(float(np.max(rate)) for rate in rates)
    return tuple(run.held_to(fastest) for run in runs if ROLLS not in run.label)


def _applicable_runs(leading: Sequence[Hypothesis]) -> tuple[CandidateRun, ...]:
    """Return the candidate runs; where an effect is tied to a place of the log, those that cross the log's ground."""
    experiment, rover = experiment_of_log(leading[0].fit), leading[0].fit.model.rover
    duty = np.concatenate([np.abs(run.commands.duty).mean(axis=1) for run in experiment.runs])
    moving = duty[duty > MOVING]
    cruise = round(float(np.median(moving)), 2) if moving.size else CRUISE_DUTY
    log_start = experiment.runs[0].commands.start
    if any("x_from" in effect.places for hypothesis in leading for effect in hypothesis.fit.model.all_effects):
        return on_own_ground(rover, cruise, log_start)
    marks = {name.partition("[")[2].rstrip("]") for hypothesis in leading for name in hypothesis.names}
    alone = [at for at, wheel in enumerate(rover.wheels) if wheel.name in marks or str(at) in marks]
    return candidate_runs(rover, cruise, log_start, alone or [0])
