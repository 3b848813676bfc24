"""What a tuning has found, in numbers and sentences: before and after, training and held out, beside constant duty."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rover_pin.control.gains_file import save_gains
from rover_pin.control.slip_control import Gains
from rover_pin.plot import save, write_csv
from rover_pin.plot.tuning import tuning_figure
from rover_pin.tuning.drive_score import Cost, Score
from rover_pin.tuning.study import ESTIMATES, TuningStudy

COST_TOLERANCE = 1e-3
"""Costs closer than this count as equal."""


class Candidate(NamedTuple):
    """Gains that the full rover has driven on the training drives."""

    stage: str
    "where they come from: before, search or polish"
    gains: Gains
    reduced_cost: float
    cost: float
    "of the full rover"
    scores: tuple[Score, ...]


class Drives(NamedTuple):
    """The full rover's scores under one control."""

    control: str
    training: tuple[Score, ...]
    held_out: tuple[Score, ...]


WORTH = 0.02
"""Difference of a drive's cost that counts as better or worse: a fiftieth of a drive that goes nowhere (assumed)."""


CONTROLLED = ("the torque check alone", "the gains before", "the tuned gains")
"""What the counts of a verdict are of, in order."""


class Digest(NamedTuple):
    """An ensemble in a few numbers."""

    mean: float
    worst: float
    tail: float
    "mean of the worst tenth, one drive at least"
    stuck: float
    "share of drives that end stuck"


def digest(scores: Sequence[Score], cost: Cost) -> Digest:
    """Return mean, worst, 10 % tail and stuck share of an ensemble's costs."""
    costs = np.sort([score.cost(cost) for score in scores])
    worst = costs[-max(1, math.ceil(len(costs) / 10)) :]
    stuck = float(np.mean([score.stuck for score in scores]))
    return Digest(float(np.mean(costs)), float(costs[-1]), float(np.mean(worst)), stuck)


