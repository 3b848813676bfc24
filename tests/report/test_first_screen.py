"""The first screen of a report: a short sentence, the causes with their numbers, reasons for and against, and the next
run.
"""

import dataclasses
import math
import re
from types import SimpleNamespace

import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out_errors import ChannelScore, RunScore
from rover_pin.discrepancy.verdict import Alternative
from rover_pin.effects.names import meaning_of, title_of
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.numbers import Number
from rover_pin.report.cause_sets import BASE_MODEL, best_held_out, cause_table, in_order_of_interest
from rover_pin.report.drive.report import labels_of
from rover_pin.report.headline import (
    MAX_HEADLINE_WORDS,
    NOTHING_MISSING,
    full_answer,
    headline,
    improvement,
    next_run,
    opposing_reasons,
    supporting_reasons,
)
from rover_pin.report.verdict_page import answer_section, first_lines, first_screen
from rover_pin.report.words import Labels, brief, capital, pair, with_interval
from rover_pin.simulation.model.effect_files import package_effects

RIG = Labels("at slips that were not fitted", "levels of slip")


def score(name, unit, before, after, low, high, floor=1e-4):
    return ChannelScore(name, unit, floor, before, after, after / before - 1, low, high)


SINKAGE = score("sinkage", "m", 0.0055, 0.0013, -0.85, -0.7)
PULL = score("drawbar pull", "N", 0.75, 0.55, -0.6, 0.4, floor=0.3)


@pytest.fixture
def rig(verdict):
    """Return a verdict on wheel-rig data with the fields that the sentences need."""
    named = {"named": ("SlipSinkage",), "indistinguishable": ("SlipSinkage",), "effects": ()}
    return dataclasses.replace(verdict, kind="wheel-rig", scores=(PULL, SINKAGE), **named)


def test_rig_sentence_states_error_reduction_and_reason(rig):
    better, unclaimed = improvement(rig, RIG).split("; ")
    assert re.findall(r"^Sinkage|[\d.]+ mm", better) == ["Sinkage", "5.5 mm", "1.3 mm"]
    assert better.endswith(RIG.unseen)
    assert "drawbar pull" in unclaimed
    assert "(slip-sinkage)" in full_answer(rig, RIG)


def test_the_full_answer_states_cause_size_and_confidence(verdict):
    """The answer has the numbers, units and intervals of the fit, and the probability from the beliefs."""
    said = full_answer(dataclasses.replace(verdict, beyond_noise={}), labels_of(verdict))
    assert said.startswith(capital(f"{meaning_of(SupplySag)} ({title_of(SupplySag)}): R_b = "))
    for number in (number for number in verdict.after.numbers if number.name.startswith("SupplySag.")):
        match = re.search(rf"{number.name.partition('.')[2]} = ([\d.]+) \w+ \[([\d.]+), ([\d.]+)\]", said)
        numbers = tuple(map(float, match.groups()))
        assert numbers == pytest.approx((number.value, number.low, number.high), rel=0.06)
    assert said.endswith(f"with probability {verdict.beliefs.inclusion('SupplySag'):.2f}.")


def test_a_residual_beyond_the_noise_is_stated_whatever_was_named(verdict):
    """If the residual of a channel exceeds 3 times its noise, something else acts. The channels with the largest
    residuals are named, and the others are counted.
    """
    beyond = {"wheel_rate_fl": 6.04, "path": 3.7, "wheel_rate_fr": 5.1, "body_z": 3.2, "body_roll": 3.1}
    manner = labels_of(verdict)
    small, large = (dataclasses.replace(verdict, beyond_noise=ratios) for ratios in ({}, beyond))
    said = full_answer(large, manner).removeprefix(full_answer(small, manner))
    assert re.findall(r"([\d.]+) times", said) == ["6.0", "5.1", "3.7", "3"]
    assert manner.channel("wheel_rate_fl") in said
    assert "2 more" in said
    assert headline(large, manner).startswith(headline(small, manner).rstrip(".") + "; ")


