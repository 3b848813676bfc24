"""The runs of a drive log as an experiment: many models are replayed on all processor cores, and their features are
compared.

A replay is a simulation with the commands of the log. A feature is a half-second mean that is compared with the log.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, cast

import numpy as np

from rover_pin.base.errors import ParameterError, SimulationError
from rover_pin.base.jobs.cluster import Workers, results
from rover_pin.base.jobs.time_left import showing_progress
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.effects.effect import SensorEffect
from rover_pin.estimation.experiment import Arrays, Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import rms_of
from rover_pin.estimation.random_effects.random_field import Kind, RandomField, join
from rover_pin.experiments.drive_log.block_noise import declared_block_sd, scatter
from rover_pin.experiments.drive_log.features import DRIFT, HEADING, PATH, SPEED, LoggedRun
from rover_pin.experiments.drive_log.model import owners, with_record
from rover_pin.experiments.drive_log.random_effects import (
    GROUND_ERROR,
    KINDS,
    STEPS,
    TRACKER,
    ground_columns,
    ground_error_columns,
    step_columns,
    tracker_columns,
)
from rover_pin.experiments.drive_log.resume import Memory, Recent, digest
from rover_pin.simulation.logged_inputs import PLACE
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import Perturbation, Replay, ReplayCommands, StepsTaken, replay
from rover_pin.simulation.start import SharedRest, shared_rest
from rover_pin.simulation.stepping.step_error import MARGIN
from rover_pin.simulation.trace.channels import unit_of
from rover_pin.terrain.terrain import Terrain

FEATURE_UNITS = {PATH: "m", DRIFT: "m", HEADING: "rad", SPEED: "m/s"}
"""Feature that is computed from several channels -> its unit."""
AHEAD = 0.005
"""Forward displacement [m] of the logged place. It shows how a drift of the tracker changes the predictions. The value
is some SDs of a tracker's noise."""
TWO_ROWS = np.array([0.0, 1.0])
"""Times of two rows [s]. Each sensor effect is applied to two such rows, to find out whether it changes the inputs of a
replay."""
LOST = 1e3
"""Value that replaces a prediction that is not a number, in the unit of the channel. The residual is then large but
finite, so that the fit continues."""
MIN_LENGTH = 0.05
"""Minimum length of a stretch of ground [m] in the search for the place of an effect."""


