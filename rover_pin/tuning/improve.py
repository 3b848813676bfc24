"""From measured data to a better control: identified models, torque bounds, tuned gains, and the predicted benefit.

The search for missing effects (`close_the_loop`) identifies models from the data. Several models that are equally
probable represent the uncertainty of the identification. The benefit of the control is predicted from drives on all of
these models.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import stdtrit

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file, is_folder
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.public import brief
from rover_pin.base.trust import Trust
from rover_pin.control.rover_bounds import bounds_of_model
from rover_pin.control.slip_control import HOLE_GAINS, HoleLaw
from rover_pin.control.torque_bounds import SLIP_LIMIT
from rover_pin.discrepancy.question import Progress
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.verdict_file import POSTERIOR
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.toml_file import models_of
from rover_pin.tuning.evaluations import Progress as Stages
from rover_pin.tuning.report import MIN_COST_CHANGE, TuningResult
from rover_pin.tuning.study import DriveCase, Effort, TuningStudy
from rover_pin.tuning.tune import tune_gains

Terrains = Mapping[str, Sequence[Mapping[str, Any]]]
"""The terrains of drives: name of a scenario -> a list of settings, with one drive for each entry of the list."""

TRAINING_TERRAINS: Terrains = {
    "incline": [{"terrain.angle_deg": 4.0}, {"terrain.angle_deg": 8.0}, {"terrain.angle_deg": 12.0}],
    "slope": [{}],
    "ditch": [{"terrain.wall_angle_deg": 35.0}, {"terrain.wall_angle_deg": 45.0}],
    "hills": [{}],
    "rocks": [{}],
}
HELD_OUT_TERRAINS: Terrains = {
    "incline": [{"terrain.angle_deg": 6.0}, {"terrain.angle_deg": 10.0}],
    "slope": [{"terrain.start": 0.25}],
    "ditch": [{"terrain.wall_angle_deg": 40.0}],
    "hills": [{"terrain.seed": 2}],
    "rocks": [{"terrain.seed": 2}],
}
"""TRAINING_TERRAINS and HELD_OUT_TERRAINS are the terrains of the training drives and of the held-out drives in a
tuning without a study of the user. Both have equal scenarios with different settings."""


def default_drives(terrains: Terrains) -> tuple[DriveCase, ...]:
    """Return the drives of a study for the terrains `terrains`: one drive for each entry, with the duration of its
    scenario.
    """
    return tuple(
        DriveCase(" ".join([scene, *(f"{value:g}" for value in ground.values())]), scene, tuple(ground.items()))
        for scene, settings in terrains.items()
        for ground in settings
    )


CONSTANT = "constant duty"
"""Name of the control with which the tuned control is compared."""
TUNED, UNTUNED = "the tuned control", "slip control with its gains before the tuning"
"""Names of the two slip controls that `improve` can advise."""
COVERAGE = 0.90
"""Probability that the interval of a prediction contains the true rover's value."""
DEFAULT_STUDY = TuningStudy(
    "usual grounds",
    default_drives(TRAINING_TERRAINS),
    default_drives(HELD_OUT_TERRAINS),
    {"k_p": (0.1, 10.0), "k_i": (0.1, 30.0), "S_d": (0.2, 0.8), "hole.S_deep": (0.0, 0.2), "hole.deep": (0.1, 0.4)},
    before=HOLE_GAINS,
    hole=HoleLaw(),
    estimate="onboard",
    effort=Effort(population=8, generations=5, starts=0, keep=4),
)
"""The tuning without a study of the user: it tunes the gains and the hole law of the slip control that reads on-board
sensors only."""


