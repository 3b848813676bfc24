"""The search where fits are exact, against the linear Gaussian model in closed form: every decision in milliseconds."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import chi2 as chi2_law
from scipy.stats import norm

from rover_pin.base.errors import OptimisationError
from rover_pin.discrepancy import cross_validation
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.assessment import assess_residual
from rover_pin.discrepancy.calibration import again, calibrated
from rover_pin.discrepancy.candidate import plain_candidate
from rover_pin.discrepancy.cross_validation import FAR, held_out_residual, losses_of
from rover_pin.discrepancy.decide_answer import as_fitted, chosen_anew
from rover_pin.discrepancy.decide_answer import make_verdict as verdict_of
from rover_pin.discrepancy.exact_refits import bearable, paired, rank_refits, variants
from rover_pin.discrepancy.refit import Refit, indistinguishable_refits
from rover_pin.discrepancy.screen import null_threshold
from rover_pin.discrepancy.search import _after_plain_laws, search, threshold_after
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.load_exponent import LoadExponent
from rover_pin.effects.skid_sinkage import SkidSinkage
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.estimation import numbers as intervals_module
from rover_pin.estimation.fit import fit
from rover_pin.estimation.numbers import intervals, is_adequate, numbers, settled
from rover_pin.experiments.wheel_rig.candidates import candidates, rig_kinds
from rover_pin.loop.rig import on_rig
from rover_pin.report.sections.which_effect import own_text
from tests.experiments.wheel_rig import linear_rig as linear

ROWS, FREE = 2 * linear.RUNS, linear.FREE
SILENT = lambda said: None  # noqa: E731
FURTHER, ODDS, HALF = 2 * math.log(20), 9.2, 0.5
"""The limits as they are stated: to change one is a decision, and a test says so."""


def laws_of(random, *effects, size=1.0):
    """Random laws of the uncertain numbers, and of the sizes of effects: `size` SDs at the default size."""
    laws = {name: linear.law_of(name, random.normal(size=ROWS)) for name in FREE}
    for effect in effects:
        laws |= linear.law_of_size(effect, size * random.normal(size=ROWS))
    return laws


def clipped(random):
    """Noise without strays: where no row is one, the robust fit is least squares."""
    return np.clip(random.normal(size=ROWS), -2.2, 2.2)


def rows_of(laws, random, **shares):
    """Noise, and these shares of the default size of effects' sizes."""
    shown = sum(share * laws[name.replace("__", ".")].slope for name, share in shares.items())
    return clipped(random) + shown


def based(rows, laws):
    experiment = linear.made(rows, laws)
    return calibrated(experiment, linear.MODEL, experiment.uncertain(linear.MODEL))


def tried(base, *effects):
    kinds = [type(effect) for effect in effects] or rig_kinds()
    return candidates(base.task.experiment.data, base.model, kinds)


@pytest.fixture(scope="module")
def made():
    """A set that hides the default slip-sinkage among two uncertain numbers, one with a prior."""
    random = np.random.default_rng(5)
    laws = laws_of(random, SlipSinkage(), ExitAngle(), LoadExponent(), SkidSinkage())
    rows = rows_of(laws, random, SlipSinkage__n_1=1.0)
    return based(rows, laws), rows, laws


def closed(made, *names):
    _, rows, laws = made
    return linear.gaussian(rows, laws, (*FREE, *names))


# --- fits ------------------------------------------------------------------------------------------------------------


def test_the_fit_is_least_squares_with_priors(made):
    base = made[0]
    u, chi2 = closed(made).solved()
    np.testing.assert_allclose(base.u, u, atol=1e-5)
    assert base.chi2 == pytest.approx(chi2, rel=1e-8)
    assert base.freedom == ROWS - 1
    assert base.misfit == pytest.approx((chi2 - base.u[1] ** 2) / (ROWS - 1))


