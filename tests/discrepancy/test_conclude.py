"""Verdicts on linear experiments whose noise is declared or learnt: the answer, what is kept, numbers and errors."""

from dataclasses import replace

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import conclude
from rover_pin.estimation.numbers import MAX_DEVIATION
from tests.inference import linear_search as toys

NAMES = "pqrs"


def quiet(said):
    pass


def verdict(sizes, number=toys.NUMBER, **how):
    experiment = toys.made(NAMES, sizes, **{"size": 12.0, **how})
    return conclude(toys.question(experiment, NAMES, number), quiet)


@pytest.mark.parametrize("sd", [1.0, None])
def test_a_hidden_effect_is_named_with_its_size(sd):
    found = verdict({"q": 1.5}, sd=sd)
    assert (found.answer, found.named) == (Answer.NAMED, ("q",))
    assert [type(effect) for effect in found.effects] == [toys.Effect]
    assert dict(found.model.records)["q"].a == found.effects[0].a
    (size,) = [number for number in found.after.numbers if number.name == "q.a"]
    assert size.low < 1.5 < size.high
    assert size.high - size.low < 0.8
    assert found.after.misfit < found.before.misfit
    assert all(score.after < score.before for score in found.scores)
    assert set(found.errors_anew) == {"c0", "c1"}
    assert set(found.chosen.values()) <= {"q", "p + q", "q + r", "q + s"}
    assert found.as_dict()["posterior"]["inclusion"]["q"] > 0.95


def test_noise_needs_no_effect_and_adds_none():
    found = verdict({})
    assert (found.answer, found.named, found.effects, found.share) == (Answer.NONE_NEEDED, (), (), 0.0)
    assert found.after is found.before
    assert [number.name for number in found.after.numbers] == ["base.b"]


def test_two_that_do_the_same_are_a_set():
    experiment = toys.made(NAMES, {"q": 1.5}, size=12.0)
    experiment.columns["r"] = 1.01 * experiment.columns["q"]
    found = conclude(toys.question(experiment, NAMES), quiet)
    assert found.answer is Answer.SET
    assert {*found.indistinguishable} >= {"q", "r"}
    kept, other = {"q", "r"} & {*found.named}, {"q", "r"} & {*found.others}
    assert (len(kept), len(other)) == (1, 1)
    (size,) = found.others[other.pop()].numbers
    assert size.low < 1.5 < size.high
    assert size.name in found.summary()
    assert found.as_dict()["others"].keys() == found.as_dict()["held_out_others"].keys() == found.others.keys()
    assert found.effects[0].name == found.named[0]


def test_what_cannot_be_told_is_listed_and_none_of_it_kept():
    experiment = toys.made(NAMES, {"q": 0.6}, size=12.0)
    for name in ("p", "r", "s"):
        experiment.columns[name] = 1.01 * experiment.columns["q"]
    found = conclude(toys.question(experiment, NAMES), quiet)
    assert (found.answer, found.named) == (Answer.CANNOT_TELL, ())
    assert {*found.indistinguishable} >= {*NAMES}
    assert found.as_dict()["alike"] == [*found.indistinguishable]


@pytest.mark.parametrize(
    ("far", "declared", "answer"),
    [(1.1, True, Answer.INADEQUATE), (0.9, True, Answer.NONE_NEEDED), (1.1, False, Answer.NONE_NEEDED)],
)
def test_a_number_five_sd_from_what_is_declared_is_inadequate(far, declared, answer):
    """What was assumed contradicts nobody."""
    found = verdict({}, replace(toys.NUMBER, declared=declared), b=far * MAX_DEVIATION, size=60.0)
    assert found.answer is answer
    assert (found.named, MAX_DEVIATION) == ((), 5.0)
    assert ("base.b" in found.sentence) is (answer is Answer.INADEQUATE)


def test_what_is_on_no_list_is_something_that_acts():
    experiment = toys.made(NAMES, {})
    wave = 12.0 * np.sin(4.0 * experiment.varied[:, None, :, 0])
    found = conclude(toys.question(replace(experiment, observed=experiment.observed + wave), NAMES), quiet)
    assert found.answer is Answer.NONE_FITS
    assert found.beliefs.leaves_more(()) > 0.99
