"""Wheel-rig data in the form that the loop (the search for missing effects) needs: one data set, or several with one
sand.

`RigData` holds the runs, the starting model of the loop, and the functions that the loop calls.
"""

import dataclasses
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from rover_pin.base.errors import DataError
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.discrepancy.question import LoopData, Progress, Question, quiet
from rover_pin.discrepancy.rivals import against_rivals
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.effect import Effect
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.side_shear import SideShear
from rover_pin.estimation.baselines import curves
from rover_pin.estimation.numbers import profiles
from rover_pin.experiments.wheel_rig.candidates import candidates, numbers_of, shown_by_rigs
from rover_pin.experiments.wheel_rig.checks import findings, too_poor
from rover_pin.experiments.wheel_rig.declared import describe_declared
from rover_pin.experiments.wheel_rig.describe import draft_curve
from rover_pin.experiments.wheel_rig.diagnostics import (
    JointExtra,
    RigExtra,
    cautions,
    diagnose,
    flags,
    parameter_cautions,
    set_errors,
)
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.joint_model import JointModel
from rover_pin.experiments.wheel_rig.model import RigModel, read_model, write_model
from rover_pin.experiments.wheel_rig.next_runs import next_runs
from rover_pin.experiments.wheel_rig.runs import RigRuns
from rover_pin.experiments.wheel_rig.unloaded import unloaded_readings, zero_readings
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_set import RigSet
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import KIND
from rover_pin.simulation.model.toml_file import read_model as read_rover_model
from rover_pin.terrain.shapes import flat

INACTIVE_ON_RIG = (NormalDamping, SideShear)
"""Effects of a rover's model that have no influence on a wheel that rolls straight ahead at constant speed. They are
skipped without a warning."""

log = logging.getLogger(__name__)


def start_on_rig(data: RigSet, file: str | Path, trust: Trust = Trust()) -> RigModel:
    """Read a model file and return it as the starting model of the search for missing effects on a rig data set.

    The file may hold the model of a wheel on a rig or of a rover. From a rover's model, soil, traction law and contact
    effects are used with the wheel of the rig. Effects that cannot act on a rig are removed with a warning.

    Raises
    ------
    DataError, ParameterError
        The file is not a model file or cannot be read.
    """
    if read_toml(Path(file)).get("kind") != KIND:
        return read_model(file, trust)
    model = read_rover_model(file, flat(), trust)
    # The slip of a rig is set by its drives, so effects that compute or change the slip have no place in its model.
    active = [
        effect for effect in model.all_effects if effect != model.slip and not isinstance(effect, INACTIVE_ON_RIG)
    ]
    # Motors, sensors and the body do not exist on a rig.
    contact = [effect for effect in active if isinstance(effect, Effect)]
    wheel_effects = tuple(effect for effect in contact if not effect.before_slip and not effect.places)
    omitted = dict.fromkeys(type(effect).__name__ for effect in active if effect not in wheel_effects)
    if omitted:
        log.warning("%s: %s cannot act on a wheel on a rig and is left out.", file, ", ".join(omitted))
    return RigModel(data.wheel, model.soils[0], wheel_effects)


