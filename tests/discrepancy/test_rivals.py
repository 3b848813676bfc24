"""Rivals of a model, never below the noise and said first where one is better; folds and verdicts as plain values."""

import math

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out_errors import ChannelScore, LevelError, fall_of
from rover_pin.discrepancy.rivals import against_rivals, is_sure, losses
from rover_pin.discrepancy.verdict import SCHEMA, Side, Verdict
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.numbers import Number


def score(name, after, floor=1.0, lost=()):
    levels = tuple(LevelError(str(at), 2.0 * error, error) for at, error in enumerate(after))
    return ChannelScore(name, "N", floor, 2.0, rms(after), -0.5, -0.6, -0.4, levels, lost=lost)


def rms(errors):
    return float(np.sqrt(np.nanmean(np.square(errors)))) if not np.isnan(errors).all() else math.nan


def curve(errors, kind="quadratic"):
    return [Baseline(name, "N", kind, rms(values), by_fold=tuple(values)) for name, values in errors.items()]


SCORES = (score("pull", [2.0, 2.0, 2.0]), score("sinkage", [8.0, 8.0, 8.0]))


@pytest.mark.parametrize("seed", range(6))
def test_chance_is_students_t_of_the_ratios(seed):
    """Against scipy's test of one sample, about where half of the draws pass."""
    ratios = np.random.default_rng(seed).normal(-0.5, 0.5, 6)
    (row,) = curve({"pull": 4.0 * np.exp(ratios)})
    is_known = ttest_1samp(ratios, 0.0)
    assert is_sure(score("pull", [4.0] * 6, floor=0.1), row) is bool(is_known.pvalue < 0.05 and ratios.mean() < 0.0)


def test_what_is_below_the_noise_counts_as_the_noise():
    assert not losses([score("pull", [1.04, 1.04])], curve({"pull": [0.1, 0.1]}))
    assert losses([score("pull", [2.0, 2.0])], curve({"pull": [0.1, 0.1]}), surely=True)
    assert not losses([score("pull", [0.5, 1.2, 1.2])], curve({"pull": [0.1, 0.1, 0.1]}), surely=True)


def test_what_cannot_be_compared_is_not():
    assert not losses([score("pull", [2.0, math.nan], lost=("a",))._replace(after=math.nan)], curve({"pull": [1, 1]}))
    assert not losses(SCORES, curve({"torque": [0.1, 0.1, 0.1]}))
    assert not losses([score("pull", [2.0])], curve({"pull": [1.0]}), surely=True)


def test_a_fold_without_a_channel_counts_by_the_others():
    (row,) = curve({"sinkage": [math.nan, 4.0, 3.9]})
    assert is_sure(score("sinkage", [math.nan, 8.0, 8.0]), row)


@pytest.mark.parametrize(
    ("times", "first"),
    [([0.94, 0.94, 0.94], True), ([0.96, 0.96, 0.96], False), ([0.4, 1.5, 0.5], False), ([0.4, 0.6, 0.5], True)],
)
def test_a_curve_that_is_better_at_one_channel_is_said_first(times, first):
    verdict = Verdict("wheel-rig", Answer.NAMED, "a set", "An effect acts.", None, named=("Grousers",), scores=SCORES)
    worse = curve({"pull": [9.0] * 3, "sinkage": [90.0] * 3}, "mean")
    better = curve({"pull": [20.0] * 3, "sinkage": 8.0 * np.array(times)}, "Gaussian process")
    beside = against_rivals(verdict, [*worse, *better])
    assert (beside.answer is Answer.INADEQUATE) is first
    assert ("sinkage" in beside.sentence and "a Gaussian process" in beside.sentence) is first
    assert beside.sentence.endswith("An effect acts.")
    assert beside.named == ("Grousers",)
    assert len(beside.baselines) == 4


def test_what_is_on_no_list_stays_the_answer():
    verdict = Verdict("wheel-rig", Answer.NONE_FITS, "a set", "Something acts.", None, scores=SCORES)
    beside = against_rivals(verdict, curve({"pull": [1.0] * 3, "sinkage": [4.0] * 3}))
    assert beside.answer is Answer.NONE_FITS
    assert "quadratic" in beside.rival
    assert "(1 N against 2 N)" in beside.rival


def test_folds_that_only_one_model_predicts_are_not_compared():
    """What the second loses keeps both from being compared; what only the first loses counts for neither."""
    without, with_effect, lost = np.array([9.0, 7.0, 5.0]), np.array([3.0, 6.0, 1.0]), np.array([np.nan, 0.0, 0.0])
    assert fall_of(without, with_effect) == 11.0
    assert fall_of(without + lost, with_effect) == fall_of(without + lost, with_effect + lost) == 5.0
    assert np.isnan(fall_of(without, with_effect + lost))


def verdict(**more):
    return Verdict(kind="test-bed", answer=Answer.NAMED, name="bed", sentence="so it is.", model=None, **more)


def number(name, drift=0.0):
    return Number(name, "N", 2.0, 1.0, 3.0, drift)


def side(*numbers, misfit=1.0):
    return Side(None, numbers, misfit, None)


def test_a_verdict_as_plain_values():
    values = verdict(after=side(number("A.c", 1.5))).as_dict()
    assert (values["schema"], values["kind"], values["answer"]) == (3, "test-bed", "an effect is missing")
    assert SCHEMA == 3, "docs/verdict.md describes this one"
    assert values["share"] == 0.0
    assert (values["before"], list(values["after"])) == ({}, ["A.c"])
    assert values["after"]["A.c"]["drift"] == 1.5
    assert values["posterior"] == {}, "where hypotheses were not weighed"
    assert "rounds" not in values
