"""The rules of the answer at their limits, on searches made by hand: what holds, what is like, what speaks against."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2 as chi2_law

from rover_pin.discrepancy import decide_answer
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.decide_answer import (
    ResidualAssessment,
    answer_of,
    graded,
    held_out_share,
    hold_together,
    holds,
    share_taken,
    vetoes,
)
from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.estimation.numbers import Number, implausible, is_adequate
from rover_pin.estimation.parameter import Parameter


def parameter(name="soil.phi", prior=True, low=-50.0, high=50.0, declared=True):
    return Parameter(name, 0.0, 1.0, low, high, prior=prior, declared=declared)


def fitted(rows_chi2=50.0, freedom=50, u=(), parameters=(), **more):
    """A fit whose rows' chi2 is this, with as many numbers as u has."""
    rows = np.full(100, math.sqrt(rows_chi2 / 100))
    given = parameters or tuple(parameter(f"n.{at}") for at in range(len(u)))
    return SimpleNamespace(rows=rows, chi2=rows_chi2, freedom=freedom, parameters=given, u=np.array(u), **more)


def of_folds(count):
    return SimpleNamespace(experiment=SimpleNamespace(folds=("fold",) * count))


def found(*names, base=None, last=None, alike=None):
    effects = tuple(SimpleNamespace(name=name, names=(f"{name}.x", f"{name}.y")) for name in names)
    return SimpleNamespace(
        best_refits=effects,
        added=effects,
        names=" + ".join(names),
        indistinguishable=alike or names,
        base=base or fitted(),
        last=last or fitted(),
    )


PLAUSIBLE, BENT = fitted(u=(4.9, -4.9)), fitted(u=(0.0, -5.1))


@pytest.mark.parametrize(
    ("search", "left", "takes_most", "answer"),
    [
        (found(base=PLAUSIBLE), ResidualAssessment(False), False, Answer.NONE_NEEDED),
        (found(base=BENT), ResidualAssessment(False), False, Answer.INADEQUATE),
        (found(base=PLAUSIBLE), ResidualAssessment(True), True, Answer.INADEQUATE),
        (found(base=PLAUSIBLE), ResidualAssessment(True, described=True), True, Answer.NONE_FITS),
        (found("A"), ResidualAssessment(False), False, Answer.NAMED),
        (found("A", base=BENT), ResidualAssessment(False), False, Answer.NAMED),
        (found("A", alike=("A", "B")), ResidualAssessment(False), False, Answer.SET),
        (found("A"), ResidualAssessment(True), True, Answer.LIKE),
        (found("A"), ResidualAssessment(True), False, Answer.INADEQUATE),
        (found("A"), ResidualAssessment(True, described=True), True, Answer.LIKE),
        (found("A", alike=("A", "B")), ResidualAssessment(True, described=True), False, Answer.NONE_FITS),
    ],
)
def test_the_answer(search, left, takes_most, answer):
    assert answer_of(search, left, takes_most) is answer


@pytest.mark.parametrize(("share", "answer"), [(0.67, Answer.LIKE), (0.66, Answer.INADEQUATE)])
def test_share_of_the_first_counts_only_for_an_unlisted_residual(share, answer, monkeypatch):
    monkeypatch.setattr(decide_answer, "first_of", lambda search: search)
    monkeypatch.setattr(decide_answer, "held_out_share", lambda base, last: share)
    assert graded(found("A", base=fitted(task=of_folds(9))), ResidualAssessment(True), {})[0] is answer
    assert graded(found("A"), ResidualAssessment(False), {})[0] is Answer.NAMED
    assert graded(found(base=PLAUSIBLE), ResidualAssessment(True), {})[0] is Answer.INADEQUATE


AGREED = {"one": "B + A", "two": "A + B", "three": "A"}
"""Two of three folds choose both, in any order."""