def test_held_out_levels_are_predicted_by_least_squares(made):
    """What has no prior is held near the whole fit by FAR of its scale: hardly at all."""
    base, rows, _ = made
    exact = closed(made)
    whole, _ = exact.solved()
    level = np.tile(base.task.experiment.data.level, 2)
    left = base.task.experiment.rows(held_out_residual(base)) / np.array(linear.SD)[:, None]
    for one in np.unique(level):
        keep = level != one
        anchored = np.diag([FAR**-2, 1.0])
        u = np.linalg.solve(
            exact.X[keep].T @ exact.X[keep] + anchored, exact.X[keep].T @ rows[keep] + [whole[0] * FAR**-2, 0.0]
        )
        np.testing.assert_allclose(left.ravel()[~keep], rows[~keep] - exact.X[~keep] @ u, atol=1e-4)
    assert losses_of(base).sum() == pytest.approx(np.sum(left**2), rel=0.2)


def test_a_level_that_a_fit_has_not_is_not_fitted_without(made, monkeypatch):
    base = made[0]
    good = base.task.noise.good.copy()
    good[2] = False
    task = dataclasses.replace(base.task, noise=dataclasses.replace(base.task.noise, good=good))
    fits = []
    monkeypatch.setattr(cross_validation, "fit", lambda *a, **k: fits.append(a) or fit(*a, **k))
    losses = losses_of(again(dataclasses.replace(base, task=task)))
    assert len(fits) == len(good) - 1
    assert [at for at, one in enumerate(losses) if one == 0.0] == [2]


def test_a_descent_predicts_where_it_ended_once(made, monkeypatch):
    base, asked = made[0], []
    plain = linear.LinearRig.sensitivities

    def noted(self, model, parameters, u):
        asked.append(u.tobytes())
        return plain(self, model, parameters, u)

    monkeypatch.setattr(linear.LinearRig, "sensitivities", noted)
    end = fit(base.task, base.model, base.parameters, base.u + 0.5)
    assert end.u.tobytes() == asked[-1]
    assert len(set(asked)) == len(asked)


def widths(base):
    return np.array([one.high - one.low for one in intervals(settled(base))[1]])


def test_intervals_match_the_noise_and_widen_with_the_misfit():
    """Half-width 1.96 SD of the posterior; where more than the noise is left, in noise as large as that."""
    random = np.random.default_rng(2)
    laws = laws_of(random)
    noise = clipped(random)
    scale = np.array([laws[name].parameter.slope(0.0) for name in FREE])
    sd = np.sqrt(np.diag(linear.gaussian(noise, laws, FREE).covariance())) * scale
    np.testing.assert_allclose(widths(based(noise, laws)), 2 * norm.ppf(0.975) * sd, rtol=2e-3)
    poor = based(1.6 * noise, laws)
    assert not is_adequate(poor)
    wide = np.sqrt(np.diag(linear.gaussian(1.6 * noise, laws, FREE).covariance(poor.misfit))) * scale
    np.testing.assert_allclose(widths(poor), 2 * norm.ppf(0.975) * wide, rtol=2e-2)


def test_slightly_large_noise_does_not_widen_an_interval():
    random = np.random.default_rng(2)
    laws = laws_of(random)
    base = based(1.15 * clipped(random), laws)
    assert base.misfit > 1.0
    assert settled(base) is base


def test_interval_is_that_of_the_covariance_if_profiling_fails(made, monkeypatch):
    def fails(*asked):
        raise OptimisationError("no end")

    profiled = numbers(made[0])
    monkeypatch.setattr(intervals_module, "interval", fails)
    for one, other in zip(numbers(made[0]), profiled, strict=True):
        assert (one.low, one.high) == pytest.approx((other.low, other.high), rel=1e-3)
        assert one.closed


