"""The answer as a sentence: what is said of how well the noise is met, what was bent, and what is left, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2 as chi2_law

from rover_pin.discrepancy import sentence as module
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.sentence import sentence
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.parameter import Parameter

FREEDOM = 40
ENOUGH, TOO_MUCH = 40.0, 90.0
"""Values of chi2 that 40 degrees of freedom leave, and leave once in 100,000 sets."""


def fit_of(chi2=ENOUGH, declared=True, floors=None, rms=(1.0,), u=()):
    """A fit of 40 rows with this chi2; channel i has RMS rms[i] in every fold, and the scatter floors[i]."""
    channels = tuple("abcdefgh"[: len(rms)])
    experiment = SimpleNamespace(
        channels=channels, folds=("run 1", "run 2"),
        noise=lambda: object() if declared else None, floor=lambda: None if floors is None else np.array(floors),
        least_noise=lambda model: np.full(len(rms), 1e-6),
    )  # fmt: skip
    good = np.ones((2, len(rms), 20 // len(rms)), dtype=bool)
    task = SimpleNamespace(experiment=experiment, noise=SimpleNamespace(good=good, floor=np.ones(len(rms))))
    residual = np.array(rms)[None, :, None] * np.ones(good.shape)
    numbers = tuple(Parameter(f"soil.{at}", 0.0, 1.0, -50.0, 50.0, declared=True) for at in range(len(u)))
    rows = np.full(int(good.sum()), np.sqrt(chi2 / good.sum()))
    return SimpleNamespace(
        model=None,
        rows=rows,
        freedom=FREEDOM,
        misfit=chi2 / FREEDOM,
        task=task,
        residual=residual,
        missed=residual,
        parameters=numbers,
        u=u,
    )


def search_of(base=None, last=None, added=(), alike=None):
    return SimpleNamespace(
        base=base or fit_of(),
        last=last or fit_of(),
        added=added,
        best_refits=added,
        indistinguishable=alike or [one.name for one in added],
    )


def said(answer, found, share=0.5, left="", against=()):
    return sentence(answer, found, share, (left, against))


EFFECT = Candidate("ExitAngle", object(), ("ExitAngle.c",))
FREED = Candidate("soil.phi", None, ("soil.phi",))


def number(name, value=0.5, drift=4.0):
    return Number(name, "rad", value, value - 0.1, value + 0.1, drift)


@pytest.mark.parametrize("answer", [Answer.NAMED, Answer.SET])
@pytest.mark.parametrize(
    ("declared", "chi2", "more"), [(True, ENOUGH, False), (True, TOO_MUCH, True), (False, TOO_MUCH, False)]
)
def test_more_than_a_declared_noise_is_said_to_be_left(answer, declared, chi2, more):
    """Noise that was learnt from what is left cannot be exceeded by it."""
    found = search_of(fit_of(declared=declared), fit_of(chi2), (EFFECT,))
    assert ("What is left is still more than the noise" in said(answer, found)) is more
    assert "takes 50% of what the base model misses" in said(answer, found)


@pytest.mark.parametrize(
    ("added", "bent"),
    [((FREED,), "soil.phi to 28.65 deg, +4.0 SD from what was"), ((EFFECT,), ""), ((EFFECT, FREED), "soil.phi")],
)
def test_a_number_that_was_freed_had_been_bent_before(added, bent, monkeypatch):
    """Of the base's numbers those that were freed, not others; an effect's sizes are none of the base's."""
    asked = []
    known = (number("soil.phi"), number("soil.k"), number("ExitAngle.c"))
    monkeypatch.setattr(module, "numbers", lambda base: asked.append(base) or known)
    text = said(Answer.NAMED, search_of(added=added))
    assert ("the base model already had to bend" in text) is bool(bent)
    assert bent in text
    assert "soil.k" not in text
    assert "to bend ExitAngle" not in text
    assert " and ExitAngle.c" not in text
    assert bool(asked) is bool(bent), "intervals cost fits: none where nothing was freed"


