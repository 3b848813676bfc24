"""The result of a tuning in numbers and sentences, which compare controls on the training drives and the held-out
drives.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rover_pin.control.slip_control import Gains, HoleLaw, save_gains
from rover_pin.plot import save, write_csv
from rover_pin.plot.tuning import frontier_figure, tuning_figure
from rover_pin.tuning.drive_score import Cost, Score
from rover_pin.tuning.study import SlipLaw, TuningStudy

COST_TOLERANCE = 1e-3
"""Minimum difference between the mean costs of two controls. Below this value, the costs count as equal."""


class Candidate(NamedTuple):
    """One of the sets of gains that the result of a tuning is chosen from, with the scores of the full rover (the
    complete simulation) on all training drives.
    """

    stage: str
    """origin of the gains: `before` (the gains before the tuning), `search`, or `polish` (the descent after the
    search)"""
    law: SlipLaw
    "the gains and the hole law"
    reduced_cost: float
    """cost of the training drives with the reduced model; NaN if the reduced model does not contain this control"""
    cost: float
    "cost of the training drives with the full rover"
    scores: tuple[Score, ...]
    "scores of the training drives with the full rover"


class Trial(NamedTuple):
    """The success of one set of gains on the training drives. A figure shows the success of all gains that the search
    evaluated.
    """

    passed: float
    "fraction of the training drives that do not end stuck"
    buried: float
    "fraction of the training drives that bury a wheel"

    @classmethod
    def of(cls, scores: np.ndarray) -> Trial:
        """Return the success of a set of gains from its scores on all training drives, an array (drives, fields of a
        score).
        """
        parts = Score(*np.transpose(scores))
        return cls(float(np.mean(1.0 - parts.stuck)), float(np.mean(parts.buried)))


class ControlScores(NamedTuple):
    """The scores of one control on all drives of a study, driven by the full rover (the complete simulation)."""

    control: str
    "name of the control, for example `tuned, true`"
    training: tuple[Score, ...]
    "scores of the training drives, in their order"
    held_out: tuple[Score, ...]
    "scores of the held-out drives, in their order"


STATISTICS = ("mean", "worst", "10 % tail", "stuck share", "buried share")
"""Names of the fields of `CostStatistics` in tables and files."""
MIN_COST_CHANGE = 0.02
"""Minimum change of a drive's cost that counts as better or worse (assumed): 2 % of the cost of a drive without
progress."""
COMPARED_CONTROLS = ("the torque check alone", "the gains before", "the tuned gains")
"""Controls that `TuningResult.where` compares with constant duty, in this order."""


class CostStatistics(NamedTuple):
    """Statistics of the costs of several drives with one control, as the tables of the report show them."""

    mean: float
    "mean cost of the drives"
    worst: float
    """largest cost of a drive"""
    tail: float
    """mean cost of the worst 10 % of the drives; if there are fewer than ten drives, the cost of the worst drive"""
    stuck: float
    "fraction of the drives that end stuck"
    buried: float
    "fraction of the drives that bury a wheel"


def cost_statistics(scores: Sequence[Score], cost: Cost) -> CostStatistics:
    """Return the statistics of the costs of several drives from their scores, with the weights in `cost`."""
    # The costs are sorted, so that the worst drives are the last ones.
    costs = np.sort([score.cost(cost) for score in scores])
    tail = costs[-max(1, math.ceil(len(costs) / 10)) :]
    stuck, buried = (float(np.mean([getattr(score, name) for score in scores])) for name in ("stuck", "buried"))
    return CostStatistics(float(np.mean(costs)), float(costs[-1]), float(np.mean(tail)), stuck, buried)


@dataclass(frozen=True)
class TuningResult:
    """The result of a tuning: the tuned gains, and the scores that led to their choice and that test them."""

    study: TuningStudy
    law: SlipLaw
    "the tuned gains and hole law"
    candidates: tuple[Candidate, ...]
    """sets of gains with scores of the full rover; the tuned gains are one of them"""
    drives: tuple[ControlScores, ...]
    """scores of all drives with each control that the report compares"""
    check: tuple[tuple[str, float, float, float], ...]
    """errors of the reduced model on each training drive: name of the drive, RMSE of the slip [-], RMSE of the speed
    [m/s], distance between the end positions [m]"""
    evaluations: int
    """number of evaluations that were computed and not read from the file of an earlier tuning"""
    seconds: float
    "duration of the tuning [s]"
    files: tuple[Path, ...] = ()
    "files that were written"
    cautions: tuple[str, ...] = ()
    """sentences about effects that the reduced model, or every drive, leaves out (`drives.cautions`)"""
    search_notes: tuple[str, ...] = ()
    """sentences about the drives of the full rover in the search, and about the polish after the search"""
    trials: tuple[Trial, ...] = ()
    "success of all gains that the search evaluated, in their order"

    @property
    def gains(self) -> Gains:
        """The tuned gains."""
        return self.law.gains

    @property
    def hole(self) -> HoleLaw | None:
        """The tuned hole law, or None if the desired slip is constant."""
        return self.law.hole

    def statistics(self) -> dict[str, dict[str, CostStatistics]]:
        """Return the statistics of the costs for each set of drives and each control: name of the set -> control ->
        statistics.

        The sets of drives are `training`, and `held out` if there are held-out drives.
        """
        cost = self.study.cost
        table = {"training": {drives.control: cost_statistics(drives.training, cost) for drives in self.drives}}
        if self.study.held_out:
            table["held out"] = {drives.control: cost_statistics(drives.held_out, cost) for drives in self.drives}
        return table

    def verdicts(self) -> list[str]:
        """Return sentences that compare the mean cost of each control with the mean cost of constant duty.

        There are sentences for the training drives, and separate sentences for the held-out drives.
        """
        # One sentence for the torque check alone, and one for each slip estimate.
        sentences = []
        for where, table in self.statistics().items():
            constant, check = table["constant duty"], table["torque check"]
            sentences.append(
                f"{where}: the torque check alone has a cost of {check.mean:.3f}, compared with {constant.mean:.3f} "
                f"for constant duty{_consequence(check, constant)}"
            )
            for estimate in self.study.compared:
                before, after = table[f"before, {estimate}"], table[f"tuned, {estimate}"]
                sentences.append(
                    f"{where}, {estimate} slip: the tuned control has a cost of {after.mean:.3f}, compared with "
                    f"{before.mean:.3f} before the tuning and {constant.mean:.3f} for constant duty"
                    f"{_consequence(after, constant)}"
                )
        return sentences

    def where(self) -> list[str]:
        """Return sentences with the numbers of drives that each control makes better and worse than constant duty.

        There is one sentence for the training drives, and one for the held-out drives. A drive is better or worse if
        its cost differs by more than `MIN_COST_CHANGE`.
        """
        cost, estimate, sentences = self.study.cost, self.study.estimate, []
        # Without held-out drives, only the training drives are compared.
        for name, part in [("training", "training"), *([("held out", "held_out")] if self.study.held_out else [])]:
            costs = {
                drives.control: np.array([score.cost(cost) for score in getattr(drives, part)])
                for drives in self.drives
            }
            constant, check = costs["constant duty"], costs["torque check"]
            before, tuned = costs[f"before, {estimate}"], costs[f"tuned, {estimate}"]
            # Arrays (controls, drives): whether the control lowers, or raises, the cost of the drive.
            better, worse = (
                [sign * (constant - trial) > MIN_COST_CHANGE for trial in (check, before, tuned)]
                for sign in (1.0, -1.0)
            )
            counts = [
                f"{int(np.sum(gains))} are better and {int(np.sum(losses))} are worse with {control}"
                for control, gains, losses in zip(COMPARED_CONTROLS, better, worse, strict=True)
            ]
            sentences.append(
                f"{name}, {len(constant)} drives, compared with constant duty: {', '.join(counts)}; "
                "the tuned gains are better than the gains before on "
                f"{int(np.sum(tuned < before - MIN_COST_CHANGE))} drives; no control is better than constant duty on "
                f"{int(np.sum(~np.any(better, axis=0)))} drives"
            )
        return sentences

    def by_ground(self) -> list[str]:
        """Return a sentence for each scenario with the numbers of drives that get through and that bury a wheel with
        each control.
        """
        table = self.table()
        controls = {
            "constant duty": "constant duty",
            "the gains before": f"before, {self.study.estimate}",
            "the tuned gains": f"tuned, {self.study.estimate}",
        }
        # The groups keep the order of the table: training drives first, then held-out drives.
        lines = []
        for (where, ground), drives in table.groupby(["set", "ground"], sort=False):
            counts = []
            for words, control in controls.items():
                rows = drives[drives["control"] == control]
                through, buried = np.sum(1.0 - rows["stuck"]), rows["buried"].sum()
                counts.append(f"with {words}, {through:.0f} get through and {buried:.0f} bury a wheel")
            lines.append(f"{where}, {ground}, {len(rows)} drives: {'; '.join(counts)}")
        return lines

    def summary(self) -> dict[str, Any]:
        """Return gains, statistics, errors of the reduced model and sentences as plain values, for a table or JSON."""
        rows = {
            f"{where}: {control}": dict(zip(STATISTICS, statistics, strict=True))
            for where, table in self.statistics().items()
            for control, statistics in table.items()
        }
        # The errors of the reduced model are in millimetres, because they are small.
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
        """Return the scores as a pandas DataFrame, with one row for every drive with every control."""
        import pandas as pd

        rows = []
        # One row for each drive under each control, with the fields of the score as columns.
        for drives in self.drives:
            for where, runs, scores in (
                ("training", self.study.training_runs, drives.training),
                ("held out", self.study.held_out_runs, drives.held_out),
            ):
                for run, score in zip(runs, scores, strict=True):
                    cost, ground = score.cost(self.study.cost), run.case.scenario
                    rows.append((where, run.case.name, ground, run.seed, drives.control, cost, *score))
        return pd.DataFrame(rows, columns=["set", "drive", "ground", "seed", "control", "cost", *Score._fields])


def _consequence(after: CostStatistics, constant: CostStatistics) -> str:
    """Return the end of a sentence that compares a control with constant duty.

    The text states the fractions of drives that end stuck or bury a wheel, or it states that the control does not help.
    """
    if after.mean > constant.mean + COST_TOLERANCE:
        return ". The control is WORSE than constant duty."
    if after.mean > constant.mean - COST_TOLERANCE:
        return ". The control changes nothing."
    return (
        f"; {100 * after.stuck:.0f} % of the drives end stuck instead of {100 * constant.stuck:.0f} %, and "
        f"{100 * after.buried:.0f} % bury a wheel instead of {100 * constant.buried:.0f} %."
    )


def write_result(result: TuningResult, out: Path) -> TuningResult:
    """Write the result of a tuning to a folder: gains.toml, drives.csv, candidates.csv and figures.

    Return a copy of the result that also has the paths of the files.
    """
    import pandas as pd

    # The file of gains begins with a comment about the tuning from which the gains come.
    study, table = result.study, result.table()
    on = f" on {', '.join(study.model_files)}" if study.model_files else ""
    comment = f"Tuned by rover_pin for the study '{study.name}'{on} with {study.estimate} slip.\n" + "\n".join(
        result.verdicts()
    )
    # The columns of candidates.csv are all gains, and the free numbers of the hole law.
    numbers = tuple(dict.fromkeys((*result.gains.values(), *study.free)))
    rows = [
        (candidate.stage, *map(candidate.law.number, numbers), candidate.reduced_cost, candidate.cost)
        for candidate in result.candidates
    ]
    names = ["stage", *numbers, "reduced_cost", "full_cost"]
    # The title of the figure states the tuned numbers.
    free = ", ".join(f"{name} = {result.law.number(name):.3g}" for name in study.free)
    title = f"{study.name}, tuned with {study.estimate} slip: {free}"
    files = (
        save_gains(result.gains, out / "gains.toml", comment, result.hole),
        write_csv(table, out / "drives.csv"),
        write_csv(pd.DataFrame(rows, columns=names), out / "candidates.csv"),
        save(tuning_figure(table, title), out / "drives.png"),
        save(frontier_figure(table, result.trials, study.estimate), out / "frontier.png"),
    )
    return dataclasses.replace(result, files=files)
