"""Models drawn from what is believed: as often and as wide as it is believed, inside every bound."""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.weighed_anew import drawn_models


class Row:
    """A fitted hypothesis of two numbers with a mean, an SD that may exceed the posterior's, and a correlation."""

    is_fitted = True

    def __init__(self, name, mean, sd, correlation, low=-np.inf):
        self.model, self.mean, self.sd = name, np.array(mean), np.array(sd)
        self.parameters = tuple(Parameter(letter, 0.0, 1.0, low, np.inf) for letter in "xy")
        covariance = 0.25 * np.outer(sd, sd) * np.array([[1.0, correlation], [correlation, 1.0]])
        self.posterior = SimpleNamespace(covariance=covariance)
        self.experiment = SimpleNamespace(with_values=lambda model, values: (model, values["x"], values["y"]))

    def moments(self, name):
        at = "xy".index(name)
        return self.mean[at], self.sd[at]


def believed(*rows):
    return SimpleNamespace(weights=np.array([weight for weight, _ in rows]), hypotheses=[row for _, row in rows])


def test_draws_have_the_mean_sd_and_correlation_of_the_intervals():
    draws = drawn_models(believed((1.0, Row("a", [1.0, -2.0], [0.5, 2.0], 0.8))), 6000, seed=1)
    table = np.array([draw[1:] for draw in draws])
    assert table.mean(axis=0) == pytest.approx([1.0, -2.0], abs=0.08)
    assert table.std(axis=0) == pytest.approx([0.5, 2.0], rel=0.04)
    assert np.corrcoef(table.T)[0, 1] == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("weights", [(0.5, 0.5), (0.76, 0.24), (0.1, 0.9)])
def test_each_hypothesis_comes_as_often_as_it_is_probable(weights):
    """Within one draw, as systematic resampling promises; what was only estimated comes never."""
    estimate = Row("estimate", [0, 0], [1, 1], 0.0)
    estimate.is_fitted = False
    rows = [(0.5 * weight, Row(name, [0, 0], [1, 1], 0.0)) for weight, name in zip(weights, "ab", strict=True)]
    for seed in range(5):
        names = [draw[0] for draw in drawn_models(believed(*rows, (0.5, estimate)), 8, seed)]
        assert abs(names.count("a") - 8 * weights[0]) < 1.0
        assert "estimate" not in names


def test_draws_keep_to_the_bounds_and_to_their_seed():
    beliefs = believed((1.0, Row("a", [0.1, 0.1], [1.0, 1.0], 0.0, low=0.0)))
    assert min(min(draw[1:]) for draw in drawn_models(beliefs, 200)) == 0.0
    assert drawn_models(beliefs, 5, seed=3) == drawn_models(beliefs, 5, seed=3)
    assert drawn_models(beliefs, 5, seed=3) != drawn_models(beliefs, 5, seed=4)
