"""How often a search looks, what it pairs, and what a judgement keeps of it, on rounds made by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.discrepancy import assessment as left_of_a_law
from rover_pin.discrepancy import decide_answer, held_out, search
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.assessment import SCATTER, ResidualAssessment, described, is_outperformed, share_taken
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.decide_answer import WORSE_BY, first_of, with_draft
from rover_pin.discrepancy.held_out import errors_anew, errors_of_others
from rover_pin.discrepancy.refit import Refit, rescale_thresholds
from rover_pin.discrepancy.screen import null_threshold
from rover_pin.discrepancy.verdict import Verdict


def experiment(folds=12, exact=True, noise="declared"):
    return SimpleNamespace(
        folds=tuple(range(folds)),
        is_exact=exact,
        noise=lambda: noise,
        least_noise=lambda model: np.ones(2),
        random_field=lambda model: None,
        turns=lambda: None,
    )


def fitted(rms=(9.0, 9.0), **how):
    noise = SimpleNamespace(inflation=1.5)
    task = SimpleNamespace(experiment=experiment(**how), noise=noise)
    return SimpleNamespace(predicted=np.zeros((1, 2, 1)), task=task, model=None, rms=np.array(rms))


@pytest.mark.parametrize(
    ("folds", "exact", "most"),
    [(3, True, 1), (4, True, 1), (5, True, 2), (11, True, 2), (12, True, 3), (40, True, 3), (3, False, 4)],
)
def test_five_levels_bear_two_effects_twelve_three(folds, exact, most):
    """Where fits are not exact, three and a round that finds none."""
    assert search._most(experiment(folds, exact)) == most


@pytest.mark.parametrize(
    ("folds", "freed", "most"),
    [(8, 1, 1), (9, 1, 2), (9, 2, 1), (10, 2, 2), (12, 1, 2), (13, 1, 3), (14, 2, 3), (40, 9, 3), (5, 1, 1), (2, 3, 1)],
)
def test_a_freed_shape_takes_the_level_that_tells_it(folds, freed, most):
    shapes = tuple(f"A.q{at}" for at in range(freed))
    bent, plain = Candidate("A", object(), (), free_shapes=shapes), Candidate("B", object(), ())
    assert search._most(experiment(folds, True), [plain, bent]) == most
    assert search._most(experiment(folds, False), [plain, bent]) == 4


@pytest.mark.parametrize(
    ("instead", "freed", "borne"),
    [
        ((), 0, False),
        ((), 1, False),
        ((0,), 0, True),
        ((0,), 1, True),
        ((1,), 0, True),
        ((1,), 1, False),
        ((2,), 0, False),
    ],
)
def test_bent_law_replacement_may_add_a_second_if_levels_suffice(instead, freed, borne):
    """Nine levels, and a first law with two shapes freed: alone it stands, and with another it is not tried."""

    def law(count):
        return Candidate(f"L{count}", object(), (), free_shapes=tuple(f"L.q{at}" for at in range(count)))

    task = SimpleNamespace(experiment=experiment(9))
    found = SimpleNamespace(added=(law(2),), base=SimpleNamespace(task=task))
    assert search._has_enough_folds(found, (tuple(map(law, instead)), law(freed), None)) is borne
    assert search._has_enough_folds(SimpleNamespace(added=(), base=found.base), ((), law(5), None))


class Found:
    """A round that found something, or not."""

    def __init__(self, *alike):
        self.indistinguishable, self.refits = alike, alike


@pytest.fixture
def looked(monkeypatch):
    """A search whose rounds find what is given in turn; what it did is noted."""

    def look(*rounds, adequate=False, shared=(), **how):
        made, done, learnt = list(rounds), [], list(shared)

        def another(name, result):
            done.append(name)
            return result

        patches = {
            "signatures": lambda base, tried: [],
            "score": lambda base, known: [],
            "_round": lambda found, tried, progress: another("singles", made.pop(0)),
            "_pairs": lambda found, count, progress: another("pairs", Found()),
            "_with_residual_noise": lambda base, known, chance, least: another("noise", base),
            "again": lambda base: base,
            "beyond_declared": lambda last, known: learnt.pop(0) if learnt else None,
            "replace": replaced,
            "is_adequate": lambda base: adequate,
        }
        for name, instead in patches.items():
            monkeypatch.setattr(search, name, instead)
        search.search(fitted(**how), [], lambda said: None)
        return done

    return look


SOMETHING = Found(SimpleNamespace(candidate=Candidate("A", object(), ()), instead=(), gain=9.0, fit="with A"))


def replaced(one, **how):
    return SimpleNamespace(**(vars(one) | how)) if isinstance(one, SimpleNamespace) else replace(one, **how)


def test_search_repeats_in_shared_noise_until_its_result_repeats(looked):
    noise = SimpleNamespace(inflation=1.0)
    assert looked(SOMETHING, Found(), Found(), Found(), shared=[noise] * 3, adequate=True) == ["singles"] * 4
    assert looked(Found(), Found(), shared=[noise] * 3, adequate=True) == ["singles"] * 2
    assert looked(SOMETHING, Found(), Found(), shared=[noise], adequate=True) == ["singles"] * 3
    assert looked(Found(), SOMETHING, Found(), Found(), shared=[noise] * 3, adequate=True) == ["singles"] * 4
    assert looked(Found(), shared=[noise], exact=False) == ["singles"]


def test_rounds_follow_as_long_as_something_is_found(looked):
    assert looked(SOMETHING, Found()) == ["singles"] * 2
    assert looked(SOMETHING, SOMETHING, SOMETHING) == ["singles"] * 3
    assert looked(SOMETHING, SOMETHING, folds=8) == ["singles"] * 2


def test_pairs_are_tried_if_no_single_holds_and_the_base_misfits(looked):
    """If there are levels for two effects, and fits are exact."""
    assert looked(Found()) == ["singles", "pairs"]
    assert looked(Found(), folds=8) == ["singles", "pairs"]
    assert looked(Found(), adequate=True) == ["singles"]
    assert looked(Found(), folds=7) == ["singles"]
    assert looked(Found(), exact=False) == ["singles"]


def test_noise_that_nobody_declares_is_learnt_twice(looked):
    assert looked(Found(), exact=False, noise=None) == ["noise", "noise", "singles"]


@pytest.mark.parametrize(("rms", "looks"), [((1.2, 0.7), 0), ((0.0, 1.4), 0), ((1.2, 1.0), 3), ((1.5, 0.0), 3)])
def test_nothing_is_sought_below_the_error_of_predictions(rms, looks, looked):
    assert len(looked(Found(), exact=False, noise=None, rms=rms)) == looks


def test_pair_pays_for_both_effects_in_units_of_the_noise(monkeypatch):
    seen = []
    monkeypatch.setattr(search, "paired", lambda base, singles, best, progress: [])
    monkeypatch.setattr(search, "rank_refits", lambda base, tried, fee, paid: seen.append(paid) or ())
    single = Refit(Candidate("A", object(), ("A.x",)), SimpleNamespace(), 1.0, 14.0, 0.0, unit=2.0)
    for refits, paid in (((single,), 7.0), ((), 0.0)):
        found = SimpleNamespace(rounds=(SimpleNamespace(refits=refits),), base=fitted())
        search._pairs(found, 5, lambda said: None)
        assert seen.pop() == paid


@pytest.mark.parametrize(
    ("rounds", "adequate", "pairs"),
    [(0, False, None), (1, True, []), (1, False, ["of leaders", "after plain"]), (2, False, []), (2, True, [])],
)
def test_pairs_join_the_second_round_where_the_first_misfits(rounds, adequate, pairs, monkeypatch):
    monkeypatch.setattr(search, "is_adequate", lambda fit: adequate)
    monkeypatch.setattr(search, "paired", lambda base, refits, best, progress: ["of leaders"])
    monkeypatch.setattr(search, "_after_plain_laws", lambda found, tried, fee, progress: ["after plain"])
    found = SimpleNamespace(rounds=(SOMETHING,) * rounds, best_refits=("A",) * rounds, base="base", last="last")
    assert search._second(found, [], None, lambda said: None) == pairs


@pytest.mark.parametrize("exact", [True, False])
def test_added_effect_is_not_retried_and_exact_fits_are_rescored(exact, monkeypatch):
    monkeypatch.setattr(search, "signatures", lambda last, tried: (last, [one.kind for one in tried]))
    tried = [Candidate(kind, object(), ()) for kind in "AB"]
    known = [SimpleNamespace(candidate=one) for one in tried]
    found = SimpleNamespace(added=tried[:1], base=fitted(exact=exact), last="last", signatures=known)
    assert search._remaining_signatures(found, tried) == (("last", ["B"]) if exact else known[1:])
    found.added = []
    assert search._remaining_signatures(found, tried) == known


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


@pytest.mark.parametrize(
    ("misfit", "rest", "unlisted"),
    [(3.9, True, True), (3.9, False, False), (3.9, None, False), (4.1, False, True), (4.1, None, True)],
)
def test_patternless_residual_is_scatter_to_four_times_the_noise(misfit, rest, unlisted, monkeypatch):
    monkeypatch.setattr(left_of_a_law, "assess_residual", lambda found: ResidualAssessment(True))
    monkeypatch.setattr(left_of_a_law, "is_outperformed", lambda found, draft: False)
    drafts = {"last": None if rest is None else SimpleNamespace(accepted=rest), "base": SimpleNamespace(accepted=True)}
    found = SimpleNamespace(best_refits=("A",), last=Named("last", misfit), base=Named("base", 9.0))
    left, draft = described(found, True, lambda here: drafts[here.name])
    assert left == ResidualAssessment(unlisted, described=unlisted, patterned=rest is True)
    assert (draft is drafts["base"]) is unlisted
    assert (SCATTER, WORSE_BY) == (4.0, 0.05)
    assert described(found, False, lambda here: drafts[here.name]) == (ResidualAssessment(True), None)


@pytest.mark.parametrize(
    ("found", "unlisted", "rest", "better", "expected", "asked"),
    [
        ((), False, None, False, ResidualAssessment(False), []),
        ((), True, None, False, ResidualAssessment(True, described=True), ["base"]),
        (("A",), False, None, True, ResidualAssessment(False), ["last"]),
        (("A",), False, False, False, ResidualAssessment(False), ["last", "base"]),
        (("A",), False, True, False, ResidualAssessment(False, patterned=True), ["last", "base"]),
        (("A",), False, False, True, ResidualAssessment(True, "", True, False, True), ["last", "base"]),
        (("A",), True, True, True, ResidualAssessment(True, "", True, True, True), ["last", "base"]),
    ],
)
def test_draft_replaces_a_law_only_if_its_residual_has_a_curve(
    found, unlisted, rest, better, expected, asked, monkeypatch
):
    """A law that leaves nothing that a draft could describe is not asked for one on the base, which costs a refit."""
    monkeypatch.setattr(left_of_a_law, "assess_residual", lambda found: ResidualAssessment(unlisted))
    monkeypatch.setattr(left_of_a_law, "is_outperformed", lambda found, draft: better)
    tried, base = [], SimpleNamespace(accepted=True)
    drafts = {"last": None if rest is None else SimpleNamespace(accepted=rest), "base": base}
    search = SimpleNamespace(best_refits=found, last=Named("last", 1.0), base=Named("base", 9.0))
    left, draft = described(search, True, lambda here: tried.append(here.name) or drafts[here.name])
    assert (left, tried) == (expected, asked)
    assert draft is (base if expected.unlisted else None)


@pytest.mark.parametrize(
    ("law", "drawn", "fee", "accepted", "better"),
    [
        (300.0, 199.0, 20.0, True, True),
        (300.0, 201.0, 20.0, True, False),
        (300.0, 199.0, 102.0, True, False),
        (300.0, 199.0, 20.0, False, False),
        (105.0, 95.0, 12.0, True, False),
        (95.0, 70.0, 20.0, True, True),
    ],
)
def test_draft_outperforms_a_law_by_half_of_its_excess(law, drawn, fee, accepted, better, monkeypatch):
    """On folds left out, of 100 compared values, and beyond chance."""
    losses = {"last": [law / 4, 3 * law / 4], "drawn": [drawn / 2, drawn / 2]}
    monkeypatch.setattr(left_of_a_law, "held_out_losses", lambda one: np.array(losses[one.name]))
    base = SimpleNamespace(task=SimpleNamespace(noise=SimpleNamespace(good=np.ones((2, 1, 50), bool))))
    found = SimpleNamespace(base=base, last=SimpleNamespace(name="last"))
    draft = SimpleNamespace(refit=SimpleNamespace(fit=SimpleNamespace(name="drawn"), threshold=fee), accepted=accepted)
    assert is_outperformed(found, draft) is better
    assert not is_outperformed(found, SimpleNamespace(refit=None, accepted=accepted))


def test_base_is_assessed_where_nothing_was_found_else_the_law(monkeypatch):
    monkeypatch.setattr(left_of_a_law, "is_adequate", lambda fit: False)
    monkeypatch.setattr(left_of_a_law, "holds", lambda found: True)
    assert left_of_a_law.assess_residual(SimpleNamespace(best_refits=(), base=None)) == ResidualAssessment(True)
    assert left_of_a_law.assess_residual(SimpleNamespace(best_refits=("A",), base=None)) == ResidualAssessment(False)


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
        "vetoes": lambda found, chosen, scores, patterned: against,
        "sentence": lambda answer, found, share, besides: answer.value,
    }  # fmt: skip
    for name, instead in patches.items():
        monkeypatch.setattr(decide_answer, name, instead)
    found = decide_answer.make_verdict(("wheel-rig", "x"), of("AB"), {}, ResidualAssessment(False), 0)
    assert (found.answer, found.named, found.share) == (said, named, share)
    assert found.model == ("".join(named) or "base")
    assert found.vetoes == (against if named else ())
    assert found.sentence == said.value


class Named:
    """A fit by name, with what it leaves."""

    def __init__(self, name, misfit):
        self.name, self.misfit = name, misfit


@pytest.mark.parametrize(
    ("answer", "unlisted", "draft"),
    [
        (Answer.LIKE, True, "of what is said"),
        (Answer.LIKE, False, "of base"),
        (Answer.NONE_FITS, True, "of base"),
        (Answer.NAMED, False, "of base"),
    ],
)
def test_residual_of_the_first_law_is_drafted_for_a_like_answer(answer, unlisted, draft, monkeypatch):
    found = SimpleNamespace(base="base")
    patches = {
        "calibrated": lambda experiment, model, numbers, seed: "base",
        "search": lambda base, candidates, progress: found,
        "_leading": lambda found, candidates: [],
        "chosen_anew": lambda base, tried: {},
        "drafted": lambda question, here, progress: f"of {here}",
        "described": lambda found, can_draft, drafts: (ResidualAssessment(unlisted), drafts("base")),
        "make_verdict": lambda of, found, chosen, left, seed: Verdict(
            "wheel-rig", answer, "x", "said", None, search=SimpleNamespace(last="what is said")
        ),
        "errors_anew": lambda base, anew: {},
        "with_draft": lambda verdict, draft, seed: draft,
    }
    for name, instead in patches.items():
        monkeypatch.setattr(decide_answer, name, instead)
    question = SimpleNamespace(
        kind="wheel-rig", name="x", experiment=None, model=None, numbers=(), candidates=lambda base: [], draft=None
    )
    assert decide_answer.concluded(question, lambda said: None) == draft
