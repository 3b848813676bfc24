"""What is expected of runs not made, against conditioning one normal law of all runs on those that were made."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin.estimation.noise import declared_noise
from rover_pin.inference.error_model import Discrepancy
from rover_pin.inference.hypothesis import Fitter
from rover_pin.inference.next_measurement import Offer, expectation, with_uncertain_numbers
from tests.inference import linear_toy as toys

MADE, AHEAD, CHANNELS, SD = 9, 4, 2, 0.4
INPUTS = np.array([2.0, 90.0])
"""Of two inputs; a third never changes."""


def problem(seed, kind):
    """All runs with their law, the hypothesis of those that were made, and the others as an offer."""
    draw, shape = np.random.default_rng(seed), (MADE + AHEAD, CHANNELS, 1)
    inputs = np.concatenate([draw.random((MADE + AHEAD, 1, 2)) * INPUTS, np.full((MADE + AHEAD, 1, 1), 7.0)], axis=2)
    inputs[0, 0, :2], inputs[1, 0, :2] = 0.0, INPUTS  # none ahead is beyond those that were made
    columns = {name: draw.normal(size=shape) for name in ("base", "law")}
    observed = (
        0.8 * columns["base"] + 1.3 * columns["law"] + 0.5 * np.sin(inputs[:, :, :1]) + SD * draw.normal(size=shape)
    )
    duplicate, ahead = observed.copy(), np.zeros(shape)
    duplicate[MADE:], ahead[:MADE] = np.nan, np.nan
    parts = [toys.Toy(values, np.full(shape, SD), columns, inputs) for values in (observed, duplicate, ahead)]
    causes = [toys.cause("law", 2.0)]
    fitter = Fitter(parts[1], parts[1].samples(), {}, (toys.number("base"),))
    hypothesis = fitter.hypothesis(causes, np.array([0.5, 0.5]), kind)
    return parts[0], hypothesis, Offer(parts[2], declared_noise(np.full(CHANNELS, SD), ahead))


def conditioned(full, hypothesis):
    """Mean and covariance of the runs ahead given those made, u ~ N(0, I) beforehand, channel after channel."""
    errors = hypothesis.errors
    scales = toys.scales_of(errors, hypothesis.posterior.scales)
    for at, spread in enumerate(errors.samples.spread):
        scales["a", at] = scales.get(("a", at), 0.0) * spread / max(full.observed[:, at].std(), SD)
    added = [full.columns["law"] * hypothesis.parameters[1].value(hypothesis.u[1])]
    for table, row in zip(added, errors.added, strict=False):
        table[:MADE] = errors.samples.table_of(row)[:MADE]
    slopes = np.array([full.columns["base"], 2.0 * full.columns["law"]])
    rows = toys.places(full.observed)
    slopes = np.array([slopes[:, fold, channel, at] for fold, channel, at in rows])
    both = toys.dense(full, scales, added) + slopes @ slopes.T
    is_made = np.array([fold < MADE for fold, _, _ in rows])
    value = np.array([full.observed[place] for place in rows])
    gain = both[np.ix_(~is_made, is_made)] @ np.linalg.inv(both[np.ix_(is_made, is_made)])
    order = np.argsort([fold * CHANNELS + channel for fold, channel, _ in rows if fold >= MADE])
    covariance = both[np.ix_(~is_made, ~is_made)] - gain @ both[np.ix_(is_made, ~is_made)]
    return (gain @ value[is_made])[order], covariance[np.ix_(order, order)]


@settings(max_examples=12)
@given(st.integers(0, 10**6), st.sampled_from(list(Discrepancy)))
def test_it_is_the_normal_law_conditioned_on_what_was_measured(seed, kind):
    full_problem, hypothesis, offer = problem(seed, kind)
    expected_moments = expectation(offer, hypothesis, hypothesis)
    mean, covariance = with_uncertain_numbers(offer, hypothesis, expected_moments).at(np.full(AHEAD * CHANNELS, True))
    expected_mean, expected_covariance = conditioned(full_problem, hypothesis)
    assert SD * mean == pytest.approx(expected_mean, rel=1e-3, abs=1e-3)
    assert SD**2 * covariance == pytest.approx(expected_covariance, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("kind", [Discrepancy.SMOOTH, Discrepancy.FORM])
def test_a_repeat_tells_less_of_what_is_left(kind):
    """Of a run that was made what is left is known as far as its noise allows, far from all runs nothing is."""
    _, hypothesis, offer = problem(3, kind)
    fold = np.nonzero(offer.noise.good)[0]
    again, duplicate = offer.experiment.inputs.copy(), offer.experiment.inputs.copy()
    again[MADE:], duplicate[MADE:] = again[0], 100.0 * INPUTS.max()
    sizes = []
    for inputs in (again, duplicate):
        offer.experiment.inputs = inputs
        columns = expectation(offer, hypothesis, hypothesis).columns
        sizes.append((columns**2).sum(axis=1)[fold == MADE])
    assert (sizes[0] < sizes[1]).all()
