"""A verdict in words and as plain values: what is told of the model, of folds, channels and numbers, by hand."""

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.verdict import SCHEMA, Side, Verdict
from rover_pin.estimation.numbers import Number


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
