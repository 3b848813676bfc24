"""Curves as rivals of the whole model: over channels and folds, never below the noise, said first where better."""

import math

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import ChannelScore, LevelError
from rover_pin.discrepancy.rivals import against_rivals, error_ratio
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import Baseline


def score(name, after, floor=1.0, lost=()):
    levels = tuple(LevelError(str(at), 2.0 * error, error) for at, error in enumerate(after))
    return ChannelScore(name, "N", floor, 2.0, 1.0, -0.5, -0.6, -0.4, levels, lost=lost)


def curve(errors, kind="quadratic"):
    return [Baseline(name, "N", kind, 1.0, by_fold=tuple(values)) for name, values in errors.items()]


SCORES = (score("pull", [2.0, 2.0, 2.0]), score("sinkage", [8.0, 8.0, 8.0]))


def test_the_ratio_is_the_geometric_mean_and_its_bound_students():
    ratio, high = error_ratio(SCORES, curve({"pull": [4.0, 2.0, 1.0], "sinkage": [4.0, 4.0, 4.0]}))
    logs = np.log([2.0 * 0.5, 1.0 * 0.5, 0.5 * 0.5]) / 2
    assert ratio == pytest.approx(math.exp(logs.mean()))
    assert high == pytest.approx(math.exp(logs.mean() + 4.302653 * logs.std(ddof=1) / math.sqrt(3)), rel=1e-5)


def test_what_is_below_the_noise_counts_as_the_noise():
    assert error_ratio((score("pull", [0.5, 0.5]),), curve({"pull": [0.1, 0.1]}))[0] == pytest.approx(1.0)
    assert error_ratio((score("pull", [2.0, 2.0]),), curve({"pull": [0.1, 0.1]}))[0] == pytest.approx(0.5)


def test_what_cannot_be_compared_is_not():
    lost = score("pull", [2.0, math.nan], lost=("a",))
    for scores, rows in (((lost,), {"pull": [1.0, 1.0]}), (SCORES, {"pull": [1.0, 1.0, 1.0]}), ((), {})):
        assert math.isnan(error_ratio(scores, curve(rows))[0])
    assert math.isnan(error_ratio((score("pull", [2.0]),), curve({"pull": [1.0]}))[0])


def test_a_fold_without_a_channel_counts_by_the_others():
    scores = (score("pull", [2.0, 2.0]), score("sinkage", [math.nan, 8.0]))
    ratio, _ = error_ratio(scores, curve({"pull": [4.0, 4.0], "sinkage": [math.nan, 8.0]}))
    assert ratio == pytest.approx(math.exp((math.log(2.0) + math.log(2.0) / 2) / 2))


@pytest.mark.parametrize(
    ("times", "first"),
    [([0.94, 0.94, 0.94], True), ([0.96, 0.96, 0.96], False), ([0.4, 1.5, 0.5], False), ([0.4, 0.6, 0.5], True)],
)
def test_a_better_rival_is_said_first(times, first):
    verdict = Verdict("wheel-rig", Answer.NAMED, "a set", "An effect acts.", None, named=("Grousers",), scores=SCORES)
    worse = curve({"pull": [9.0] * 3, "sinkage": [90.0] * 3}, "mean")
    better = curve({"pull": 2.0 * np.array(times), "sinkage": 8.0 * np.array(times)}, "Gaussian process")
    beside = against_rivals(verdict, [*worse, *better])
    assert (beside.answer is Answer.INADEQUATE) is first
    assert beside.sentence.startswith("A Gaussian process of what was set predicts") is first
    assert beside.sentence.endswith("An effect acts.")
    assert beside.named == ("Grousers",)
    assert len(beside.baselines) == 4


def test_what_is_on_no_list_stays_the_answer():
    verdict = Verdict("wheel-rig", Answer.NONE_FITS, "a set", "Something acts.", None, scores=SCORES)
    beside = against_rivals(verdict, curve({"pull": [1.0] * 3, "sinkage": [4.0] * 3}))
    assert beside.answer is Answer.NONE_FITS
    assert beside.rival.startswith("a quadratic of what was set")
