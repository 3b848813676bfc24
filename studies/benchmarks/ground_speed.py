"""Measure the cost of the ground: the ditch as few points, many points, or a grid; rough ground; and a case of a sweep.

    python studies/benchmarks/ground_speed.py [--quick] [--keep]

Each line compares 20 s of the same rover on one core, in CPU seconds, the minimum of several turns, with the six points
of the ditch. Points on the ditch's own lines merge into one facet, whatever their number. Rough ground has a contact
patch for each facet under a wheel, and costs their sum. A case of a sweep is compared with the drive that it makes.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from speed_table import keep, reader

from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate
from rover_pin.sweep import read_study
from rover_pin.sweep.case import drive_case, run_case, scenario_of
from rover_pin.terrain.terrain import HeightGrid, Lanes, Profile, Terrain

STUDY = Path(__file__).parents[1] / "sweep_ditch.toml"
LOW, HIGH = -2.0, 4.0
ROUGH = 0.01
"""Approximate height of the waves of the rough ground [m]."""


def main() -> None:
    """Measure all grounds and the sweep, and print the times; with --keep, store them in speed.csv."""
    options = reader(__doc__, "one turn instead of seven").parse_args()
    turns = 1 if options.quick else 7
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    measured = {**compare_grounds(turns), **compare_case(turns)}
    if options.keep:
        keep(measured)


def grounds() -> dict[str, Terrain]:
    """Return a mapping from names to grounds. The first ground is the ditch of six points."""
    ditch = scenario("ditch", soil="table-1").model.terrain
    assert isinstance(ditch, Lanes)
    line = ditch.profiles[0]
    x = np.linspace(LOW, HIGH, 1000)
    # Noise averaged over 60 points gives smooth waves.
    waves = np.convolve(np.random.default_rng(1).normal(0.0, ROUGH, 1059), np.ones(60) / 60, "valid")
    y = np.linspace(-1.5, 1.5, 300)
    along = np.linspace(LOW, HIGH, 300)
    grid = np.repeat(line.height(along)[:, None], 300, axis=1)
    # The first entry is the reference that all others are compared with.
    return {
        "ditch, 6 points": ditch,
        "ditch, 1,000 points and its corners": _lane(np.union1d(x, line.x), line),
        "ditch, 1,000 points, corners cut": _lane(x, line),
        "ditch, 300 x 300 grid": HeightGrid(LOW, y[0], along[1] - along[0], y[1] - y[0], grid),
        "rough ground, 81 points": Lanes((Profile(x[::12][:81], waves[::12][:81]),)),
        "rough ground, 1,000 points": Lanes((Profile(x, waves),)),
    }


def compare_grounds(turns: int) -> dict[str, float]:
    """Print the time of 20 s on each ground; return its ratio to the first ground."""
    case = scenario("ditch", soil="table-1")
    drives: dict[str, Callable[[], Any]] = {}
    for name, terrain in grounds().items():
        model = dataclasses.replace(case.model, terrain=terrain)
        # The default argument binds this model; a plain lambda would see the last one.
        drives[name] = lambda model=model: drive_once(case, model)  # type: ignore[misc]
    first, *others = least(drives, turns).items()
    print(f"{first[0]:38s} {1e3 * first[1]:6.1f} ms for 20 s, {20.0 / first[1]:.0f} x real time")
    for name, seconds in others:
        print(f"{name:38s} {1e3 * seconds:6.1f} ms, {seconds / first[1]:.2f} times the ditch of six points")
    return {f"{name} [x]": seconds / first[1] for name, seconds in others}


def drive_once(case: Any, model: Any) -> None:
    """Drive 20 s on a ground, at the same step on all grounds, without measuring the step error."""
    simulate(model, case.controller, 20.0, case.start, measure_error=False)


def compare_case(turns: int) -> dict[str, float]:
    """Print and return the cost of cases of a sweep relative to their drives."""
    study = read_study(STUDY)
    cases = list(study.cases())[:8]
    # The same drives without the sweep, to separate the cost of its bookkeeping.
    drives = [scenario_of(study, case) for case in cases]
    times = least(
        {
            "cases": lambda: [run_case(study, drive_case, case) for case in cases],
            "drives": lambda: [case_drive.drive() for case_drive in drives],
        },
        turns,
    )
    seconds = study.duration or 0.0
    print(
        f"a sweep's case: {times['cases'] / times['drives']:.2f} times its drive; "
        f"{seconds * len(cases) / times['cases']:.0f} s of driving a second of one core"
    )
    return {
        "case over drive [x]": times["cases"] / times["drives"],
        "drive-seconds a core-second": seconds * len(cases) / times["cases"],
    }


def _lane(x: np.ndarray, line: Profile) -> Lanes:
    """Return the ditch's profile sampled at x."""
    return Lanes((Profile(x, line.height(x)),))


def least(calls: dict[str, Callable[[], Any]], turns: int) -> dict[str, float]:
    """Return the minimum CPU time [s] of each call. The calls alternate, after one untimed turn."""
    best = dict.fromkeys(calls, np.inf)
    for turn in range(turns + 1):
        # The calls alternate within a turn, so that slow changes of the machine affect all of them.
        for name, call in calls.items():
            begin = time.process_time()
            call()
            if turn:
                best[name] = min(best[name], time.process_time() - begin)
    return best


if __name__ == "__main__":
    main()