@pytest.mark.parametrize("answer", [Answer.LIKE, Answer.SET, Answer.NONE_FITS])
def test_a_contradiction_by_held_out_data_is_stated(answered, answer):
    reason = "With all data, TetherDrag has the probability 0.98, but it makes path larger (+70%)."
    overturned = dataclasses.replace(answered(answer), overturned=(reason,))
    manner = labels_of(overturned)
    assert full_answer(overturned, manner).endswith(reason.replace("TetherDrag", "tether drag"))
    assert "held-out data" in headline(overturned, manner)
    assert "held-out data" not in headline(dataclasses.replace(overturned, overturned=()), manner)


def test_the_full_answer_states_the_size_of_each_of_a_set(rig):
    """If the data cannot distinguish several causes, the answer states the size that each of them would have."""
    tilt = Number("GravityTilt.angle", "rad", 0.029, 0.02, 0.04, float("nan"))
    sets = {"indistinguishable": ("SlipSinkage", "GravityTilt"), "others": {"GravityTilt": Alternative((tilt,), {})}}
    said = full_answer(dataclasses.replace(rig, answer=Answer.SET, beliefs=None, **sets), RIG)
    assert ": 1.7 deg [1.1, 2.3]" in said.split("; or ")[1]


TILT = Number("GravityTilt.angle", "rad", 0.029, 0.02, 0.04, float("nan"))
SINKS = Number("SlipSinkage.n_1", "", 1.5, 0.9, 2.0, float("nan"), closed=False)


def with_sets(rig, probabilities, others, more=0.0):
    """Return the verdict on wheel-rig data with other probabilities of the sets of causes, and with other held-out
    errors.
    """
    beliefs = SimpleNamespace(
        sets={frozenset(names): p for names, p in probabilities.items()},
        hypotheses=(),
        choice=6,
        probability=lambda of: more,
    )
    sets = tuple(" + ".join(names) or "nothing" for names in probabilities)
    after = rig.after._replace(numbers=(SINKS,))
    return dataclasses.replace(
        rig, answer=Answer.SET, beliefs=beliefs, indistinguishable=sets, others=others, after=after, beyond_noise={}
    )


MANY = {("SlipSinkage",): 0.4, ("PostPeak",): 0.004, ("GravityTilt",): 0.2, ("TrackingDelay",): 0.1,
        ("SupplySag",): 0.02, (): 0.276}  # fmt: skip


def test_the_most_probable_of_many_sets_are_listed(rig):
    """The empty set (nothing is missing) may be the most probable of many sets, and is then listed too."""
    left = with_sets(rig, MANY, {})
    said = full_answer(left, RIG)
    assert re.findall(r"probability ([\d.]+\d)", said) == ["0.40", "0.28", "0.20", "0.10"]
    assert f"{NOTHING_MISSING}, with probability 0.28" in said
    (doubt,) = [line for line in opposing_reasons(left, RIG) if "distinguished" in line]
    assert "eak" not in doubt, "of what is not worth a word nothing is said"


@pytest.mark.parametrize(
    ("errors", "best"),
    [
        ({"sinkage": 0.0006, "drawbar pull": 0.5}, "GravityTilt"),  # half the kept set's error
        ({"sinkage": 0.0013, "drawbar pull": 0.54}, ""),  # within five per cent
        ({"sinkage": 0.0026, "drawbar pull": 0.6}, "SlipSinkage"),
        ({"sinkage": float("nan"), "drawbar pull": 0.01}, ""),  # not predicted everywhere
    ],
)
def test_the_set_that_predicts_best_is_first_next_to_the_most_probable(rig, errors, best):
    left = with_sets(
        rig, {("SlipSinkage",): 0.7, ("GravityTilt",): 0.3}, {"GravityTilt": Alternative((TILT,), errors)}, 0.8
    )
    found = best_held_out(left)
    assert (found.names if found else ()) == ((best,) if best else ())
    order = [row.names[0] for row in in_order_of_interest(left)]
    assert order == (["GravityTilt", "SlipSinkage"] if best == "GravityTilt" else ["SlipSinkage", "GravityTilt"])
    said = headline(left, RIG)
    assert ("best" in said) is bool(best)
    assert "slip-sinkage is most probable" in said
    assert "tilted table" in said.lower()
    assert any("0.80" in line for line in opposing_reasons(left, RIG)), "a discrepancy that remains is a doubt"


