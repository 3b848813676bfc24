"""What a tuning has found, in numbers and sentences: before and after, training and held out, beside constant duty."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.slip_control import Gains, save_gains
from rover_pin.plot import save, write_csv
from rover_pin.plot.tuning import frontier_figure, tuning_figure
from rover_pin.tuning.drive_score import Cost, Score
from rover_pin.tuning.study import SlipLaw, TuningStudy

COST_TOLERANCE = 1e-3
"""Costs closer than this count as equal."""


class Candidate(NamedTuple):
    """Numbers that the full rover has driven on the training drives."""

    stage: str
    "where they come from: before, search or polish"
    law: SlipLaw
    reduced_cost: float
    "NaN of a control that the reduced model does not know"
    cost: float
    "of the full rover"
    scores: tuple[Score, ...]


class Trial(NamedTuple):
    """Shares of the training drives that get through, and that bury a wheel, under numbers that the search tried."""

    passed: float
    buried: float

    @classmethod
    def of(cls, scores: np.ndarray) -> Trial:
        """Return the shares of scores (drives, parts)."""
        parts = Score(*np.transpose(scores))
        return cls(float(np.mean(1.0 - parts.stuck)), float(np.mean(parts.buried)))


class Drives(NamedTuple):
    """The full rover's scores under one control."""

    control: str
    training: tuple[Score, ...]
    held_out: tuple[Score, ...]


STATISTICS = ("mean", "worst", "10 % tail", "stuck share", "buried share")
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
    buried: float
    "share of drives that bury a wheel"


def digest(scores: Sequence[Score], cost: Cost) -> Digest:
    """Return mean, worst and 10 % tail of an ensemble's costs, and how many of its drives end stuck or buried."""
    costs = np.sort([score.cost(cost) for score in scores])
    worst = costs[-max(1, math.ceil(len(costs) / 10)) :]
    stuck, buried = (float(np.mean([getattr(score, name) for score in scores])) for name in ("stuck", "buried"))
    return Digest(float(np.mean(costs)), float(costs[-1]), float(np.mean(worst)), stuck, buried)


@dataclass(frozen=True)
class TuningResult:
    """The gains and how they were judged."""

    study: TuningStudy
    law: SlipLaw
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
    "where the search drove the full rover, and what the polish brought"
    trials: tuple[Trial, ...] = ()
    "of all that the search tried, in turn"

    @property
    def gains(self) -> Gains:
        """The gains found."""
        return self.law.gains

    @property
    def hole(self) -> HoleLaw | None:
        """The hole law found; None where S_d is constant."""
        return self.law.hole

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
            for estimate in self.study.compared:
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

    def by_ground(self) -> list[str]:
        """Return in a sentence a kind of ground how many of its drives get through, and bury a wheel."""
        table = self.table()
        names = ("constant duty", *(f"{when}, {self.study.estimate}" for when in ("before", "tuned")))
        lines = []
        for (where, ground), drives in table.groupby(["set", "ground"], sort=False):
            rows = [drives[drives["control"] == name] for name in names]
            counts = ", ".join(
                f"{name} {int(np.sum(1.0 - row['stuck']))} through and {int(row['buried'].sum())} buried"
                for name, row in zip(names, rows, strict=True)
            )
            lines.append(f"{where}, {ground}, of {len(rows[0])}: {counts}")
        return lines

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
            f"{where}: {control}": dict(zip(STATISTICS, statistics, strict=True))
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
            **({"hole law": {name: float(value) for name, value in self.hole.values().items()}} if self.hole else {}),
            **rows,
            **check,
            "verdict": [*self.verdicts(), *self.search_notes],
            "where": [*self.where(), *self.by_ground()],
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
            for where, runs, scores in (
                ("training", self.study.training_runs, drives.training),
                ("held out", self.study.held_out_runs, drives.held_out),
            ):
                for run, score in zip(runs, scores, strict=True):
                    cost, ground = score.cost(self.study.cost), run.case.scenario
                    rows.append((where, run.case.name, ground, run.seed, drives.control, cost, *score))
        return pd.DataFrame(rows, columns=["set", "drive", "ground", "seed", "control", "cost", *Score._fields])


def _warning(after: Digest, constant: Digest) -> str:
    if after.mean > constant.mean + COST_TOLERANCE:
        return ": the control makes things WORSE than constant duty."
    if after.mean > constant.mean - COST_TOLERANCE:
        return ": the control changes nothing."
    stuck = f"stuck {100 * after.stuck:.0f} % against {100 * constant.stuck:.0f} %"
    return f", {stuck}, buried {100 * after.buried:.0f} % against {100 * constant.buried:.0f} %."


def _title(result: TuningResult) -> str:
    free = ", ".join(f"{name} = {result.law.number(name):.3g}" for name in result.study.free)
    return f"{result.study.name}: tuned with {result.study.estimate} slip to {free}"


def write_result(result: TuningResult, out: Path) -> TuningResult:
    """Write gains.toml, drives.csv, candidates.csv and figures into `out`; return the result with their paths."""
    import pandas as pd

    study, table = result.study, result.table()
    on = f" on {', '.join(study.model_files)}" if study.model_files else ""
    comment = f"Found by rover_pin for '{study.name}'{on} with {study.estimate} slip.\n" + "\n".join(result.verdicts())
    numbers = tuple(dict.fromkeys((*result.gains.values(), *study.free)))
    rows = [
        (candidate.stage, *map(candidate.law.number, numbers), candidate.reduced_cost, candidate.cost)
        for candidate in result.candidates
    ]
    names = ["stage", *numbers, "reduced_cost", "full_cost"]
    files = (
        save_gains(result.gains, out / "gains.toml", comment, result.hole),
        write_csv(table, out / "drives.csv"),
        write_csv(pd.DataFrame(rows, columns=names), out / "candidates.csv"),
        save(tuning_figure(table, _title(result)), out / "drives.png"),
        save(frontier_figure(table, result.trials, study.estimate), out / "frontier.png"),
    )
    return dataclasses.replace(result, files=files)
