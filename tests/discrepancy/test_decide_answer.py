"""The rules of the graded answer on a bed without any rover: points of a line, and bends of it that may be missing."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from rover_pin.base.quantity import Record, quantity
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.calibration import calibrated
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.discrepancy.decide_answer import chosen_anew, concluded
from rover_pin.discrepancy.standalone import Parts, Standalone, question_of
from rover_pin.discrepancy.verdict import SCHEMA
from rover_pin.estimation.noise import declared_noise
from rover_pin.loop.close import close_the_loop

X = np.linspace(0.0, 1.0, 12) + np.linspace(0.0, 0.05, 6)[:, None]
SD = 0.02


@dataclass(frozen=True)
class Line(Record):
    """y = a x."""

    a: float = quantity(1.0, "", "declared", -10.0, 10.0, "a")


@dataclass(frozen=True)
class Bend(Record):
    """y += b x^2, b at most 0.6."""

    b: float = quantity(0.3, "", "assumed", -0.6, 0.6, "b")
    neutral: ClassVar[dict[str, float]] = {"b": 0.0}
    shape = staticmethod(lambda x: x**2)


@dataclass(frozen=True)
class Twin(Bend):
    """The same but for a little."""

    shape = staticmethod(lambda x: x**2 + 1e-4 * np.sin(30 * x))


@dataclass(frozen=True)
class Wave(Bend):
    """y += b sin(9 x)."""

    shape = staticmethod(lambda x: np.sin(9 * x))


@dataclass(frozen=True)
class Ripple(Bend):
    """y += b sin(14 x)."""

    shape = staticmethod(lambda x: np.sin(14 * x))


@dataclass(frozen=True, eq=False)
class Points(Standalone):
    """Points of y over x in folds of 12."""

    observed: np.ndarray
    folds: tuple[str, ...] = tuple("abcdef")
    name: str = "line"
    channels: ClassVar[tuple[str, ...]] = ("y",)
    poor: str = ""
    said: str = "declared"

    @classmethod
    def read(cls, path):
        raise NotImplementedError

    def base_model(self):
        return Parts({"line": Line()})

    def uncertain(self, model):
        return (self.parameter(model, "line.a", 0.05, declared=self.said),)

    def noise(self):
        return declared_noise(np.array([SD]), self.observed)

    def candidates(self, model, kinds):
        return tuple(plain_candidate(kind()) for kind in kinds)

    def insufficient(self):
        return self.poor

    def predict(self, models):
        rows = [m.records["line"].a * X + sum(each.b * each.shape(X) for each in m.effects) for m in models]
        return np.array(rows)[:, :, None, :]


def bed(law=lambda x: 0.0 * x, slope=1.02, seed=0, **how):
    noise = SD * np.random.default_rng(seed).normal(size=X.shape)
    return Points((slope * X + law(X) + noise)[:, None, :], **how)


def answer(made, kinds=(Bend, Wave)):
    return concluded(question_of(made, kinds), lambda said: None)


def test_a_law_of_the_list_is_named_and_taken_wholly():
    found = answer(bed(lambda x: 0.3 * x**2))
    assert (found.answer, found.named, found.vetoes) == (Answer.NAMED, ("Bend",), ())
    assert found.share > 0.95
    assert found.model.effects[0].b == pytest.approx(0.3, abs=0.05)
    assert set(found.chosen.values()) == {"Bend"}
    assert found.as_dict()["schema"] == SCHEMA


@pytest.mark.parametrize("seed", range(5))
def test_noise_needs_nothing(seed):
    found = answer(bed(seed=seed))
    assert (found.answer, found.named) == (Answer.NONE_NEEDED, ())


def test_two_that_do_the_same_are_a_set():
    found = answer(bed(lambda x: 0.3 * x**2), (Bend, Twin, Wave))
    assert found.answer is Answer.SET
    assert set(found.indistinguishable) == {"Bend", "Twin"}
    assert "cannot be distinguished" in found.sentence


def test_another_law_is_like_the_one_that_takes_most_of_it():
    found = answer(bed(lambda x: 0.4 * x**2 + 0.03 * np.sin(14 * x)), (Bend,))
    assert (found.answer, found.named) == (Answer.LIKE, ("Bend",))
    assert 0.5 < found.share < 0.95
    assert "1 is the noise" in found.summary()


def test_misfit_that_no_candidate_takes_is_an_inadequate_base():
    found = answer(bed(lambda x: 0.2 * np.sin(14 * x)), (Wave,))
    assert (found.answer, found.named, found.model.effects) == (Answer.INADEQUATE, (), ())
    assert "no candidate describes it" in found.sentence


def test_what_takes_too_little_is_found_and_not_added():
    found = answer(bed(lambda x: 0.2 * x**2 + 0.12 * np.sin(14 * x)), (Bend,))
    assert found.search.names == "Bend"
    assert (found.answer, found.named, found.effects, found.share) == (Answer.INADEQUATE, (), (), 0.0)
    assert found.model.effects == ()
    assert found.vetoes == ()


def test_summary_reports_gains_and_losses_only_after_an_addition():
    with_it, without = (answer(bed(lambda x, b=b: b * x**2)).summary() for b in (0.3, 0.0))
    assert "No channel got worse" in with_it
    assert "Bend.b = 0.3" in with_it
    assert "got worse" not in without
    assert "line.a = 1.02" in without


def test_a_size_at_its_bound_does_not_stand_alone():
    found = answer(bed(lambda x: 0.62 * x**2), (Bend,))
    assert found.answer is Answer.LIKE
    assert found.vetoes == ("Bend.b lies at its bound",)


def test_slope_far_from_its_declared_value_is_inadequate():
    found = answer(bed(slope=1.6), (Wave,))
    assert found.answer is Answer.INADEQUATE
    assert "line.a +12" in found.sentence
    assert found.vetoes == (), "nothing was added that could be spoken against"
    assumed = answer(bed(slope=1.6, said=""), (Wave,))
    assert assumed.answer is Answer.NONE_NEEDED, "what is assumed contradicts nobody"
    assert "+12.0 SD from what was assumed" in assumed.summary()


def test_data_that_do_not_suffice_are_not_judged():
    found = close_the_loop(bed(poor="3 points are too few; measure 10."))
    assert (found.answer, found.sentence) == (Answer.CANNOT_TELL, "3 points are too few; measure 10.")
    assert found.as_dict()["before"] == {}


def test_each_fold_is_left_out_of_the_choice_too():
    """What shows in one fold only is chosen by all folds but not without that one."""
    only = np.zeros(X.shape)
    only[2] = 0.3 * np.sin(9 * X[2])
    made = bed(lambda x: only)
    base = calibrated(made, made.base_model(), made.uncertain(made.base_model()))
    chosen = chosen_anew(base, made.candidates(None, (Wave,)))
    assert chosen["c"].names == ""


def test_the_schema_is_the_documented_one():
    text = (Path(__file__).parents[2] / "docs" / "verdict.md").read_text(encoding="utf-8")
    keys = set(re.findall(r"`(\w+)`", "\n".join(line.split("|")[1] for line in text.splitlines() if line[:3] == "| `")))
    made = answer(bed(lambda x: 0.3 * x**2)).as_dict()
    assert set(made) == keys - {"versions", "seed", "seconds", "command"}
    assert f"schema {SCHEMA})" in text
    for one in Answer:
        assert f"| {one.value} |" in text


def test_a_round_in_which_a_number_was_freed_is_written_too():
    """A candidate without an effect frees a number of the model; its fitted value is what is said of it."""
    found = answer(bed(lambda x: 0.3 * x**2))
    (first, *others), *_ = (one.refits for one in found.search.rounds)
    number = first.fit.parameters[0].name
    freed = replace(first, candidate=Candidate(number, None, (number,)))
    rounds = (replace(found.search.rounds[0], refits=(freed, *others)),)
    ((said, *_),) = (
        one["refits"] for one in replace(found, search=replace(found.search, rounds=rounds)).as_dict()["rounds"]
    )
    assert said["values"] == {number: first.fit.value(number)}
