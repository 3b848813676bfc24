"""From measured data to better control: a model with its posterior, torque bounds, tuned gains, what they gain."""

from __future__ import annotations

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
from rover_pin.base.quantity import Record
from rover_pin.base.trust import Trust
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.rover_bounds import bounds_of_model
from rover_pin.control.slip_control import HOLE_GAINS
from rover_pin.control.torque_bounds import SLIP_LIMIT
from rover_pin.discrepancy.question import Progress
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.verdict_file import POSTERIOR
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.toml_file import models_of
from rover_pin.tuning.evaluations import Progress as Stages
from rover_pin.tuning.report import WORTH, TuningResult
from rover_pin.tuning.study import DriveCase, Effort, TuningStudy
from rover_pin.tuning.tune import tune_gains

Grounds = Mapping[str, Sequence[Mapping[str, Any]]]

TRAINED_ON: Grounds = {
    "incline": [{"terrain.angle_deg": 4.0}, {"terrain.angle_deg": 8.0}, {"terrain.angle_deg": 12.0}],
    "slope": [{}],
    "ditch": [{"terrain.wall_angle_deg": 35.0}, {"terrain.wall_angle_deg": 45.0}],
    "hills": [{}],
    "rocks": [{}],
}
HELD_OUT_ON: Grounds = {
    "incline": [{"terrain.angle_deg": 6.0}, {"terrain.angle_deg": 10.0}],
    "slope": [{"terrain.start": 0.25}],
    "ditch": [{"terrain.wall_angle_deg": 40.0}],
    "hills": [{"terrain.seed": 2}],
    "rocks": [{"terrain.seed": 2}],
}
"""Grounds by scenario with their settings, for who names none: what the scenarios of one heading are."""


def usual_drives(grounds: Grounds) -> tuple[DriveCase, ...]:
    """Return a drive of the usual duration on each ground."""
    return tuple(
        DriveCase(" ".join([scene, *(f"{value:g}" for value in ground.values())]), scene, tuple(ground.items()))
        for scene, settings in grounds.items()
        for ground in settings
    )


COVERED = 0.90
"""Probability of the interval of a predicted gain."""
STUDY = TuningStudy(
    "usual grounds",
    usual_drives(TRAINED_ON),
    usual_drives(HELD_OUT_ON),
    {"k_p": (0.1, 10.0), "k_i": (0.1, 30.0), "S_d": (0.2, 0.8), "hole.S_deep": (0.0, 0.2), "hole.deep": (0.1, 0.4)},
    before=HOLE_GAINS,
    hole=HoleLaw(),
    estimate="onboard",
    effort=Effort(population=8, generations=5, starts=0, keep=4),
)
"""What is tuned where no study is named: the hole law, by what rates, currents and angles say."""


