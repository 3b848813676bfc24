"""Curves as rivals of the whole model: over all channels, never below the noise, said first where one is better."""

import math

import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.discrepancy.rivals import against_rivals, error_ratio
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import Baseline


def score(name, after, floor=1.0, lost=()):
    return ChannelScore(name, "N", floor, 2.0 * after, after, -0.5, -0.6, -0.4, lost=lost)


def curve(errors, kind="quadratic"):
    return [Baseline(name, "N", kind, error) for name, error in errors.items()]


SCORES = (score("pull", 2.0), score("sinkage", 8.0))


def test_the_ratio_is_the_geometric_mean_over_channels():
    assert error_ratio(SCORES, curve({"pull": 4.0, "sinkage": 4.0})) == pytest.approx(1.0)
    assert error_ratio(SCORES, curve({"pull": 1.0, "sinkage": 2.0})) == pytest.approx(math.sqrt(1 / 8))


def test_what_is_below_the_noise_counts_as_the_noise():
    assert error_ratio((score("pull", 0.5),), curve({"pull": 0.1})) == pytest.approx(1.0)
    assert error_ratio((score("pull", 2.0),), curve({"pull": 0.1})) == pytest.approx(0.5)


def test_a_lost_channel_or_one_that_no_curve_has_is_not_compared():
    assert math.isnan(error_ratio((score("pull", math.nan, lost=("a",)),), curve({"pull": 1.0})))
    assert math.isnan(error_ratio(SCORES, curve({"pull": 1.0})))


@pytest.mark.parametrize(("times", "first"), [(0.94, True), (0.96, False)])
def test_a_better_rival_is_said_first(times, first):
    verdict = Verdict("wheel-rig", Answer.NAMED, "a set", "An effect acts.", None, named=("Grousers",), scores=SCORES)
    worse = curve({"pull": 9.0, "sinkage": 90.0}, "mean")
    beside = against_rivals(
        verdict, [*worse, *curve({"pull": 2.0 * times, "sinkage": 8.0 * times}, "Gaussian process")]
    )
    assert (beside.answer is Answer.INADEQUATE) is first
    assert beside.sentence.startswith("A Gaussian process of what was set predicts") is first
    assert beside.sentence.endswith("An effect acts.")
    assert beside.named == ("Grousers",)
    assert len(beside.baselines) == 4
