"""Errors on what was not fitted: what is compared, per channel, fold and run, and what may be claimed, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.discrepancy import conclude, draft
from rover_pin.discrepancy import held_out as module
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.draft import Draft
from rover_pin.discrepancy.held_out import ChannelScore, _by_channel, _by_run, losses
from rover_pin.discrepancy.verdict import SCHEMA, Verdict
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.noise import declared_noise


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
    return declared_noise(np.array(floor), np.where(good, 0.0, np.nan))


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


# --- by run ----------------------------------------------------------------------------------------------------------


def test_a_run_is_judged_by_its_robust_chi2_a_compared_block():
    """Up to 4 SDs squared, beyond it by 8 times the size less 16."""
    good = np.array([[[True, True, False]], [[True, False, False]]])
    residual = np.array([[[1.0, 10.0, 99.0]], [[2.0, 99.0, 99.0]]])
    pair = residual, 0.5 * residual
    first, second = _by_run(experiment(timed=True), noise(good, (1.0,)), pair, np.random.default_rng(0))
    assert (first.run, first.blocks, first.before, first.after) == ("a", 2, (1.0 + 64.0) / 2, (0.25 + 24.0) / 2)
    assert (second.run, second.blocks, second.before, second.after) == ("b", 1, 4.0, 1.0)
    assert module.together((second,)) == (4.0, 1.0)
    assert module.together((first, second)) == (pytest.approx(69.0 / 3), pytest.approx(25.25 / 3))


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


def fold_fit(losses):
    """A fit whose folds cost so much where they are left out."""
    return SimpleNamespace(task=SimpleNamespace(experiment=experiment()), losses=np.array(losses))


@pytest.mark.parametrize(
    ("odds", "after", "accepted", "says"),
    [
        (3.0, [1.0, 2.0], True, "the data are 20.1 times as probable with it, chi2 of folds left out falls by 4"),
        (-1.0, [1.0, 2.0], False, "chi2 of folds left out falls by 4; it does not hold up"),
        (3.0, [4.0, 5.0], False, "chi2 of folds left out falls by -2; it does not hold up"),
        (3.0, [1.0, np.nan], False, "nothing compared, but b left out is predicted by nobody; it does not hold up"),
    ],
)
def test_a_draft_holds_where_it_is_probable_and_predicts(odds, after, accepted, says, monkeypatch):
    monkeypatch.setattr(draft, "losses_of", lambda fitted: fitted.losses)
    monkeypatch.setattr(draft, "replace", lambda fitted, task: fitted)
    found = draft.draft_of("text", fold_fit([3.0, 4.0]), fold_fit(after), odds)
    assert found.accepted is accepted
    assert found.sentence.endswith(says)
    assert found.as_dict()["accepted"] is accepted


def test_a_draft_with_which_no_fit_ends_promises_nothing():
    empty = draft.draft_of("text", None, None, -np.inf)
    assert (empty.accepted, empty.fit, empty.lines()) == (False, None, [empty.sentence])
    assert draft.scored(empty, None, 0) is empty
    assert Draft("text", command="again").lines()[-1] == "try it again: again"


@pytest.mark.parametrize(
    ("answer", "side", "tried"),
    [
        (Answer.NONE_FITS, "fit", True),
        (Answer.LIKE, "fit", True),
        (Answer.NAMED, "fit", False),
        (Answer.LIKE, None, False),
    ],
)
def test_a_draft_is_scored_where_nothing_of_the_list_holds(answer, side, tried, monkeypatch):
    monkeypatch.setattr(conclude, "scored", lambda draft, before, seed: (draft, before, seed))
    after = None if side is None else SimpleNamespace(fit=side)
    verdict = Verdict("wheel-rig", answer, "x", "said", None, after=after)
    assert conclude.with_draft(verdict, lambda fitted: "draft", 3).draft == (("draft", "fit", 3) if tried else None)
    assert conclude.with_draft(verdict, lambda fitted: None, 3).draft is None


# --- the verdict -----------------------------------------------------------------------------------------------------


def test_draft_and_residual_are_in_the_summary_and_the_schema():
    left = SimpleNamespace(lines=lambda added: ["left: " + ("after" if added else "before")], as_dict=lambda: {})
    bare = Verdict("wheel-rig", Answer.CANNOT_TELL, "x", "too little", None)
    full = Verdict("wheel-rig", Answer.NONE_FITS, "x", "nothing", None, draft=Draft("text"), extra=left)
    assert "left: before" in full.summary()
    assert "draft: the draft promises nothing" in full.summary()
    assert "draft" not in bare.summary()
    assert full.as_dict()["draft"]["accepted"] is False
    assert bare.as_dict()["draft"] == {}
    assert SCHEMA == bare.as_dict()["schema"] == 3


def test_fold_that_adds_more_is_counted_apart_from_the_same():
    chosen = {"a": "A", "b": "A + B", "c": ""}
    verdict = Verdict("wheel-rig", Answer.NAMED, "x", "said", None, named=("A",), chosen=chosen)
    assert verdict.chosen_again == "A chosen in 1 of 3 folds, and with another in 1"


@pytest.mark.parametrize("samples", [module.STRETCH, 2 * module.STRETCH + 1])
def test_stretches_of_a_run_are_summed_along_its_samples(samples):
    values = np.arange(2.0 * 3 * samples).reshape(2, 3, samples)
    found = module._summed(values)
    ends = [*range(0, samples, module.STRETCH), samples]
    expected = [values[..., a:b].sum(axis=-1) for a, b in zip(ends, ends[1:], strict=False)]
    assert found.shape == (2, 3, len(expected))
    np.testing.assert_allclose(np.moveaxis(found, -1, 0), expected)