def test_the_table_has_size_probability_and_errors_of_each_set_and_of_the_base_model(rig):
    errors = {"sinkage": 0.0006, "drawbar pull": 0.5}
    left = with_sets(rig, {("SlipSinkage",): 0.7, ("GravityTilt",): 0.3}, {"GravityTilt": Alternative((TILT,), errors)})
    tilt, sinks, base = (row.cells for row in cause_table(left, RIG).rows)
    assert tilt[1:4] == ("1.7 deg [1.1, 2.3]", "0.30", "sinkage 0.60 mm")
    assert sinks[:3] == ("slip-sinkage", "n_1 = 1.5 [0.90, 2.0], limited by its bounds", "0.70")
    assert sinks[3] == "sinkage 1.3 mm"
    assert base[0] == BASE_MODEL
    assert base[2:4] == ("0.00", "sinkage 5.5 mm")
    # Floors are 0.3 N and 0.1 mm.
    assert float(tilt[4].split()[0]) == pytest.approx(math.sqrt(((0.5 / 0.3) ** 2 + 6.0**2) / 2), rel=0.05)
    assert float(base[4].split()[0]) == pytest.approx(math.sqrt(((0.75 / 0.3) ** 2 + 55.0**2) / 2), rel=0.05)


@pytest.mark.parametrize("count", [1, 2, 3, 6, 12])
def test_the_headline_stays_short_however_many_causes_act(rig, count):
    """If there are many sets with several effects each, the headline counts the effects that it cannot name."""
    kinds = sorted(kind.__name__ for kind in package_effects())
    held = {("SlipSinkage",): 0.5}
    held |= {tuple(kinds[3 * at : 3 * at + 3]): 0.4 / count for at in range(count)}
    for best in (0.0001, 0.01):
        others = {
            " + ".join(names): Alternative((), {"sinkage": best, "drawbar pull": 0.3}) for names in list(held)[1:2]
        }
        said = headline(with_sets(rig, held, others), RIG)
        assert len(said.split()) <= MAX_HEADLINE_WORDS
        assert not re.search(r"\d\.\d", said)


def test_worse_channels_are_in_the_sentence(rig):
    worse = score("drawbar pull", "N", 0.5, 0.6, 0.1, 0.3, floor=0.1)
    sentence = improvement(dataclasses.replace(rig, scores=(worse, SINKAGE)), RIG)
    assert "0.50 N to 0.60 N." in sentence


