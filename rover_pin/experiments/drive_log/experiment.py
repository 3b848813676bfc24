"""Many models on the runs of a log: replays on all cores, and what the log's channels would have been."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, cast

import numpy as np

from rover_pin.base.errors import ParameterError, SimulationError
from rover_pin.base.jobs.cluster import Workers, results
from rover_pin.base.jobs.time_left import telling
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.effects.effect import SensorEffect
from rover_pin.estimation.experiment import Arrays, Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import rms_of
from rover_pin.estimation.random_effects.random_field import RandomField, join
from rover_pin.experiments.drive_log.features import LoggedRun
from rover_pin.experiments.drive_log.ground.field import KINDS, ground_columns
from rover_pin.experiments.drive_log.parameters import owners, with_record
from rover_pin.experiments.drive_log.places import neighbours
from rover_pin.experiments.drive_log.readings.ambiguous_timing import STEPS, step_columns
from rover_pin.experiments.drive_log.readings.scatter import declared_block_sd, scatter
from rover_pin.experiments.drive_log.readings.tracker import TRACKER, tracker_columns
from rover_pin.experiments.drive_log.resume import Memory, Recent, digest
from rover_pin.simulation.logged_inputs import PLACE
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.outcome.step_error import MARGIN
from rover_pin.simulation.replay import Commands, Perturbation, Replay, StepsTaken, replay
from rover_pin.simulation.start.place import SharedRest, shared_rest
from rover_pin.simulation.trace.channels import unit_of

MADE = {"path": "m", "drift": "m", "heading": "rad", "speed": "m/s"}
"""Units of the features that are made of several channels."""
AHEAD = 0.005
"""How much further ahead runs are held to learn what a wandering place moves [m]: some SDs of a tracker's noise."""
TWO_ROWS = np.array([0.0, 1.0])
"""What sensors are asked about to learn whether they misread the inputs of replays."""
LOST = 1e3
"""What a prediction that is not a number counts as while a fit descends [channel's unit]: far, but finite."""


