"""The first screen: one sentence with numbers, reasons for and against, what to drive next; no class as headline."""

import dataclasses
import re
from types import SimpleNamespace

import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out_errors import ChannelScore, RunScore
from rover_pin.discrepancy.verdict import Alternative
from rover_pin.estimation.numbers import Number
from rover_pin.report.drive.report import labels_of
from rover_pin.report.headline import headline, improvement, next_run, opposing_reasons, supporting_reasons
from rover_pin.report.verdict_page import first_lines, first_screen
from rover_pin.report.words import Labels, brief, pair
from rover_pin.simulation.model.effect_files import package_effects

RIG = Labels("at slips that were not fitted", "levels of slip")


def score(name, unit, before, after, low, high, floor=1e-4):
    return ChannelScore(name, unit, floor, before, after, after / before - 1, low, high)


SINKAGE = score("sinkage", "m", 0.0055, 0.0013, -0.85, -0.7)
PULL = score("drawbar pull", "N", 0.75, 0.55, -0.6, 0.4, floor=0.3)


@pytest.fixture
def rig(verdict):
    """A rig's verdict as the sentence needs it."""
    named = {"named": ("SlipSinkage",), "indistinguishable": ("SlipSinkage",), "effects": ()}
    return dataclasses.replace(verdict, kind="wheel-rig", scores=(PULL, SINKAGE), **named)


def test_rig_sentence_states_error_reduction_and_reason(rig):
    better, unclaimed = improvement(rig, RIG).split("; ")
    assert re.findall(r"^Sinkage|[\d.]+ mm", better) == ["Sinkage", "5.5 mm", "1.3 mm"]
    assert better.endswith(RIG.unseen)
    assert "drawbar pull" in unclaimed
    assert "(slip-sinkage)" in headline(rig, RIG)


def test_the_headline_states_cause_size_and_confidence(verdict):
    """Numbers with unit and interval are those of the fit; the probability is that of the beliefs."""
    headline_text = headline(verdict, labels_of(verdict))
    assert headline_text.startswith("The bus voltage drops with the current that all motors draw (supply sag): R_b = ")
    for number in (number for number in verdict.after.numbers if number.name.startswith("SupplySag.")):
        match = re.search(rf"{number.name.partition('.')[2]} = ([\d.]+) \w+ \[([\d.]+), ([\d.]+)\]", headline_text)
        numbers = tuple(map(float, match.groups()))
        assert numbers == pytest.approx((number.value, number.low, number.high), rel=0.06)
    assert headline_text.endswith(f"with probability {verdict.beliefs.inclusion('SupplySag'):.2f}.")


def test_the_headline_states_the_size_of_each_of_a_set(rig):
    """Sets that cannot be distinguished are equivalents: this much of one, or that much of another."""
    tilt = Number("GravityTilt.angle", "rad", 0.029, 0.02, 0.04, float("nan"))
    sets = {"indistinguishable": ("SlipSinkage", "GravityTilt"), "others": {"GravityTilt": Alternative((tilt,), {})}}
    headline_text = headline(dataclasses.replace(rig, answer=Answer.SET, beliefs=None, **sets), RIG)
    assert ": 1.7 deg [1.1, 2.3]" in headline_text.split("; or ")[1]


def test_the_headline_lists_the_most_probable_of_many_sets(rig):
    """That nothing is missing stands last, and may be the most probable of many sets all the same."""
    probabilities = {("SlipSinkage",): 0.4, ("PostPeak",): 0.004, ("GravityTilt",): 0.2, ("TrackingDelay",): 0.1,
            ("SupplySag",): 0.02, (): 0.276}  # fmt: skip
    beliefs = SimpleNamespace(sets={frozenset(names): p for names, p in probabilities.items()}, hypotheses=(), choice=6)
    sets = tuple(" + ".join(names) or "nothing" for names in probabilities)
    left = dataclasses.replace(rig, answer=Answer.SET, beliefs=beliefs, indistinguishable=sets)
    headline_text = headline(left, RIG)
    assert re.findall(r"probability ([\d.]+\d)", headline_text) == ["0.40", "0.20", "0.10", "0.28"]
    assert "nothing is missing, with probability 0.28" in headline_text
    (opposing_reason,) = [line for line in opposing_reasons(left, RIG) if "distinguished" in line]
    assert "eak" not in opposing_reason, "of what is not worth a word nothing is said"


