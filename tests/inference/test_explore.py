"""The explorer on linear toys with six causes: it finds what was hidden, whatever a stray says."""

from functools import cache

import numpy as np
import pytest

from rover_pin.estimation.profile import CLEAR_SDS
from tests.inference import linear_causes as toys

NAMES = tuple("pqrstu")
HIDDEN = {"none": {}, "single": {"r": 1.5}, "pair": {"q": -2.0, "t": 1.8}}
"""Sizes of what is hidden, over the default."""


def toy_with(hidden, stray=0.0):
    """Data of hidden causes with white noise, one value off by `stray` SDs."""
    toy = toys.design(11, NAMES, folds=6, each=4, size=None)
    noise = np.random.default_rng(4).normal(size=toy.sd.shape)
    noise[3, 0, 1] += stray
    parts = (size * toy.columns[name] for name, size in hidden.items())
    toy.observed = sum(parts, toy.columns["base"] + toys.NOISE * noise)
    return toy


@cache
def explored(case, stray):
    explorer = toys.explorer(toy_with(HIDDEN[case], stray), NAMES)
    return explorer, explorer.explore()


@pytest.mark.parametrize("stray", [0.0, 20.0, -100.0])
@pytest.mark.parametrize("case", HIDDEN)
def test_what_is_hidden_is_found_whatever_a_stray_says(case, stray):
    _, beliefs = explored(case, stray)
    names, probability = next(iter(beliefs.sets.items()))
    assert names == frozenset(HIDDEN[case])
    assert probability > 0.5
    for name in NAMES:
        assert (beliefs.inclusion(name) > 0.5) == (name in HIDDEN[case])


@pytest.mark.parametrize("case", ["single", "pair"])
def test_sizes_are_those_that_were_hidden(case):
    _, beliefs = explored(case, 0.0)
    best = beliefs.best(list(HIDDEN[case]))
    for name, size in HIDDEN[case].items():
        mean, sd = best.moments(name)
        assert 2.0 * mean == pytest.approx(size, abs=4 * 2.0 * sd)
        assert 2.0 * sd < 0.5 * abs(size)


@pytest.mark.parametrize("stray", [20.0, -100.0])
@pytest.mark.parametrize("case", HIDDEN)
def test_only_a_stray_is_taken_for_one(case, stray):
    (plain, _), (explorer, _) = explored(case, 0.0), explored(case, stray)
    assert plain.fitter.inflation is None
    table = explorer.fitter.samples.table_of(explorer.fitter.inflation)
    assert abs(stray) / np.sqrt(table[3, 0, 1]) < 2.0 * CLEAR_SDS, "it is near reach then"
    table[3, 0, 1] = 1.0
    assert (table == 1.0).all()
