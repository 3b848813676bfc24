"""Fitting the base model while outliers are down-weighted."""

from dataclasses import dataclass

import numpy as np
import pytest

from rover_pin.base.errors import OptimisationError
from rover_pin.inference.explore import Explorer


@dataclass
class FitterThatFails:
    """A fitter whose fits fail from a certain number on, as those of numbers far outside any model do."""

    fails_from: int
    inflation: np.ndarray | None = None
    numbers: tuple = ()
    model: object = None
    experiment: object = None

    def flat(self, causes, starts):
        if self.inflation is not None or self.fails_from == 0:
            raise OptimisationError("no start converged.")
        return np.zeros(1), 1.0

    def hypothesis(self, causes, u, kind, base):
        return type("Plain", (), {"causes": causes, "u": u})()


@pytest.fixture
def explorer(monkeypatch):
    monkeypatch.setattr(Explorer, "_outlier_inflation", lambda self: np.full(3, 4.0))
    monkeypatch.setattr(Explorer, "_fit_discrepancy", lambda self, plain: None)
    return lambda fails_from: Explorer(FitterThatFails(fails_from), ())


def test_the_last_fit_stays_where_a_larger_variance_has_none(explorer):
    """It ended with a KeyError."""
    base_explorer = explorer(1)
    base_explorer.base()
    assert frozenset() in base_explorer.fitted
    assert base_explorer.fitter.inflation is None


def test_a_base_model_without_a_fit_is_one_sentence(explorer):
    with pytest.raises(OptimisationError, match="converged"):
        explorer(0).base()