@pytest.mark.parametrize(
    ("names", "share", "chosen", "folds", "together"),
    [
        ("AB", 0.8, AGREED, 12, True),
        ("AB", 0.79, AGREED, 12, False),
        ("AB", 0.9, AGREED, 11, False),
        ("AB", 0.9, AGREED | {"four": "A"}, 12, False),
        ("AB", 0.9, {"one": "A + C"}, 12, False),
        ("AB", 0.9, {"one": "A + B + C"}, 12, False),
        ("A", 0.9, {"one": "A", "two": "A"}, 12, False),
    ],
)
def test_effects_hold_together_by_their_share_and_most_folds(names, share, chosen, folds, together, monkeypatch):
    """Each has two numbers of its own, so that both ask for twelve folds."""
    first, whole = object(), found(*names, base=fitted(task=of_folds(folds)))
    monkeypatch.setattr(decide_answer, "first_of", lambda search: SimpleNamespace(last=first))
    monkeypatch.setattr(decide_answer, "held_out_share", lambda base, last: 0.1 if last is first else share)
    assert hold_together(whole, chosen) is together
    assert graded(whole, ResidualAssessment(True), chosen) == (Answer.LIKE if together else Answer.INADEQUATE, whole)
    assert graded(whole, ResidualAssessment(False), chosen) == (Answer.NAMED if len(names) == 1 else Answer.SET, whole)


@pytest.mark.parametrize(("together", "said_of"), [(False, "first"), (True, "whole")])
def test_missing_effect_is_like_the_whole_set_or_like_the_first(together, said_of, monkeypatch):
    """Where the first alone takes most; nothing is predicted for it where all hold together."""
    first, whole = SimpleNamespace(last=fitted()), found("A", "B")
    shares = []
    monkeypatch.setattr(decide_answer, "first_of", lambda search: first)
    monkeypatch.setattr(decide_answer, "hold_together", lambda search, chosen: together)
    monkeypatch.setattr(decide_answer, "held_out_share", lambda base, last: shares.append(last) or 0.9)
    assert graded(whole, ResidualAssessment(True), {}) == (Answer.LIKE, first if said_of == "first" else whole)
    assert shares == ([] if together else [first.last])


# --- what holds ------------------------------------------------------------------------------------------------------


def test_what_is_left_is_a_surprise_once_in_a_thousand():
    limit = chi2_law.isf(1e-3, 50)
    assert is_adequate(fitted(0.999 * limit))
    assert not is_adequate(fitted(1.001 * limit))
    assert is_adequate(fitted(1.001 * chi2_law.isf(0.01, 50)))
    assert not is_adequate(fitted(1.001 * chi2_law.isf(0.01, 50)), 0.01)


@pytest.mark.parametrize(("taken", "law"), [(0.901, True), (0.899, False)])
def test_law_holds_at_nine_tenths_taken_or_a_p_value_of_0_01(taken, law):
    base = fitted(1050.0)
    assert holds(found("A", base=base, last=fitted(1050.0 - 1000.0 * taken))) == law
    limit = chi2_law.isf(0.01, 50)
    assert holds(found("A", base=fitted(limit + 1), last=fitted(0.999 * limit)))
    assert not holds(found("A", base=fitted(limit + 1), last=fitted(1.001 * limit)))


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [
        (150.0, 50.0, 1.0),
        (150.0, 100.0, 0.5),
        (150.0, 30.0, 1.0),
        (150.0, 160.0, 0.0),
        (50.0, 49.0, 1.0),
        (40.0, 41.0, 0.0),
    ],
)
def test_the_share_that_is_taken_is_of_what_is_beyond_the_noise(before, after, share):
    """Of 50 rows more than numbers."""
    assert share_taken(found("A", base=fitted(before), last=fitted(after))) == pytest.approx(share)


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [
        (300.0, 100.0, 1.0),
        (300.0, 200.0, 0.5),
        (300.0, 400.0, 0.0),
        (300.0, 50.0, 1.0),
        (100.0, 99.0, 1.0),
        (90.0, 91.0, 0.0),
        (100.5, 100.2, 0.6),
    ],
)
def test_on_held_out_folds_too(monkeypatch, before, after, share):
    """Of 100 compared blocks."""
    monkeypatch.setattr(decide_answer, "held_out_losses", lambda one: np.array([0.25, 0.75]) * one.loss)
    task = SimpleNamespace(noise=SimpleNamespace(good=np.ones((2, 1, 50), bool)))
    base, last = (fitted(loss=loss, task=task) for loss in (before, after))
    assert held_out_share(base, last) == pytest.approx(share)