class Predicted(NamedTuple):
    """A number of the true rover, from equally probable models: Student's t of one more draw."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Any) -> Predicted:
        """Return mean and interval, of probability COVERED, of the next value; of one value it is unknown."""
        values = np.asarray(values, dtype=float)
        n, mean = len(values), float(np.mean(values))
        if n < 2:
            return cls(mean, -math.inf, math.inf)
        half = float(stdtrit(n - 1, 0.5 + COVERED / 2) * np.std(values, ddof=1) * math.sqrt(1.0 + 1.0 / n))
        return cls(mean, mean - half, mean + half)

    @property
    def opposite(self) -> Predicted:
        """The number with the other sign."""
        return Predicted(0.0 - self.mean, 0.0 - self.high, 0.0 - self.low)

    def words(self, unit: str = "", digits: int = 2) -> str:
        """Return it as text."""
        return f"{self.mean:.{digits}f} [{self.low:.{digits}f}, {self.high:.{digits}f}]{unit}"


@brief
@dataclass(frozen=True)
class Improvement:
    """What the data say of the control: bounds and gains, and what these gain on drives that were not tuned on."""

    tuning: TuningResult
    bounds: dict[str, Predicted]
    "least torque bound of a wheel [N m], and the slope [deg] that is climbed at SLIP_LIMIT"
    now: str
    "the control that is compared with"
    gain: dict[str, Predicted]
    "of tuned against now, on the drives held out: share through, share buried, cost saved"

    @property
    def is_certain(self) -> bool:
        """Whether the interval of the cost saved lies above nothing."""
        return self.gain["cost saved"].low > 0.0

    @property
    def is_worth_it(self) -> bool:
        """Whether the cost saved, expected over the models, counts."""
        return self.gain["cost saved"].mean > WORTH

    @property
    def sentence(self) -> str:
        """The predicted gain in a sentence, or that none is expected: then the control of now is to be kept."""
        saved, through, buried = (self.gain[name] for name in ("cost saved", "through", "buried"))
        drives = len(self.tuning.study.held_out_runs)
        what = (
            f"the cost of a drive changes by {saved.opposite.words()}, {100 * through.mean:+.0f} % of drives get "
            f"through and {100 * buried.mean:+.0f} % bury a wheel, against {self.now} on {drives} drives that were not "
            "tuned on"
        )
        if not self.is_worth_it:
            return f"keep {self.now}, no gain is expected: {what}"
        return f"gain: {what}" if self.is_certain else f"a gain is expected, not certain: {what}"

    def summary(self) -> dict[str, Any]:
        """Return plain values, for a table or JSON."""
        records = {"gains": self.tuning.gains, "hole law": self.tuning.hole}
        return {
            "gain": self.sentence,
            "gain is certain": self.is_certain,
            "advice": "the tuned control" if self.is_worth_it else self.now,
            **{name: predicted.words() for name, predicted in (self.bounds | self.gain).items()},
            "control": self.tuning.study.estimate,
            **{name: _plain(record) for name, record in records.items() if record},
            "where": [line for line in self.tuning.by_ground() if line.startswith("held out")],
            "files": [str(file) for file in self.tuning.files],
        }


def _plain(record: Record) -> dict[str, float]:
    return {name: float(value) for name, value in record.values().items()}


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
    """Close the loop on data, tune the slip control over its posterior, and predict what that gains.

    Parameters
    ----------
    data : path
        A drive log or a rig set, or the folder of results of a loop on one.
    out : path
        Folder: `loop` has the loop's results, `control` the gains, the tables and figures; improve.json the rest.
    study : TuningStudy, optional
        Drives and free numbers; else STUDY, the hole law on the usual grounds.
    effects, trust
        As of `close_the_loop`.
    progress, stages : callable
        Called with a line before each step of the loop, and with the stage, its finished evaluations and their number.
    workers : int
        Processes; 0 for all cores.

    Returns
    -------
    Improvement
        The gain is of a control by on-board sensors against constant duty, on drives that were not tuned on, with an
        interval over the models that the data leave open. Where no gain above WORTH is expected over these, it says to
        keep constant duty; what was tuned stays in `control` nevertheless.

    Raises
    ------
    DataError, ParameterError, OptimisationError
        As `close_the_loop` and `tune_gains`.
    """
    out = Path(out)
    loop = Path(data)
    if not is_file(loop / "verdict.json"):
        loop = out / "loop"
        close_the_loop(data, None, effects, loop, progress, jobs=workers, trust=trust)
    if not is_folder(loop / POSTERIOR):
        raise DataError(
            f"{loop}: this loop left no {POSTERIOR} to tune over; its report says why. Measure more, or tune on a "
            "model yourself: rover-pin tune --model FILE."
        )
    allowed = Trust.of(effects, trust)
    models = models_of(loop / POSTERIOR)
    tuning_study = (study or STUDY).on_model(*models).trusting(allowed)
    tuning = tune_gains(tuning_study, out / "control", stages, workers or None)
    improvement = Improvement(
        tuning, torque_bounds(models, {"trust": allowed}), "constant duty", predicted_gain(tuning)
    )
    replace_file(out / "improve.json", json.dumps(improvement.summary(), indent=1) + "\n")
    return improvement


def torque_bounds(
    models: tuple[Path, ...], settings: Mapping[str, Any], slip: float = SLIP_LIMIT, slope: float = 0.0
) -> dict[str, Predicted]:
    """Return the least torque bound on a slope [rad], and the slope climbed at a slip, over the models so set."""
    rows = [bounds_of_model(scenario("flat", model=str(file), **settings).model, slip, slope) for file in models]
    return {
        "torque bound [N m]": Predicted.of([float(np.min(bounds.limit)) for bounds, _ in rows]),
        "climbable at the slip limit [deg]": Predicted.of([plain["climbable_at_slip_limit_deg"] for _, plain in rows]),
    }


def predicted_gain(tuning: TuningResult) -> dict[str, Predicted]:
    """Return what the tuned control gains against constant duty on the drives held out, over their models."""
    drives = {row.control: row.held_out for row in tuning.drives}
    runs, cost = tuning.study.held_out_runs, tuning.study.cost
    models = np.array([run.case.model_file for run in runs])
    pairs = list(zip(drives["constant duty"], drives[f"tuned, {tuning.study.estimate}"], strict=True))
    rows = np.array(
        [
            (now.stuck - tuned.stuck, tuned.buried - now.buried, now.cost(cost) - tuned.cost(cost))
            for now, tuned in pairs
        ]
    )
    means = np.array([rows[models == model].mean(axis=0) for model in dict.fromkeys(models)])
    return dict(zip(("through", "buried", "cost saved"), map(Predicted.of, means.T), strict=True))
