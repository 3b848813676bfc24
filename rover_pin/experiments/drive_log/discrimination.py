"""How far apart two fitted models are on a run that was not driven yet, beyond the noise and the doubt of both fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from rover_pin.base.errors import SimulationError
from rover_pin.estimation.fit import Fit, Task
from rover_pin.estimation.gauss_newton import slopes_at
from rover_pin.estimation.noise import Noise
from rover_pin.experiments.drive_log.candidate_runs import CandidateRun
from rover_pin.experiments.drive_log.experiment import DriveExperiment, logged
from rover_pin.experiments.drive_log.features import WHOLE, LoggedRun, blocks, comparable_rows
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import Commands, Replay, replay
from rover_pin.simulation.sensors import Sensors
from rover_pin.simulation.start.place import shared_rest


@dataclass(frozen=True, eq=False)
class Instruments:
    """The channels by which a run is judged, with their noise (see `Noise`): the log's, and perhaps further ones."""

    names: tuple[str, ...]
    sd: np.ndarray
    rho: np.ndarray
    mixing: np.ndarray = field(repr=False)

    def noise(self, usable: np.ndarray) -> Noise:
        """Return the noise of one run of which these blocks are compared."""
        good = np.repeat(usable[None, None, :], len(self.names), axis=1)
        return Noise(self.sd, self.rho, self.mixing, good)


def logged_instruments(fit: Fit) -> Instruments:
    """Return the channels of the log, with the noise that they showed."""
    noise = fit.task.noise
    return Instruments(fit.task.experiment.channels, noise.sd, noise.rho, noise.mixing)


def with_currents(logged: Instruments, wheels: Sequence[str]) -> Instruments:
    """Return the instruments with a motor current of every wheel.

    A current that is not logged has the SD of one sample, as much larger as the wheel rates' blocks are above theirs:
    what the ground adds to the one it adds to the other.
    """
    added = tuple(name for name in (f"current_{wheel}_A" for wheel in wheels) if name not in logged.names)
    sensors = Sensors()
    rates = [sd for name, sd in zip(logged.names, logged.sd, strict=True) if name.startswith("wheel_rate_")]
    worse = max(1.0, float(np.median(rates)) / float(sensors.rate_sd)) if rates else 1.0
    sd = np.full(len(added), worse * float(sensors.current_sd))
    return Instruments(
        (*logged.names, *added),
        np.concatenate([logged.sd, sd]),
        np.concatenate([logged.rho, np.zeros(len(added))]),
        block_diag(logged.mixing, np.eye(len(added))),
    )


@dataclass(frozen=True, eq=False)
class PredictedDifference:
    """A candidate run as both models drive it, with every channel that an instrument may read."""

    run: CandidateRun
    fits: tuple[Fit, Fit] = field(repr=False)
    models: tuple[Model, Model] = field(repr=False)
    experiment: DriveExperiment = field(repr=False)
    difference: np.ndarray = field(repr=False)
    "first - second (1, channels, blocks)"
    moving: tuple[np.ndarray, np.ndarray] = field(repr=False)
    "which blocks (blocks,) would be compared if the first were true, and if the second were"

    @cached_property
    def uncertainties(self) -> np.ndarray:
        """Shifts of the features (columns, 1, channels, blocks) by one SD along each axis of doubt of each fit.

        A number that both models have is taken to act in the second as it does in the first.
        """
        slopes_by_name: dict[str, np.ndarray] = {}
        shifts = []
        for fit, model in zip(self.fits, self.models, strict=True):
            missing = [at for at, parameter in enumerate(fit.parameters) if parameter.name not in slopes_by_name]
            task = Task(self.experiment, fit.task.noise)
            slopes_by_name |= (
                slopes_at(task, model, [fit.parameters[at] for at in missing], fit.u[missing]) if missing else {}
            )
            slopes = np.array([slopes_by_name[parameter.name] for parameter in fit.parameters])
            shifts.append(np.einsum("ij,i...->j...", _root(fit.covariance), slopes))
        return np.concatenate(shifts)

    def plain(self, instruments: Instruments) -> float:
        """Return the chi2 that the difference would have if both models were known exactly."""
        rows = self._rows(instruments)
        return float(
            np.mean([np.sum(noise.white(self.difference[:, rows]) ** 2) for noise in self._noises(instruments)])
        )

    def expected_chi2(self, instruments: Instruments) -> tuple[float, str]:
        """Return the chi2 expected of the wrong model, and the channel that adds most to it.

        d^T (I + A A^T)^-1 d with d the whitened difference and A the doubts, as d^T (d - A (I + A^T A)^-1 A^T d). With
        both fits' doubts in A this is no more than either model, if it is the wrong one, is to expect. Blocks where
        only one of the models stands still count half: they are compared only if the other is true.
        """
        rows, sums = self._rows(instruments), np.zeros(len(instruments.names))
        for noise in self._noises(instruments):
            difference, uncertainty = (
                noise.white(self.difference[:, rows]),
                noise.white(self.uncertainties[:, :, rows]).T,
            )
            inner = np.eye(uncertainty.shape[1]) + uncertainty.T @ uncertainty
            share = difference * (difference - uncertainty @ np.linalg.solve(inner, uncertainty.T @ difference))
            sums += 0.5 * np.bincount(np.nonzero(noise.good)[1], share, minlength=len(sums))
        return float(sums.sum()), instruments.names[int(sums.argmax())]

    def _noises(self, instruments: Instruments) -> list[Noise]:
        return [instruments.noise(usable) for usable in self.moving]

    def _rows(self, instruments: Instruments) -> list[int]:
        return [self.experiment.channels.index(name) for name in instruments.names]


def _root(covariance: np.ndarray) -> np.ndarray:
    """Return a matrix whose square L L^T is the covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def predict_difference(
    run: CandidateRun, fits: tuple[Fit, Fit], channels: tuple[str, ...]
) -> PredictedDifference | None:
    """Return what both models do on a run, held to the way of the first; None where one of them cannot drive it."""
    first_model, second_model = (run.on(fit.model) for fit in fits)
    try:
        rest_state = shared_rest(first_model, run.start)
        free = replay(first_model, run.commands(first_model.rover), rest_state=rest_state)
        place = np.column_stack([free.channels[name] for name in ("body_x", "body_y", "body_yaw")])
        commands = run.commands(first_model.rover, place)
        guided = replay(second_model, commands, rest_state=rest_state)
    except SimulationError:
        return None
    if free.stop or guided.stop:
        return None
    moving = [_moving(commands, drive, first_model) for drive in (free, guided)]
    compared = [blocks(rows, commands.period) > WHOLE for rows in moving]
    blank = np.zeros((len(channels), len(compared[0])))
    either = moving[0] | moving[1]
    ahead = LoggedRun(run.label, commands, channels, blank, place[:, 2], {}, either, either)
    experiment = DriveExperiment((ahead,), (rest_state,), logged(fits[0]).jobs)
    first, second = (
        experiment.read([drive], model.sensor_effects) for drive, model in ((free, first_model), (guided, second_model))
    )
    return PredictedDifference(
        run, fits, (first_model, second_model), experiment, first - second, (compared[0], compared[1])
    )


def _moving(commands: Commands, drive: Replay, model: Model) -> np.ndarray:
    """Return which rows would be compared if this were what the rover did."""
    rates = [drive.channels[f"wheel_rate_{wheel.name}"] for wheel in model.rover.wheels]
    return comparable_rows(commands, rates)