def test_chi2_is_a_surprise_where_its_law_says_so(made):
    base = made[0]
    rows = float(np.sum(base.rows**2))
    for limit, said in ((1e-3, ()), (0.01, (0.01,))):
        for factor in (0.999, 1.001):
            noise = base.task.noise
            scale = math.sqrt(rows / (factor * chi2_law.isf(limit, base.freedom)))
            task = dataclasses.replace(base.task, noise=dataclasses.replace(noise, sd=noise.sd * scale))
            assert is_adequate(dataclasses.replace(base, task=task), *said) == (factor < 1)


# --- refits ----------------------------------------------------------------------------------------------------------


def refits(base, *effects):
    found = [((), one, fitted) for each in tried(base, *effects) for one, fitted in variants(base, each)]
    return rank_refits(base, found, threshold_after((), len(effects), base.task.noise.inflation))


def test_a_single_gains_the_exact_fall_and_predicts_better(made):
    base = made[0]
    best, *others = refits(base, SlipSinkage(), ExitAngle(), LoadExponent())
    _, chi2 = closed(made, "SlipSinkage.n_1").solved()
    assert best.name == "SlipSinkage"
    assert best.gain == pytest.approx(base.chi2 - chi2, rel=1e-4)
    assert best.threshold == pytest.approx(max(1.0, best.fit.misfit) * null_threshold(3))
    assert best.held_out == pytest.approx(losses_of(base).sum() - losses_of(best.fit).sum())
    assert best.accepted
    assert not any(one.accepted for one in others)


def test_gains_count_in_units_of_what_the_best_leaves():
    random = np.random.default_rng(7)
    laws = laws_of(random, SlipSinkage(), ExitAngle())
    base = based(6 * clipped(random) + 8 * laws["SlipSinkage.n_1"].slope, laws)
    found = refits(base, SlipSinkage(), ExitAngle())
    left = min(one.fit.misfit for one in found)
    assert left > 10
    assert [one.unit for one in found] == pytest.approx([left] * 2)
    assert [one.threshold for one in found] == pytest.approx([left * null_threshold(2)] * 2)


@pytest.mark.parametrize(("amplitude", "freed"), [(0.0, ()), (1.5, ("Bulldozing.gamma",))])
def test_shape_is_freed_only_if_it_gains_more_than_its_threshold(amplitude, freed):
    random = np.random.default_rng(3)
    laws = laws_of(random, Bulldozing())
    shape = plain_candidate(Bulldozing()).loose
    laws["Bulldozing.gamma"] = linear.Law(shape.shape("Bulldozing.gamma"), random.normal(size=ROWS))
    rows = rows_of(laws, random, Bulldozing__share=2.0) + amplitude * laws["Bulldozing.gamma"].slope
    (best,) = refits(based(rows, laws), Bulldozing())
    assert best.candidate.free_shapes == freed
    assert best.threshold == pytest.approx(max(1.0, best.fit.misfit) * (null_threshold(1) + FURTHER * len(freed)))
    told = {f"Bulldozing.{part.partition(' = ')[0]}" for part in own_text(best).split("; ")}
    assert told == {"Bulldozing.share", *freed}, "a shape that was freed is told with the size"


def test_a_set_too_small_for_its_numbers_refits_none(made):
    base = made[0]
    few = dataclasses.replace(base.task.noise, good=np.zeros_like(base.task.noise.good))
    few.good[:2, 0, :] = True
    small = dataclasses.replace(base, task=dataclasses.replace(base.task, noise=few))
    (one,) = tried(base, SlipSinkage())
    loose = [dataclasses.replace(each, prior=False) for each in (*base.parameters, *one.parameters) * 2]
    assert bearable(small, loose[:3])
    assert not bearable(small, loose[:4])


