"""What the evidence proposes and held-out data contradict: a name needs both, and the answer says where they differ."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.confirm import confirmed, worse_channels
from rover_pin.discrepancy.decision import decide, sentence
from rover_pin.discrepancy.held_out_errors import ChannelScore, HeldOut
from rover_pin.inference.beliefs import Beliefs, SearchEnd, across_folds, excluding, held_out_gain, toward_prior
from rover_pin.inference.error_model import Discrepancy

FOLDS = 4
DECLARED = SimpleNamespace(noise=lambda: None)


def hypothesis(names, densities, misfit=1.0):
    """A fitted set of causes, with the log density of each fold given the others."""
    causes = tuple(SimpleNamespace(name=name, family=name) for name in names)
    return SimpleNamespace(
        names=tuple(names),
        causes=causes,
        discrepancy=Discrepancy.NONE,
        leaves_more=False,
        is_fitted=True,
        noise_taken={"pull": 1.0},
        experiment=DECLARED,
        fit=SimpleNamespace(misfit=misfit),
        fold_prediction=SimpleNamespace(log_density=np.array(densities, float)),
    )


def beliefs(rows, misfit=1.0):
    """Beliefs of {names: (probability, log densities of the folds)}; the empty text is nothing."""
    made = Beliefs(tuple(hypothesis(names, densities, misfit) for names, (_, densities) in rows.items()), 5)
    return Beliefs(made.hypotheses, 5, given_scores=np.log([p for p, _ in rows.values()]))


def score(before, after, scatter=0.01, name="pull", floor=1.0):
    change = after / before - 1
    low, high = change - scatter, change + scatter
    return ChannelScore(name, "N", floor, before, after, change, low, high, joint_low=low)


def errors(**by_set):
    """Held-out errors by the names of a set: those of its channels, or one channel that is better."""
    return lambda kept: HeldOut(by_set.get("".join(kept.names), (score(9.0, 5.0),)), ())


STEADY = {"A": (0.98, [-1.0] * FOLDS), "": (0.02, [-3.0] * FOLDS)}
"""A cause that every fold chooses and predicts better with."""


def test_a_name_that_predicts_and_that_every_fold_chooses_stands():
    found = confirmed(beliefs(STEADY), errors())
    assert (found.decision.answer, found.decision.retained, found.decision.reasons) == (Answer.NAMED, ("A",), ())


def test_a_cause_that_makes_a_channel_worse_and_removes_nothing_gives_way_to_one_that_predicts():
    """The evidence is sure of A; held-out data are not, and B, which the evidence left far behind, predicts."""
    rows = {"A": (0.98, [-1.0] * FOLDS), "B": (0.019, [-2.0] * FOLDS), "": (1e-6, [-9.0] * FOLDS)}
    worse = score(1.5, 12.0, name="pitch")
    found = confirmed(beliefs(rows), errors(A=(worse, score(4.0, 3.9))))
    assert (found.decision.answer, found.decision.retained) == (Answer.LIKE, ("B",))
    (reason,) = found.decision.reasons
    for fact in ("With all data, A has the probability 0.98", "removes 0%", "pitch", "+700%"):
        assert fact in reason
    said = sentence(found.decision, found.beliefs, 0.4, 1.2)
    assert said.startswith("something like B is missing")
    assert reason in said


def test_where_no_cause_predicts_something_acts():
    rows = {"A": (0.98, [-1.0] * FOLDS), "": (0.02, [-3.0] * FOLDS)}
    found = confirmed(beliefs(rows), errors(A=(score(2.0, 3.0),)))
    assert (found.decision.answer, found.decision.retained) == (Answer.NONE_FITS, ())
    assert "A has the probability 0.98" in sentence(found.decision, found.beliefs, 0.0, 1.2)


def test_what_the_evidence_leaves_open_stays_open():
    rows = {"A": (0.7, [-1.0] * FOLDS), "": (0.3, [-3.0] * FOLDS)}
    found = confirmed(beliefs(rows), errors(A=(score(2.0, 3.0),)))
    assert (found.decision.answer, found.decision.sets) == (Answer.CANNOT_TELL, (("A",), ()))


@pytest.mark.parametrize(
    ("densities", "answer"), [([-4.0, -4.5, -4.2, -4.8], Answer.NONE_FITS), ([-1.0, -4.5, -1.2, -7.0], Answer.NAMED)]
)
def test_a_cause_that_surely_lowers_the_density_of_held_out_folds_is_not_named(densities, answer):
    """A loss within the scatter of the folds contradicts nothing."""
    made = beliefs({"A": (0.98, densities), "": (0.02, [-3.0] * FOLDS)})
    assert held_out_gain(made, "A").total == pytest.approx(sum(densities) + 12.0)
    assert held_out_gain(made, "A").total < 0.0
    assert confirmed(made, errors()).decision.answer is answer


def test_a_law_that_costs_one_channel_but_removes_error_is_only_similar():
    both = (score(9.0, 3.0), score(2.0, 3.0, name="sinkage"))
    found = confirmed(beliefs(STEADY), errors(A=both))
    assert (found.decision.answer, found.decision.retained) == (Answer.LIKE, ("A",))
    assert "sinkage" in found.decision.reasons[0]


def test_a_set_that_costs_one_channel_stays_a_set_and_overturns_nothing():
    rows = {"A": (0.6, [-1.0] * FOLDS), "B": (0.38, [-1.0] * FOLDS), "": (0.02, [-3.0] * FOLDS)}
    both = (score(9.0, 3.0), score(2.0, 3.0, name="sinkage"))
    found = confirmed(beliefs(rows), errors(A=both))
    assert (found.decision.answer, found.decision.retained, found.decision.reasons) == (Answer.SET, ("A",), ())


def test_a_name_that_most_folds_drop_is_one_of_a_set():
    """A leads by what each fold adds to the evidence; without any one of three folds B leads."""
    rows = {"A": (0.97, [-1.0, -1.0, -1.0, -9.0]), "B": (0.03, [-9.0, -9.0, -9.0, -3.0]), "": (1e-9, [-20.0] * FOLDS)}
    assert decide(beliefs(rows)).answer is Answer.NAMED
    found = confirmed(beliefs(rows), errors())
    assert (found.decision.answer, found.decision.sets) == (Answer.SET, (("B",), ("A",)))
    assert sum(found.beliefs.sets.values()) == pytest.approx(1.0)
    assert "without 3 of the 4 folds" in found.decision.reasons[0]
    assert "(1.00)" not in sentence(found.decision, found.beliefs, 0.4, 1.2)


def test_a_name_that_is_nothing_without_most_folds_is_that_or_nothing():
    rows = {"A": (0.97, [-1.0, -1.0, -1.0, -2.0]), "": (0.03, [-6.0] * FOLDS)}
    found = confirmed(beliefs(rows), errors())
    assert (found.decision.answer, found.decision.retained) == (Answer.SET, ("A",))
    assert found.decision.sets == (("A",), ())


@pytest.mark.parametrize(("misfit", "answer"), [(40.0, Answer.SET), (1.0, Answer.NAMED)])
def test_far_from_the_noise_one_fold_that_disagrees_suffices(misfit, answer):
    """No probability of 1.00 where reduced chi2 is far above 3 and a fold drops the second cause."""
    rows = {"AB": (0.9999, [-1.0] * FOLDS), "A": (1e-4, [-1.0, -1.0, -1.0, -20.0]), "": (1e-30, [-30.0] * FOLDS)}
    found = confirmed(beliefs(rows, misfit), errors())
    assert found.decision.answer is answer
    said = sentence(found.decision, found.beliefs, 0.9, 50.0)
    assert ("A and B is missing with probability 1.00" in said) is (answer is Answer.NAMED)
    assert ("A + B (0.75) or A (0.25)" in said) is (answer is Answer.SET)


def test_a_similar_law_far_from_the_noise_stays_similar_with_the_average_probability():
    rows = {"A": (0.99, [-1.0] * FOLDS), "": (0.01, [-1.0, -1.0, -1.0, -20.0])}
    made = beliefs(rows, misfit=40.0)
    made.hypotheses[0].leaves_more = True
    found = confirmed(made, errors())
    assert (found.decision.answer, found.decision.retained) == (Answer.LIKE, ("A",))
    assert "(probability 0.74 on average over the folds)" in sentence(found.decision, found.beliefs, 0.9, 50.0)


def test_worse_is_what_no_scatter_and_no_floor_explains():
    channels = (
        score(2.0, 2.6, name="worse"),
        score(2.0, 2.6, scatter=0.5, name="within scatter"),
        score(2.0, 2.02, name="not visible"),
        score(0.5, 1.1, name="at the floor"),
        score(2.0, math.nan, name="lost"),
        score(2.6, 2.0, name="better"),
    )
    assert [one.name for one in worse_channels(channels)] == ["lost", "worse"]


def test_gain_and_averages_follow_from_the_densities_of_the_folds():
    rows = {"A": (0.8, [-1.0, -2.0, -1.5, -3.0]), "B": (0.1, [-2.0] * FOLDS), "": (0.1, [-4.0, -2.0, -3.0, -2.0])}
    made = beliefs(rows)
    gains = np.array([3.0, 0.0, 1.5, -1.0])
    assert held_out_gain(made, "A") == pytest.approx((gains.sum(), 2.0 * gains.std(ddof=1)))
    # Without a fold, each set has its probability divided by the density of this fold.
    weights = np.array([[p * math.exp(-density) for density in of] for p, of in rows.values()])
    average = (weights / weights.sum(axis=0)).mean(axis=1)
    assert list(across_folds(made).weights) == pytest.approx(list(average))
    assert {frozenset(): 0.5, frozenset("B"): 0.5} == pytest.approx(excluding(made, "A").sets)


def test_far_from_the_noise_nothing_is_certain_although_all_folds_agree():
    """A reduced chi2 of 40 is no noise: the name stays similar, and four folds that agree are no proof."""
    found = confirmed(beliefs(STEADY, misfit=40.0), errors())
    assert (found.decision.answer, found.decision.retained) == (Answer.LIKE, ("A",))
    (doubt,) = found.decision.doubts
    assert "40" in doubt
    assert 0.5 < found.beliefs.inclusion("A") < 0.9
    assert "1.00" not in sentence(found.decision, found.beliefs, 0.9, 50.0)


def test_a_fit_that_still_falls_is_not_certain_either():
    made = beliefs(STEADY)
    ended = Beliefs(made.hypotheses, 5, given_scores=made.scores, end=SearchEnd(10, 100, (), {frozenset("A"): 12.0}))
    found = confirmed(ended, errors())
    assert found.decision.answer is Answer.LIKE
    assert "12" in found.decision.doubts[0]
    elsewhere = Beliefs(made.hypotheses, 5, given_scores=made.scores, end=SearchEnd(10, 100, (), {frozenset("B"): 9.0}))
    assert confirmed(elsewhere, errors()).decision.answer is Answer.NAMED


def test_one_more_fold_has_the_prior_probabilities():
    averaged = across_folds(beliefs(STEADY))
    counted = toward_prior(averaged, FOLDS)
    prior = {"A": 0.3 * 0.6 / 5, "": 0.5 * 0.7}
    share = prior["A"] / sum(prior.values())
    assert counted.inclusion("A") == pytest.approx((FOLDS * averaged.inclusion("A") + share) / (FOLDS + 1))
    assert sum(counted.weights) == pytest.approx(1.0)
