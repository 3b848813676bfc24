"""A drive log in the form that the search for missing effects needs: data check, base model, candidates, and additional
results.
"""

import dataclasses
import functools
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from rover_pin.base.code_digest import key_of_code
from rover_pin.base.errors import DataError
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.jobs.cluster import Workers
from rover_pin.base.trust import Trust
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import with_draft
from rover_pin.discrepancy.question import LoopData, Progress, Question, quiet
from rover_pin.discrepancy.rivals import against_rivals
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.estimation.numbers import profiles
from rover_pin.experiments.drive_log.calibrate import experiment_on
from rover_pin.experiments.drive_log.candidates import candidates
from rover_pin.experiments.drive_log.checks.log import findings, too_poor
from rover_pin.experiments.drive_log.experiment import experiment_of_log
from rover_pin.experiments.drive_log.features import run_name
from rover_pin.experiments.drive_log.free_runs import DriveExtra, cautions, free_runs
from rover_pin.experiments.drive_log.ground_variability import ground_variability
from rover_pin.experiments.drive_log.model import base_model, is_rate_driven, with_spread, with_wheels
from rover_pin.experiments.drive_log.next_drives import next_drives
from rover_pin.experiments.drive_log.odometry_rival import odometry_baselines
from rover_pin.experiments.drive_log.resume import Memory
from rover_pin.experiments.unlisted.actions import Scene
from rover_pin.experiments.unlisted.residual import describe, draft_term
from rover_pin.experiments.unlisted.terms import functions
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.logs.drive_log import DriveLog
from rover_pin.measurements.checks import Finding
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.effect_files import file_of, offered_effects, user_effects
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.toml_file import RIG_KIND, read_model, write_model


def start_on_log(log: DriveLog, file: str | Path, trust: Trust = Trust()) -> Model:
    """Read a model file and return it as the starting model of the search for missing effects on a drive log.

    If the file holds the model of a single wheel, soil, traction law and contact effects come from this file, and
    rover, motors and ground from the log.

    Raises DataError or ParameterError if the file is not a model file or cannot be read, or if the model of a wheel
    does not have exactly one SoilTraction.
    """
    if read_toml(Path(file)).get("kind") != RIG_KIND:
        return read_model(file, log.terrain(), trust)
    # A drive has exactly one traction law, which the effects of the base model complete.
    wheel = read_rig_model(file, trust)
    tractions = [effect for effect in wheel.effects if isinstance(effect, SoilTraction)]
    if len(tractions) != 1:
        raise DataError(
            f"{file}: the model of a wheel has {len(tractions)} effects SoilTraction, but the model of a rover needs "
            "exactly one; correct the model file."
        )
    declared = base_model(log)
    effects = base_effects(wheel.soil, declared.rover, tractions[0], declared.gravity)
    model = dataclasses.replace(declared, soils=(wheel.soil, *declared.soils[1:]), effects=effects)
    return functools.reduce(Model.having, wheel.effects, model)


