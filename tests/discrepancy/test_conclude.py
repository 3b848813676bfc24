"""Verdicts on linear experiments whose noise is declared or learnt: the answer, what is kept, numbers and errors."""

from dataclasses import replace

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import conclude
from rover_pin.estimation.numbers import MAX_DEVIATION
from tests.inference import linear_search as toys

NAMES = "pqrs"


def quiet(message):
    pass


def verdict(sizes, number=toys.NUMBER, **options):
    experiment = toys.made(NAMES, sizes, **{"size": 12.0, **options})
    return conclude(toys.question(experiment, NAMES, number), quiet)


@pytest.mark.parametrize("sd", [1.0, None])
def test_a_hidden_effect_is_named_with_its_size(sd):
    conclusion = verdict({"q": 1.5}, sd=sd)
    assert (conclusion.answer, conclusion.named) == (Answer.NAMED, ("q",))
    assert [type(effect) for effect in conclusion.effects] == [toys.Effect]
    assert dict(conclusion.model.records)["q"].a == conclusion.effects[0].a
    (size,) = [number for number in conclusion.after.numbers if number.name == "q.a"]
    assert size.low < 1.5 < size.high
    assert size.high - size.low < 0.8
    assert conclusion.after.misfit < conclusion.before.misfit
    assert all(score.after < score.before for score in conclusion.scores)
    assert set(conclusion.errors_anew) == {"c0", "c1"}
    assert set(conclusion.chosen.values()) <= {"q", "p + q", "q + r", "q + s"}
    assert conclusion.as_dict()["posterior"]["inclusion"]["q"] > 0.95


def test_noise_needs_no_effect_and_adds_none():
    conclusion = verdict({})
    assert (conclusion.answer, conclusion.named, conclusion.effects, conclusion.share) == (
        Answer.NONE_NEEDED,
        (),
        (),
        0.0,
    )
    assert conclusion.after is conclusion.before
    assert [number.name for number in conclusion.after.numbers] == ["base.b"]


def test_two_that_do_the_same_are_a_set():
    experiment = toys.made(NAMES, {"q": 1.5}, size=12.0)
    experiment.columns["r"] = 1.01 * experiment.columns["q"]
    conclusion = conclude(toys.question(experiment, NAMES), quiet)
    assert conclusion.answer is Answer.SET
    assert {*conclusion.indistinguishable} >= {"q", "r"}
    stored, second = {"q", "r"} & {*conclusion.named}, {"q", "r"} & {*conclusion.others}
    assert (len(stored), len(second)) == (1, 1)
    (size,) = conclusion.others[second.pop()].numbers
    assert size.low < 1.5 < size.high
    assert size.name in conclusion.summary()
    assert (
        conclusion.as_dict()["others"].keys()
        == conclusion.as_dict()["held_out_others"].keys()
        == conclusion.others.keys()
    )
    assert conclusion.effects[0].name == conclusion.named[0]


def test_what_cannot_be_told_is_listed_and_none_of_it_kept():
    experiment = toys.made(NAMES, {"q": 0.6}, size=12.0)
    for name in ("p", "r", "s"):
        experiment.columns[name] = 1.01 * experiment.columns["q"]
    conclusion = conclude(toys.question(experiment, NAMES), quiet)
    assert (conclusion.answer, conclusion.named) == (Answer.CANNOT_TELL, ())
    assert {*conclusion.indistinguishable} >= {*NAMES}
    assert conclusion.as_dict()["alike"] == [*conclusion.indistinguishable]


@pytest.mark.parametrize(
    ("distance", "declared", "answer"),
    [(1.1, True, Answer.INADEQUATE), (0.9, True, Answer.NONE_NEEDED), (1.1, False, Answer.NONE_NEEDED)],
)
def test_a_number_five_sd_from_what_is_declared_is_inadequate(distance, declared, answer):
    """What was assumed contradicts nobody."""
    conclusion = verdict({}, replace(toys.NUMBER, declared=declared), b=distance * MAX_DEVIATION, size=60.0)
    assert conclusion.answer is answer
    assert (conclusion.named, MAX_DEVIATION) == ((), 5.0)
    assert ("base.b" in conclusion.sentence) is (answer is Answer.INADEQUATE)


def test_what_is_on_no_list_is_something_that_acts():
    experiment = toys.made(NAMES, {})
    wave = 12.0 * np.sin(4.0 * experiment.varied[:, None, :, 0])
    conclusion = conclude(toys.question(replace(experiment, observed=experiment.observed + wave), NAMES), quiet)
    assert conclusion.answer is Answer.NONE_FITS
    assert conclusion.beliefs.leaves_more(()) > 0.99
