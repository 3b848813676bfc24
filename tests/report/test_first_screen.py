"""The first screen: one sentence with numbers, reasons for and against, what to drive next; no class as headline."""

import dataclasses
import re

import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import ChannelScore, RunScore
from rover_pin.report.drive.report import labels_of
from rover_pin.report.headline import headline, improvement
from rover_pin.report.reasons import next_run, opposing_reasons, supporting_reasons
from rover_pin.report.verdict_page import first_lines, first_screen
from rover_pin.report.words import Labels, brief, cause, pair
from rover_pin.simulation.model.effect_files import package_effects

RIG = Labels("on slips it never saw", "levels of slip")


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
    assert improvement(rig, RIG) == (
        "Sinkage was wrong by 5.5 mm and is now wrong by 1.3 mm on slips it never saw; drawbar pull: no claim."
    )
    assert headline(rig, RIG).startswith("Sand gives way as the wheel slips (slip-sinkage), with probability ")


def test_the_headline_states_cause_size_and_confidence(verdict):
    """Numbers with unit and interval are those of the fit; the probability is that of the beliefs."""
    said = headline(verdict, labels_of(verdict))
    assert said.startswith("The bus voltage drops with the current that all motors draw (supply sag): R_b = ")
    for number in (one for one in verdict.after.numbers if one.name.startswith("SupplySag.")):
        found = re.search(rf"{number.name.partition('.')[2]} = ([\d.]+) \w+ \[([\d.]+), ([\d.]+)\]", said)
        told = tuple(map(float, found.groups()))
        assert told == pytest.approx((number.value, number.low, number.high), rel=0.06)
    assert said.endswith(f"with probability {verdict.beliefs.inclusion('SupplySag'):.2f}.")


def test_one_size_with_a_unit_needs_no_name(verdict):
    sizes = tuple(one for one in verdict.after.numbers if one.name != "SupplySag.tau")
    one = dataclasses.replace(verdict, after=verdict.after._replace(numbers=sizes))
    assert re.search(r"\(supply sag\): [\d.]+ ohm \[", headline(one, RIG))
    open_end = tuple(each._replace(closed=False) for each in sizes)
    one = dataclasses.replace(verdict, after=verdict.after._replace(numbers=open_end))
    assert "ohm (no interval), with" in headline(one, RIG)


def test_what_got_worse_stands_in_the_sentence(rig):
    worse = score("drawbar pull", "N", 0.5, 0.6, 0.1, 0.3, floor=0.1)
    said = improvement(dataclasses.replace(rig, scores=(worse, SINKAGE)), RIG)
    assert "0.50 N to 0.60 N." in said


def test_without_a_better_channel_nothing_is_claimed(rig):
    said = improvement(dataclasses.replace(rig, scores=(PULL,)), RIG)
    assert said == "No channel is predicted better on slips it never saw beyond its scatter."


@pytest.mark.parametrize("answer", Answer)
def test_every_answer_has_its_sentence_reasons_and_next_step(answered, answer):
    one = answered(answer)
    manner = labels_of(one)
    said = headline(one, manner)
    assert said[0].isupper()
    assert said.endswith(".")
    assert re.search(r"\d", said)
    lines = [said, *supporting_reasons(one, manner), *opposing_reasons(one, manner), *next_run(one)]
    names = {kind.__name__ for kind in package_effects()} - {"Grousers", "Bulldozing", "Ploughing"}
    for line in lines:
        assert not names & set(re.findall(r"\w+", line)), line
        assert line.endswith(".")
        assert ".." not in line
    assert opposing_reasons(one, manner)
    assert next_run(one)


def test_answers_that_add_nothing_say_so_and_claim_no_cause(answered):
    for answer in (Answer.NONE_NEEDED, Answer.NONE_FITS, Answer.INADEQUATE, Answer.CANNOT_TELL):
        assert "is now" not in improvement(answered(answer), labels_of(answered(answer)))
    assert "fitted numbers" in headline(answered(Answer.NONE_FITS), RIG)
    far = dataclasses.replace(
        answered(Answer.INADEQUATE), sentence="numbers are far off: motor.gear = 30.", experiments=()
    )
    assert headline(far, RIG).startswith("Numbers are far off: motor.gear = 30: do not use")
    assert next_run(far)[0].startswith("Measure those numbers alone")
    none = headline(answered(Answer.NONE_NEEDED), RIG)
    assert "nothing needs" in none.lower()
    assert none.endswith("none of the 4 candidates acts, with probability 1.00.")
    assert "times its noise" in improvement(answered(Answer.NONE_NEEDED), RIG)
    assert "at worst" not in improvement(answered(Answer.NONE_FITS), RIG).lower()


@pytest.mark.parametrize(("times", "doubted"), [(1.4, False), (5.6, True)])
def test_channel_far_above_its_noise_opposes_no_effect_needed(answered, times, doubted):
    """A ground that is learnt may take the excess, so that nothing is needed; the reader is told of it."""
    one = answered(Answer.NONE_NEEDED)
    score = one.scores[0]
    loud = score._replace(after=times * score.floor)
    lines = opposing_reasons(dataclasses.replace(one, scores=(loud,)), labels_of(one))
    assert any(("5.6 times" in line) for line in lines) is doubted


def test_what_cannot_be_told_apart_is_said_as_either_or(answered):
    one = answered(Answer.SET)
    said = headline(one, RIG)
    assert said.startswith("Either ")
    assert re.search(r"; or .*\(stress peak[^)]*\); and .* \(weak motor, 4\), with .*: these data cannot tell", said)
    assert any("distinguished" in line.lower() for line in opposing_reasons(one, RIG))


