"""What a measurement is expected to tell: against sampling, its limits, and what is chosen of linear experiments."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from rover_pin.estimation.noise import declared_noise
from rover_pin.inference.next_measurement import Offer, information, next_measurement
from tests.inference import linear_toy as toys


def drawn(seed, sets=3, many=4):
    random = np.random.default_rng(seed)
    roots = random.normal(size=(sets, many, many))
    weights = random.dirichlet(np.ones(sets))
    return weights, 2.0 * random.normal(size=(sets, many)), roots @ roots.transpose(0, 2, 1) + np.eye(many)


def entropy(weights):
    return float(-np.sum(weights * np.log(weights)))


@given(st.integers(0, 10**6), st.floats(0.0, 50.0))
def test_information_is_between_nothing_and_what_is_open(seed, far):
    weights, mean, covariance = drawn(seed)
    nats = information(weights, far * mean, covariance)
    assert 0.0 <= nats <= entropy(weights) + 1e-9
    assert information(weights, 0.0 * mean, np.repeat(covariance[:1], 3, axis=0)) == pytest.approx(0.0, abs=1e-9)
    assert information(weights, 1e4 * mean, covariance) == pytest.approx(entropy(weights), abs=1e-6)


@given(st.integers(0, 10**6))
def test_units_of_what_is_measured_do_not_matter(seed):
    weights, mean, covariance = drawn(seed)
    turn = np.random.default_rng(seed + 1).normal(size=(4, 4)) + 4.0 * np.eye(4)
    nats = information(weights, mean @ turn.T, turn @ covariance @ turn.T)
    assert nats == pytest.approx(information(weights, mean, covariance), abs=1e-7)


@given(st.integers(0, 10**6))
def test_a_row_more_tells_no_less(seed):
    weights, mean, covariance = drawn(seed)
    assert information(weights, mean[:, :3], covariance[:, :3, :3]) <= information(weights, mean, covariance) + 1e-9


@pytest.mark.parametrize("distance", [0.0, 0.5, 1.0, 3.0])
def test_two_sets_with_the_same_errors_have_a_closed_form(distance):
    nats = information(np.array([0.5, 0.5]), np.array([[0.0], [2.0 * distance]]), np.full((2, 1, 1), 4.0))
    assert nats == pytest.approx(-math.log((1.0 + math.exp(-(distance**2) / 8.0)) / 2.0))


@pytest.mark.parametrize("seed", range(4))
def test_it_is_no_more_than_what_samples_tell_and_near(seed):
    weights, mean, covariance = drawn(seed)
    random, sampled_nats = np.random.default_rng(seed), 0.0
    for at, weight in enumerate(weights):
        rows = random.multivariate_normal(mean[at], covariance[at], 40_000)
        logs = np.array([multivariate_normal(mean[i], covariance[i]).logpdf(rows) for i in range(len(weights))])
        sampled_nats += weight * float(np.mean(logs[at] - logsumexp(logs, b=weights[:, None], axis=0)))
    assert 0.6 * sampled_nats < information(weights, mean, covariance) < sampled_nats + 0.01


class Ahead(toys.Toy):
    """Folds that could be measured: `law` is what a set of causes expects, slope that of the one shared number."""

    stand_in = 1e3

    def __init__(self, slope, folds):
        single_column = np.zeros((len(folds), 2, 1))
        super().__init__(single_column, single_column + 1.0, {"shared": slope}, np.zeros((len(folds), 1, 0)))
        self.folds, self.channels = folds, ("pull", "torque")

    def predict(self, models):
        return np.array(models)


def table(*rows):
    """(folds, channels, 1) of pull and torque of each fold."""
    return np.array(rows, dtype=float)[:, :, None]


def told(laws, slope=None, sd=1e3, weights=None, more=(), folds=None, errors=(1.0, 1.0)):
    """What is proposed where sets expect these tables and share one number of this SD."""
    folds = folds or tuple("abcd"[: len(laws[0])])
    ahead = Ahead(table(*([[0.0, 0.0]] * len(folds))) if slope is None else slope, folds)
    hypotheses = []
    for at, law in enumerate(laws):
        noise = SimpleNamespace(floor=errors[min(at, 1)] * np.ones(2))
        fit = SimpleNamespace(
            model=law, parameters=(toys.number("shared"),), u=np.zeros(1), task=SimpleNamespace(noise=noise)
        )
        names, spread = (f"law {at}",) if at else (), np.full((1, 1), sd**2)
        hypotheses.append(SimpleNamespace(
            names=names, fit=fit, posterior=SimpleNamespace(covariance=spread), experiment=ahead
        ))  # fmt: skip
    shares = weights or [1.0 / len(laws)] * len(laws)
    offer = Offer(ahead, declared_noise(np.ones(2), np.zeros((len(folds), 2, 1))), unmeasured=more)
    return next_measurement(list(zip(shares, hypotheses, strict=True)), (offer,))


def test_what_two_sets_expect_otherwise_is_measured():
    proposal = told([table([0, 0], [0, 0], [0, 0]), table([1, 0], [0, 4], [2, 0])])
    assert (proposal.what, proposal.channel) == ("b", "torque")
    assert proposal.open_nats == pytest.approx(math.log(2.0))
    for words in ("nothing from law 1", f"{proposal.nats / proposal.open_nats:.0%}", "torque"):
        assert words in proposal.sentence


def test_a_difference_that_a_number_may_take_tells_nothing():
    """Fold a moves along the shared number, fold b across it; known exactly, a would tell more."""
    laws = [table([0, 0], [0, 0]), table([9, 0], [2, 0])]
    slope = table([1, 0], [0, 0])
    assert told(laws, slope).what == "b"
    assert told(laws, slope, sd=1e-3).what == "a"


def test_a_channel_that_tells_twice_as_much_is_asked_for():
    laws = [table([0, 0], [0, 0]), table([0.5, 5], [1, 1])]
    proposal = told(laws, more=("torque",))
    assert (proposal.what, proposal.channel) == ("a, with torque too", "torque")
    near_proposal = told([table([0, 0], [0, 0]), table([4, 1], [1, 1])], more=("torque",))
    assert (near_proposal.what, near_proposal.channel) == ("a", "pull")
