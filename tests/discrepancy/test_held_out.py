"""Errors on what was not fitted: what is compared, per channel, fold and run, and what may be claimed, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.discrepancy import held_out as module
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import Candidate, _reach
from rover_pin.discrepancy.draft import Draft, Drafted, scored, tried
from rover_pin.discrepancy.held_out import (
    ChannelScore,
    Excess,
    RunScore,
    _by_channel,
    _by_run,
    beyond_floor,
    floor_of,
    largest_residual,
    losses,
)
from rover_pin.discrepancy.refit import Refit
from rover_pin.discrepancy.sentence import sentence
from rover_pin.discrepancy.verdict import SCHEMA, Verdict
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.numbers import DRIFTED
from rover_pin.estimation.wording import Change


def experiment(timed=False, told=None, channels=("pull",), least=0.0):
    return SimpleNamespace(
        channels=channels,
        folds=("a", "b"),
        is_timed=timed,
        unit=lambda name: "N",
        floor=lambda: told,
        least_noise=lambda model: np.full(len(channels), least),
    )


def noise(good, floor=(0.5,)):
    return SimpleNamespace(good=good, floor=np.array(floor), white=lambda residual: residual[good])


# --- by channel ------------------------------------------------------------------------------------------------------


def channel_of(good, before, after, timed=False):
    random = np.random.default_rng(0)
    pair = tuple(np.array(each, dtype=float).reshape(2, 1, -1) for each in (before, after))
    compared = np.array(good, dtype=bool).reshape(2, 1, -1)
    [found] = _by_channel(experiment(timed), noise(compared), pair, random)
    return found


def test_the_rms_is_of_what_was_compared():
    """What was not compared counts neither as an error nor as a sample."""
    found = channel_of([1, 1, 0, 1, 0, 0], [3, 4, 99, 12, 99, 99], [1, 2, 99, 2, 99, 99])
    assert (found.before, found.after) == (pytest.approx(13.0 / 3**0.5), pytest.approx(3.0 / 3**0.5))
    assert found.change == pytest.approx(3.0 / 13.0 - 1.0)
    assert found.levels == (
        ("a", pytest.approx((25 / 2) ** 0.5), pytest.approx((5 / 2) ** 0.5)), ("b", 12.0, 2.0)
    )  # fmt: skip
    assert found.of == "folds"
    assert channel_of([1] * 6, [1] * 6, [1] * 6, timed=True).of == "runs"


def test_a_single_sample_and_none_at_all():
    one = channel_of([1, 0, 0, 0], [3, 9, 9, 9], [1, 9, 9, 9])
    assert (one.before, one.after) == (3.0, 1.0)
    np.testing.assert_array_equal([level[1:] for level in one.levels], [(3.0, 1.0), (np.nan, np.nan)])
    none = channel_of([0] * 4, [3] * 4, [1] * 4)
    assert (none.before, none.after) == (0.0, 0.0)


@pytest.mark.parametrize("timed", [False, True])
def test_levels_without_the_channel_are_not_resampled(timed):
    """Of logs stretches are drawn, of all runs: what a run lacks stands in them as nothing."""
    random = np.random.default_rng(7)
    before, after = random.normal(size=(2, 5, 1, 4))
    good = np.ones((5, 1, 4), dtype=bool)
    good[2], good[4, :, 1:] = False, False

    def interval(use):
        among = SimpleNamespace(**{**vars(experiment(timed)), "folds": use})
        [found] = _by_channel(among, noise(good[use]), (before[use], after[use]), np.random.default_rng(0))
        return found.low, found.high

    whole = interval([0, 1, 2, 3, 4])
    assert (whole == interval([0, 1, 3, 4])) is not timed
    assert whole != interval([0, 1, 3])


def test_errors_are_told_in_times_the_noise():
    score = ChannelScore("pull", "N", 0.5, 3.0, 2.0, -1 / 3, -0.5, -0.1)
    assert score.times(3.0) == 6.0
    assert ChannelScore("pull", "N", 0.0, 3.0, 2.0, 0.0, 0.0, 0.0).times(0.0) == 0.0


def test_the_interval_holds_the_middle_19_of_20_of_the_draws(monkeypatch):
    """Draws 0 to 1,999 in turn: the ends lie at 2.5 % and 97.5 % of them, between neighbours by their distance."""
    after = np.arange(1.0, 2001.0)
    each = SimpleNamespace(integers=lambda low, high, size: np.arange(high)[:, None])
    assert module.DRAWS == 2000
    low, high = module._change(np.array([np.full(2000, 2.0), after]), 1.0, each)
    ends = 1.0 + 0.025 * 1999, 1.0 + 0.975 * 1999
    assert (low, high) == pytest.approx([end / 2.0 - 1.0 for end in ends])


# --- floors ----------------------------------------------------------------------------------------------------------


def test_the_floor_is_the_scatter_of_samples_where_that_is_told():
    some = noise(np.ones((2, 3, 1), dtype=bool), floor=(0.5, 0.6, 0.7))
    assert list(floor_of(experiment(told=None), some)) == [0.5, 0.6, 0.7]
    assert list(floor_of(experiment(told=np.array([0.2, 0.0, np.nan])), some)) == [0.2, 0.6, 0.7]


def test_excess_beyond_the_floor_names_its_worst_fold_in_order():
    """Per compared sample: fold a has one of 3, fold b two of 2.5, which sum to more."""
    good = np.ones((2, 3, 2), dtype=bool)
    good[0, :, 1] = False
    residual = np.zeros((2, 3, 2))
    residual[0, :, 1] = 99.0
    residual[0, :, 0] = [3.0, 12.0, 0.1]
    residual[1] = [[2.5, 2.5], [9.0, 0.0], [0.1, 0.1]]
    names = experiment(channels=("pull", "sinkage", "torque"))
    fitted = SimpleNamespace(
        residual=residual,
        missed=residual,
        task=SimpleNamespace(experiment=names, noise=noise(good, (0.5, 0.5, 0.5))),
        model=None,
    )
    found = beyond_floor(fitted)
    rms = (9.0 + 2 * 6.25) ** 0.5 / 3**0.5, (144.0 + 81.0) ** 0.5 / 3**0.5
    assert found == (
        Excess("sinkage", pytest.approx(rms[1] / 0.5), "a"), Excess("pull", pytest.approx(rms[0] / 0.5), "a")
    )  # fmt: skip


def test_a_channel_that_was_never_compared_leaves_nothing():
    good = np.zeros((2, 1, 2), dtype=bool)
    good[0, 0, 0] = True
    assert beyond_floor(leaving_two(good, experiment())) == (Excess("pull", 4.0, "a"),)


def test_the_error_of_predictions_is_a_floor_too():
    good = np.ones((2, 1, 2), dtype=bool)
    assert beyond_floor(leaving_two(good, experiment(least=0.8))) == (Excess("pull", 2.5, "a"),)
    assert beyond_floor(leaving_two(good, experiment(least=2.0))) == ()


def leaving_two(good, names):
    task = SimpleNamespace(experiment=names, noise=noise(good))
    residual = np.full((2, 1, 2), 2.0)
    return SimpleNamespace(residual=residual, missed=residual, task=task, model=None)


def test_largest_residual_is_the_greatest_compared_rms_in_sds():
    good = np.ones((2, 2, 2), dtype=bool)
    good[0, 0, 1] = good[1, 1] = False
    rows = np.array([3.0, 0.1, 0.1, 2.0, 3.2])  # a: pull, twice sinkage; b: twice pull
    names = experiment(channels=("pull", "sinkage"))
    fitted = SimpleNamespace(
        rows=rows, missed=np.zeros(good.shape), task=SimpleNamespace(experiment=names, noise=noise(good))
    )
    assert largest_residual(fitted) == Excess("pull", 3.0, "a")
    fitted.rows = np.array([2.0, 0.1, 0.1, 2.0, 3.2])
    assert largest_residual(fitted) == Excess("pull", pytest.approx(((4.0 + 3.2**2) / 2) ** 0.5), "b")


def left_by_a_null(chi2, declared=True):
    """A search that found nothing on a base whose 40 rows have this chi2, most in fold b."""
    good = np.ones((2, 1, 20), dtype=bool)
    rows = np.full(40, 0.5)
    rows[20:] = np.sqrt((chi2 - 20 * 0.25) / 20)
    names = SimpleNamespace(**vars(experiment()), noise=lambda: object() if declared else None)
    task = SimpleNamespace(experiment=names, noise=noise(good))
    residual = rows.reshape(2, 1, 20)
    base = SimpleNamespace(rows=rows, freedom=40, misfit=chi2 / 40, task=task, residual=residual, missed=residual)
    return SimpleNamespace(base=base)


def test_improbable_chi2_is_reported_though_no_effect_is_needed():
    """The 95 % point of chi2 with 40 degrees of freedom is 55.76; it was silent up to one set in 1,000."""
    said = sentence(Answer.NONE_NEEDED, left_by_a_null(55.7), 0.0, ("", ()))
    assert said.startswith("the calibrated base model meets the data within their noise")
    said = sentence(Answer.NONE_NEEDED, left_by_a_null(66.77), 0.0, ("", ()))
    assert "reduced chi-square 1.67, as chance has it in 0.5% of sets, most in pull of b (1.8 times its noise)" in said
    learnt = left_by_a_null(66.77, declared=False)
    assert "meets the data" in sentence(Answer.NONE_NEEDED, learnt, 0.0, ("", ()))


# --- by run ----------------------------------------------------------------------------------------------------------


def test_a_run_is_judged_by_its_robust_chi2_a_compared_block():
    """Up to 4 SDs squared, beyond it by 8 times the size less 16."""
    good = np.array([[[True, True, False]], [[True, False, False]]])
    residual = np.array([[[1.0, 10.0, 99.0]], [[2.0, 99.0, 99.0]]])
    pair = residual, 0.5 * residual
    first, second = _by_run(experiment(timed=True), noise(good), pair, np.random.default_rng(0))
    assert (first.run, first.blocks, first.before, first.after) == ("a", 2, (1.0 + 64.0) / 2, (0.25 + 24.0) / 2)
    assert (second.run, second.blocks, second.before, second.after) == ("b", 1, 4.0, 1.0)
    assert module.together((second,)) == (4.0, 1.0)
    assert module.together((first, second)) == (pytest.approx(69.0 / 3), pytest.approx(25.25 / 3))


def test_a_run_is_worded_in_units_of_the_noise():
    assert RunScore("a", 3, 2.0, 1.5, -0.4, -0.1).worded == Change(2.0, 1.5, -0.4, -0.1, 1.0, "stretches")


@pytest.mark.parametrize("timed", [True, False])
def test_stretches_of_runs_hang_together_else_whole_folds(timed):
    squares = np.ones((2, module.STRETCH + 1))
    expected = [module.STRETCH, 1.0] * 2 if timed else [module.STRETCH + 1.0] * 2
    assert list(module._resampled(experiment(timed), squares)) == expected


# --- beside curves ---------------------------------------------------------------------------------------------------


def test_a_curve_is_compared_with_the_model_on_its_own_channel():
    score = ChannelScore("pull", "N", 0.5, 3.0, 2.0, -1 / 3, -0.5, -0.1)
    own, other = (Baseline(channel, "N", "mean", error) for channel, error in (("pull", 1.0), ("sinkage", 0.1)))
    assert len(losses([score], [own, other])) == 1
    assert losses([score], [other]) == ()


# --- drafts ----------------------------------------------------------------------------------------------------------


def refit(net=1.0, held_out=2.0):
    task = SimpleNamespace(experiment=SimpleNamespace(folds=("S = 0", "S = 0.5", "S = 1")))
    return Refit(Candidate("D", object(), ()), SimpleNamespace(task=task), 10.0 + net, 10.0, held_out)


def test_draft_states_its_gain_or_that_it_promises_nothing(monkeypatch):
    empty, made = Draft("text"), Draft("text", refit(), command="rover-pin close-loop x --effects y")
    assert empty.as_dict() == {
        "accepted": False, "said": "the draft promises nothing when it is tried", "held_out": [], "command": ""
    }  # fmt: skip
    assert empty.lines() == [empty.sentence]
    told = made.as_dict()
    assert (told["accepted"], told["gain"], told["threshold"], told["held_out_gain"]) == (True, 11.0, 10.0, 2.0)
    assert made.lines() == [made.sentence, "try it again: rover-pin close-loop x --effects y"]
    assert Draft("text", refit(held_out=-1.0)).sentence.endswith("; it does not hold up")
    assert scored(empty, None, 0) is empty


def test_a_draft_that_promises_nothing_has_no_refit(monkeypatch):
    from rover_pin.discrepancy import draft

    monkeypatch.setattr(draft, "held_out_losses", lambda fitted: np.ones(3))
    for refits in ((), (refit(), refit(net=0.5))):
        monkeypatch.setattr(draft, "attempted", lambda here, candidates, progress, made=refits: made)
        found = tried(Drafted("text", ()), None, lambda said: None)
        assert found.refit is (refits[0] if refits else None)
        assert found.accepted is bool(refits)


def test_a_fold_that_nobody_predicts_vetoes_a_draft(monkeypatch):
    """Such a fold counts for neither model, so that on the rest alone the draft gains."""
    from rover_pin.discrepancy import draft

    monkeypatch.setattr(draft, "attempted", lambda here, candidates, progress: (refit(),))
    monkeypatch.setattr(draft, "held_out_losses", lambda fitted: np.array([1.0, np.nan, 2.0]))
    found = tried(Drafted("text", ()), None, lambda said: None)
    assert (found.accepted, found.unpredicted) == (False, ("S = 0.5",))
    assert found.sentence.endswith("but S = 0.5 left out is predicted by nobody; it does not hold up")
    assert found.as_dict()["accepted"] is False


def test_a_run_without_a_prediction_has_no_error():
    good, residual = np.ones((2, 1, 2), dtype=bool), np.array([[[0.1, 0.2]], [[1e3, 1e3]]])
    task = SimpleNamespace(experiment=experiment(), noise=noise(good, (0.01,)))
    missed = np.where(residual > 1.0, np.nan, residual)
    fitted = SimpleNamespace(rows=residual[good] / 0.01, residual=residual, missed=missed, task=task, model=None)
    assert largest_residual(fitted).fold == "a"
    assert largest_residual(fitted).times < 100.0
    assert all(one.times < 100.0 and one.fold == "a" for one in beyond_floor(fitted))


# --- the verdict -----------------------------------------------------------------------------------------------------


def test_draft_and_residual_are_in_the_summary_and_the_schema():
    left = SimpleNamespace(lines=lambda added: ["left: " + ("after" if added else "before")], as_dict=lambda: {})
    bare = Verdict("wheel-rig", Answer.CANNOT_TELL, "x", "too little", None)
    full = Verdict("wheel-rig", Answer.NONE_FITS, "x", "nothing", None, draft=Draft("text", refit()), extra=left)
    assert "left: before" in full.summary()
    assert "draft: tried" in full.summary()
    assert "draft" not in bare.summary()
    assert full.as_dict()["draft"]["gain"] == 11.0
    assert bare.as_dict()["draft"] == {}
    assert SCHEMA == bare.as_dict()["schema"] == 3


def test_numbers_more_than_two_sd_away_have_drifted():
    numbers = tuple(SimpleNamespace(name=name, drift=drift) for name, drift in zip("abcd", DRIFTS, strict=True))
    side = SimpleNamespace(numbers=numbers, misfit=1.0)
    verdict = Verdict("wheel-rig", Answer.NONE_NEEDED, "x", "said", None, after=side)
    assert [one.name for one in verdict.drifted] == ["b", "c"]
    assert (
        "reduced chi-square" not in Verdict("wheel-rig", Answer.NONE_NEEDED, "x", "said", None, before=side).summary()
    )


def test_fold_that_adds_more_is_counted_apart_from_the_same():
    chosen = {"a": "A", "b": "A + B", "c": ""}
    verdict = Verdict("wheel-rig", Answer.NAMED, "x", "said", None, named=("A",), chosen=chosen)
    assert verdict.chosen_again == "A chosen in 1 of 3 folds, and with another in 1"


DRIFTS = (0.98 * DRIFTED, 1.02 * DRIFTED, -1.02 * DRIFTED, -0.98 * DRIFTED)


@pytest.mark.parametrize("samples", [module.STRETCH, 2 * module.STRETCH + 1])
def test_stretches_of_a_run_are_summed_along_its_samples(samples):
    values = np.arange(2.0 * 3 * samples).reshape(2, 3, samples)
    found = module._summed(values)
    ends = [*range(0, samples, module.STRETCH), samples]
    expected = [values[..., a:b].sum(axis=-1) for a, b in zip(ends, ends[1:], strict=False)]
    assert found.shape == (2, 3, len(expected))
    np.testing.assert_allclose(np.moveaxis(found, -1, 0), expected)


# --- what a candidate is called --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "sought", "name", "owner"),
    [("", False, "Weak", "Weak"), ("2", False, "Weak[2]", "Weak[2]"), ("1.5", True, "Weak@1.5", "Weak")],
)
def test_a_place_on_the_way_does_not_belong_to_the_effects_name(place, sought, name, owner):
    one = Candidate("Weak", object(), (), place=place, place_searched=sought)
    assert (one.name, one.owner) == (name, owner)


def test_effect_without_its_own_size_is_tried_at_a_hundredth():
    assert [_reach(unit) for unit in ("m", "rad", "N")] == [0.01, 0.01, 0.05]