class Prediction(NamedTuple):
    """The prediction of a number for the true rover, with an interval, from its values on models that are equally
    probable.

    The true rover counts as one more draw from the normal distribution of these values, so that the interval follows
    from Student's t distribution.
    """

    mean: float
    """predicted value: the mean of the values that the models give"""
    low: float
    """lower end of the interval that contains the value of the true rover with the probability COVERAGE"""
    high: float
    """upper end of the interval that contains the value of the true rover with the probability COVERAGE"""

    @classmethod
    def of(cls, values: Any) -> Prediction:
        """Return the prediction of a number from its values on several models. A single value gives an infinite
        interval.
        """
        values = np.asarray(values, dtype=float)
        # The interval for one further draw from a normal distribution of unknown mean and variance.
        n, mean = len(values), float(np.mean(values))
        if n < 2:
            return cls(mean, -math.inf, math.inf)
        half = float(stdtrit(n - 1, 0.5 + COVERAGE / 2) * np.std(values, ddof=1) * math.sqrt(1.0 + 1.0 / n))
        return cls(mean, mean - half, mean + half)

    @property
    def opposite(self) -> Prediction:
        """The prediction of this number multiplied by -1."""
        return Prediction(0.0 - self.mean, 0.0 - self.high, 0.0 - self.low)

    def words(self, unit: str = "", digits: int = 2) -> str:
        """Return the prediction as text: the mean, the interval in brackets, and the unit."""
        # "z" writes a small negative number as 0.00 and not as -0.00.
        mean, low, high = (f"{value:z.{digits}f}" for value in self)
        return f"{mean} [{low}, {high}]{unit}"


@brief
@dataclass(frozen=True)
class Improvement:
    """The result of `improve`: torque bounds, tuned gains, and the predicted benefit of the tuned control."""

    tuning: TuningResult
    "the tuned gains with their scores"
    bounds: dict[str, Prediction]
    """predictions of the smallest torque bound of a wheel [N m], and of the slope [deg] that the rover climbs at the
    slip limit SLIP_LIMIT"""
    now: str
    "name of the control that the tuned control is compared with"
    gain: dict[str, Prediction]
    """predicted changes on held-out drives by the tuned control, compared with the control `now`: change of the
    fraction of drives that get through (`through`), change of the fraction that bury a wheel (`buried`), and saved cost
    (`cost saved`)
    """
    gain_before_tuning: dict[str, Prediction]
    """the part of the predicted change `gain` that slip control brings with its controller gains before the tuning,
    compared with the control `now`"""
    gain_of_tuning: dict[str, Prediction]
    """the part of the predicted change `gain` that the tuning brings: the tuned slip control, compared with slip
    control before the tuning"""

    @property
    def is_certain(self) -> bool:
        """Whether the whole interval of the saved cost is above 0."""
        return self.gain["cost saved"].low > 0.0

    @property
    def is_worth_it(self) -> bool:
        """Whether the mean of the saved cost is above MIN_COST_CHANGE, so that the tuned control is advised."""
        return self.gain["cost saved"].mean > MIN_COST_CHANGE

    @property
    def is_tuning_worth_it(self) -> bool:
        """Whether the mean of the cost that the tuning saves is above MIN_COST_CHANGE, compared with slip control
        before the tuning.
        """
        return self.gain_of_tuning["cost saved"].mean > MIN_COST_CHANGE

    @property
    def advice(self) -> str:
        """Name of the control that is advised: the tuned control, slip control with its gains before the tuning if the
        tuning adds no gain, or the present control if no gain is expected.
        """
        if self.is_worth_it and self.is_tuning_worth_it:
            return TUNED
        # Without a gain of the tuning, slip control before the tuning must bring the gain by itself.
        return UNTUNED if self.gain_before_tuning["cost saved"].mean > MIN_COST_CHANGE else self.now

    @property
    def sentence(self) -> str:
        """The predicted benefit of the tuned control in words, with the part that slip control brings before the
        tuning, and the part that the tuning brings. If there is no benefit, the advice is to keep the present control.
        """
        # The sentence states changes, so that a saved cost becomes a negative change.
        saved, through, buried = (self.gain[name] for name in ("cost saved", "through", "buried"))
        untuned, of_tuning = (part["cost saved"].opposite for part in (self.gain_before_tuning, self.gain_of_tuning))
        drives = len(self.tuning.study.held_out_runs)
        change = (
            f"compared with {self.now}, the cost of a drive changes by {saved.opposite.words()}, the fraction of "
            f"drives that get through by {100 * through.mean:+.0f} %, and the fraction that bury a wheel by "
            f"{100 * buried.mean:+.0f} %, on {drives} held-out drives. Slip control before the tuning brings "
            f"{untuned.words()} of this change of cost, and the tuning brings {of_tuning.words()}"
        )
        # A mean gain that is too small to matter gives the advice to keep the present control, whatever the interval
        # is.
        if not self.is_worth_it:
            return f"keep {self.now}, because no gain is expected: {change}"
        if self.advice == UNTUNED:
            change += ". The tuning adds no gain, so that the advice is slip control with its gains before the tuning"
        return f"gain: {change}" if self.is_certain else f"a gain is expected but not certain: {change}"

    def summary(self) -> dict[str, Any]:
        """Return the result as plain values, for a table or a JSON file."""
        # Only numbers that the tuning found are listed; without a hole law there is no such record.
        records = {"gains": self.tuning.gains, "hole law": self.tuning.hole}
        return {
            "gain": self.sentence,
            "gain is certain": self.is_certain,
            "advice": self.advice,
            **_in_words(self.bounds | self.gain),
            "gain of slip control before tuning": _in_words(self.gain_before_tuning),
            "gain of the tuning": _in_words(self.gain_of_tuning),
            "control": self.tuning.study.estimate,
            **{
                name: {key: float(value) for key, value in record.values().items()}
                for name, record in records.items()
                if record
            },
            "where": [line for line in self.tuning.by_ground() if line.startswith("held out")],
            "files": [str(file) for file in self.tuning.files],
        }