# --- what speaks against a lone name ---------------------------------------------------------------------------------


def against(u=0.5, one=None, chosen=None, scores=(), names=("A",)):
    last = fitted(u=(u,), parameters=(one or parameter("A.size", prior=False, low=-2.0, high=3.0),))
    return vetoes(found(*names, last=last), chosen or {}, scores)


@pytest.mark.parametrize(
    ("u", "stuck"), [(3.0, True), (3.0 - 0.9e-6, True), (3.0 - 1.1e-6, False), (-2.0, True), (-2.0 + 0.9e-6, True)]
)
def test_a_size_within_a_millionth_of_its_bound_stands_at_it(u, stuck):
    assert against(u) == (["A.size lies at its bound"] if stuck else [])


@pytest.mark.parametrize(
    ("high", "u", "prior", "stuck"), [(1.0, 1.0, False, False), (1.0, 1.0, True, True), (1.1, 1.1, False, True)]
)
def test_published_law_is_not_vetoed_at_the_bound_of_its_prior(high, u, prior, stuck):
    one = parameter("A.share", prior=prior, low=0.0, high=high)
    assert against(u, one) == (["A.share lies at its bound"] if stuck else [])


def test_a_number_five_sd_from_what_is_declared_speaks_against():
    for u, said in (
        (5.1, ["soil.phi +5.1 SD from what is declared of it"]),
        (-4.9, []),
        (-5.1, ["soil.phi -5.1 SD from what is declared of it"]),
    ):
        assert against(u, parameter()) == said
    assert implausible(fitted(u=(9.0,), parameters=(parameter(prior=False),))) == ()
    assert implausible(fitted(u=(9.0,), parameters=(parameter(declared=False),))) == ()


@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        ("AAB", []),
        ("AABB", ["A is chosen in 2 of 4 folds only"]),
        ("ABB", ["A is chosen in 1 of 3 folds only"]),
        ("", []),
    ],
)
def test_a_name_is_chosen_in_more_than_half_of_the_folds(chosen, said):
    assert against(chosen=dict(enumerate(chosen))) == said


def test_two_that_were_added_are_chosen_in_either_order():
    chosen = {"a": "B + A", "b": "A + B", "c": "A"}
    assert against(chosen=chosen, names=("A", "B")) == []
    assert against(chosen={**chosen, "d": ""}, names=("A", "B")) == ["A + B is chosen in 2 of 4 folds only"]


def test_a_fold_that_chooses_more_does_not_choose_the_same():
    assert against(chosen=dict(enumerate(["A", "A + B", "A + B"]))) == ["A is chosen in 1 of 3 folds only"]


def score(change, low, high, floor=0.1):
    return ChannelScore("sinkage", "m", floor, 1.0, 1.0 + change, change, low, high)


@pytest.mark.parametrize(
    ("made", "worse"),
    [
        (score(0.06, 0.01, 0.1), True),
        (score(0.04, 0.01, 0.1), False),
        (score(0.06, -0.01, 0.1), False),
        (score(-0.2, -0.3, -0.1), False),
    ],
)
def test_channel_predicted_worse_by_a_twentieth_is_a_veto(made, worse):
    assert against(scores=[made]) == (["sinkage is predicted worse where it was not fitted"] if worse else [])


# --- a number in words -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("drift", "more", "end"),
    [
        (2.9, {}, "1 m [0.5 m, 1.5 m]"),
        (3.1, {"declared": True}, "1 m [0.5 m, 1.5 m], +3.1 SD from what was declared"),
        (-3.1, {}, "1 m [0.5 m, 1.5 m], -3.1 SD from what was assumed"),
        (math.nan, {"closed": False}, "1 m [0.5 m, 1.5 m], not closed by the data"),
        (0.0, {"closed": False, "at_bound": True}, "1 m [0.5 m, 1.5 m], at its bound"),
    ],
)
def test_a_number_says_what_is_to_be_known_of_it(drift, more, end):
    said = Number("k", "N", 1.0, 0.5, 1.5, drift, **more).text
    assert said == f"k = {end.replace(' m', ' N')}"