@pytest.mark.parametrize("answer", Answer)
def test_every_answer_has_its_sentence_reasons_and_next_step(answered, answer):
    changed_verdict = answered(answer)
    manner = labels_of(changed_verdict)
    said, short = full_answer(changed_verdict, manner), headline(changed_verdict, manner)
    assert re.search(r"\d", said)
    assert len(short.split()) <= MAX_HEADLINE_WORDS
    assert not re.search(r"\d", short)
    for sentence in (said, short):
        assert sentence[0].isupper()
        assert sentence.endswith(".")
    lines = [
        said,
        short,
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


def test_answers_without_an_added_effect_claim_no_cause(answered):
    for answer in (Answer.NONE_NEEDED, Answer.NONE_FITS, Answer.INADEQUATE, Answer.CANNOT_TELL):
        assert "is now" not in improvement(answered(answer), labels_of(answered(answer)))
    assert "fitted numbers" in full_answer(answered(Answer.NONE_FITS), RIG)
    far = dataclasses.replace(
        answered(Answer.INADEQUATE), sentence="numbers are far off: motor.gear = 30.", experiments=()
    )
    assert full_answer(far, RIG).startswith("Numbers are far off: motor.gear = 30: do not use")
    assert "declare" in next_run(far)[0]
    number = far.before.numbers[0]
    named = dataclasses.replace(far, sentence=f"numbers are far off: {number.text}.")
    assert headline(named, RIG).endswith(f": {number.name}.")
    assert number.name in cause_table(named, RIG).rows[0].cells[1]
    none = full_answer(answered(Answer.NONE_NEEDED), RIG)
    assert none.endswith("none of the 4 candidates acts, with probability 1.00.")
    assert "times its noise" in improvement(answered(Answer.NONE_NEEDED), RIG)
    assert "times its noise" not in improvement(answered(Answer.NONE_FITS), RIG)


@pytest.mark.parametrize(("after", "doubted"), [(6.15, True), (2.5, False), (1.0, False)])
def test_a_run_that_the_others_predict_worse_is_a_doubt(verdict, after, doubted):
    runs = (RunScore("climb-1", 90, 1.2, 0.9, -0.3, -0.1), RunScore("climb-steps", 80, 2.1, after, -0.5, 6.0))
    reasons = opposing_reasons(dataclasses.replace(verdict, runs=runs), RIG)
    assert any(line.startswith("Climb-steps ") and "2.1 -> 6.2" in line for line in reasons) is doubted


def test_the_answer_in_full_has_the_meaning_of_the_cause(verdict):
    manner = labels_of(verdict)
    content = answer_section(verdict, manner).content
    assert content["sentences"] == [full_answer(verdict, manner), improvement(verdict, manner)]


def test_a_terminal_gets_the_same_first_screen(verdict):
    manner = labels_of(verdict)
    text = first_lines(verdict, manner)
    content = first_screen(verdict, manner).content
    rows = content["causes"].rows
    lines = text.splitlines()
    assert lines[0] == content["sentence"] == headline(verdict, manner)
    for line, row in zip(lines[1 : 1 + len(rows)], rows, strict=True):
        assert all(cell in line for cell in row.cells)
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


@pytest.mark.parametrize(
    ("value", "low", "high", "closed", "text"),
    [
        (3.005, 2.96, 3.049, True, "3.00 ohm [2.96, 3.05]"),
        (1.5, 0.87, 2.0, True, "1.5 ohm [0.87, 2.0]"),
        (1.5, 0.87, 2.0, False, "1.5 ohm [0.87, 2.0], limited by its bounds"),
        (1.5, 1.5, 1.5, True, "1.5 ohm (no interval)"),
        (1.5, math.nan, math.nan, True, "1.5 ohm (no interval)"),
    ],
)
def test_an_interval_has_as_many_digits_as_its_ends_need(value, low, high, closed, text):
    assert with_interval(Number("SupplySag.R_b", "ohm", value, low, high, math.nan, closed)) == text


def test_two_numbers_have_enough_digits_to_differ():
    assert pair(0.0123, 0.0124, "m") == ("12.3 mm", "12.4 mm")
    assert pair(0.02, 0.01, "m") == ("20 mm", "10 mm")


def test_a_rival_is_stated_first_and_an_effect_is_advised(answered):
    first = "a quadratic of what was set predicts what was left out with 0.50 times this model's errors"
    drafted = dataclasses.replace(answered(Answer.NONE_FITS), rival=first)
    assert full_answer(drafted, RIG).startswith(f"A{first[1:]}; ")
    assert "candidates" in full_answer(drafted, RIG)
    channel = drafted.scores[0].name
    curve = Baseline(channel, "m", "quadratic", 0.0, by_fold=(0.0,))
    short = headline(dataclasses.replace(drafted, baselines=(curve,)), RIG)
    assert "quadratic" in short
    assert channel in short
    assert len(short.split()) <= MAX_HEADLINE_WORDS
    plain = dataclasses.replace(answered(Answer.INADEQUATE), experiments=())
    assert "declare" in next_run(plain)[0]
    assert "declare" not in next_run(dataclasses.replace(plain, rival=first))[0]