@dataclass(frozen=True, eq=False)
class RigData(LoopData):
    """The runs of one or several rig data sets, with the starting model of the loop (the search for missing effects).

    If `model` is None, the loop starts from the model that the data sets declare. The model of one data set is a
    `RigModel`, and the model of several data sets is a `JointModel`.
    """

    experiment: RigExperiment
    model: RigModel | JointModel | None = None
    kind: ClassVar[str] = "wheel-rig"

    @classmethod
    def starting_from(cls, data: RigSet, start: Any, trust: Trust = Trust()) -> "RigData":
        """Return one data set together with the starting model of the search for missing effects.

        Parameters
        ----------
        data : RigSet
            The data set.
        start : RigModel, Soil, str, Path or None
            The model; or the soil that replaces the soil of the declared model; or the path of a model file; or None
            for the declared model.
        trust : Trust
            States whether code that a model file names may run.

        Raises
        ------
        DataError
            `start` is the model of a rover.
        """
        if isinstance(start, Model):
            raise DataError(
                f"{data.name}: the loop on a wheel-rig data set starts from the model of a wheel, but this is the "
                "model of a rover; give the model of a wheel or a model file."
            )
        experiment = RigExperiment((data,))
        if isinstance(start, (str, Path)):
            return cls(experiment, start_on_rig(data, start, trust))
        return cls(experiment, experiment.base_model(start) if isinstance(start, Soil) else start)

    @property
    def name(self) -> str:
        """Name of the data: the names of the data sets, joined by " + "."""
        return self.experiment.name

    def base_model(self) -> RigModel | JointModel:
        """Return the starting model of the search for missing effects: the given model, or otherwise the model that the
        data sets declare.
        """
        return self.model if self.model is not None else self.experiment.base_model()

    def question(self, kinds: Sequence[type], progress: Progress = quiet) -> Question:
        """Return the question of the loop on these data: which effects of the given classes does the base model lack?

        The result holds the data, the base model, its free parameters, and functions that return the candidate effects
        and the possible next runs. The uncertain constants of sand, wheel and rig are free parameters.
        """
        model, tried = self.base_model(), shown_by_rigs(kinds)
        return Question(
            self.kind,
            self.name,
            self.experiment,
            model,
            numbers_of(self.experiment, model),
            lambda base: candidates(self.experiment, base.model, tried),
            lambda base: draft_curve(self.experiment, base),
            offers=lambda leading: (next_runs(self.experiment.sets), unloaded_readings(self.experiment)),
        )

    def describe(self) -> str:
        """Return a text on the amount of data: number of runs and slip levels, range of the slip, and channels.

        If there are several data sets, the text describes the first one.
        """
        data = self.experiment.sets[0]
        slips = f"S from {data.slip.min():.2g} to {data.slip.max():.2g}"
        channels = ", ".join(channel.column for channel in data.channels)
        return f"{data.slip.size} runs at {len(data.level_names)} levels, {slips}; {channels}"

    def insufficient(self) -> str:
        """Return why the runs cannot determine the free parameters of the model; an empty text if they can determine
        them.
        """
        return too_poor(self.experiment, len(numbers_of(self.experiment, self.base_model())))

    def findings(self) -> tuple[Finding, ...]:
        """Check the data, and return the findings, such as gaps or repeated runs that scatter more than the stated
        noise.
        """
        return tuple(findings(self.experiment))

    def extra(self, verdict: Verdict, question: Question, progress: Progress = quiet, seed: int = 0) -> Verdict:
        """Return the verdict of the search for missing effects extended by the results that only rig data have.

        These results are diagnostics of the models, cautions, and held-out errors of simple curves. `seed` is the seed
        of the permutation tests of the residuals.
        """
        assert verdict.before is not None
        # A zero error that explains the data is checked by a reading without load, before any other run.
        proposed = (*zero_readings(verdict.named), *verdict.experiments)
        tried = [candidate.effect for candidate in question.candidates(verdict.before.fit)]
        declared = describe_declared(self.experiment.declared, tried, self.base_model().effects)
        if len(self.experiment.sets) > 1:
            # For several data sets: the held-out errors of each data set, of the joint model and of a simple curve
            # through the points of the data set alone.
            errors, rig = set_errors(self.experiment, verdict), self.experiment.declared
            fitted = verdict.after.numbers if verdict.after else ()
            against = parameter_cautions((), flags(rig, verdict.model.soil, float(rig.wheel.b), fitted))
            losses = [error.loss for error in errors if error.is_lost]
            return dataclasses.replace(
                verdict,
                extra=JointExtra(errors, declared),
                cautions=(*against, *verdict.cautions, *losses),
                experiments=proposed,
            )
        progress("errors of curves through the points, for comparison")
        # For one data set: diagnostics, cautions, likelihood profiles, and the errors of simple curves.
        (data,) = self.experiment.sets
        assert verdict.after is not None
        before, after = (
            diagnose(data, side.model, side.numbers, self.experiment.in_sds(side.fit.residual), seed)
            for side in (verdict.before, verdict.after)
        )
        # A pressed wheel has no slip, so a curve over slip is compared on the runs of the rolling wheel only.
        rolled = RigRuns(data.rolled)
        channels = [(name, self.experiment.unit(name)) for name in rolled.channels]
        verdict = dataclasses.replace(
            verdict,
            extra=RigExtra(before, after, declared),
            cautions=cautions(verdict, after),
            experiments=proposed,
            profiles=profiles(verdict.after.fit, tuple(number.name for number in verdict.after.numbers)),
        )
        return against_rivals(verdict, curves(rolled.observed, rolled.inputs, channels))

    def write_models(self, model: RigModel | JointModel, folder: Path, stem: str, note: str) -> list[Path]:
        """Write the model to files in a folder and return their paths. `note` is a remark for the reader of the files.

        The model of one data set becomes STEM.toml. A joint model becomes one file for each data set, STEM-SET.toml.
        """
        if isinstance(model, RigModel):
            return [write_model(model, folder / f"{stem}.toml", note)]
        # A file holds the model of a single wheel, so a joint model needs one file for each data set.
        names = self.experiment.runs
        return [write_model(model.of(name), folder / f"{stem}-{name}.toml", note) for name in names]
