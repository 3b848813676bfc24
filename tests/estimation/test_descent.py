"""The one descent of the package against scipy's, from the same scattered starts on measured and simulated rigs."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from rover_pin.base.errors import OptimisationError
from rover_pin.contact import Soil
from rover_pin.estimation.descent import descend
from rover_pin.identification.identify import Search, build, scatter
from rover_pin.measurements.wheel_rig import read_wheel_rig

DATA = Path(__file__).parents[2] / "studies" / "data"
CASES = {
    "cmu-smooth-wheel": (Soil(c=0.0, k=0.005, n=1.46), ("k", "phi", "k_1")),
    "ding-2011-smooth": (Soil(), ("k", "phi", "k_1", "n")),
}


class Counted:
    """A problem that counts its evaluations; scipy asks for residual and Jacobian apart, which count once."""

    def __init__(self, problem):
        self.space, self._problem, self.count, self._last = problem.space, problem, 0, (None, None)

    def evaluate(self, u):
        if self._last[0] != u.tobytes():
            self.count += 1
            self._last = (u.tobytes(), self._problem.evaluate(u))
        return self._last[1]


def of_scipy(problem, start):
    counted, (low, high) = Counted(problem), (problem.space.low, problem.space.high)
    margin = 1e-6 * np.minimum(high - low, 1.0)
    found = least_squares(
        lambda u: counted.evaluate(u)[0],
        np.clip(start, low + margin, high - margin),
        lambda u: counted.evaluate(u)[1],
        bounds=(low, high), x_scale="jac", max_nfev=400, ftol=1e-12, xtol=1e-12, gtol=1e-12,
    )  # fmt: skip
    return 2 * found.cost, counted.count


def of_ours(problem, start):
    counted = Counted(problem)
    try:
        return descend(counted, np.clip(start, problem.space.low, problem.space.high))[1], counted.count
    except OptimisationError:
        return np.inf, counted.count


@pytest.mark.parametrize("name", CASES)
def test_it_ends_as_low_as_scipy_in_no_more_evaluations(name):
    soil, free = CASES[name]
    problem = build(read_wheel_rig(DATA / name), soil, free, {})
    starts = scatter(problem, Search(starts=12))
    ours, theirs = ([solve(problem, start) for start in starts] for solve in (of_ours, of_scipy))
    lowest = min(chi2 for chi2, _ in theirs)
    reached = [sum(chi2 < lowest * (1 + 1e-6) + 1e-6 for chi2, _ in one) for one in (ours, theirs)]
    spent = [sum(count for _, count in one) for one in (ours, theirs)]
    print(f"{name}: of {len(starts)} starts {reached[0]} end lowest, {reached[1]} of scipy; {spent} evaluations")
    assert min(chi2 for chi2, _ in ours) <= lowest * (1 + 1e-8)
    assert reached[0] >= reached[1]
    assert spent[0] <= spent[1]
