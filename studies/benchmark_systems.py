"""The loop on data of the kinds of public benchmarks: five systems with a hidden effect, and runs of usual lengths.

Question
    How often does the loop name the hidden effect, or an effect that is not there? How well does its model predict
    unseen runs, compared with a plain least-squares fit that knows the right law? How long do 25,000 and 131,000
    samples take?
Method
    The generator (tests/oracle/benchmark_generator.py) shares no code with the package. Its five systems are cascaded
    tanks that overflow, a resonator with a cubic spring, a servo with load-dependent Stribeck friction, a resonator
    with Bouc-Wen hysteresis, and a motor with a dead time; their numbers are invented. The models
    (tests/experiments/benchmark_systems.py) have five or six candidates each. Of six runs, four are given to the loop
    and two are unseen. A set hides the effect, no effect, or an effect that is not on the list. The plain fit minimises
    the sum of squares over all numbers of the base model and of the right law, without priors, by SciPy, from the
    default sizes and from half of them; the better end counts. The data of full length hide the effect too: 24,840
    samples of the servo (as EMPS has) and 131,072 of the spring (as Silverbox has).
Result
    See studies/results/benchmark_systems.csv: one row for each set.
What the paper says
    The paper has no such systems.
What differs
    The noise is white and of its declared size, and all numbers are invented, so that the errors are no errors on the
    public data.

Run: python studies/benchmark_systems.py [--quick] [--seed N] [--out DIR]
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from rover_pin import plot
from rover_pin.discrepancy.answer import Answer
from rover_pin.estimation.parameter import bounds_of
from rover_pin.loop.close import close_the_loop

ROOT = Path(__file__).resolve().parents[1]
SEED, RUNS, GIVEN = 81001, 6, 4
LONG = {"servo": (4, 6210), "spring": (8, 16384)}
"""Numbers of runs and of samples of a run, as EMPS (24,841 samples) and Silverbox (131,072) have them."""
HEADER = (
    "system", "hidden", "seed", "samples", "answer", "named", "largest extra", "RMSE unseen", "RMSE plain fit",
    "chi2 after", "CPU [s]",
)  # fmt: skip


def module(path: str) -> ModuleType:
    """Return a module of the tests, which are no package."""
    name = Path(path).stem
    spec = importlib.util.spec_from_file_location(name, ROOT / "tests" / path)
    found = importlib.util.module_from_spec(spec)
    sys.modules[name] = found
    spec.loader.exec_module(found)
    return found


GENERATOR, MODELS = module("oracle/benchmark_generator.py"), module("experiments/benchmark_systems.py")


def part(experiment: Any, runs: slice, measured: bool) -> Any:
    """Return some runs of an experiment. An unseen run (`measured` is False) begins with the declared states."""
    return replace(
        experiment, folds=experiment.folds[runs], time=experiment.time[runs], set_values=experiment.set_values[runs],
        observed=experiment.observed[runs], is_measured=measured,
    )  # fmt: skip


def rmse(experiment: Any, model: Any) -> float:
    """Return the RMS error of a prediction over all channels, in SDs of the noise."""
    missed = (experiment.observed - experiment.predict([model])[0]) / experiment.sd[:, None]
    return float(np.sqrt(np.mean(missed**2)))


def plain_fit(experiment: Any, law: str) -> Any:
    """Return the model with the law, fitted by plain least squares without priors."""
    kinds = {kind.__name__: kind for kind in experiment.laws}
    model = experiment.base_model().having(kinds[law]())
    candidate = next(row for row in experiment.candidates(model, ()) if row.kind == law)
    numbers = (*experiment.uncertain(model), *map(candidate.size, candidate.amplitudes))
    numbers = (*numbers, *map(candidate.shape, candidate.shapes))
    ends = []
    for share in (1.0, 0.5):
        start = np.array([number.u(experiment.value(model, number.name)) for number in numbers])
        start[len(numbers) - len(candidate.names)] *= share

        def at(u: np.ndarray) -> Any:
            values = {number.name: number.value(x) for number, x in zip(numbers, u, strict=True)}
            return experiment.with_values(model, values)

        def rows(u: np.ndarray) -> np.ndarray:
            return ((experiment.observed - experiment.predict([at(u)])[0]) / experiment.sd[:, None]).ravel()

        low, high = bounds_of(numbers).T
        end = least_squares(rows, np.clip(start, low, high), bounds=(low, high), x_scale="jac", max_nfev=200)
        ends.append((end.cost, at(end.x)))
    return min(ends, key=lambda row: row[0])[1]


def row_of(system: str, hidden: str, seed: int) -> tuple:
    """Return the row of one set: answer of the loop, and errors on unseen runs."""
    whole = MODELS.SYSTEMS[system].of(GENERATOR.made(system, hidden, seed, RUNS))
    given, unseen = part(whole, slice(GIVEN), True), part(whole, slice(GIVEN, None), False)
    begun = time.process_time()
    verdict = close_the_loop(given)
    cpu = time.process_time() - begun
    law = GENERATOR.SYSTEMS[system][1]
    plain = rmse(unseen, plain_fit(given, law)) if hidden == law else float("nan")
    extras = [p for name, p in verdict.deciding_beliefs.included.items() if name != hidden]
    named = " + ".join(verdict.named) if verdict.answer is Answer.NAMED else ""
    return (
        system, hidden, seed, given.observed.size, verdict.answer.word, named, f"{max(extras, default=0.0):.2f}",
        f"{rmse(unseen, verdict.model):.4f}", f"{plain:.4f}", f"{verdict.after.misfit:.3g}", f"{cpu:.1f}",
    )  # fmt: skip


def long_row(system: str, seed: int) -> tuple:
    """Return the row of a set of full length, of which all runs are given."""
    law = GENERATOR.SYSTEMS[system][1]
    experiment = MODELS.SYSTEMS[system].of(GENERATOR.made(system, law, seed, *LONG[system]))
    begun = time.process_time()
    verdict = close_the_loop(experiment)
    cpu = time.process_time() - begun
    extras = [p for name, p in verdict.deciding_beliefs.included.items() if name != law]
    named = " + ".join(verdict.named) if verdict.answer is Answer.NAMED else ""
    return (
        system, law, seed, experiment.observed.size, verdict.answer.word, named, f"{max(extras, default=0.0):.2f}",
        "", "", f"{verdict.after.misfit:.3g}", f"{cpu:.1f}",
    )  # fmt: skip


def main() -> None:
    """Close the loop on every set, and write and print the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two systems with their hidden effect, on another seed")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, default=Path("out/benchmark_systems"))
    options = parser.parse_args()
    hidden = {system: row[1] for system, row in GENERATOR.SYSTEMS.items()}
    sets = [(system, law) for system, law in hidden.items()]
    sets += [(system, kind) for kind in ("none", "unlisted") for system in hidden]
    if options.quick:
        sets, options.seed = [("tanks", "Overflow"), ("motor", "DeadTime")], 1
    rows = []
    for system, law in sets:
        rows.append(row_of(system, law, options.seed))
        print(*rows[-1], sep=", ", flush=True)
    for system in () if options.quick else LONG:
        rows.append(long_row(system, options.seed))
        print(*rows[-1], sep=", ", flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "benchmark_systems.csv").open("w", newline="") as file:
        csv.writer(file).writerows([HEADER, *rows])
    print(f"written: {options.out}/benchmark_systems.csv, {figure(rows, options.out)}")


def figure(rows: list[list[str]], out: Path) -> Path:
    """Draw the RMSE on unseen data over that of a plain fit that knows the law, for each set, and return the file.

    A set whose hidden effect was named is blue, a set without a name grey.
    """
    table = [dict(zip(HEADER, row, strict=True)) for row in rows]
    compared = [row for row in table if row["RMSE plain fit"]]
    ratios = [float(row["RMSE unseen"]) / float(row["RMSE plain fit"]) for row in compared]
    sheet, axis = plot.new_figure(1, 1, size=(7.5, 1.2 + 0.35 * len(compared)))
    axis.barh(
        [f"{row['system']}: {row['hidden']}, {row['samples']} samples" for row in compared],
        ratios,
        color=["tab:blue" if row["named"] else "tab:gray" for row in compared],
    )
    axis.axvline(1.0, color="black", lw=0.8)
    axis.set(xlabel="RMSE on unseen data over that of a plain fit with the hidden law", xlim=(0.9, None))
    axis.invert_yaxis()
    return plot.save(sheet, out / "benchmark_systems.png")


if __name__ == "__main__":
    main()
