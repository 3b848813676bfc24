"""Sampling the posterior: against the profile intervals, its seed, and its refusals."""

import builtins
import importlib.util
import math

import numpy as np
import pytest

from rover_pin.base.errors import MissingExtraError, OptimisationError, ParameterError
from rover_pin.contact import Soil, Wheel
from rover_pin.identification.identify import build, identify
from rover_pin.identification.posterior import Chain, log_density, posterior
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.soil.traction import load_traction_factor

SLIPS = np.linspace(0, 1, 11)
needs_emcee = pytest.mark.skipif(importlib.util.find_spec("emcee") is None, reason="emcee is an optional extra")


def points():
    clean = np.array([load_traction_factor(float(S), Soil(k=0.005), Wheel()) for S in SLIPS])
    return TractionPoints(SLIPS, clean + np.random.default_rng(4).normal(0, 0.03, len(SLIPS)), 0.03)


def test_density_is_the_likelihood_inside_the_bounds_only():
    problem = build(points(), Soil(), ("k", "phi"), {})
    u = problem.space.start()
    assert log_density(problem, u) == pytest.approx(-problem.chi2(u) / 2)
    assert log_density(problem, problem.space.high + 1) == -math.inf


@needs_emcee
def test_posterior_agrees_with_the_profile_where_the_data_tell():
    data, chain = points(), Chain(walkers=16, steps=600, burn_in=100)
    sampled, fitted = posterior(data, Soil(), chain=chain), identify(data, Soil())
    for name in ("k", "phi"):
        low, high = sampled.interval(name)
        width = fitted[name].high - fitted[name].low
        assert low == pytest.approx(fitted[name].low, abs=0.15 * width)
        assert high == pytest.approx(fitted[name].high, abs=0.15 * width)
    assert sampled.samples.shape == (16 * 500, 2)
    np.testing.assert_array_equal(posterior(data, Soil(), chain=chain).samples, sampled.samples)
    with pytest.raises(ParameterError, match="'n' was not free"):
        sampled.interval("n")


@needs_emcee
def test_a_chain_too_short_for_its_memory_is_refused():
    with pytest.raises(OptimisationError, match="the chain is too short: its memory is") as caught:
        posterior(points(), Soil(), chain=Chain(walkers=8, steps=40, burn_in=10))
    assert caught.value.status > 0


def test_missing_emcee_names_the_extra(monkeypatch):
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "emcee":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtraError, match=r"pip install 'rover-pin\[bayes\]'"):
        posterior(points(), Soil())
