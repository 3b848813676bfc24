"""Shapes of laws of which even the order is assumed: free within their doubt wherever fits are exact."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.calibration import calibrated
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.discrepancy.decide_answer import as_fitted
from rover_pin.discrepancy.exact_refits import rank_refits, variants, with_visible_shapes
from rover_pin.discrepancy.search import threshold_after
from rover_pin.effects.post_peak import PostPeak
from rover_pin.effects.rate_dependence import RateDependence
from tests.experiments.wheel_rig import linear_rig as linear

SIZE, SHAPE = "RateDependence.c_r", "RateDependence.v_0"
RATE = plain_candidate(RateDependence())


def test_published_law_frees_its_unknown_shape_within_a_decade():
    known, doubted = RATE.bare.parameters
    assert (known.name, known.prior) == (SIZE, False)
    assert (doubted.name, doubted.prior, doubted.log) == (SHAPE, True, True)
    assert [doubted.value(u) for u in (-2.0, -1.0, 0.0, 1.0, 2.0)] == pytest.approx([1e-4, 1e-3, 0.01, 0.1, 1.0])
    assert RATE.bare.names == (SIZE, SHAPE)


def test_a_published_shape_is_held_as_published():
    law = plain_candidate(PostPeak()).bare
    assert [one.name for one in law.parameters] == ["PostPeak.fraction"]
    assert law.diffuse_shapes == ()


def test_freed_assumed_shape_loses_its_prior_until_it_is_refixed():
    loose = RATE.loose
    assert [(one.name, one.prior) for one in loose.parameters] == [(SIZE, False), (SHAPE, False)]
    for one in (loose.bare, RATE.bare.bare, RATE.bare.loose.bare):
        assert (one.shapes, one.free_shapes, one.diffuse_shapes) == ((), (), (SHAPE,))


def test_assumed_shape_has_the_usual_prior_in_inexact_fits():
    assert [one.scale for one in RATE.parameters if one.name == SHAPE] == [0.5]


def test_refit_uses_the_prior_and_pays_for_its_size_alone():
    random = np.random.default_rng(31)
    laws = {name: linear.law_of(name, random.normal(size=2 * linear.RUNS)) for name in linear.FREE}
    laws |= {one.name: linear.Law(one, random.normal(size=2 * linear.RUNS)) for one in RATE.bare.parameters}
    rows = np.clip(random.normal(size=2 * linear.RUNS), -2.2, 2.2) + 4.0 * laws[SIZE].slope + 0.7 * laws[SHAPE].slope
    experiment = linear.made(rows, laws)
    base = calibrated(experiment, linear.MODEL, experiment.uncertain(linear.MODEL))
    (one, found), *_ = variants(base, RATE)
    u, chi2 = linear.gaussian(rows, laws, (*linear.FREE, SIZE, SHAPE)).solved()
    np.testing.assert_allclose(found.u, u, atol=1e-5)
    assert found.chi2 == pytest.approx(chi2, rel=1e-8)
    fee = threshold_after((), 10, 1.0)
    (row,) = rank_refits(base, [((), one, found)], fee)
    assert row.threshold == pytest.approx(row.unit * 2 * math.log(10 / 0.05))


@pytest.mark.parametrize(("fitted", "shown"), [(0.01, 0.1), (0.1, 1.0), (1.0, 0.1)])
def test_shape_visibility_is_tested_from_its_fitted_value(fitted, shown):
    """One SD is a factor of e^(1/2); beyond its bound of 1 m/s it is moved the other way."""
    asked = []

    class Line:
        def value(self, model, name):
            return model[name]

        def with_values(self, model, given):
            asked.append(given[SHAPE])
            return given

        def predict(self, models):
            return np.zeros((1, 1))

    task = SimpleNamespace(experiment=Line(), noise=SimpleNamespace(white=lambda moved: moved))
    with_visible_shapes(SimpleNamespace(task=task, model={SHAPE: fitted}, predicted=np.zeros(1)), RATE)
    assert asked == pytest.approx([fitted * math.exp(0.5 if shown > fitted else -0.5)])


def test_fold_starts_an_assumed_shape_without_the_full_data_fit():
    record = RateDependence(c_r=0.3, v_0=0.2)
    experiment = SimpleNamespace(records=lambda model: {"RateDependence": record})
    whole = SimpleNamespace(task=SimpleNamespace(experiment=experiment), model=None)
    assert as_fitted(RATE.bare, whole).effect == RateDependence(c_r=0.3)
    assert as_fitted(replace(RATE.bare, diffuse_shapes=()), whole).effect == record
    assert isinstance(as_fitted(RATE.bare, whole), Candidate)


def test_every_doubt_is_of_a_positive_number_within_its_bounds():
    about = quantities(RateDependence)["v_0"]
    assert about.log_sd == pytest.approx(math.log(10.0))
    assert about.low == pytest.approx(0.01 * math.exp(-2 * about.log_sd))
    assert about.high == pytest.approx(0.01 * math.exp(2 * about.log_sd))
    assert [one.log_sd for one in quantities(PostPeak).values()] == [0.0, 0.0]
