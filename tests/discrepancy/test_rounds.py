"""How often a search looks, and what a judgement keeps of it, on rounds made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.discrepancy import decide_answer, held_out, search
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.decide_answer import ResidualAssessment, first_of, share_taken, with_draft
from rover_pin.discrepancy.held_out import errors_anew, errors_of_others
from rover_pin.discrepancy.refit import Refit, rescale_thresholds
from rover_pin.discrepancy.screen import null_threshold
from rover_pin.discrepancy.verdict import Verdict


def experiment(noise="declared"):
    return SimpleNamespace(noise=lambda: noise, least_noise=lambda model: np.ones(2), random_field=lambda model: None)


def fitted(rms=(9.0, 9.0), **how):
    noise = SimpleNamespace(inflation=1.5)
    task = SimpleNamespace(experiment=experiment(**how), noise=noise)
    return SimpleNamespace(predicted=np.zeros((1, 2, 1)), task=task, model=None, rms=np.array(rms))


class Found:
    """A round that found something, or not."""

    def __init__(self, *alike):
        self.indistinguishable, self.refits = alike, alike


@pytest.fixture
def looked(monkeypatch):
    """A search whose rounds find what is given in turn; what it did is noted."""

    def look(*rounds, **how):
        made, done = list(rounds), []

        def another(name, result):
            done.append(name)
            return result

        patches = {
            "signatures": lambda base, tried: [],
            "score": lambda base, known: [],
            "_round": lambda found, tried, progress: another("singles", made.pop(0)),
            "_with_residual_noise": lambda base, known, chance, least: another("noise", base),
            "again": lambda base: base,
        }
        for name, instead in patches.items():
            monkeypatch.setattr(search, name, instead)
        search.search(fitted(**how), [], lambda said: None)
        return done

    return look


SOMETHING = Found(SimpleNamespace(candidate=Candidate("A", object(), ()), gain=9.0, fit="with A"))


def test_rounds_follow_as_long_as_something_is_found(looked):
    assert looked(SOMETHING, Found()) == ["singles"] * 2
    assert looked(SOMETHING, SOMETHING, SOMETHING, SOMETHING) == ["singles"] * 4
    assert looked(Found()) == ["singles"]


def test_noise_that_nobody_declares_is_learnt_twice(looked):
    assert looked(Found(), noise=None) == ["noise", "noise", "singles"]


@pytest.mark.parametrize(("rms", "looks"), [((1.2, 0.7), 0), ((0.0, 1.4), 0), ((1.2, 1.0), 3), ((1.5, 0.0), 3)])
def test_nothing_is_sought_below_the_error_of_predictions(rms, looks, looked):
    assert len(looked(Found(), noise=None, rms=rms)) == looks


def test_an_added_effect_is_not_tried_again():
    known = [SimpleNamespace(candidate=Candidate(kind, object(), ())) for kind in "AB"]
    found = SimpleNamespace(added=[known[0].candidate], signatures=known)
    assert search._remaining_signatures(found) == known[1:]
    found.added = []
    assert search._remaining_signatures(found) == known


# --- units -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("misfits", "unit"), [((3.0, 2.0), 2.0), ((1.2, 3.0), 1.5)])
def test_thresholds_scale_with_the_best_misfit_in_declared_noise(misfits, unit):
    def made(name, misfit, gain):
        task = SimpleNamespace(experiment=experiment(), noise=SimpleNamespace(inflation=1.5))
        return Refit(Candidate(name, object(), ()), SimpleNamespace(misfit=misfit, task=task), gain, 1.0, 0.0)

    fee = lambda candidate, inflation: {"A": 10.0, "B": 4.0}[candidate.kind] * inflation  # noqa: E731
    found = rescale_thresholds((made("A", misfits[0], 30.0), made("B", misfits[1], 29.0)), fee)
    assert [(one.name, one.threshold, one.unit) for one in found] == [("B", 4 * unit, unit), ("A", 10 * unit, unit)]


def test_one_more_candidate_of_one_costs_twice_the_log_of_twenty():
    assert null_threshold(1) == pytest.approx(2 * np.log(20))


# --- what is judged --------------------------------------------------------------------------------------------------


def rounds_of(*alike):
    return search.Search(None, tuple(Found(*each) for each in alike), ())


def test_what_is_like_something_is_told_by_the_first_round_alone():
    one = SimpleNamespace(name="A")
    assert len(first_of(rounds_of((one,), (one,))).rounds) == 1
    empty = rounds_of((), ())
    assert first_of(empty) is empty


def chi2(base, last, freedom=50.0):
    return SimpleNamespace(base=SimpleNamespace(chi2=base, freedom=freedom), last=SimpleNamespace(chi2=last))


@pytest.mark.parametrize(("found", "share"), [((52.0, 51.0), 0.5), ((50.5, 50.2), 0.6), ((50.0, 49.5), 1.0)])
def test_the_share_of_little_beyond_the_noise_is_its_share_too(found, share):
    assert share_taken(chi2(*found)) == pytest.approx(share)


def test_errors_of_others_come_from_the_last_round_with_a_result(monkeypatch):
    """By the name of all that stands in the model with each; every fold as the fits to the others predict it."""
    good = np.array([[[True, True]], [[True, False]]])
    task = SimpleNamespace(noise=SimpleNamespace(good=good), experiment=SimpleNamespace(channels=("pull",)))
    left = {"b": np.array([[[3.0, 4.0]], [[12.0, 99.0]]]), "c": np.array([[[1.0, 1.0]], [[1.0, 99.0]]])}
    monkeypatch.setattr(held_out, "held_out_residual", lambda fitted: left[fitted.name])
    first, *others = (SimpleNamespace(fit=SimpleNamespace(task=task, name=name)) for name in "abc")
    rounds = [SimpleNamespace(indistinguishable=one) for one in ((first,), (first, *others), ())]
    found = SimpleNamespace(rounds=rounds, indistinguishable=("X + A", "X + B", "C + D"))
    errors = errors_of_others(found)
    assert errors == {"X + B": {"pull": pytest.approx(13.0 / 3**0.5)}, "C + D": {"pull": 1.0}}


def test_errors_with_each_folds_choice_cover_compared_values():
    good = np.array([[[True, True]], [[True, False]]])
    base = SimpleNamespace(
        task=SimpleNamespace(noise=SimpleNamespace(good=good), experiment=SimpleNamespace(channels=("pull",)))
    )
    left = [np.array([[[3.0, 4.0]], [[99.0, 99.0]]]), np.array([[[99.0, 99.0]], [[12.0, 99.0]]])]
    anew = {name: SimpleNamespace(last=SimpleNamespace(missed=each)) for name, each in zip("ab", left, strict=True)}
    assert errors_anew(base, anew) == {"pull": pytest.approx(13.0 / 3**0.5)}
    good[:, 0, 1] = good[1, 0, 0] = False
    assert errors_anew(base, anew) == {"pull": 3.0}


@pytest.mark.parametrize(
    ("answer", "side", "tried"),
    [
        (Answer.NONE_FITS, "fit", True),
        (Answer.LIKE, "fit", True),
        (Answer.NAMED, "fit", False),
        (Answer.NONE_FITS, None, False),
    ],
)
def test_a_draft_is_scored_where_nothing_of_the_list_holds(answer, side, tried, monkeypatch):
    monkeypatch.setattr(decide_answer, "scored", lambda draft, before, seed: (draft, before, seed))
    after = None if side is None else SimpleNamespace(fit=side)
    verdict = Verdict("wheel-rig", answer, "x", "said", None, after=after)
    assert with_draft(verdict, "draft", 3).draft == (("draft", "fit", 3) if tried else None)
    assert with_draft(verdict, None, 3).draft is None


def test_base_is_assessed_where_nothing_was_found_else_the_law(monkeypatch):
    monkeypatch.setattr(decide_answer, "is_adequate", lambda fit: False)
    monkeypatch.setattr(decide_answer, "holds", lambda found: True)
    assert decide_answer.assess_residual(SimpleNamespace(best_refits=(), base=None)) == ResidualAssessment(True)
    assert decide_answer.assess_residual(SimpleNamespace(best_refits=("A",), base=None)) == ResidualAssessment(False)


@pytest.mark.parametrize(
    ("answer", "against", "named", "said", "share"),
    [
        (Answer.NAMED, (), ("A", "B"), Answer.NAMED, 0.9),
        (Answer.NAMED, ("it lies at its bound",), ("A", "B"), Answer.LIKE, 0.9),
        (Answer.SET, ("it lies at its bound",), ("A", "B"), Answer.SET, 0.9),
        (Answer.LIKE, (), ("A",), Answer.LIKE, 0.9),
        (Answer.LIKE, (), ("A", "B"), Answer.LIKE, 0.9),
        (Answer.INADEQUATE, (), (), Answer.INADEQUATE, 0.0),
        (Answer.NONE_FITS, (), (), Answer.NONE_FITS, 0.0),
    ],
)
def test_a_verdict_keeps_what_its_answer_says(answer, against, named, said, share, monkeypatch):
    """Both effects where they stand or hold together, the first where something is like it, none where none fits."""
    task = SimpleNamespace(
        noise=None, experiment=SimpleNamespace(records=lambda model: {"A": "a", "B": "b"}, no_value="")
    )

    def fit(name):
        return SimpleNamespace(name=name, task=task)

    def of(names):
        added = tuple(Candidate(name, object(), ()) for name in names)
        return SimpleNamespace(base=base, last=fit(names or "base"), added=added, indistinguishable=tuple(names))

    base, patches = fit("base"), {
        "graded": lambda found, left, chosen: (answer, of("".join(named)) if answer is Answer.LIKE else found),
        "side_of": lambda fitted: SimpleNamespace(fit=fitted, model=fitted.name),
        "held_out": lambda before, after, noise, seed: SimpleNamespace(channels=(), runs=()),
        "held_out_share": lambda base, last: 0.9,
        "vetoes": lambda found, chosen, scores: against,
        "sentence": lambda answer, found, share, besides: answer.value,
    }  # fmt: skip
    for name, instead in patches.items():
        monkeypatch.setattr(decide_answer, name, instead)
    found = decide_answer.make_verdict(("wheel-rig", "x"), of("AB"), {}, ResidualAssessment(False), 0)
    assert (found.answer, found.named, found.share) == (said, named, share)
    assert found.model == ("".join(named) or "base")
    assert found.vetoes == (against if named else ())
    assert found.sentence == said.value