@dataclass(frozen=True, eq=False)
class DriveExperiment(Experiment):
    """The runs of a drive log as an experiment (`estimation.experiment.Experiment`) for the fit of models.

    The observations are the features of the runs (half-second means of channels, see `features`). A model predicts the
    features by replays: simulations with the logged commands, which are held to the logged place. Each run is held out
    of a fit alone.
    """

    runs: tuple[LoggedRun, ...]
    rests: tuple[SharedRest | None, ...] = field(repr=False)
    """the rover's state of rest at the start of each run; None if the rover does not settle at this start"""
    jobs: Workers = 1
    """worker processes that replay the runs"""
    memory: Memory = field(default=Memory(), repr=False)
    """store of results in files, from which a search that was stopped can continue"""
    recent: Recent = field(default_factory=Recent, repr=False)
    """store of the most recently computed predictions in this process"""
    noise_sd: Mapping[str, float] = field(default_factory=dict, repr=False)
    """declared SD of one sample in SI: key of the log's [noise] table -> SD"""
    is_timed = True
    stand_in = LOST
    difference = 1e-5
    no_value = "the rover does not settle there, or its drive breaks off"

    @cached_property
    def identity(self) -> str:
        """Digest of the runs and of the rest states at their starts. Stored results are found by this digest."""
        return digest(self.runs, self.rests)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Names of the compared features that all runs have."""
        return tuple(name for name in self.runs[0].channels if all(name in run.channels for run in self.runs))

    @cached_property
    def length(self) -> int:
        """Number of half-second blocks in the longest run, which is the last axis of all arrays of features."""
        return max(run.observed.shape[1] for run in self.runs)

    @cached_property
    def observed(self) -> np.ndarray:
        """Measured features (runs, channels, blocks); NaN in blocks that are not compared."""
        return self._pad_tables([run.observed for run in self.runs])

    @property
    def folds(self) -> tuple[str, ...]:
        """Names of the runs. Each run is held out alone."""
        return tuple(run.name for run in self.runs)

    @property
    def rate_driven(self) -> bool:
        """Whether the wheels follow their measured rates in at least one run, so that effects in the motors do not
        show.
        """
        return any(run.commands.rate_driven for run in self.runs)

    @property
    def free(self) -> DriveExperiment:
        """A copy of this experiment, in which the simulated rover drives freely from its start, without corrections
        towards the logged place.
        """
        # NaN as the place means that a replay gets no corrections.
        runs = tuple(_held_to(run, np.full_like(run.commands.place, np.nan)) for run in self.runs)
        return dataclasses.replace(self, runs=runs)

    def alone(self, name: str) -> DriveExperiment:
        """Return the experiment with a single run, the one with this name."""
        index = self.folds.index(name)
        return dataclasses.replace(self, runs=(self.runs[index],), rests=(self.rests[index],))

    def floor(self) -> np.ndarray:
        """Return the noise SD of each feature (channels,): from the scatter of the samples or from declared SDs,
        whichever is larger.
        """
        return np.asarray(np.fmax(scatter(self.runs, self.channels), declared_block_sd(self.noise_sd, self.channels)))

    def least_noise(self, model: Model) -> np.ndarray:
        """Return the minimum noise SD of each feature (channels,), which is the RMS error of a replay because of its
        finite time step.

        The error of a replay is taken as MARGIN / (1/2) times the change of its features when the time step is halved,
        as for every simulated drive. In a log without sensor noise, this error is the only noise.
        """

        def step_error() -> dict[str, np.ndarray]:
            tasks = [
                (model, run.commands, Perturbation(), rest_state, True)
                for run, rest_state in zip(self.runs, self.rests, strict=True)
            ]
            # The same replays with half the time step; the change estimates the error that the step size leaves.
            finer = self.read(self._spread_tasks(_replay_run, tasks), model.sensor_effects)
            change = finer - self.predict([model])[0]
            use = np.isfinite(self.observed) & (np.abs(change) < LOST / 2)
            return {"error": MARGIN / 0.5 * rms_of(change, use)}

        return np.fmax(super().least_noise(model), self.cached_arrays(("half the steps", model), step_error)["error"])

    def predict(self, models: Sequence[Model]) -> np.ndarray:
        """Return the features that each model predicts (models, runs, channels, blocks).

        A feature is a half-second mean that is compared with the log. Models that differ only in their sensors share
        one replay. Recently computed predictions are taken from a store.
        """
        # The digest contains all numbers of a model, so equal models share one prediction.
        keys = [digest(self.identity, model) for model in models]
        return np.array(self.recent.of(keys, lambda missing: self._model_features([models[i] for i in missing])))

    def predict_near(self, models: Sequence[Model]) -> np.ndarray:
        """Return the features that each of several similar models predicts (models, runs, channels, blocks), to compute
        derivatives.

        A feature is a half-second mean that is compared with the log. All replays use the time steps that were chosen
        for the first model, so the predictions are smooth functions of the models' numbers, as a derivative needs.
        """
        # Models that drive like the first one only need other sensors on the same replay.
        centre = self.replays(models[0])
        drives = [_drive_key(model, self.rate_driven) for model in models]
        other_models = [model for model, drive in zip(models, drives, strict=True) if drive != drives[0]]
        others = iter(self._model_features(other_models, [replay.steps for replay in centre]))
        return np.array(
            [
                self.read(centre, model.sensor_effects) if drive == drives[0] else next(others)
                for model, drive in zip(models, drives, strict=True)
            ]
        )

    def _model_features(self, models: Sequence[Model], steps: Sequence[StepsTaken | None] = ()) -> list[np.ndarray]:
        """Compute the features that each model predicts (runs, channels, blocks), without using stored predictions.

        The replay of each run uses the given time steps. If none are given, each replay chooses its own.
        """
        # Models that drive alike and differ only in their sensors form a group with one replay for each run.
        groups: dict[tuple[int, ...], list[int]] = {}
        for index, model in enumerate(models):
            groups.setdefault(_drive_key(model, self.rate_driven), []).append(index)
        by_run = list(zip(self.runs, self.rests, steps or [None] * len(self.runs), strict=True))
        tasks = [([models[index] for index in group], *parts) for group in groups.values() for parts in by_run]
        tables = iter(self._spread_tasks(_features, tasks))
        features: dict[int, list[np.ndarray]] = {index: [] for index in range(len(models))}
        for group in groups.values():
            for _ in by_run:
                for index, table in zip(group, next(tables), strict=True):
                    features[index].append(table)
        return [self._pad_tables(features[index]) for index in range(len(models))]

    def records(self, model: Model) -> dict[str, Any]:
        """Return a mapping from names to the parts of a model that have numbers to fit: "soil", "motor", and each
        effect.
        """
        return owners(model)

    def replace_record(self, model: Model, owner: str, record: Any) -> Model:
        """Return the model with another soil, motor or effect: `record` replaces the part named `owner`."""
        return with_record(model, owner, record)

    def unit(self, channel: str) -> str:
        """Return the unit of a compared feature."""
        return FEATURE_UNITS.get(channel) or unit_of(channel)

    def neighbours(self, candidate: Candidate, step: float) -> list[Candidate]:
        """Return variants of a candidate effect with one end of its stretch of ground moved by `step` [m]."""
        return neighbours(candidate, step)

    def random_field(self, model: Model) -> RandomField:
        """Return the effects that are drawn anew in each run: uneven ground, drift of the tracker, and ambiguous duty
        steps.

        The noise model contains them, with standard deviations that are learnt from the log.
        """
        replays, read = partial(self.perturbed_replays, model), partial(self.read_run, sensors=model.sensor_effects)
        late = [(index, duty) for index, run in enumerate(self.runs) for duty in run.later]

        def columns(make: Callable[..., Arrays], subject: Sequence[Any]) -> Arrays:
            request = (make.__name__, model)
            return self.cached_arrays(request, lambda: make(subject, model, self.predict([model])[0], replays, read))

        def slope_ahead() -> dict[str, np.ndarray]:
            held = []
            for run in self.runs:
                forward = np.array([np.cos(run.heading), np.sin(run.heading), 0.0 * run.heading]).T
                held.append(_held_to(run, run.commands.place + AHEAD * forward))
            # All replays are held 5 mm further ahead, and the change of their features is divided by this distance.
            displaced = dataclasses.replace(self, runs=tuple(held)).predict([model])[0]
            return {"slope": (displaced - self.predict([model])[0]) / AHEAD}

        # Change of the predictions per metre [1/m] if the tracker's place, to which a replay is held, is too far ahead.
        slope = self.cached_arrays(("held further ahead", model), slope_ahead)["slope"]
        ahead = np.where(np.abs(slope) < LOST, slope, 0.0)
        tracker = tracker_columns(self.runs, self.channels, self.length, ahead)
        parts: list[tuple[Sequence[Kind], Arrays]] = [(KINDS, columns(ground_columns, self.runs)), (TRACKER, tracker)]
        if any(run.ground for run in self.runs):

            def predict_on(requests: Sequence[tuple[int, Terrain]]) -> list[np.ndarray]:
                # All replays of a run take equal time steps, so that their differences contain no error of step sizes.
                steps, tasks = [driven.steps for driven in self.replays(model)], []
                for at, terrain in requests:
                    commands = dataclasses.replace(self.runs[at].commands, terrain=terrain)
                    tasks.append((model, commands, Perturbation(), self.rests[at], False, steps[at]))
                driven = zip(requests, self._spread_tasks(_replay_run, tasks), strict=True)
                return [read(at, replayed) for (at, _), replayed in driven]

            def ground_error() -> Arrays:
                return ground_error_columns(self.runs, self.predict([model])[0], predict_on)

            parts.append((GROUND_ERROR, self.cached_arrays((ground_error_columns.__name__, model), ground_error)))
        return join([*parts, (STEPS, columns(step_columns, late))] if late else parts)

    def cached_arrays(self, request: tuple[Any, ...], make: Callable[[], Arrays]) -> Arrays:
        """Return the arrays of a request for these runs from the store; if the store does not have them, compute and
        store them.
        """
        return self.memory.cached_arrays((self.identity, *request), make)

    def replays(self, model: Model, perturbations: Sequence[Perturbation] | None = None) -> tuple[Replay, ...]:
        """Return the replay of each run by a model. If `perturbations` (runs,) are given, each one disturbs the replay
        of its run.
        """
        return self.perturbed_replays(model, list(enumerate(perturbations or [Perturbation()] * len(self.runs))))

    def perturbed_replays(self, model: Model, perturbations: Sequence[tuple[int, Perturbation]]) -> tuple[Replay, ...]:
        """Return one replay of a model for each pair (index of the run, perturbation of the replay)."""
        tasks = [
            (model, self.runs[index].commands, perturbation, self.rests[index]) for index, perturbation in perturbations
        ]
        return tuple(self._spread_tasks(_replay_run, tasks))

    def read(self, replays: Sequence[Replay], sensors: Sequence[SensorEffect]) -> np.ndarray:
        """Return the features of all runs (runs, channels, blocks) as sensors with errors would measure them in given
        replays.
        """
        return np.array([self.read_run(index, replay, sensors) for index, replay in enumerate(replays)])

    def read_run(self, at: int, replay: Replay, sensors: Sequence[SensorEffect]) -> np.ndarray:
        """Return the features (half-second means) of a replay as the given sensors, with their errors, would measure
        them (channels, blocks). `at` is the index of the run.
        """
        return self._common(self.runs[at], self.runs[at].features(replay.channels, sensors))

    def _spread_tasks(self, function: Callable[..., Any], tasks: list[tuple[Any, ...]]) -> list:
        """Call a function once for each tuple of arguments, spread over all worker processes, and return the results in
        order.
        """
        return list(showing_progress(results(function, tasks, self.jobs, short=True), len(tasks), "replays"))

    def _pad_tables(self, tables: Sequence[np.ndarray]) -> np.ndarray:
        """Return the features of all runs, each with its own channels and length, as one array (runs, channels,
        blocks).
        """
        return np.array([self._common(run, table) for run, table in zip(self.runs, tables, strict=True)])

    def _common(self, run: LoggedRun, table: np.ndarray) -> np.ndarray:
        """Return the features of one run for the channels that all runs have (channels, blocks), filled with NaN after
        its end.
        """
        # Runs differ in length and in their channels, but one array needs the same shape for all.
        padded_table = np.full((len(self.channels), self.length), np.nan)
        padded_table[:, : table.shape[1]] = table[[run.channels.index(name) for name in self.channels]]
        return padded_table


def neighbours(candidate: Candidate, step: float) -> list[Candidate]:
    """Return variants of a candidate effect with one end of its stretch of ground moved by `step` [m].

    The search for the place of an effect compares these variants. Each end is moved forwards and backwards, which gives
    up to four variants. The list is empty if the place of the effect is not searched.
    """
    effect: Any = candidate.effect
    if not candidate.place_searched:
        return []
    # Each of the four variants moves one end by one step; stretches that become too short are left out.
    begin, end = float(effect.x_from), float(effect.x_from + effect.length)
    edges = [(begin - step, end), (begin + step, end), (begin, end - step), (begin, end + step)]
    moved = [effect.replace(x_from=start, length=stop - start) for start, stop in edges if stop - start > MIN_LENGTH]
    return [
        dataclasses.replace(candidate, effect=moved_effect, place=f"{float(moved_effect.x_from):.3f}")
        for moved_effect in moved
    ]


def experiment_of(
    runs: Sequence[LoggedRun],
    model: Model,
    jobs: Workers = 1,
    memory: Memory = Memory(),
    noise_sd: Mapping[str, float] = {},
) -> DriveExperiment:
    """Return logged runs as an experiment. Every model starts each run from the state of rest of `model`.

    The arguments `jobs`, `memory` and `noise_sd` are the fields of `DriveExperiment`.
    """
    # The rest state is found once and used by all models, which saves the settling of each of them.
    rests = results(_rest, [(model, run.commands) for run in runs], jobs)
    return DriveExperiment(tuple(runs), tuple(rests), jobs, memory, noise_sd=noise_sd)


def experiment_of_log(fit: Fit) -> DriveExperiment:
    """Return the experiment of a fit, for a fit that was made to a drive log."""
    return cast(DriveExperiment, fit.task.experiment)


def _held_to(run: LoggedRun, place: np.ndarray) -> LoggedRun:
    """Return the run with another place (rows, 3), which its replays are held to. With NaN, the replays drive
    freely.
    """
    return dataclasses.replace(run, commands=dataclasses.replace(run.commands, place=place))


def _rest(model: Model, run: ReplayCommands) -> SharedRest | None:
    """Return a model's state of rest at the start of a run, or None if the model does not settle at this start."""
    try:
        return shared_rest(run.on(model), run.start)
    except SimulationError:
        return None