def _in_words(predictions: Mapping[str, Prediction]) -> dict[str, str]:
    """Return predictions as texts, by their names."""
    return {name: predicted.words() for name, predicted in predictions.items()}


def improve(
    data: str | Path,
    out: str | Path,
    study: TuningStudy | None = None,
    effects: str | Path | None = None,
    trust: bool = False,
    progress: Progress = lambda message: None,
    stages: Stages | None = None,
    workers: int = 0,
) -> Improvement:
    """Identify models from data, tune the slip control on these models, and predict the benefit of the tuned control.

    Parameters
    ----------
    data : path
        A drive log or a set of rig data, or the results folder of an earlier `close_the_loop`, which is then not
        repeated.
    out : path
        Folder for all results: `loop` with the results of `close_the_loop`, `control` with gains, tables and figures,
        and improve.json with a summary.
    study : TuningStudy, optional
        Drives and free numbers; by default DEFAULT_STUDY, the slip control with a hole law on several terrains.
    effects : path, optional
        Folder or file with your own effects, which the loop may add to the model.
    trust : bool
        Whether effect files that the data name may be executed.
    progress : callable
        Called with a line of text before each step of the loop.
    stages : callable, optional
        Called with the name of a stage of the tuning, the number of its finished evaluations, and their total.
    workers : int
        Number of processes; 0 for one per core.

    Returns
    -------
    Improvement
        The benefit compares the tuned control, which reads on-board sensors, with constant duty on held-out drives. Its
        interval covers the models that are consistent with the data. If no benefit above MIN_COST_CHANGE is expected,
        the advice is to keep constant duty; the tuned gains are also in `control` in this case.

    Raises
    ------
    DataError
        The data cannot be read, or the loop has found no model for the tuning.
    ParameterError
        A setting of the study or of the data is not allowed.
    OptimisationError
        Every training drive ends stuck with all gains.

    Examples
    --------
    >>> from rover_pin.tuning.improve import improve
    >>> print(improve("logs/monday", "out/improve").sentence)  # doctest: +SKIP
    """
    out = Path(out)
    # A folder with a verdict is the result of a loop already.
    loop = Path(data)
    if not is_file(loop / "verdict.json"):
        loop = out / "loop"
        close_the_loop(data, None, effects, loop, progress, jobs=workers, trust=trust)
    if not is_folder(loop / POSTERIOR):
        raise DataError(
            f"{loop}: close-loop wrote no models to the folder {POSTERIOR}, so that the control cannot be tuned on "
            "models from the data. The report of close-loop states why. Measure more data, or tune on a model of your "
            "own: rover-pin tune --model FILE."
        )
    # Tune on all models of the posterior, so that the gains do not fit one of them by chance.
    allowed = Trust.of(effects, trust)
    models = models_of(loop / POSTERIOR)
    tuning_study = (study or DEFAULT_STUDY).on_model(*models).trusting(allowed)
    # The slip estimate knows the posterior as a whole. It does not know which of its models is driven.
    if not tuning_study.believes:
        tuning_study = dataclasses.replace(tuning_study, believes=str(loop / POSTERIOR))
    tuning = tune_gains(tuning_study, out / "control", stages, workers or None)
    # The benefit is predicted from the held-out drives, which the search has not seen.
    improvement = improvement_of(tuning, predicted_bounds(models, {"trust": allowed}))
    replace_file(out / "improve.json", json.dumps(improvement.summary(), indent=1) + "\n")
    return improvement