def test_two_effects_that_resemble_a_third_are_found_as_a_pair():
    """The third is added first; of the pairs of leading singles the true one leaves least."""
    random = np.random.default_rng(11)
    laws = laws_of(random, SlipSinkage(), ExitAngle())
    both = laws["SlipSinkage.n_1"].slope + laws["ExitAngle.e_1"].slope
    laws |= linear.law_of_size(LoadExponent(), both + 1.0 * random.normal(size=ROWS))
    base = based(rows_of(laws, random, SlipSinkage__n_1=2.0, ExitAngle__e_1=2.0), laws)
    found = search(base, tried(base, SlipSinkage(), ExitAngle(), LoadExponent()), SILENT)
    assert found.rounds[0].indistinguishable[0].name == "LoadExponent"
    assert {one.name for one in found.added} == {"SlipSinkage", "ExitAngle"}
    assert set(found.names.split(" + ")) == {"SlipSinkage", "ExitAngle"}
    pairs = paired(base, found.rounds[0].refits, found.rounds[0].indistinguishable[0], SILENT)
    assert len(pairs) == 3
    assert [instead == () for instead, _, _ in pairs].count(True) == 2


@pytest.mark.parametrize("shape", [True, False])
def test_bent_law_is_replaced_by_the_two_effects_it_imitates(shape):
    """Rows are 2 a + 2 b; SlipSinkage moves a, ExitAngle b - a and gains nothing alone; a third with its shape both."""
    random = np.random.default_rng(5)
    a, b, off, away = np.linalg.qr(random.normal(size=(ROWS, 4)))[0].T * 12
    laws = {name: linear.law_of(name, random.normal(size=ROWS)) for name in FREE}
    laws |= linear.law_of_size(SlipSinkage(), a) | linear.law_of_size(ExitAngle(), b - a)
    laws |= linear.law_of_size(Bulldozing(), a + (0.5 if shape else 0.9) * b + 0.5 * off)
    one = plain_candidate(Bulldozing()).loose.shape("Bulldozing.gamma")
    laws[one.name] = linear.Law(one, (b + 0.5 * away) if shape else 0.01 * away)
    base = based(2 * a + 2 * b + 0.5 * clipped(random), laws)
    found = search(base, tried(base, SlipSinkage(), ExitAngle(), Bulldozing()), SILENT)
    first = found.rounds[0]
    assert first.indistinguishable[0].candidate.free_shapes == (("Bulldozing.gamma",) if shape else ())
    assert next(each.net for each in first.refits if each.name == "ExitAngle") < 0
    steps = _after_plain_laws(
        found, tried(base, SlipSinkage(), ExitAngle(), Bulldozing()), threshold_after((), 3), SILENT
    )
    assert bool(steps) is shape
    if shape:
        assert {each[0].name for each, _, _ in steps} == {"Bulldozing", "SlipSinkage"}
        assert all(each.free_shapes == () for (each,) in (before for before, _, _ in steps))
        assert {each.name for each in found.added} == {"SlipSinkage", "ExitAngle"}


def test_what_only_a_pair_shows_pays_for_both():
    random = np.random.default_rng(4)
    laws = laws_of(random, SlipSinkage(), ExitAngle())
    base = based(clipped(random), laws)
    singles = refits(base, SlipSinkage(), ExitAngle())
    ((_, one, fitted),) = paired(base, singles, None, SILENT)
    fee = threshold_after((), 2, 1.0)
    (pair,) = rank_refits(base, [((singles[0].candidate,), one, fitted)], fee, singles[0].threshold / singles[0].unit)
    assert pair.threshold == pytest.approx(2 * null_threshold(2), rel=0.05)


# --- what cannot be distinguished ------------------------------------------------------------------------------------


def made_refit(name, net, held_out=50.0, unit=1.0):
    candidate = dataclasses.replace(plain_candidate(SlipSinkage()), kind=name)
    return Refit(candidate, None, net + 10.0, 10.0, held_out, unit)


def names(*found):
    return "".join(one.name for one in indistinguishable_refits(found))