def test_disagreeing_folds_oppose_and_agreeing_folds_support(verdict):
    chosen = {"a": "SupplySag", "b": "SupplySag", "c": ""}
    agrees = dataclasses.replace(verdict, chosen=chosen)
    line = "It is chosen anew in 2 of 3 cases when one of the levels of slip is left out."
    assert line in supporting_reasons(agrees, RIG)
    assert not any("chosen anew" in line for line in opposing_reasons(agrees, RIG))
    other = dataclasses.replace(verdict, chosen=dict.fromkeys("abc", ""))
    assert any("0 of 3" in line for line in opposing_reasons(other, RIG))
    assert not any("chosen anew" in line for line in supporting_reasons(other, RIG))


@pytest.mark.parametrize(("after", "doubted"), [(6.15, True), (2.5, False), (1.0, False)])
def test_a_run_that_the_others_predict_worse_is_a_doubt(verdict, after, doubted):
    runs = (RunScore("climb-1", 90, 1.2, 0.9, -0.3, -0.1), RunScore("climb-steps", 80, 2.1, after, -0.5, 6.0))
    line = "Climb-steps is predicted worse with it by the others (chi2 for each number 2.1 -> 6.2): what it tells they"
    assert (
        any(one.startswith(line) for one in opposing_reasons(dataclasses.replace(verdict, runs=runs), RIG)) is doubted
    )


def test_worse_predicted_level_is_named_by_its_meaning(verdict):
    one = dataclasses.replace(verdict, runs=(RunScore("15.0", 80, 2.1, 6.2, -0.5, 6.0),))
    said = opposing_reasons(one, RIG._replace(fold={"15.0": "S = 0.65, 45 N"}.get))
    assert any(("S = 0.65, 45 N is predicted" in line) for line in said)
    assert not any("15.0" in line for line in said)


def test_a_veto_is_not_said_again_as_a_caution(answered):
    cautions = ("R_b lies at its bound: the form of the model is strained", "c lies at its bound: another")
    said = opposing_reasons(dataclasses.replace(answered(Answer.LIKE), cautions=cautions), RIG)
    assert [line for line in said if "bound" in line] == ["R_b lies at its bound.", "C lies at its bound: another."]


def test_free_runs_that_stay_no_closer_are_no_reason_to_believe(verdict):
    extra = verdict.extra
    for after in (1.002, 0.995, 2.0, float("nan")):
        free = tuple(each._replace(after=after * each.before) for each in extra.free)
        one = dataclasses.replace(verdict, extra=extra._replace(free=free))
        assert not labels_of(one).evidence


def test_a_terminal_gets_the_same_first_screen(verdict):
    manner = labels_of(verdict)
    text = first_lines(verdict, manner)
    assert text.splitlines()[:2] == [headline(verdict, manner), improvement(verdict, manner)]
    content = first_screen(verdict, manner).content
    for line in (*content["believe"], *content["doubt"], *content["next"]):
        assert f"  - {line}" in text


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (0.0155, "m", "16 mm"),
        (0.001, "m", "1.0 mm"),
        (1234.0, "N", "1200 N"),
        (0.0, "N", "0 N"),
        (0.52, "rad", "30 deg"),
    ],
)
def test_numbers_are_short_and_never_powers_of_ten(value, unit, said):
    assert brief(value, unit) == said


def test_two_numbers_have_as_many_digits_as_tell_them_apart():
    assert pair(0.0123, 0.0124, "m") == ("12.3 mm", "12.4 mm")
    assert pair(0.02, 0.01, "m") == ("20 mm", "10 mm")


def test_causes_have_their_place_and_numbers_their_own_clause():
    kinds = package_effects()
    assert cause("HardPatch@1.2", kinds).endswith("(patch of other soil, at x = 1.2 m)")
    assert cause("WeakMotor[2]", kinds).endswith("(weak motor, 2)")
    assert cause("soil.k", kinds) == "soil.k is not what was declared"


def test_a_cause_that_may_act_all_the_same_is_a_reason_to_doubt(answered, verdict):
    one = dataclasses.replace(answered(Answer.NONE_NEEDED), beliefs=verdict.beliefs)
    assert "Supply sag may act all the same: probability 1.00." in opposing_reasons(one, RIG)


def test_a_wheel_is_named_in_headline_and_reasons(verdict):
    named = ("WeakMotor[4]",)
    one = dataclasses.replace(
        verdict, named=named, indistinguishable=(*named, "WeakMotor[1]"), cautions=("WeakMotor[4].g is far off",)
    )
    manner = labels_of(one)
    assert "(weak motor, wheel rl)" in headline(one, manner)
    doubts = opposing_reasons(one, manner)
    assert "Weak motor[wheel fr] cannot be distinguished from it by these data." in doubts
    assert "WeakMotor[4].g is far off." in doubts


def test_a_rival_is_said_first_and_asks_for_an_effect(answered):
    first = "a quadratic of what was set predicts what was left out with 0.50 times this model's errors"
    drafted = dataclasses.replace(answered(Answer.NONE_FITS), rival=first)
    assert headline(drafted, RIG).startswith(f"A{first[1:]}; ")
    assert "candidates explains it" in headline(drafted, RIG)
    plain = dataclasses.replace(answered(Answer.INADEQUATE), experiments=())
    assert "easure those numbers alone" in next_run(plain)[0]
    assert "easure those numbers alone" not in next_run(dataclasses.replace(plain, rival=first))[0]