@dataclass(frozen=True, eq=False)
class DriveLogData(LoopData):
    """A drive log with everything that the search for missing effects needs: the start model, worker processes, and a
    store of finished replays.
    """

    log: DriveLog
    model: Model | None = None
    """starting model of the search for missing effects; None: the model that the log declares"""
    workers: Workers = 1
    memory: Memory = Memory()
    kind: ClassVar[str] = "drive-log"

    @classmethod
    def starting_from(
        cls, log: DriveLog, start: Any, workers: Workers = 1, trust: Trust = Trust(), memory: Memory = Memory()
    ) -> "DriveLogData":
        """Return a drive log together with the starting model of the search for missing effects.

        `start` is the model of a rover, a model file, or None for the model that the log declares.

        Raises DataError if `start` is not the model of a rover, or if its rover has other wheels than the rover of the
        log.
        """
        model = start_on_log(log, start, trust) if isinstance(start, (str, Path)) else start
        if not isinstance(model, (Model, type(None))):
            raise DataError(
                f"{log.folder}: close-loop on a drive log starts from the model of a rover, but this is a "
                f"{type(model).__name__}; give a model of the rover or a model file."
            )
        if model is not None:
            # Columns of the log are named by its wheels, so that a model with other wheels cannot be compared.
            log_wheels, model_wheels = _wheel_names(log.load_rover()), _wheel_names(model.rover)
            if log_wheels != model_wheels:
                raise DataError(
                    f"{log.folder}: the rover of the model has the wheels {model_wheels}, but the rover of the log has "
                    f"{log_wheels}; give a model of the log's rover."
                )
        return cls(log, model, workers, memory)

    def remembering(self, folder: Path | None, effects: str | Path | None) -> "DriveLogData":
        """Return the data with a store that keeps results of replays in `folder`, so that a search that was stopped can
        continue.

        Replays depend on the formulas of the effects. Therefore stored results are used only if the code of all effect
        files is unchanged: the user's file `effects`, the files of effects that other installed packages offer, and
        the files of the effects in the model. If `folder` is None, nothing is stored.
        """
        if folder is None:
            return self
        # Results are found by the code of these files, so that a changed formula never meets old results.
        users = (*offered_effects(), *(user_effects(effects) if effects else ()))
        kinds = (*users, *map(type, self.base_model().all_effects))
        memory = Memory(folder, key_of_code({file_of(kind) for kind in kinds}))
        return dataclasses.replace(self, model=self.base_model(), memory=memory)

    @property
    def name(self) -> str:
        """Name of the log."""
        return self.log.metadata.name

    def base_model(self) -> Model:
        """Return the starting model of the search for missing effects."""
        return self.model if self.model is not None else base_model(self.log)

    def question(self, kinds: Sequence[type], progress: Progress = quiet) -> Question:
        """Return the question of the search for missing effects on this log: which effect, at which wheel, channel or
        place, does the model lack?

        `kinds` are the classes of the effects that are considered.
        """
        if self.memory.status:
            progress(f"continuing: {self.memory.status}")
        # Motors and tachogenerators differ a little even without a missing effect, so their gains are fitted too.
        start = with_spread(self.base_model(), motors=not is_rate_driven(self.log))
        experiment, model, numbers = experiment_on(self.log, start, self.workers, progress, self.memory)
        return Question(
            self.kind,
            self.name,
            experiment,
            model,
            numbers,
            lambda base: candidates(base.model, experiment, base.parameters, kinds),
            functions=lambda base: functions(Scene(base)),
            offers=next_drives,
        )

    def describe(self) -> str:
        """Return a text with the number of runs, their total duration, and the name of the rover."""
        # Durations of the runs, not of the driving.
        seconds = sum(float(run.t[-1] - run.t[0]) for run in self.log.runs)
        return f"{len(self.log.runs)} runs, {seconds:.0f} s, rover {self.log.metadata.rover}"

    def insufficient(self) -> str:
        """Return why the runs vary too little for an answer of the search for missing effects, or an empty text if they
        vary enough.
        """
        return too_poor(self.log)

    def findings(self) -> tuple[Finding, ...]:
        """Check the log, and return the findings of the data check."""
        return findings(self.log)

    def extra(self, verdict: Verdict, question: Question, progress: Progress = quiet, seed: int = 0) -> Verdict:
        """Return the verdict extended by the remaining residual, free simulations, ground variability, and wheel
        odometry.
        """
        assert verdict.before is not None
        assert verdict.after is not None
        assert verdict.beliefs is not None
        progress("describing the remaining residual")
        after, rover = verdict.after.fit, question.model.rover
        # The likelihood profiles are those of the sizes of the named effects.
        causes = verdict.beliefs.best(verdict.named).causes
        amplitudes = tuple(name for cause in causes for name in sorted(cause.amplitudes))
        residual = describe(after, progress)
        progress("driving the runs freely")
        experiment = experiment_of_log(after)
        free = free_runs(experiment, verdict.before.model, verdict.model)
        # A ground that was estimated, or assumed to be flat, is no declaration that the log could contradict.
        undeclared = {run_name(trace) for trace in self.log.runs if self.log.is_estimated(trace)}
        ground = ground_variability(after, undeclared)
        odometry = odometry_baselines(experiment, rover)
        verdict = with_draft(verdict, lambda fitted: draft_term(fitted, residual, self.name, progress), seed)
        # The sentence of the verdict names a wheel by its number; a reader also needs the name.
        action = f"The unlisted cause {residual.best.description}." if verdict.answer is Answer.NONE_FITS else ""
        sentences = " ".join(filter(None, (verdict.sentence, action, ground.sentence if ground else "")))
        verdict = dataclasses.replace(
            verdict,
            sentence=with_wheels(sentences, [wheel.name for wheel in rover.wheels], "{name}[{number}] (wheel {wheel})"),
            profiles=profiles(after, amplitudes) if amplitudes and verdict.named else (),
            cautions=(*verdict.cautions, *cautions(verdict, free)),
            extra=DriveExtra(free, residual, ground),
        )
        return against_rivals(verdict, odometry, same_inputs=experiment.rate_driven)

    def write_models(self, model: Model, folder: Path, stem: str, note: str) -> list[Path]:
        """Write the model to the file stem.toml in `folder`. The path of the rover's file is written relative to
        `folder`.
        """
        # The name of a shipped rover has no suffix and needs no path.
        rover = Path(self.log.rover)
        path = os.path.relpath(rover.resolve(), folder.resolve()) if rover.suffix else ""
        return [write_model(model, folder / f"{stem}.toml", note, path)]

    @contextmanager
    def resuming(self, progress: Progress = quiet) -> Iterator[None]:
        """Keep results of replays in the folder of the store during this `with` block, and remove them when the block
        is finished.
        """
        with self.memory.noting():
            yield
        self.memory.remove_files()


def _wheel_names(rover: Rover) -> str:
    return ", ".join(wheel.name for wheel in rover.wheels)