def test_the_set_of_rivals():
    best = made_refit("A", 100.0)
    assert names(best, made_refit("B", 100.0 - ODDS + 0.1)) == "AB"
    assert names(best, made_refit("B", 100.0 - ODDS - 0.1)) == "A"
    assert names(made_refit("A", 100.0, unit=3.0), made_refit("B", 100.0 - 3 * ODDS + 0.1)) == "AB"
    assert names(made_refit("A", 100.0, -1.0), made_refit("B", 20.0)) == "BA", "the best is the first accepted"
    assert names(made_refit("A", -1.0)) == ""


def test_a_rival_may_gain_less_where_it_predicts_better():
    best = made_refit("A", 100.0, 50.0)
    assert names(best, made_refit("B", 100.0 * HALF + 1, 50.1)) == "AB"
    assert names(best, made_refit("B", 100.0 * HALF + 1, 49.9)) == "A"
    assert names(best, made_refit("B", 100.0 * HALF - 1, 60.0)) == "A"


# --- answers ---------------------------------------------------------------------------------------------------------


def answered(rows, laws):
    return on_rig(linear.made(rows, laws), linear.MODEL, None, SILENT, 0)


def test_hidden_effect_is_named_in_every_fold_and_errors_fall():
    random = np.random.default_rng(8)
    laws = laws_of(random, SlipSinkage(), ExitAngle())
    found = answered(rows_of(laws, random, SlipSinkage__n_1=2.0), laws)
    assert (found.answer, found.named, found.vetoes) == (Answer.NAMED, ("SlipSinkage",), ())
    assert found.share > 0.8
    size = next(one for one in found.after.numbers if one.name == "SlipSinkage.n_1")
    assert size.low < 1.0 < size.high
    assert all(score.after < score.before for score in found.scores)
    assert set(found.chosen.values()) == {"SlipSinkage"}
    assert found.chosen_again == "SlipSinkage chosen in 8 of 8 folds"
    assert [one.level for one in found.scores[0].levels] == list(found.chosen)


def test_two_that_do_the_same_are_a_set():
    random = np.random.default_rng(9)
    laws = laws_of(random, SlipSinkage())
    same = laws["SlipSinkage.n_1"].slope
    laws |= linear.law_of_size(ExitAngle(), same + 1e-3 * random.normal(size=ROWS))
    found = answered(rows_of(laws, random, SlipSinkage__n_1=2.0), laws)
    assert found.answer is Answer.SET
    assert set(found.indistinguishable) == {"SlipSinkage", "ExitAngle"}
    assert "these cannot be distinguished" in found.sentence


def test_undescribed_misfit_adds_no_effect_and_is_inadequate():
    random = np.random.default_rng(10)
    laws = laws_of(random, SlipSinkage())
    found = answered(clipped(random) + 4 * random.normal(size=ROWS), laws)
    assert (found.answer, found.named, found.share) == (Answer.INADEQUATE, (), 0.0)
    assert found.model is found.before.model
    assert f"the noise may be {np.sqrt(found.before.misfit):.2g} times what is declared" in found.sentence


@pytest.mark.parametrize(("beside", "answer"), [(1.05, Answer.LIKE), (3.0, Answer.INADEQUATE)])
def test_effect_taking_two_thirds_is_missing_in_another_law(beside, answer):
    random = np.random.default_rng(12)
    laws = laws_of(random, SlipSinkage())
    rest = beside * 2.0 * random.normal(size=ROWS)
    found = answered(rows_of(laws, random, SlipSinkage__n_1=3.8) + rest, laws)
    assert found.answer is answer
    if answer is Answer.LIKE:
        assert "something like SlipSinkage is missing" in found.sentence
        assert "its law does not hold exactly" in found.sentence
        assert found.share >= 2 / 3