def _replay_run(
    model: Model,
    run: ReplayCommands,
    perturbation: Perturbation,
    rest_state: SharedRest | None,
    fine: bool = False,
    steps: StepsTaken | None = None,
) -> Replay:
    """Replay a run by a model, that is, simulate the model with the logged commands.

    If the rover does not settle at the start or has impossible values, the replay has no channels except the times. For
    the arguments, see `simulation.replay.replay`.
    """
    try:
        return replay(model, run, perturbation, rest_state, fine, steps)
    except (ParameterError, SimulationError) as error:
        return Replay({"t_s": run.t}, str(error))


def _drive_key(model: Model, rate_driven: bool) -> tuple[int, ...]:
    """Return a key that is equal for models with equal replays: the identities of all parts that a replay depends on.

    The sensors of a model do not belong to the key, except sensors that change the inputs of a replay. These inputs are
    the logged place and, if `rate_driven` is True, the wheel rates.
    """
    # Identities suffice as a key, because models are immutable and share unchanged parts.
    parts = [getattr(model, part.name) for part in dataclasses.fields(model) if part.name != "sensor_effects"]
    rates = [f"wheel_rate_{wheel.name}" for wheel in model.rover.wheels] if rate_driven else []
    inputs = dict.fromkeys((*PLACE, *rates), TWO_ROWS)
    return tuple(map(id, (*parts, *(sensor for sensor in model.sensor_effects if sensor.undo(TWO_ROWS, inputs)))))


def _features(
    models: Sequence[Model], run: LoggedRun, rest_state: SharedRest | None, steps: StepsTaken | None
) -> list[np.ndarray]:
    """Return the features of one run (channels, blocks) that each of several models predicts, if they differ only in
    their sensors.

    The run is replayed once, and the sensors of each model measure this replay. Values that are not finite are replaced
    by LOST.
    """
    # Non-finite values would end a fit; a large finite error only makes the model improbable.
    channels = _replay_run(models[0], run.commands, Perturbation(), rest_state, steps=steps).channels
    tables = [run.features(channels, model.sensor_effects) for model in models]
    return [np.nan_to_num(table, nan=LOST, posinf=LOST, neginf=-LOST) for table in tables]
