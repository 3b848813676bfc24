"""What is left of a log may be its sand, prepared anew for every run: when it is, and when something else acts."""

import numpy as np
import pytest

from rover_pin.experiments.unlisted.actions import FORCE, GRIP, Act
from rover_pin.experiments.unlisted.regressors import Argument, Hats, Polynomial
from rover_pin.experiments.unlisted.term import Term

RUNS = ("one", "two", "three")
EVEN = Argument("run", "", None, Polynomial(0.0, 1.0, 0), per_run=True)
ALONG = Argument("moment", "s", None, Hats((0.0, 1.0, 2.0)), per_run=True)


def term(size, kind=GRIP, argument=EVEN):
    size = np.array(size, dtype=float)
    return Term(Act(kind, "", "", ()), argument, RUNS, size, 1e-8 * np.eye(len(size)), 500.0, len(size), 20.0, None)


@pytest.mark.parametrize(
    ("one", "raking"),
    [
        (term([0.01, -0.02, 0.015]), True),
        (term([0.01, -0.08, 0.015]), False),
        (term([0.01, -0.02, 0.015], FORCE), False),
        (term([0.02], argument=EVEN._replace(per_run=False)), False),
        (term([0.04, -0.02, 0.01] * 3, argument=ALONG), True),
        (term([0.09, -0.05, 0.01] * 3, argument=ALONG), False),
    ],
)
def test_small_changes_of_grip_between_runs_are_raked_sand(one, raking):
    assert one.is_raking is raking
