"""Time of one rig identification: exact CasADi Jacobians against scipy's 2-point differences, in the same run.

The differences are given a model compiled with a single column of the Jacobian, the least that compiles.

Run: python studies/benchmarks/identification.py [--quick] [--repeats N]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from rover_pin.contact import Soil, Wheel
from rover_pin.estimation.problem import Problem
from rover_pin.identification.identify import Search, build, identify
from rover_pin.measurements.channel import DrawbarPull, Predictor, Sinkage, Torque
from rover_pin.measurements.wheel_rig import WheelRig, read_wheel_rig
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.soil.traction import wheel_forces

DATA = Path(__file__).parents[1] / "data"
TRUTH, START = Soil(k=0.008, phi=0.55, n=1.1, c=400.0, k_1=8e4), Soil(k=0.01, n=0.9, c=100.0)
FREE = ("k", "phi", "c", "n", "k_1")
GOAL = 0.2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two repeats")
    parser.add_argument("--repeats", type=int, default=20)
    options = parser.parse_args()
    repeats = 2 if options.quick else options.repeats
    smooth = read_wheel_rig(DATA / "cmu-smooth-wheel")
    cases = {
        "simulated rig, 3 loads, 21 runs, F + T + h, 5 free": (simulated(), START, FREE),
        "smooth wheel, 15 runs, F + h, 3 free": (smooth, Soil(c=0.0, k=0.005, n=1.46), ("k", "phi", "k_1")),
    }
    for name, (data, start, free) in cases.items():
        report(name, data, start, free, repeats)


def report(name: str, data: WheelRig, start: Soil, free: tuple[str, ...], repeats: int) -> None:
    compiled = seconds(lambda: build(data, start, free, {}), 1)
    problem = build(data, start, free, {})
    plain = data.predictor(free[:1])
    exact = lambda: solve(problem, lambda u: problem.evaluate(u)[0], lambda u: problem.evaluate(u)[1])  # noqa: E731
    differences = lambda: solve(problem, lambda u: weighted(problem, plain, u), "2-point")  # noqa: E731
    print(name)
    print(f"  compile, once a process                          {1000 * compiled:8.1f} ms")
    for label, run in (("CasADi Jacobian", exact), ("scipy 2-point Jacobian", differences)):
        found = run()
        told = f"chi2 {2 * found.cost:.8g}, {found.nfev} steps"
        print(f"  one start, least_squares, {label:23s}{1000 * seconds(run, repeats):8.1f} ms   {told}")
    for label, search in (("1 start", Search(starts=1)), ("5 starts", Search())):
        spent = seconds(lambda search=search: identify(data, start, free, search=search), repeats)
        verdict = "reached" if spent <= GOAL else "MISSED"
        told = f"goal {GOAL} s: {verdict}"
        print(f"  identify with profiles and verdicts, {label:12s}{1000 * spent:8.1f} ms   {told}")


def solve(problem: Problem, residuals: Callable, jacobian: Callable | str) -> OptimizeResult:
    """Solve from the start, with residuals and Jacobian evaluated each time scipy asks."""
    bounds = (problem.space.low, problem.space.high)
    return least_squares(residuals, problem.space.start(), jacobian, bounds=bounds, x_scale="jac", max_nfev=500)


def weighted(problem: Problem, predict: Predictor, u: np.ndarray) -> np.ndarray:
    return (predict(problem.space.fields(u))[0] - problem.measured) / problem.sd


def simulated() -> WheelRig:
    wheel, rng = Wheel(), np.random.default_rng(0)
    slip, load = np.tile([0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8], 3), np.repeat([5.0, 9.5, 15.0], 7)
    rows = []
    for S, W in zip(slip.tolist(), load.tolist(), strict=True):
        theta_1 = entry_angle(W, S, wheel, TRUTH)
        forces = wheel_forces(S, theta_1, -TRUTH.exit_ratio * theta_1, wheel, TRUTH)
        rows.append((forces.f_t, forces.torque, sinkage(theta_1, wheel)))
    kinds = zip((DrawbarPull, Torque, Sinkage), np.array(rows).T, (0.1, 0.003, 0.0005), strict=True)
    return WheelRig(wheel, slip, load, tuple(kind(v + rng.normal(0, sd, v.size), sd) for kind, v, sd in kinds))


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
