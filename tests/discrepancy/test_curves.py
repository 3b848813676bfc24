"""Curves through the points, each fold predicted from the others, beside what a model does."""

import numpy as np
import pytest

from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.discrepancy.rivals import losses
from rover_pin.estimation.baselines import curves

SLIP = np.linspace(0.0, 0.8, 6)[:, None] + np.array([0.0, 0.01, 0.02])


def found(values):
    observed = np.full((6, 1, 3), np.nan)
    observed[:, 0] = values
    return {one.curve: one.error for one in curves(observed, SLIP[:, :, None], [("pull", "N")])}


def test_a_quadratic_predicts_a_parabola_that_a_mean_does_not():
    errors = found(2 + 3 * SLIP - 4 * SLIP**2)
    assert errors["quadratic"] == pytest.approx(0.0, abs=1e-9)
    assert errors["mean"] > 0.1


def test_a_mean_left_out_is_that_of_the_others():
    values = np.zeros((6, 3))
    values[5] = 6.0
    folds = np.array([*[values[:5].sum() / 15 + 18 / 15] * 5, 6.0])
    assert found(values)["mean"] == pytest.approx(np.sqrt(np.mean(folds**2)))


def test_what_was_not_measured_is_left_out():
    values = 2 + 3 * SLIP
    values[2, 1] = np.nan
    assert found(values)["quadratic"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("after", "floor", "said"), [(0.3, 0.0, True), (0.2, 0.0, False), (0.3, 2.0, False)])
def test_a_model_that_loses_to_a_curve_is_said_to_lose(after, floor, said):
    rows = curves(np.sin(4 * SLIP)[:, None], SLIP[:, :, None], [("pull", "N")])
    least = min(one.error for one in rows)
    score = ChannelScore("pull", "N", floor, 1.0, least / (1 - after + 0.2), 0.0, 0.0, 0.0)
    told = losses([score], rows)
    assert bool(told) == said
    assert all("pull is predicted better by a" in one for one in told)