@dataclass(frozen=True)
class TuningResult:
    """The gains and how they were judged."""

    study: TuningStudy
    gains: Gains
    candidates: tuple[Candidate, ...]
    drives: tuple[Drives, ...]
    check: tuple[tuple[str, float, float, float], ...]
    "drive, RMSE of slip [-], of speed [m/s], end distance [m] of the reduced model from the full rover"
    evaluations: int
    seconds: float
    files: tuple[Path, ...] = ()
    cautions: tuple[str, ...] = ()
    "what the reduced model, or every drive, leaves out of the model"
    search_notes: tuple[str, ...] = ()
    "where the search drove the full rover, and where the polish was not begun"

    def digests(self) -> dict[str, dict[str, Digest]]:
        """Return 'training' and 'held out' -> control -> Digest; without held-out drives only the first."""
        cost = self.study.cost
        table = {"training": {drives.control: digest(drives.training, cost) for drives in self.drives}}
        if self.study.held_out:
            table["held out"] = {drives.control: digest(drives.held_out, cost) for drives in self.drives}
        return table

    def verdicts(self) -> list[str]:
        """Return sentences on what the tuning is worth, the bad news included."""
        sentences = []
        for where, table in self.digests().items():
            constant, check = table["constant duty"], table["torque check"]
            sentences.append(
                f"{where}: the torque check alone {check.mean:.3f} against {constant.mean:.3f} at constant duty"
                f"{_warning(check, constant)}"
            )
            for estimate in ESTIMATES:
                before, after = table[f"before, {estimate}"], table[f"tuned, {estimate}"]
                sentences.append(
                    f"{where}, {estimate} slip: tuned {after.mean:.3f} against {before.mean:.3f} before and "
                    f"{constant.mean:.3f} at constant duty{_warning(after, constant)}"
                )
        return sentences

    def where(self) -> list[str]:
        """Return in a sentence a set on how many drives a control helps, tuning adds to it, and nothing does."""
        sets = [("training", "training"), *([("held out", "held_out")] if self.study.held_out else [])]
        return [f"{name}: {self._outcome_counts(part)}" for name, part in sets]

    def _outcome_counts(self, part: str) -> str:
        cost, by = self.study.cost, self.study.estimate
        costs = {
            drives.control: np.array([score.cost(cost) for score in getattr(drives, part)]) for drives in self.drives
        }
        constant, check = costs["constant duty"], costs["torque check"]
        before, tuned = costs[f"before, {by}"], costs[f"tuned, {by}"]
        helped, harmed = (
            [sign * (constant - trial) > WORTH for trial in (check, before, tuned)] for sign in (1.0, -1.0)
        )
        counts = [f"{what} {int(np.sum(which))}" for what, which in zip(CONTROLLED, helped, strict=True)]
        return (
            f"of {len(constant)} drives, better than at constant duty: {', '.join(counts)}; worse: "
            f"{', '.join(str(int(np.sum(which))) for which in harmed)}; tuning adds to the gains before on "
            f"{int(np.sum(tuned < before - WORTH))}; nothing helps on {int(np.sum(~np.any(helped, axis=0)))}"
        )

    def summary(self) -> dict[str, Any]:
        """Return the gains, the digests, the check of the reduced model and the verdicts, for a table or JSON."""
        rows = {
            f"{where}: {control}": dict(zip(("mean", "worst", "10 % tail", "stuck share"), statistics, strict=True))
            for where, table in self.digests().items()
            for control, statistics in table.items()
        }
        check = {
            f"reduced model on {name}": {"slip RMSE": slip, "speed RMSE [mm/s]": 1e3 * speed, "end x [mm]": 1e3 * end}
            for name, slip, speed, end in self.check
        }
        return {
            "study": self.study.name,
            "tuned by": f"{self.study.estimate} slip",
            **({"model": list(self.study.model_files)} if self.study.model_files else {}),
            "gains": {name: float(value) for name, value in self.gains.values().items()},
            **rows,
            **check,
            "verdict": [*self.verdicts(), *self.search_notes],
            "where": self.where(),
            **({"warnings": list(self.cautions)} if self.cautions else {}),
            "new evaluations": self.evaluations,
            "seconds": round(self.seconds, 1),
            "files": [str(file) for file in self.files],
        }

    def table(self) -> Any:
        """Return a pandas DataFrame with a row for every drive under every control."""
        import pandas as pd

        rows = []
        for drives in self.drives:
            for where, cases, scores in (
                ("training", self.study.training, drives.training),
                ("held out", self.study.held_out, drives.held_out),
            ):
                for case, score in zip(cases, scores, strict=True):
                    rows.append((where, case.name, drives.control, score.cost(self.study.cost), *score))
        return pd.DataFrame(rows, columns=["set", "drive", "control", "cost", *Score._fields])


def _warning(after: Digest, constant: Digest) -> str:
    if after.mean > constant.mean + COST_TOLERANCE:
        return ": the control makes things WORSE than constant duty."
    if after.mean > constant.mean - COST_TOLERANCE:
        return ": the control changes nothing."
    return f", stuck {100 * after.stuck:.0f} % against {100 * constant.stuck:.0f} %."


def _title(result: TuningResult) -> str:
    free = ", ".join(f"{name} = {float(getattr(result.gains, name)):.3g}" for name in result.study.free)
    return f"{result.study.name}: tuned with {result.study.estimate} slip to {free}"


def write_result(result: TuningResult, out: Path) -> TuningResult:
    """Write gains.toml, drives.csv, candidates.csv and drives.png into `out`; return the result with their paths."""
    import pandas as pd

    study = result.study
    on = f" on {', '.join(study.model_files)}" if study.model_files else ""
    comment = f"Found by rover_pin for '{study.name}'{on} with {study.estimate} slip.\n" + "\n".join(result.verdicts())
    rows = [
        (candidate.stage, *candidate.gains.values().values(), candidate.reduced_cost, candidate.cost)
        for candidate in result.candidates
    ]
    names = ["stage", *result.gains.values(), "reduced_cost", "full_cost"]
    files = (
        save_gains(result.gains, out / "gains.toml", comment),
        write_csv(result.table(), out / "drives.csv"),
        write_csv(pd.DataFrame(rows, columns=names), out / "candidates.csv"),
        save(tuning_figure(result.table(), _title(result)), out / "drives.png"),
    )
    return dataclasses.replace(result, files=files)