@pytest.mark.parametrize(
    ("against", "says"),
    [
        ((), "but its law does not hold exactly."),
        (("it lies at its bound", "b"), "stand alone: it lies at its bound; b."),
    ],
)
def test_what_is_like_an_effect_says_what_speaks_against_it(against, says):
    found = search_of(fit_of(TOO_MUCH), fit_of(ENOUGH), (EFFECT,), ["ExitAngle", "Wear"])
    text = said(Answer.LIKE, found, against=against)
    assert text.startswith("something like ExitAngle or Wear is missing: the first takes 50%")
    assert "(reduced chi-square 2.25 -> 1)" in text
    assert text.endswith(says)


@pytest.mark.parametrize(("share", "rare"), [(0.052, False), (0.048, True)])
def test_what_chance_leaves_once_in_twenty_sets_is_rare(share, rare):
    base = fit_of(float(chi2_law.isf(share, FREEDOM)))
    assert ("no candidate gains more than chance, but" in said(Answer.NONE_NEEDED, search_of(base))) is rare
    learnt = fit_of(float(chi2_law.isf(share, FREEDOM)), declared=False)
    assert "meets the data within their noise" in said(Answer.NONE_NEEDED, search_of(learnt))


@pytest.mark.parametrize(
    ("rms", "told", "more"),
    [
        ((2.0,), ["a 2 times"], 0),
        ((2.0, 1.0, 5.0), ["c 5 times", "a 2 times"], 0),
        ((2.0, 5.0, 3.0), ["b 5 times", "c 3 times", "a 2 times"], 0),
        ((2.0, 5.0, 3.0, 4.0), ["b 5 times", "d 4 times", "c 3 times"], 1),
        ((2.0, 5.0, 3.0, 4.0, 6.0), ["e 6 times", "b 5 times", "d 4 times"], 2),
    ],
)
def test_at_most_three_channels_above_their_scatter_are_named(rms, told, more):
    base = fit_of(declared=False, floors=[1.0] * len(rms), rms=rms)
    text = said(Answer.NONE_NEEDED, search_of(base))
    named = [f"{one} (most in run 1)" for one in told]
    assert text.endswith(f"scatter: {', '.join(named)}{f' and {more} channels more' if more else ''}.")


@pytest.mark.parametrize(("floors", "rms"), [([1.0], (1.2,)), (None, (9.0,))])
def test_data_within_the_scatter_or_of_unknown_scatter_are_met(floors, rms):
    base = fit_of(declared=False, floors=floors, rms=rms)
    assert said(Answer.NONE_NEEDED, search_of(base)) == (
        "the calibrated base model meets the data within their noise, and no candidate gains more than chance."
    )


@pytest.mark.parametrize("left", ["", "acts as a force"])
def test_what_is_on_no_list_names_the_nearest_where_there_is_one(left):
    begins = "something acts that is not on the list: it acts" if left else "the base model misses the data by more"
    text = said(Answer.NONE_FITS, search_of(fit_of(TOO_MUCH), added=(EFFECT,)), left=left)
    assert text.startswith(begins)
    assert text.endswith(" The nearest of the list, ExitAngle, does not take it.")
    alone = said(Answer.NONE_FITS, search_of(fit_of(TOO_MUCH)), left=left)
    assert alone.startswith(begins)
    assert "nearest" not in alone
    assert left or "reduced chi-square 2.25" in alone


def test_far_numbers_are_named_where_the_noise_is_met():
    far = fit_of(u=(1.0, -6.0))
    text = said(Answer.INADEQUATE, search_of(far))
    assert text.endswith("only with numbers far from what is declared of them: soil.1 -6.0 SD.")
    assert "misses the data by more" in said(Answer.INADEQUATE, search_of(far, added=(EFFECT,)))
    assert "misses the data by more" in said(Answer.INADEQUATE, search_of(fit_of(TOO_MUCH, u=(1.0, -6.0))))


@pytest.mark.parametrize(
    ("chi2", "declared", "told"),
    [(90.0, True, "the noise may be 1.5 times"), (42.0, True, "1 times"), (90.0, False, ""), (38.0, True, "")],
)
def test_declared_noise_may_be_too_small_for_an_unknown_residual(chi2, declared, told):
    text = said(Answer.INADEQUATE, search_of(fit_of(chi2, declared), added=(EFFECT,)))
    assert ("single values may be outliers, or the noise may be" in text) is bool(told)
    assert told in text
