"""Whether `improve` keeps its word: predicted gains of logs against those on the true, hidden rover.

Question
    Does the 90 % interval of a predicted gain hold the gain on the true sand as often as it says, and does the tuned
    control ever harm?
Method
    Drive logs by `rover-pin demo drive-log`: sand off by what bench tests err, an effect of six or none hidden, motors
    and tachogenerators not quite alike, sensors' noise, a tracker that wanders. `improve` closes the loop and tunes on
    the usual grounds (with less effort than it usually makes, EFFORT). Then the held-out grounds are driven on the true
    model with noise of another seed: the true gain is the cost saved against constant duty. Where no gain above
    MIN_COST_CHANGE is expected, `improve` says to keep constant duty. Harm: a true gain below -MIN_COST_CHANGE where
    it does not. That rule was thought of after 38 sets of seeds 88101 to 88138; these are of others.
Result
    31 of the 40 sets (the time was up): the true gain lies inside the interval of 90 % in 29; constant duty is kept in
    24, none of which loses a gain by that; the tuned control is advised in 7 and gains in all of them. No harm. No
    gain is certain: the loop leaves open by how much sand loses strength past its peak.
What the paper says
    Nothing of the kind.
What differs
    The interval is that of a mean over the grounds.

Run: python studies/blind_improve.py [--quick] [--sets N] [--workers N] [--out DIR]
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from rover_pin import plot
from rover_pin.demo.drive_log import declared_model, hidden_model, write
from rover_pin.demo.hidden import ANY
from rover_pin.simulation.model.toml_file import write_model
from rover_pin.tuning.drive_score import Cost, Score
from rover_pin.tuning.drives import CONSTANT_DUTY, Control, full_score
from rover_pin.tuning.improve import DEFAULT_STUDY, improve
from rover_pin.tuning.report import MIN_COST_CHANGE
from rover_pin.tuning.study import Effort, SlipLaw, TuningStudy

SEED, ROVER = 88_201, "nexus6"
EFFORT = Effort(population=5, generations=3, starts=0, keep=2)
QUICK = Effort(population=5, generations=0, starts=0, keep=1)
NOISE_SEED = 7_000
RESULTS = Path(__file__).parent / "results"


class Row(NamedTuple):
    """A set: what it hid, the gain that was predicted with its interval, and the true one."""

    seed: int
    hidden: str
    predicted: float
    low: float
    high: float
    true: float
    is_certain: bool
    keeps: bool
    "whether the advice is constant duty"


def main() -> None:
    """Hide, improve, drive the truth, write and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one set, two short drives: shows that it runs")
    parser.add_argument("--sets", type=int, default=40)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    study = dataclasses.replace(DEFAULT_STUDY, effort=EFFORT)
    if options.quick:
        study = dataclasses.replace(quick(), effort=QUICK)
    sets = 1 if options.quick else options.sets
    options.out.mkdir(parents=True, exist_ok=True)
    finished = Parallel(options.workers, batch_size=1, return_as="generator")(
        delayed(improved)(SEED + at, study) for at in range(sets)
    )
    rows: list[Row] = []
    for row in finished:
        rows.append(row)
        table = judged(pd.DataFrame(rows))
        plot.write_csv(table, options.out / "blind_improve.csv")
    figure(table, options.out)
    print(report(table))


def quick() -> TuningStudy:
    """Return the usual study on two short drives."""
    cases = [
        tuple(dataclasses.replace(case, settings=(*case.settings, ("duration", 3.0))) for case in part[:1])
        for part in (DEFAULT_STUDY.training, DEFAULT_STUDY.held_out)
    ]
    return dataclasses.replace(DEFAULT_STUDY, training=cases[0], held_out=cases[1])


def improved(seed: int, study: TuningStudy) -> Row:
    """Return the row of a set."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "log"
        data.mkdir()
        truth = write(data, ANY, seed).truth
        result = improve(data, Path(folder) / "out", study, workers=1)
        model, _ = hidden_model(declared_model(ROVER), ANY, np.random.default_rng(seed))
        file = write_model(model, Path(folder) / "truth.toml")
        true = true_gain(study.on_model(file), result.tuning.law)
        row = Row(
            seed, str(truth["hidden"]), *result.gain["cost saved"], true, result.is_certain, not result.is_worth_it
        )
    print(*row, flush=True)
    return row


def true_gain(study: TuningStudy, law: SlipLaw) -> float:
    """Return the mean cost that a law saves on the held-out drives against constant duty."""
    saved = []
    for at, case in enumerate(study.held_out):
        constant, tuned = (
            Score(*full_score(case, Control.of(by, law, NOISE_SEED + at))).cost(Cost())
            for by in (CONSTANT_DUTY, study.estimate)
        )
        saved.append(constant - tuned)
    return float(np.mean(saved))


def judged(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with whether the interval holds, and whether there is harm."""
    inside = table["true"].between(table["low"], table["high"])
    return table.assign(inside=inside, harms=~table["keeps"] & (table["true"] < -MIN_COST_CHANGE))


def figure(table: pd.DataFrame, out: Path) -> None:
    """Draw the true gains over the predicted ones with their intervals."""
    sheet, axes = plot.new_figure(1, size=(6.0, 5.0))
    for keeps, rows in table.groupby("keeps"):
        low, high = rows.predicted - rows.low, rows.high - rows.predicted
        label, colour = ("constant duty kept", plot.COLOURS[0]) if keeps else ("tuned control taken", plot.COLOURS[1])
        axes.errorbar(rows.predicted, rows.true, xerr=(low, high), fmt="o", ms=4, lw=0.8, color=colour, label=label)
    ends = [table.true.min(), table.true.max()]
    axes.plot(ends, ends, color="0.6", lw=0.8)
    axes.set(xlabel="predicted gain, its 90 % interval [cost]", ylabel=f"true gain of {len(table)} logs [cost]")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    plot.save(sheet, out / "blind_improve.png")


def report(table: pd.DataFrame) -> str:
    """Return how often the interval holds, and how often there is harm."""
    taken = table[~table["keeps"]]
    return (
        f"{len(table)} sets: the true gain lies inside the interval of 90 % in {table['inside'].sum()}; constant duty "
        f"is kept in {table['keeps'].sum()}, the tuned control taken in {len(taken)}: a true gain in "
        f"{(taken['true'] > 0.0).sum()}, harm in {taken['harms'].sum()}; mean of predicted and true gain where it is "
        f"taken {taken['predicted'].mean():.3f}, {taken['true'].mean():.3f}"
    )


if __name__ == "__main__":
    main()