@dataclass(frozen=True, eq=False)
class DriveExperiment(Experiment):
    """The runs of a log, where the rover stood at the start of each, how many processes replay them, what is kept."""

    runs: tuple[LoggedRun, ...]
    rests: tuple[SharedRest | None, ...] = field(repr=False)
    jobs: Workers = 1
    memory: Memory = field(default=Memory(), repr=False)
    recent: Recent = field(default_factory=Recent, repr=False)
    noise_sd: Mapping[str, float] = field(default_factory=dict, repr=False)
    "what the log declares of its sensors, in SI by kind"
    is_timed = True
    stand_in = LOST
    difference = 1e-5
    no_value = "the rover does not settle there, or its drive breaks off"

    @cached_property
    def identity(self) -> str:
        """A digest of the runs and of where they start."""
        return digest(self.runs, self.rests)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """The features that all runs have."""
        return tuple(name for name in self.runs[0].channels if all(name in run.channels for run in self.runs))

    @cached_property
    def length(self) -> int:
        """Blocks of the longest run."""
        return max(run.observed.shape[1] for run in self.runs)

    @cached_property
    def observed(self) -> np.ndarray:
        """Measured features (runs, channels, blocks); not a number where nothing is compared."""
        return self._pad_tables([run.observed for run in self.runs])

    def floor(self) -> np.ndarray:
        """Return the SD of each feature (channels,) that its samples' scatter shows, or the log states: the greater."""
        return np.asarray(np.fmax(scatter(self.runs, self.channels), declared_block_sd(self.noise_sd, self.channels)))

    def least_noise(self, model: Model) -> np.ndarray:
        """Return the RMS error of a replay in each feature (channels,), no less than LEAST_NOISE.

        As a drive states its own, it is MARGIN / (1/2) times what half the step moves, judged as a drive's. A log
        without noise shows that alone.
        """

        def step_error() -> dict[str, np.ndarray]:
            tasks = [
                (model, run.commands, Perturbation(), rest_state, True)
                for run, rest_state in zip(self.runs, self.rests, strict=True)
            ]
            finer = self.read(self._spread_tasks(_replay_run, tasks), model.sensor_effects)
            change = finer - self.predict([model])[0]
            use = np.isfinite(self.observed) & (np.abs(change) < LOST / 2)
            return {"error": MARGIN / 0.5 * rms_of(change, use)}

        return np.fmax(super().least_noise(model), self.cached_arrays(("half the steps", model), step_error)["error"])

    @property
    def folds(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.name for run in self.runs)

    @property
    def rate_driven(self) -> bool:
        """Whether the wheels are held to their measured rates in some run: then the motors are out of sight."""
        return any(run.commands.rate_driven for run in self.runs)

    @property
    def free(self) -> DriveExperiment:
        """The experiment on which nothing draws the rover to the logged places: it drives freely from its start."""
        runs = tuple(_held_to(run, np.full_like(run.commands.place, np.nan)) for run in self.runs)
        return dataclasses.replace(self, runs=runs)

    def alone(self, name: str) -> DriveExperiment:
        """Return the experiment of one of the runs."""
        at = self.folds.index(name)
        return dataclasses.replace(self, runs=(self.runs[at],), rests=(self.rests[at],))

    def predict(self, models: Sequence[Model]) -> np.ndarray:
        """Return the features of each model (models, runs, channels, blocks).

        Models that differ in their sensors only are replayed once, and what was predicted a moment ago not again.
        """
        keys = [digest(self.identity, model) for model in models]
        return np.array(self.recent.of(keys, lambda missing: self._model_features([models[at] for at in missing])))

    def predict_near(self, models: Sequence[Model]) -> np.ndarray:
        """Return the features of each model (models, runs, channels, blocks), replayed by the steps of the first."""
        centre = self.replays(models[0])
        drives = [_drives(model, self.rate_driven) for model in models]
        elsewhere = [model for model, drive in zip(models, drives, strict=True) if drive != drives[0]]
        others = iter(self._model_features(elsewhere, [replay.steps for replay in centre]))
        return np.array(
            [
                self.read(centre, model.sensor_effects) if drive == drives[0] else next(others)
                for model, drive in zip(models, drives, strict=True)
            ]
        )

    def _model_features(self, models: Sequence[Model], steps: Sequence[StepsTaken | None] = ()) -> list[np.ndarray]:
        """Return the features of each model (runs, channels, blocks), its replay of each run by these steps."""
        groups: dict[tuple[int, ...], list[int]] = {}
        for at, model in enumerate(models):
            groups.setdefault(_drives(model, self.rate_driven), []).append(at)
        by_run = list(zip(self.runs, self.rests, steps or [None] * len(self.runs), strict=True))
        tasks = [([models[at] for at in group], *parts) for group in groups.values() for parts in by_run]
        tables = iter(self._spread_tasks(_features, tasks))
        features: dict[int, list[np.ndarray]] = {at: [] for at in range(len(models))}
        for group in groups.values():
            for _ in by_run:
                for at, table in zip(group, next(tables), strict=True):
                    features[at].append(table)
        return [self._pad_tables(features[at]) for at in range(len(models))]

    def records(self, model: Model) -> dict[str, Any]:
        """Return the soil, the motor and the effects of a model, by name."""
        return owners(model)

    def replace_record(self, model: Model, owner: str, record: Any) -> Model:
        """Return the model with another soil, motor or effect."""
        return with_record(model, owner, record)

    def unit(self, channel: str) -> str:
        """Return the unit of a feature."""
        return MADE.get(channel) or unit_of(channel)

    def neighbours(self, candidate: Candidate, step: float) -> list[Candidate]:
        """Return a candidate on a stretch of the way with its edges moved."""
        return neighbours(candidate, step)

    def random_field(self, model: Model) -> RandomField:
        """Return how each run's ground may differ from the declared, its tracker wander and its commands come late."""
        replays, read = partial(self.perturbed_replays, model), partial(self.read_run, sensors=model.sensor_effects)
        late = [(at, duty) for at, run in enumerate(self.runs) for duty in run.later]

        def columns(make: Callable[..., Arrays], subject: Sequence[Any]) -> Arrays:
            request = (make.__name__, model)
            return self.cached_arrays(request, lambda: make(subject, model, self.predict([model])[0], replays, read))

        tracker = tracker_columns(self.runs, self.channels, self.length, self._ahead(model))
        parts = [(KINDS, columns(ground_columns, self.runs)), (TRACKER, tracker)]
        return join([*parts, (STEPS, columns(step_columns, late))] if late else parts)

    def _ahead(self, model: Model) -> np.ndarray:
        """Return d features / d place (runs, channels, blocks) [1/m] for runs that are held further ahead."""

        def slope_ahead() -> dict[str, np.ndarray]:
            ahead = [np.array([np.cos(run.heading), np.sin(run.heading), 0.0 * run.heading]).T for run in self.runs]
            pairs = zip(self.runs, ahead, strict=True)
            runs = tuple(_held_to(run, run.commands.place + AHEAD * way) for run, way in pairs)
            displaced = dataclasses.replace(self, runs=runs).predict([model])[0]
            return {"slope": (displaced - self.predict([model])[0]) / AHEAD}

        change = self.cached_arrays(("held further ahead", model), slope_ahead)["slope"]
        return np.where(np.abs(change) < LOST, change, 0.0)

    def cached_arrays(self, request: tuple[Any, ...], make: Callable[[], Arrays]) -> Arrays:
        """Return what was made of these runs before, or make and keep it."""
        return self.memory.cached_arrays((self.identity, *request), make)

    def replays(self, model: Model, perturbations: Sequence[Perturbation] | None = None) -> tuple[Replay, ...]:
        """Return the replays of one model, perhaps perturbed, one perturbation a run."""
        return self.perturbed_replays(model, list(enumerate(perturbations or [Perturbation()] * len(self.runs))))

    def perturbed_replays(self, model: Model, perturbations: Sequence[tuple[int, Perturbation]]) -> tuple[Replay, ...]:
        """Return the replays of one model on these runs, by index, under these perturbations."""
        tasks = [(model, self.runs[at].commands, perturbation, self.rests[at]) for at, perturbation in perturbations]
        return tuple(self._spread_tasks(_replay_run, tasks))

    def read(self, replays: Sequence[Replay], sensors: Sequence[SensorEffect]) -> np.ndarray:
        """Return the features (runs, channels, blocks) of replays as these sensors report them."""
        return np.array([self.read_run(at, replay, sensors) for at, replay in enumerate(replays)])

    def read_run(self, at: int, replay: Replay, sensors: Sequence[SensorEffect]) -> np.ndarray:
        """Return the features (channels, blocks) of one run's replay as these sensors report them."""
        return self._common(self.runs[at], self.runs[at].features(replay.channels, sensors))

    def _spread_tasks(self, function: Callable[..., Any], tasks: list[tuple[Any, ...]]) -> list:
        return list(telling(results(function, tasks, self.jobs, short=True), len(tasks), "replays"))

    def _pad_tables(self, tables: Sequence[np.ndarray]) -> np.ndarray:
        """Return tables (channels, blocks) of the runs as one array, the common channels, gaps at the ends."""
        return np.array([self._common(run, table) for run, table in zip(self.runs, tables, strict=True)])

    def _common(self, run: LoggedRun, table: np.ndarray) -> np.ndarray:
        padded_table = np.full((len(self.channels), self.length), np.nan)
        padded_table[:, : table.shape[1]] = table[[run.channels.index(name) for name in self.channels]]
        return padded_table