def test_patternless_residual_is_scatter_and_the_law_holds():
    """Noise of 1.7 times the declared SD: the name would be "like" by the declared noise alone."""
    random = np.random.default_rng(12)
    laws = laws_of(random, SlipSinkage())
    found = answered(rows_of(laws, random, SlipSinkage__n_1=3.0) + 1.4 * random.normal(size=ROWS), laws)
    assert 2.0 < found.after.misfit < 4.0
    assert (found.answer, found.named) == (Answer.NAMED, ("SlipSinkage",))
    assert "What is left is still more than the noise" in found.sentence


def test_each_fold_is_predicted_by_the_choice_made_without_it():
    random = np.random.default_rng(15)
    laws = laws_of(random, SlipSinkage())
    rows = rows_of(laws, random, SlipSinkage__n_1=2.0)
    found = answered(rows, laws)
    assert set(found.chosen.values()) == {"SlipSinkage"}
    names = [one.name for one in found.search.last.parameters]
    missed = np.zeros(ROWS)
    for level in range(linear.LEVELS):
        own = np.tile(np.repeat(np.arange(linear.LEVELS) == level, linear.REPEATS), 2)
        closed = linear.gaussian(rows, laws, names)
        missed[own] = rows[own] - closed.X[own] @ closed.solved(~own)[0]
    rms = np.sqrt(np.mean(missed.reshape(2, -1) ** 2, axis=1)) * linear.SD
    assert list(found.errors_anew.values()) == pytest.approx(rms, rel=1e-3)
    assert "held-out RMSE with each fold's own choice: drawbar pull" in found.summary()


def test_fold_chooses_among_effects_at_their_fitted_size():
    random = np.random.default_rng(14)
    laws = laws_of(random, SlipSinkage())
    found = answered(rows_of(laws, random, SlipSinkage__n_1=2.0), laws)
    (best,) = found.search.best_refits
    assert as_fitted(best.candidate, best.fit).effect.n_1 == best.fit.value("SlipSinkage.n_1")


def test_a_size_at_its_bound_does_not_stand_alone():
    random = np.random.default_rng(13)
    laws = laws_of(random, SlipSinkage())
    found = answered(rows_of(laws, random, SlipSinkage__n_1=4.3), laws)
    assert found.answer is Answer.LIKE
    assert "SlipSinkage.n_1 lies at its bound" in found.vetoes
    assert "does not stand alone: SlipSinkage.n_1 lies at its bound" in found.sentence


def test_choice_of_a_minority_of_folds_does_not_stand_alone(made):
    found = search(made[0], tried(made[0]), SILENT)
    anew = chosen_anew(found.base, tried(made[0], SlipSinkage(), ExitAngle()))
    assert {one.names for one in anew.values()} == {"SlipSinkage"}
    for times, answer in ((5, Answer.NAMED), (4, Answer.LIKE)):
        chosen = {name: "SlipSinkage" if at < times else "ExitAngle" for at, name in enumerate(anew)}
        one = verdict_of(("wheel-rig", "linear"), found, chosen, assess_residual(found), 0)
        assert one.answer is answer
    assert one.vetoes == ("SlipSinkage is chosen in 4 of 8 folds only",)


def test_an_effect_of_one_level_is_not_chosen_without_it():
    random = np.random.default_rng(14)
    laws = laws_of(random)
    slope = np.zeros((2, linear.LEVELS, linear.REPEATS))
    slope[:, -1] = 2.0
    laws |= linear.law_of_size(SlipSinkage(), slope.ravel())
    base = based(rows_of(laws, random, SlipSinkage__n_1=4.0), laws)
    assert list(chosen_anew(base, tried(base, SlipSinkage())).values())[-1].names == ""


def test_noise_needs_no_effect_and_chooses_nothing_in_any_fold():
    random = np.random.default_rng(15)
    laws = laws_of(random, SlipSinkage(), ExitAngle(), LoadExponent())
    found = answered(clipped(random), laws)
    assert (found.answer, found.named) == (Answer.NONE_NEEDED, ())
    assert set(found.chosen.values()) == {""}
    assert "no effect in 8" in found.chosen_again