def improvement_of(tuning: TuningResult, bounds: dict[str, Prediction]) -> Improvement:
    """Return the benefit of a tuning over constant duty, and its two parts: the benefit of slip control before the
    tuning, and the benefit of the tuning. The means of the two parts add up to the mean of the benefit. `bounds` are
    the torque bounds that the result contains.
    """
    before, tuned = (f"{when}, {tuning.study.estimate}" for when in ("before", "tuned"))
    pairs = ((CONSTANT, tuned), (CONSTANT, before), (before, tuned))
    return Improvement(tuning, bounds, CONSTANT, *(predicted_gain(tuning, *pair) for pair in pairs))


def predicted_bounds(
    models: tuple[Path, ...], settings: Mapping[str, Any], slip: float = SLIP_LIMIT, slope: float = 0.0
) -> dict[str, Prediction]:
    """Return predictions of the smallest torque bound of a rover's wheels and of the slope that the rover can climb,
    from several models in files.

    Parameters
    ----------
    models : tuple of Path
        Files of models that are equally probable.
    settings : mapping
        Settings of the scenario with each model, such as `trust`.
    slip : float
        Slip limit of the torque bound and of the climbable slope [-].
    slope : float
        Slope on which the torque bound is computed [rad].
    """
    rows = [bounds_of_model(scenario("flat", model=str(file), **settings).model, slip, slope) for file in models]
    return {
        "torque bound [N m]": Prediction.of([float(np.min(bounds.limit)) for bounds, _ in rows]),
        "climbable at the slip limit [deg]": Prediction.of([plain["climbable_at_slip_limit_deg"] for _, plain in rows]),
    }


def predicted_gain(tuning: TuningResult, old: str, new: str) -> dict[str, Prediction]:
    """Return the predicted benefit of the control `new` over the control `old`, from the held-out drives of a tuning.

    The controls are names in `tuning.drives`. The dict has three predictions: the change of the fraction of drives that
    get through (`through`), the change of the fraction that bury a wheel (`buried`), and the saved cost (`cost saved`).
    """
    # For each held-out drive: changes of getting through and of burying a wheel, and the saved cost.
    drives = {row.control: row.held_out for row in tuning.drives}
    runs, cost = tuning.study.held_out_runs, tuning.study.cost
    models = np.array([run.case.model_file for run in runs])
    # The drives of both controls are in one order, so that each pair belongs to one drive.
    rows = np.array(
        [
            (then.stuck - now.stuck, now.buried - then.buried, then.cost(cost) - now.cost(cost))
            for then, now in zip(drives[old], drives[new], strict=True)
        ]
    )
    # One value per model: the drives of a model are not independent, so only the differences between models count.
    means = np.array([rows[models == model].mean(axis=0) for model in dict.fromkeys(models)])
    return dict(zip(("through", "buried", "cost saved"), map(Prediction.of, means.T), strict=True))