def experiment_of(
    runs: Sequence[LoggedRun],
    model: Model,
    jobs: Workers = 1,
    memory: Memory = Memory(),
    noise_sd: Mapping[str, float] = {},
) -> DriveExperiment:
    """Return the experiment on which every model starts where this one comes to rest."""
    rests = results(_rest, [(model, run.commands) for run in runs], jobs)
    return DriveExperiment(tuple(runs), tuple(rests), jobs, memory, noise_sd=noise_sd)


def experiment_of_log(fit: Fit) -> DriveExperiment:
    """Return the experiment of a fit to a drive log."""
    return cast(DriveExperiment, fit.task.experiment)


def _held_to(run: LoggedRun, place: np.ndarray) -> LoggedRun:
    return dataclasses.replace(run, commands=dataclasses.replace(run.commands, place=place))


def _rest(model: Model, run: Commands) -> SharedRest | None:
    try:
        return shared_rest(run.on(model), run.start)
    except SimulationError:
        return None


def _replay_run(
    model: Model,
    run: Commands,
    perturbation: Perturbation,
    rest_state: SharedRest | None,
    fine: bool = False,
    steps: StepsTaken | None = None,
) -> Replay:
    """Return the replay; where the rover does not even settle or can have no such body, one in which nothing moves."""
    try:
        return replay(model, run, perturbation, rest_state, fine, steps)
    except (ParameterError, SimulationError) as error:
        return Replay({"t_s": run.t}, str(error))


def _drives(model: Model, rate_driven: bool) -> tuple[int, ...]:
    """Return what a replay depends on: a model but its sensors, by identity, with those that misread its inputs."""
    parts = [getattr(model, each.name) for each in dataclasses.fields(model) if each.name != "sensor_effects"]
    rates = [f"wheel_rate_{wheel.name}" for wheel in model.rover.wheels] if rate_driven else []
    inputs = dict.fromkeys((*PLACE, *rates), TWO_ROWS)
    return tuple(map(id, (*parts, *(sensor for sensor in model.sensor_effects if sensor.undo(TWO_ROWS, inputs)))))


def _features(
    models: Sequence[Model], run: LoggedRun, rest_state: SharedRest | None, steps: StepsTaken | None
) -> list[np.ndarray]:
    """Return the features of models that drive alike: one replay, read by the sensors of each."""
    channels = _replay_run(models[0], run.commands, Perturbation(), rest_state, steps=steps).channels
    tables = [run.features(channels, model.sensor_effects) for model in models]
    return [np.nan_to_num(table, nan=LOST, posinf=LOST, neginf=-LOST) for table in tables]
