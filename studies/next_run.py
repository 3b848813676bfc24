"""Count the further measurements that identify a hidden law, when the loop proposes them and when they are random.

Question
    After how many further runs is the hidden law included with probability .95, if the loop proposes each run, and if
    each run is drawn at random from the same list?
Method
    Wheel rigs by tests/oracle/rig_generator.py start with five slips at one load. One listed effect is hidden, the soil
    is drawn, and the size is from the upper half of the range in studies/blind_rig.py. The noise is FINE times the
    usual noise, because with the usual noise MOST further runs identify nothing. Benches by
    tests/oracle/pendulum_generator.py start with one run with a quarter of their voltages, one law hidden, and all
    noise multiplied by COARSE. After each run all hypotheses are weighed again. Sets whose law is identified at once
    are skipped. If the law is not identified after MOST further runs, the count is MOST + 1.
Result
    studies/results/next_run.csv.
What the paper says
    The conditions of the paper's tests are given, so it chooses none.
What differs
    The proposal looks one run ahead. If only several runs together identify the law, the proposal may miss the best
    first run.

Run: python studies/next_run.py [--quick] [--sets N] [--workers N] [--out DIR]
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from blind_pendulum import generator as pendulum_generator
from blind_rig import LISTED, Hidden, Kind, drawn_sizes, drawn_soil
from blind_rig import generator as rig_generator
from joblib import Parallel, delayed

from rover_pin.discrepancy.conclude import explorer_of, search_of
from rover_pin.experiments.pendulum import Pendulum
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.loop_data import RigData
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.next_runs import next_runs
from rover_pin.inference.beliefs import Beliefs
from rover_pin.inference.next_measurement import Offer, next_measurement, open_sets
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.simulation.model.effect_files import known_effects

SURE, MOST = 0.95, 8
RIG_SEED, BENCH_SEED = 52_000, 76_000
QUICK = 3
"""Number that is added to the seed for the quick run of the study. It selects a simulated bench whose missing law is
identified by one further run."""
FIRST = (-0.15, 0.0, 0.2, 0.4, 0.6)
"""Slip ratios of the first runs of the simulated wheel rig, each at a load of 25 N."""
COARSE, FINE = 8, 0.25
"""Noise of the simulated test bench (COARSE) and of the simulated wheel rig (FINE), as multiples of the usual noise of
their data generators.

With the usual noise every run of a bench identifies the law, and no run of a rig does."""
HEADER = ("kind", "seed", "hidden", "proposed", "at random")
RESULTS = Path(__file__).parent / "results"


class Told(NamedTuple):
    """The probabilities of all hypotheses after some runs, and the runs that could be measured next."""

    beliefs: Beliefs
    offer: Offer
    conditions: Mapping[str, Any]
    """Name of each run that could be measured next -> its conditions."""


def main() -> None:
    """Count the runs with and without proposals, and write and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one bench")
    parser.add_argument("--sets", type=int, default=20, help="of each kind that are not told at once")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    kinds = {"rig": (RIG_SEED, rig), "bench": (BENCH_SEED, bench)}
    rows: list[tuple[str, int, str, int, int]] = []
    if options.quick:
        rows.append(counted("bench", bench, BENCH_SEED + QUICK))
    for kind, (first, make) in {} if options.quick else kinds.items():
        # Sets whose law is identified at once need no further run and do not count.
        open_sets_of_kind = 0
        for block in range(first, first + 3 * options.sets, options.workers):
            run = Parallel(options.workers, batch_size=1)
            counted_rows = run(delayed(counted)(kind, make, seed) for seed in range(block, block + options.workers))
            rows += [row for row in counted_rows if row[3] or row[4]][: options.sets - open_sets_of_kind]
            open_sets_of_kind = sum(row[0] == kind for row in rows)
            if open_sets_of_kind == options.sets:
                break
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "next_run.csv").open("w", newline="") as file:
        csv.writer(file).writerows([HEADER, *rows])
    table = ["| kind | sets | proposed, median | at random, median |", "| --- | --- | --- | --- |"]
    for kind in dict.fromkeys(row[0] for row in rows):
        needed = np.array([row[3:] for row in rows if row[0] == kind])
        table.append(f"| {kind} | {len(needed)} | {np.median(needed[:, 0]):g} | {np.median(needed[:, 1]):g} |")
    (options.out / "next_run.md").write_text("\n".join([*table, ""]), encoding="utf-8")
    print("\n".join(table))


def counted(kind: str, make: Callable[[int], tuple[str, Any]], seed: int) -> tuple[str, int, str, int, int]:
    """Return the result for one data set: the number of further runs that identify the hidden effect, if the runs
    follow the proposals, and if they are drawn at random.
    """
    name, after = make(seed)
    needed = [runs_needed(name, after, seed, is_proposed) for is_proposed in (True, False)]
    print(kind, seed, name, *needed, flush=True)
    return kind, seed, name, *needed


def runs_needed(name: str, after: Callable[[list[Any]], Told], seed: int, is_proposed: bool) -> int:
    """Return the number of further runs after which the hidden effect `name` is certain. The function `after` returns
    the probabilities of all hypotheses after the runs with the chosen conditions.
    """
    random, chosen = np.random.default_rng([seed, 7]), list[Any]()
    while (state := after(chosen)).beliefs.inclusion(name) < SURE:
        if len(chosen) == MOST:
            return MOST + 1
        # Without a useful proposal, a random run is taken as well.
        best = next_measurement(open_sets(state.beliefs), (state.offer,)) if is_proposed else None
        drawn = random.choice(state.offer.experiment.folds)
        chosen.append(state.conditions[drawn if best is None else best.what])
    return len(chosen)


