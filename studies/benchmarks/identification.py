"""Time of one rig fit: exact CasADi Jacobians against scipy's 2-point differences, in the same run.

Run: python studies/benchmarks/identification.py [--quick] [--repeats N]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from rover_pin.estimation.exact import ExactProblem
from rover_pin.estimation.task import Task
from rover_pin.experiments.wheel_rig.declared import as_declared
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.loop.identify import identify
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import RigSet

DATA = Path(__file__).parents[1] / "data"
GOAL = 0.5
SETS = ("cmu-smooth-wheel", "ding-2011-lugged")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two repeats")
    parser.add_argument("--repeats", type=int, default=20)
    options = parser.parse_args()
    repeats = 2 if options.quick else options.repeats
    for name in SETS:
        report(name, read_rig_set(DATA / name), repeats)


def report(name: str, data: RigSet, repeats: int) -> None:
    experiment, model = RigExperiment((data,)), as_declared(data)
    numbers = experiment.uncertain(model)
    problem = ExactProblem(Task(experiment, experiment.noise()), model, numbers)
    start = np.array([number.u(experiment.value(model, number.name)) for number in numbers])
    rows = lambda u: problem.evaluate(u)[0]  # noqa: E731
    bounds = (problem.space.low, problem.space.high)
    print(f"{name}: {len(rows(start))} rows, {len(numbers)} numbers")
    spent = {}
    jacobians = {"CasADi Jacobian": lambda u: problem.evaluate(u)[1], "scipy 2-point Jacobian": "2-point"}
    for label, jacobian in jacobians.items():
        run = lambda jacobian=jacobian: least_squares(  # noqa: E731
            rows, start, jacobian, bounds=bounds, x_scale="jac", max_nfev=500
        )
        found, spent[label] = run(), seconds(run, repeats)
        steps = f"chi2 {2 * found.cost:.8g}, {found.nfev} steps"
        print(f"  one start, least_squares, {label:23s}{1000 * spent[label]:8.1f} ms   {steps}")
    whole = seconds(lambda: identify(data), repeats)
    verdict = "reached" if whole <= GOAL else "MISSED"
    print(f"  identify, noise and discrepancy weighed         {1000 * whole:8.1f} ms   goal {GOAL} s: {verdict}")


def seconds(run: Callable[[], object], repeats: int) -> float:
    """Return the median time of a call [s]."""
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        spent.append(time.perf_counter() - start)
    return float(np.median(spent))


if __name__ == "__main__":
    main()
