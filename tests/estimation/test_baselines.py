"""Curves through the points, each fold predicted from the others, beside what a model does."""

import numpy as np
import pytest

from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.rivals import losses
from rover_pin.estimation.baselines import curves, gaussian_process

SLIP = np.linspace(0.0, 0.8, 6)[:, None] + np.array([0.0, 0.01, 0.02])


def found(values):
    observed = np.full((6, 1, 3), np.nan)
    observed[:, 0] = values
    return {curve.curve: curve.error for curve in curves(observed, SLIP[:, :, None], [("pull", "N")])}


def test_a_mean_left_out_is_that_of_the_others():
    values = np.zeros((6, 3))
    values[5] = 6.0
    folds = np.array([*[values[:5].sum() / 15 + 18 / 15] * 5, 6.0])
    assert found(values)["mean"] == pytest.approx(np.sqrt(np.mean(folds**2)))


def test_what_was_not_measured_is_left_out():
    values = 2 + 3 * SLIP
    values[2, 1] = np.nan
    assert found(values)["quadratic"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("after", "floor", "message"), [(0.3, 0.0, True), (0.2, 0.0, False), (0.3, 2.0, False)])
def test_a_model_that_loses_to_a_curve_is_said_to_lose(after, floor, message):
    rows = curves(np.sin(4 * SLIP)[:, None], SLIP[:, :, None], [("pull", "N")])
    least = min(line.error for line in rows)
    score = ChannelScore("pull", "N", floor, 1.0, least / (1 - after + 0.2), 0.0, 0.0, 0.0)
    lost_lines = losses([score], rows)
    assert bool(lost_lines) == message
    assert all("pull" in line for line in lost_lines)


def test_held_out_quadratic_is_recovered_whatever_the_input_unit():
    draw = np.random.default_rng(1)
    inputs = draw.uniform(1.0, 2.0, (5, 4, 2)) * [1e6, 1e-6]
    x, z = inputs[..., 0] / 1e6, inputs[..., 1] / 1e-6
    error_by_curve = {curve.curve: curve.error for curve in curves((x**2 - x * z)[:, None], inputs, [("y", "")])}
    assert error_by_curve["quadratic"] < 1e-8
    assert error_by_curve["mean"] > 0.1


def test_gaussian_process_smooths_noise_and_ends_at_the_mean():
    x = np.linspace(-1.0, 1.0, 40)[:, None]
    wave = 5.0 + 0.01 * np.sin(3.0 * x[:, 0])
    assert gaussian_process(x, wave, x + 0.02) == pytest.approx(5.0 + 0.01 * np.sin(3.0 * (x[:, 0] + 0.02)), abs=2e-4)
    noisy = wave + 0.003 * np.random.default_rng(0).normal(size=40)
    assert np.std(gaussian_process(x, noisy, x) - wave) < 0.0015
    assert gaussian_process(x, noisy, np.array([[900.0]])) == pytest.approx([noisy.mean()])
