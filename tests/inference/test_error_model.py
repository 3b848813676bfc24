"""The covariance of errors: the equation of its docstring, written down sample by sample."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin.inference.error_model import Discrepancy, ErrorModel
from tests.inference import linear_toy as toys

problems = st.tuples(st.integers(0, 10**6), st.sampled_from(list(Discrepancy)), st.booleans())
quick = settings(max_examples=25)


def made(seed, kind, timed):
    """A toy, its samples, an error model with two laws' parts, and scales drawn around their medians."""
    toy = toys.random_toy(seed, timed)
    samples = toy.samples()
    errors = ErrorModel(samples, kind, samples.row_of(np.array(list(toy.columns.values()))))
    eta = errors.median + errors.sd * np.random.default_rng(seed + 1).normal(size=len(errors.scales))
    return toy, samples, errors, eta


@quick
@given(problems)
def test_covariance_is_the_equation_sample_by_sample(problem):
    toy, samples, errors, eta = made(*problem)
    expected = toys.dense(toy, toys.scales_of(errors, eta), list(toy.columns.values()))
    for at, block in enumerate(samples.blocks):
        assert errors.covariance(eta, at) == pytest.approx(expected[np.ix_(block, block)], rel=1e-9, abs=1e-12)
    crossed = np.ones(expected.shape, dtype=bool)
    for block in samples.blocks:
        crossed[np.ix_(block, block)] = False
    assert not expected[crossed].any()
    assert sum(map(len, samples.blocks)) == len(samples.value) == np.isfinite(toy.observed).sum()


@quick
@given(problems)
def test_slopes_of_covariance_are_central_differences(problem):
    _, samples, errors, eta = made(*problem)
    for at in range(len(samples.blocks)):
        slopes = errors.with_slopes(eta, at)[1]
        for scale, step in enumerate(1e-5 * np.eye(len(eta))):
            change = (errors.covariance(eta + step, at) - errors.covariance(eta - step, at)) / 2e-5
            size = np.abs(errors.covariance(eta, at)).max()
            assert slopes.get(scale, np.zeros(change.shape)) == pytest.approx(change, rel=1e-5, abs=1e-8 * size)


@quick
@given(st.integers(0, 10**6), st.booleans())
def test_scales_are_those_of_the_discrepancy_and_the_turns(seed, timed):
    letters = {kind: {letter for letter, _ in made(seed, kind, timed)[2].scales} for kind in Discrepancy}
    assert letters[Discrepancy.FORM] - letters[Discrepancy.NONE] == {"e", "l"}
    assert letters[Discrepancy.SMOOTH] - letters[Discrepancy.NONE] == {"a", "l"}
    assert ("d" in letters[Discrepancy.NONE]) == timed


@quick
@given(st.integers(0, 10**6), st.booleans())
def test_form_error_is_none_where_the_law_adds_nothing(seed, timed):
    _, samples, errors, eta = made(seed, Discrepancy.FORM, timed)
    idle = np.random.default_rng(seed + 2).random(len(samples.value)) < 0.5
    errors = ErrorModel(samples, Discrepancy.FORM, [np.where(idle, 0.0, row) for row in errors.added])
    plain = ErrorModel(samples, Discrepancy.NONE)
    for at, block in enumerate(samples.blocks):
        smooth, still = errors.smooth_part(eta, at), idle[block]
        assert not smooth[still].any()
        assert not smooth[:, still].any()
        assert (np.diag(smooth)[~still] > 0).all()
        form_covariance = errors.covariance(eta, at) - plain.covariance(eta[: len(plain.scales)], at)
        assert form_covariance == pytest.approx(smooth, abs=1e-12 * np.abs(errors.covariance(eta, at)).max())


def test_noise_of_a_stray_is_raised_and_that_of_no_other():
    _, samples, errors, eta = made(3, Discrepancy.SMOOTH, False)
    inflation = np.ones(len(samples.value))
    inflation[samples.blocks[1][2]] = 50.0
    raised = ErrorModel(samples, Discrepancy.SMOOTH, inflation=inflation)
    assert np.array_equal(raised.covariance(eta, 0), errors.covariance(eta, 0))
    more = raised.covariance(eta, 1) - errors.covariance(eta, 1)
    s = np.exp(eta[errors.scales.index(("s", 1))])
    assert more[2, 2] == pytest.approx(49.0 * (s * samples.sd[samples.blocks[1][2]]) ** 2)
    more[2, 2] = 0.0
    assert not more.any()


def test_smooth_discrepancy_without_inputs_is_an_offset():
    toy = toys.random_toy(5, False)
    toy.inputs = toy.inputs[..., :0]
    samples = toy.samples()
    errors = ErrorModel(samples, Discrepancy.SMOOTH)
    smooth = errors.smooth_part(errors.median, 0)
    assert (smooth == smooth[0, 0]).all()
    assert smooth[0, 0] > 0