def test_what_got_worse_stands_in_the_sentence(rig):
    worse = score("drawbar pull", "N", 0.5, 0.6, 0.1, 0.3, floor=0.1)
    sentence = improvement(dataclasses.replace(rig, scores=(worse, SINKAGE)), RIG)
    assert "0.50 N to 0.60 N." in sentence


@pytest.mark.parametrize("answer", Answer)
def test_every_answer_has_its_sentence_reasons_and_next_step(answered, answer):
    changed_verdict = answered(answer)
    manner = labels_of(changed_verdict)
    headline_text = headline(changed_verdict, manner)
    assert headline_text[0].isupper()
    assert headline_text.endswith(".")
    assert re.search(r"\d", headline_text)
    lines = [
        headline_text,
        *supporting_reasons(changed_verdict, manner),
        *opposing_reasons(changed_verdict, manner),
        *next_run(changed_verdict),
    ]
    names = {kind.__name__ for kind in package_effects()} - {"Grousers", "Bulldozing", "Ploughing"}
    for line in lines:
        assert not names & set(re.findall(r"\w+", line)), line
        assert line.endswith(".")
        assert ".." not in line
    assert opposing_reasons(changed_verdict, manner)
    assert next_run(changed_verdict)


def test_answers_that_add_nothing_say_so_and_claim_no_cause(answered):
    for answer in (Answer.NONE_NEEDED, Answer.NONE_FITS, Answer.INADEQUATE, Answer.CANNOT_TELL):
        assert "is now" not in improvement(answered(answer), labels_of(answered(answer)))
    assert "fitted numbers" in headline(answered(Answer.NONE_FITS), RIG)
    distant = dataclasses.replace(
        answered(Answer.INADEQUATE), sentence="numbers are far off: motor.gear = 30.", experiments=()
    )
    assert headline(distant, RIG).startswith("Numbers are far off: motor.gear = 30: do not use")
    assert "declare" in next_run(distant)[0]
    none = headline(answered(Answer.NONE_NEEDED), RIG)
    assert none.endswith("none of the 4 candidates acts, with probability 1.00.")
    assert "times its noise" in improvement(answered(Answer.NONE_NEEDED), RIG)
    assert "times its noise" not in improvement(answered(Answer.NONE_FITS), RIG)


@pytest.mark.parametrize(("after", "doubted"), [(6.15, True), (2.5, False), (1.0, False)])
def test_a_run_that_the_others_predict_worse_is_a_doubt(verdict, after, doubted):
    runs = (RunScore("climb-1", 90, 1.2, 0.9, -0.3, -0.1), RunScore("climb-steps", 80, 2.1, after, -0.5, 6.0))
    reasons = opposing_reasons(dataclasses.replace(verdict, runs=runs), RIG)
    assert any(line.startswith("Climb-steps ") and "2.1 -> 6.2" in line for line in reasons) is doubted


def test_a_terminal_gets_the_same_first_screen(verdict):
    manner = labels_of(verdict)
    text = first_lines(verdict, manner)
    assert text.splitlines()[:2] == [headline(verdict, manner), improvement(verdict, manner)]
    content = first_screen(verdict, manner).content
    for line in (*content["believe"], *content["doubt"], *content["next"]):
        assert f"  - {line}" in text


@pytest.mark.parametrize(
    ("value", "unit", "message"),
    [
        (0.0155, "m", "16 mm"),
        (0.001, "m", "1.0 mm"),
        (1234.0, "N", "1200 N"),
        (0.0, "N", "0 N"),
        (0.52, "rad", "30 deg"),
    ],
)
def test_numbers_are_short_and_never_powers_of_ten(value, unit, message):
    assert brief(value, unit) == message


def test_two_numbers_have_as_many_digits_as_tell_them_apart():
    assert pair(0.0123, 0.0124, "m") == ("12.3 mm", "12.4 mm")
    assert pair(0.02, 0.01, "m") == ("20 mm", "10 mm")


def test_a_rival_is_said_first_and_asks_for_an_effect(answered):
    first = "a quadratic of what was set predicts what was left out with 0.50 times this model's errors"
    drafted = dataclasses.replace(answered(Answer.NONE_FITS), rival=first)
    assert headline(drafted, RIG).startswith(f"A{first[1:]}; ")
    assert "candidates" in headline(drafted, RIG)
    plain = dataclasses.replace(answered(Answer.INADEQUATE), experiments=())
    assert "declare" in next_run(plain)[0]
    assert "declare" not in next_run(dataclasses.replace(plain, rival=first))[0]
