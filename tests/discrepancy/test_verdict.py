"""A verdict in words and as plain values: what is told of the model, of folds, channels and numbers, by hand."""

import math

import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.discrepancy.verdict import FEW, SCHEMA, Side, Verdict
from rover_pin.estimation.numbers import Number


def verdict(**more):
    return Verdict(kind="test-bed", answer=Answer.NAMED, name="bed", sentence="so it is.", model=None, **more)


def number(name, drift=0.0):
    return Number(name, "N", 2.0, 1.0, 3.0, drift)


def side(*numbers, misfit=1.0):
    return Side(None, numbers, misfit, None)


def score(name, after=0.5, low=-0.6, high=-0.4):
    """The score of a channel whose error was 1; by default it fell by half beyond its scatter."""
    return ChannelScore(name, "N", 0.1, 1.0, after, after - 1.0, low, high)


SCATTERS = {"after": 0.9, "low": -0.3, "high": 0.2}


def lines_of(made):
    return [line.strip() for line in made.summary().splitlines()]


def test_set_lists_the_errors_of_each_indistinguishable_rival():
    made = verdict(
        named=("A",), scores=(score("pull"),), others={"B": {"pull": 3.0, "sinkage": 2.0}, "C + D": {"pull": 4.0}}
    )
    told = [line for line in lines_of(made) if "instead" in line]
    assert told == ["with B instead: held-out RMSE pull 3 N", "with C + D instead: held-out RMSE pull 4 N"]
    assert made.as_dict()["held_out_others"] == {"B": {"pull": 3.0, "sinkage": 2.0}, "C + D": {"pull": 4.0}}
    assert not any("instead" in line for line in lines_of(verdict(named=("A",), scores=(score("pull"),))))


def test_a_fold_that_is_lost_is_told_in_place_of_an_error():
    """No sinkage carries its load: there is no error, of whatever size."""
    for error, lost in ((math.nan, True), (1e3, False)):
        made = verdict(
            named=("A",),
            chosen={"a": "A"},
            scores=(score("pull"),),
            others={"B": {"pull": error}},
            errors_anew={"pull": error},
        )
        text = made.summary()
        assert ("with B instead: held-out RMSE pull not predicted" in text) is lost
        assert ("of all hypotheses together: pull not predicted" in text) is lost
        assert ("pull 1000 N" in text) is not lost


@pytest.mark.parametrize(("channels", "told"), [(FEW - 1, FEW - 1), (FEW, FEW), (FEW + 1, 2), (FEW + 3, 2)])
def test_only_claimable_changes_are_listed_of_many_channels(channels, told):
    """Up to five there is a line for each."""
    better, worse = score("c0"), score("c1", 1.5, 0.4, 0.6)
    scores = (better, worse, *(score(f"c{at}", **SCATTERS) for at in range(2, channels)))
    rows = [line for line in lines_of(verdict(scores=scores)) if line.startswith("held-out c")]
    assert [row.split()[1] for row in rows] == [f"c{at}:" for at in range(told)]
    assert FEW == 5


@pytest.mark.parametrize(("channels", "told"), [(FEW, "soil.k soil.c A.c B.d"), (FEW + 1, "soil.c A.c B.d")])
def test_large_model_lists_only_added_or_drifted_numbers(channels, told):
    """B stands at a place, whose numbers bear its name alone."""
    numbers = (number("soil.k"), number("soil.c", 4.0), number("A.c"), number("B.d"))
    scores = tuple(score(f"c{at}") for at in range(channels))
    text = lines_of(verdict(after=side(*numbers), scores=scores, named=("A", "B@1.5")))
    assert [line.split()[0] for line in text if " = " in line] == told.split()
    assert not any(" = " in line for line in lines_of(verdict(before=side(*numbers), scores=scores)))


def test_a_verdict_as_plain_values():
    values = verdict(after=side(number("A.c", 1.5))).as_dict()
    assert (values["schema"], values["kind"], values["answer"]) == (3, "test-bed", "an effect is missing")
    assert SCHEMA == 3, "docs/verdict.md describes this one"
    assert values["share"] == 0.0
    assert (values["before"], list(values["after"])) == ({}, ["A.c"])
    assert values["after"]["A.c"]["drift"] == 1.5
    assert values["posterior"] == {}, "where hypotheses were not weighed"
    assert "rounds" not in values