def rig(seed: int) -> tuple[str, Callable[[list[Any]], Told]]:
    """Return the hidden effect of a simulated wheel rig, and the function that returns the probabilities of all
    hypotheses after chosen runs.
    """
    make, random = rig_generator(), np.random.default_rng(seed)
    # With the usual noise further runs identify nothing, so the noise is reduced.
    make.SD = tuple(FINE * sd for sd in make.SD)
    name = sorted(LISTED.keys() - {"InterfaceFriction"})[seed % (len(LISTED) - 1)]
    hidden = make.Rig(sizes=drawn_sizes(Hidden(Kind.PAIR, (name,), seed, "white"), random), **drawn_soil(random))

    def after(chosen: list[tuple[float, float, float]]) -> Told:
        """Return the probabilities of all hypotheses after the first runs and the chosen runs, and the runs that could
        be measured next.
        """
        data = rig_set(make, hidden, [*((25.0, slip, 0.02) for slip in FIRST), *chosen], seed)
        question, offer = (
            RigData(RigExperiment((data,)), RigModel(data.wheel, data.soil())).question(known_effects()),
            next_runs((data,)),
        )
        # The offered runs, each with its load, slip and speed, so that a chosen name can be measured.
        ahead = offer.experiment.sets[0]
        conditions = zip(ahead.load.tolist(), ahead.slip.tolist(), ahead.speeds[:, 0].tolist(), strict=True)
        return Told(explorer_of(question, quiet).explore(), offer, dict(zip(ahead.runs, conditions, strict=True)))

    return name, after


def rig_set(make: ModuleType, hidden: Any, runs: list[tuple[float, float, float]], seed: int) -> Any:
    """Return runs (load, slip, travel speed) as the loop reads them, each with its own noise."""
    parts = [
        make.rig_set(hidden, (load,), (slip,), 1, 1000 * seed + at, (v,)) for at, (load, slip, v) in enumerate(runs)
    ]
    # One set from runs that were generated one by one, because each needs its own noise.
    columns = {name: np.concatenate([part[name] for part in parts]) for name in make.NAMES}
    _, columns["level"] = np.unique(columns["slip"], return_inverse=True)
    with tempfile.TemporaryDirectory() as folder:
        make.write(Path(folder), hidden, columns)
        return read_rig_set(Path(folder))


def bench(seed: int) -> tuple[str, Callable[[list[Any]], Told]]:
    """Return the hidden law of a simulated test bench, and the function that returns the probabilities of all
    hypotheses after chosen runs.
    """
    make = pendulum_generator()
    laws = [law for law in make.LAWS if law != "none"]
    name = laws[seed % len(laws)]
    # The bench is declared in files, as a user would declare it.
    with tempfile.TemporaryDirectory() as folder:
        make.write(Path(folder), name, seed)
        declared = Pendulum.read(Path(folder))
    ahead = replace(declared.next_runs(), sd=COARSE * declared.sd)
    measured = observed(make, name, seed, ahead)

    def after(chosen: list[int]) -> Told:
        """Return the probabilities of all hypotheses after the first run and the chosen runs, and the runs that could
        be measured next.
        """
        # The first run always belongs to the data.
        which = [0, *chosen]
        folds = tuple(f"run {at}" for at, _ in enumerate(which))
        measured_runs = replace(ahead, folds=folds, time=ahead.time[which], set_values=ahead.set_values[which],
                      observed=np.array([measured(at, turn) for turn, at in enumerate(which)]))  # fmt: skip
        beliefs = search_of(measured_runs.question(()), quiet).beliefs()
        return Told(beliefs, Offer(ahead, ahead.noise()), {name: at for at, name in enumerate(ahead.folds)})

    return name, after


def observed(make: ModuleType, law: str, seed: int, ahead: Pendulum) -> Callable[[int, int], np.ndarray]:
    """Return the function that measures a run of the list (channels, samples), with new noise each time."""
    numbers, hidden = make.drawn(np.random.default_rng(seed), law)
    volts = ahead.set_values[:, 0].T
    # The generator simulates a fixed number of runs at once.
    parts = [
        make.simulated(volts[:, at : at + make.RUNS], numbers, hidden) for at in range(0, volts.shape[1], make.RUNS)
    ]
    exact = np.concatenate(parts, axis=2)
    sd, step = COARSE * np.array([0.0, make.RATE_SD, make.CURRENT_SD])[:, None], COARSE * make.ENCODER

    def measured(at: int, turn: int) -> np.ndarray:
        """Return the measured channels of run `at` with the noise of repetition `turn`."""
        rows = exact[:, :, at] + sd * np.random.default_rng([seed, turn]).normal(size=exact.shape[:2])
        # The encoder rounds the angle to its steps.
        rows[0] = step * np.round(rows[0] / step)
        return np.asarray(rows)

    return measured


def quiet(message: str) -> None:
    """Ignore a progress message of the search."""


if __name__ == "__main__":
    main()
