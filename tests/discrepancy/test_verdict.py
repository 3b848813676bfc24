"""A verdict in words and as plain values: what is told of the model, of folds, channels and numbers, by hand."""

import math

import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.discrepancy.verdict import FEW, SCHEMA, Side, Verdict
from rover_pin.estimation.numbers import DRIFTED, Number


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


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({}, "the base model as declared, nothing fitted"),
        ({"after": side()}, "the fitted base model, to which nothing was added"),
        ({"after": side(), "named": ("A", "B")}, "the model with A + B"),
    ],
)
def test_the_model_in_words(more, words):
    assert verdict(**more).model_description == words


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        (("A", "A", "B"), "A chosen in 2 of 3 folds"),
        (("A", "A + B", "A + C", "B"), "A chosen in 1 of 4 folds, and with another in 2"),
        (("B", "", "C"), "A chosen in 0 of 3 folds"),
    ],
)
def test_folds_that_choose_the_same_and_more_are_counted(chosen, words):
    folds = dict(enumerate(chosen))
    assert verdict(named=("A",), chosen=folds).chosen_again == words
    assert words in lines_of(verdict(named=("A",), chosen=folds))
    assert not any("chosen" in line for line in lines_of(verdict(named=("A",))))


def test_folds_that_choose_where_nothing_was_added_say_what():
    made = verdict(chosen={"a": "A", "b": "", "c": "A"})
    assert made.chosen_again == "chosen in 3 folds: A in 2, no effect in 1"
    two = verdict(named=("A", "B"), chosen={"a": "B + A", "b": "A"})
    assert two.chosen_again == "A + B chosen in 1 of 2 folds", "in whatever order"


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


def test_errors_with_each_folds_choice_cover_scored_channels():
    more = {"named": ("A",), "chosen": {"a": "A"}, "scores": (score("pull"),)}
    line = "A chosen in 1 of 1 folds"
    assert line in lines_of(verdict(**more))
    assert line in lines_of(verdict(**more, errors_anew={"sinkage": 2.0}))
    told = f"{line}; held-out RMSE of all hypotheses together: pull 3 N"
    assert told in lines_of(verdict(**more, errors_anew={"pull": 3.0, "sinkage": 2.0}))


def test_drifted_numbers_are_those_of_the_model_after():
    near, far, down = number("soil.k", DRIFTED - 0.1), number("soil.c", DRIFTED + 0.1), number("soil.n", -4.0)
    assert verdict(after=side(near, far, down), before=side(number("soil.phi", 9.0))).drifted == (far, down)
    assert verdict(before=side(number("soil.phi", 9.0))).drifted == ()


@pytest.mark.parametrize(("before", "after"), [(True, True), (True, False), (False, True), (False, False)])
def test_chi_square_is_told_where_there_are_two(before, after):
    made = verdict(before=side(misfit=4.0) if before else None, after=side(misfit=1.5) if after else None)
    told = [line for line in lines_of(made) if line.startswith("reduced chi-square")]
    assert told == (["reduced chi-square: 4 -> 1.5; 1 is the noise"] if before and after else [])
    values = {"before": 4.0} if before else {}
    assert made.as_dict()["reduced_chi_square"] == values | ({"after": 1.5} if after else {})


@pytest.mark.parametrize(("channels", "told"), [(FEW - 1, FEW - 1), (FEW, FEW), (FEW + 1, 2), (FEW + 3, 2)])
def test_only_claimable_changes_are_listed_of_many_channels(channels, told):
    """Up to five there is a line for each."""
    better, worse = score("c0"), score("c1", 1.5, 0.4, 0.6)
    scores = (better, worse, *(score(f"c{at}", **SCATTERS) for at in range(2, channels)))
    rows = [line for line in lines_of(verdict(scores=scores)) if line.startswith("held-out c")]
    assert [row.split()[1] for row in rows] == [f"c{at}:" for at in range(told)]
    assert FEW == 5


@pytest.mark.parametrize("named", [(), ("A",)])
def test_what_got_worse_is_told_where_something_was_added(named):
    text = verdict(named=named, scores=(score("pull", 1.5, 0.4, 0.6),)).summary()
    assert ("Got worse: pull by 50%." in text) is bool(named)


class Told:
    """What a kind of data, or a draft, says besides."""

    def lines(self, added=None):
        return ["told"] if added is None else [f"told with {added}"]

    def as_dict(self):
        return {"told": 1}


@pytest.mark.parametrize("named", [(), ("A",)])
def test_what_a_kind_of_data_and_a_draft_say_besides(named):
    made = verdict(named=named, extra=Told(), draft=Told())
    assert {f"told with {bool(named)}", "draft: told"} <= set(lines_of(made))
    assert (made.as_dict()["extra"], made.as_dict()["draft"]) == ({"told": 1}, {"told": 1})
    bare = verdict(named=named)
    assert not any("told" in line for line in lines_of(bare))
    assert (bare.as_dict()["extra"], bare.as_dict()["draft"]) == ({}, {})


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
