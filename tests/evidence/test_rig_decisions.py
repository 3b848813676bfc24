"""The decisions of the loop on rig sets against the linear Gaussian model in closed form, all in milliseconds."""

import dataclasses
import importlib.util
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom, norm
from scipy.stats import chi2 as chi2_law

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.screen import entry_fee
from rover_pin.effects.bulldozing import Bulldozing
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.load_exponent import LoadExponent
from rover_pin.effects.peak_stress import PeakStress
from rover_pin.effects.skid_sinkage import SkidSinkage
from rover_pin.effects.slip_sinkage import SlipSinkage
from rover_pin.errors import OptimisationError
from rover_pin.estimation.wording import Outcome
from rover_pin.experiments.wheel_rig.calibrate import Fitted, calibrate, parameters, remains, settled
from rover_pin.experiments.wheel_rig.candidates import rig_kinds
from rover_pin.experiments.wheel_rig.compare import Candidate, Comparison, compare_pairs, compare_singles
from rover_pin.experiments.wheel_rig.held_out import held_out, loss, scores
from rover_pin.experiments.wheel_rig.reselect import NOTHING, Fold, Reselected, reselect
from rover_pin.experiments.wheel_rig.screen import screen
from rover_pin.loop.rig import answer_of, at_bounds, decide, held_out_share, share_taken, vetoed
from rover_pin.report.rig_cautions import of_choice

_spec = importlib.util.spec_from_file_location("linear_rig", Path(__file__).parent / "linear_rig.py")
linear = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(linear)

ROWS, FREE = 2 * linear.RUNS, linear.FREE
KINDS = rig_kinds()
SILENT = lambda said: None  # noqa: E731

SURPRISE, LEFT, ENOUGH, STABLE, ALIASED, STRAY = 1e-3, 0.01, 0.9, 0.8, 0.03, 4.0
FURTHER, ODDS, MUCH, HALF, SHOWN = 2 * math.log(20), 9.2, 1.25, 0.5, 3
"""The limits as they are stated: to change one is a decision, and a test says so."""


def laws_of(random, *effects, size=1.0):
    """Random laws of the nuisance parameters, and of the sizes of effects: `size` SDs at the default size."""
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


@pytest.fixture(scope="module")
def made():
    """A set that hides 0.6 of the default slip-sinkage among two nuisance parameters, one with a prior."""
    random = np.random.default_rng(5)
    laws = laws_of(random, SlipSinkage(), ExitAngle(), LoadExponent(), SkidSinkage())
    rows = rows_of(laws, random, SlipSinkage__n_1=1.0)
    setting = linear.setting(rows, laws)
    return setting, calibrate(setting, linear.MODEL), rows, laws


def closed(made, *names):
    _, _, rows, laws = made
    return linear.gaussian(rows, laws, (*FREE, *names))


# --- the fit ---------------------------------------------------------------------------------------------------------


def test_the_fit_is_least_squares_with_priors(made):
    setting, base, *_ = made
    u, chi2 = closed(made).solved()
    np.testing.assert_allclose(base.u, u, atol=1e-5)
    assert base.chi2 == pytest.approx(chi2, rel=1e-8)
    freedom = ROWS + 1 - 2
    assert base.problem.freedom == freedom
    assert base.misfit == pytest.approx(chi2 / freedom)
    problem = setting.problem(linear.MODEL)
    assert problem.keeping(setting.data.level != 0).freedom == freedom - 2 * linear.REPEATS


def test_levels_left_out_are_predicted_by_exact_least_squares_on_the_others(made):
    setting, base, *_ = made
    exact = closed(made).held_out(setting.data.level)
    np.testing.assert_allclose(held_out(setting.data, base), exact, atol=1e-5)
    assert loss(exact) == pytest.approx(np.mean(exact**2))
    assert loss(np.array([1.0, 5.0, -5.0])) == pytest.approx((1 + 2 * (2 * STRAY * 5 - STRAY**2)) / 3)


def test_chi2_is_a_surprise_where_its_law_says_so(made):
    _, base, *_ = made
    freedom = base.problem.freedom
    for surprise, said in ((SURPRISE, ()), (0.01, (0.01,))):
        limit = chi2_law.isf(surprise, freedom)
        for factor in (0.999, 1.001):
            one = SimpleNamespace(problem=SimpleNamespace(freedom=freedom, widen=1.0), chi2=factor * limit)
            assert remains(one, *said) == (factor > 1)
    widened = SimpleNamespace(problem=SimpleNamespace(freedom=freedom, widen=2.0), chi2=limit / 3)
    assert remains(widened, 0.01), "chi2 of SDs that were doubled counts four times"


def intervals(fit):
    _, fitted = parameters(settled(fit))
    return np.array([one.high - one.low for one in fitted])


def test_intervals_are_those_of_the_noise_and_widened_where_more_is_left():
    """Half-width 1.96 SD of the posterior; where more than the noise is left, times the root of chi2 over freedom."""
    random = np.random.default_rng(2)
    laws = laws_of(random)
    noise = clipped(random)
    scale = np.array([laws[name].coordinate.slope(0.0) for name in FREE])
    sd = np.sqrt(np.diag(linear.gaussian(noise, laws, FREE).covariance())) * scale
    fit = calibrate(linear.setting(noise, laws), linear.MODEL)
    np.testing.assert_allclose(intervals(fit), 2 * norm.ppf(0.975) * sd, rtol=1e-3)
    poor = calibrate(linear.setting(1.6 * noise, laws), linear.MODEL)
    assert remains(poor)
    assert poor.misfit > 1.5
    exact = linear.gaussian(1.6 * noise, laws, FREE)
    widened = exact.covariance()
    widened = np.linalg.inv(exact.X.T @ exact.X / poor.misfit + np.diag(exact.sd**-2.0))
    np.testing.assert_allclose(intervals(poor), 2 * norm.ppf(0.975) * np.sqrt(np.diag(widened)) * scale, rtol=2e-2)


def test_noise_by_chance_a_little_large_does_not_widen_an_interval():
    random = np.random.default_rng(2)
    laws = laws_of(random)
    noise = 1.15 * clipped(random)
    fit = calibrate(linear.setting(noise, laws), linear.MODEL)
    assert fit.misfit > 1.0
    assert not remains(fit)
    assert settled(fit).problem.widen == 1.0


def fails(*asked):
    raise OptimisationError("no end")


def test_where_no_profile_ends_the_interval_is_that_of_the_covariance(made, monkeypatch):
    _, base, *_ = made
    _, profiled = parameters(base)
    monkeypatch.setattr("rover_pin.experiments.wheel_rig.calibrate.interval", fails)
    _, local = parameters(base)
    for one, other in zip(local, profiled, strict=True):
        assert (one.low, one.high) == pytest.approx((other.low, other.high), rel=1e-3)
        assert one.closed
        assert one.prior == other.prior
    assert [one.prior for one in local] == ["", "0.143 +- 0.1"]


@pytest.mark.parametrize("size", [1e-3, 1e-2])
def test_an_interval_that_a_bound_cuts_is_not_closed(size, monkeypatch):
    """phi within 0 and 60 deg; the same whether profiles or the covariance say it."""
    random = np.random.default_rng(2)
    laws = {"phi": linear.law_of("phi", size * random.normal(size=ROWS))}
    fit = calibrate(linear.setting(0.1 * clipped(random), laws, ("phi",), {}), linear.MODEL)
    (profiled,) = parameters(fit)[1]
    monkeypatch.setattr("rover_pin.experiments.wheel_rig.calibrate.interval", fails)
    (local,) = parameters(fit)[1]
    for one in (profiled, local):
        assert not one.closed
        assert (one.low, one.high) == pytest.approx((0.0, math.radians(60)), abs=1e-9)
        assert one.covered == pytest.approx(1.0)


def test_a_value_lies_at_its_bound_where_the_interval_is_open_and_ends_there():
    def fitted(value, closed=False):
        return Fitted("k", "m", value, 1.0, 3.0, closed, "").at_bound

    assert fitted(1.0)
    assert fitted(3.0)
    assert fitted(1.0 + 1.9e-6)
    assert not fitted(1.0 + 2.1e-6)
    assert not fitted(3.0 - 2.1e-6)
    assert not fitted(2.0)
    assert not fitted(1.0, closed=True)


# --- the score test --------------------------------------------------------------------------------------------------


def test_the_score_is_the_exact_fall_of_chi2(made):
    setting, base, *_ = made
    found = {row.name: row for row in screen(setting, base, KINDS)}
    for name, size in (("SlipSinkage", "n_1"), ("ExitAngle", "e_1"), ("LoadExponent", "n_h")):
        _, chi2 = closed(made, f"{name}.{size}").solved()
        assert found[name].gain == pytest.approx(base.chi2 - chi2, rel=1e-5, abs=1e-6)
    assert next(iter(found)) == "SlipSinkage"
    slopes = closed(made, "SlipSinkage.n_1")
    matrix = np.vstack([slopes.X[:, :2], np.diag(1 / slopes.sd)[1:2, :2]])
    moved = np.concatenate([slopes.X[:, 2], [0.0]])
    own = moved - matrix @ np.linalg.lstsq(matrix, moved, rcond=None)[0]
    assert found["SlipSinkage"].visible == pytest.approx(np.linalg.norm(own), rel=1e-6)
    assert found["SlipSinkage"].smallest == pytest.approx(math.sqrt(entry_fee(len(KINDS))) / np.linalg.norm(own))


def test_a_size_that_may_not_be_negative_gains_nothing_the_other_way():
    random = np.random.default_rng(1)
    laws = laws_of(random, SlipSinkage(), ExitAngle())
    setting = linear.setting(rows_of(laws, random, SlipSinkage__n_1=-1.0, ExitAngle__e_1=-1.0), laws)
    found = {row.name: row for row in screen(setting, calibrate(setting, linear.MODEL), KINDS)}
    assert found["SlipSinkage"].gain < 1e-9, "n_1 is at least 0"
    assert found["ExitAngle"].gain > 5.0, "e_1 may have either sign"


def test_what_moves_nothing_or_what_the_nuisances_imitate_is_not_told():
    random = np.random.default_rng(1)
    laws = laws_of(random, ExitAngle())
    phi = laws["phi"].slope
    across = random.normal(size=ROWS)
    across -= phi * (phi @ across) / (phi @ phi)
    across *= np.linalg.norm(phi) / np.linalg.norm(across)
    told = []
    for share in (0.5 * ALIASED, 3 * ALIASED):
        both = laws | linear.law_of_size(SlipSinkage(), phi + share * across)
        setting = linear.setting(rows_of(both, random), both)
        found = {row.name: row for row in screen(setting, calibrate(setting, linear.MODEL), KINDS)}
        told.append(found["SlipSinkage"].told)
        assert found["Bulldozing"].note == "moves nothing that was measured here"
        assert not found["Bulldozing"].told
    assert told == [False, True]


def test_the_fee_leaves_noise_one_chance_in_twenty():
    """Of many sets of noise: the best of 12 candidates pays it seldom, and half of it often."""
    best = (np.random.default_rng(0).normal(size=(20000, 12)) ** 2).max(axis=1)
    assert np.mean(best > entry_fee(12)) < 0.05
    assert np.mean(best > entry_fee(12) / 2) > 0.05
    assert entry_fee(12) == pytest.approx(2 * math.log(240))


# --- candidates compared ---------------------------------------------------------------------------------------------


def test_a_single_gains_the_exact_fall_and_pays_for_what_it_frees(made):
    setting, base, *_ = made
    screened = screen(setting, base, KINDS)
    found = compare_singles(setting, base, screened)
    best = found.best
    assert best.name == "SlipSinkage"
    exact = closed(made, "SlipSinkage.n_1")
    _, chi2 = exact.solved()
    left = max(1.0, best.fit.misfit)
    assert best.gain == pytest.approx((base.chi2 - chi2) / left, rel=1e-5)
    assert best.fee == pytest.approx(entry_fee(len(screened)))
    assert best.loss == pytest.approx(np.mean(exact.held_out(setting.data.level) ** 2), rel=1e-4)
    assert best.reference_loss == pytest.approx(loss(closed(made).held_out(setting.data.level)), rel=1e-4)
    assert [one.name for one in found.alike] == ["SlipSinkage"]


def test_every_candidate_that_may_pay_is_refitted_and_five_at_least():
    """Seven hidden effects are all refitted; without any, the five that promise most."""
    random = np.random.default_rng(1)
    kinds = [kind() for kind in KINDS if len(kind.neutral) == 1][:10]
    laws = laws_of(random, *kinds)
    names = [next(iter(linear.law_of_size(effect, np.zeros(ROWS)))) for effect in kinds]
    hidden = {name.replace(".", "__"): 0.9 for name in names[:7]}
    for shares in (hidden, {}):
        setting = linear.setting(rows_of(laws, random, **shares), laws)
        base = calibrate(setting, linear.MODEL)
        screened = screen(setting, base, KINDS)
        told = [row for row in screened if row.told]
        paying = [row.name for row in told if row.gain > entry_fee(len(screened)) / 4]
        refitted = {one.name for one in compare_singles(setting, base, screened).ranked}
        assert refitted == {row.name for row in told[:5]} | set(paying)
        assert (len(paying) > 5) == bool(shares)
        assert len(told) > len(refitted)


def test_where_much_is_left_gains_count_in_its_units(made):
    _, _, rows, laws = made
    louder = linear.setting(2.5 * rows, laws)
    base = calibrate(louder, linear.MODEL)
    found = compare_singles(louder, base, screen(louder, base, KINDS))
    left = min(one.fit.misfit for one in found.ranked)
    assert left > 2.0
    for one in found.ranked:
        assert one.gain == pytest.approx((base.chi2 - one.fit.chi2) / left, rel=1e-6)


def test_a_shape_that_is_freed_too_pays_its_own_fee():
    random = np.random.default_rng(3)
    laws = laws_of(random, Bulldozing())
    shaped = linear.MODEL.having(Bulldozing())
    laws["Bulldozing.gamma"] = linear.law_of("Bulldozing.gamma", 3 * random.normal(size=ROWS), shaped)
    rows = rows_of(laws, random, Bulldozing__share=1.0, Bulldozing__gamma=0.8)
    setting = linear.setting(rows, laws)
    base = calibrate(setting, linear.MODEL)
    screened = screen(setting, base, KINDS)
    (best, *_) = compare_singles(setting, base, screened).ranked
    assert "Bulldozing.gamma" in best.fit.problem.space.names
    freed = len(best.fit.problem.space.names) - len(FREE)
    assert best.fee == pytest.approx(entry_fee(len(screened)) + FURTHER * (freed - 1))
    assert freed == 3


@pytest.mark.parametrize(("amplitude", "freed"), [(0.42, 1), (0.66, 3)])
def test_a_shape_is_freed_only_where_it_gains_more_than_its_fee(amplitude, freed):
    """gamma gains 48 amplitude^2 or so, 8 or 21; with the other shape it costs 2 x 6, whatever the effect costs."""
    random = np.random.default_rng(3)
    laws = laws_of(random, Bulldozing())
    shaped = linear.MODEL.having(Bulldozing())
    laws["Bulldozing.gamma"] = linear.law_of("Bulldozing.gamma", random.choice([-1.0, 1.0], ROWS), shaped)
    setting = linear.setting(rows_of(laws, random, Bulldozing__share=1.0, Bulldozing__gamma=amplitude), laws)
    base = calibrate(setting, linear.MODEL)
    (best, *_) = compare_singles(setting, base, screen(setting, base, KINDS)).ranked
    assert len(best.fit.u) == len(FREE) + freed


def test_a_pair_pays_for_both_or_for_the_one_that_it_adds():
    random = np.random.default_rng(4)
    laws = laws_of(random, SlipSinkage(), ExitAngle())
    setting = linear.setting(rows_of(laws, random, SlipSinkage__n_1=0.8, ExitAngle__e_1=0.8), laws)
    base = calibrate(setting, linear.MODEL)
    screened = screen(setting, base, KINDS)
    singles = compare_singles(setting, base, screened)
    further = screen(setting, singles.best.fit, KINDS)
    pairs = compare_pairs(setting, base, singles, further)
    best = pairs.best
    assert set(best.name.split(" + ")) == {"SlipSinkage", "ExitAngle"}
    _, chi2 = linear.gaussian(rows_of_setting(setting), laws, (*FREE, "SlipSinkage.n_1", "ExitAngle.e_1")).solved()
    assert best.fit.chi2 == pytest.approx(chi2, rel=1e-5)
    assert best.gain == pytest.approx((singles.best.fit.chi2 - chi2) / max(1.0, best.fit.misfit), rel=1e-4)
    assert best.fee == pytest.approx(entry_fee(len(screened)))
    refused = tuple(dataclasses.replace(one, loss=math.inf) for one in singles.ranked)
    without = compare_pairs(setting, base, Comparison(refused), screened)
    both = [one for one in without.ranked if len(one.fit.u) == len(FREE) + 2]
    assert both, "a pair where no single was accepted"
    assert all(one.fee == pytest.approx(2 * entry_fee(len(screened))) for one in both)


def test_a_pair_pays_for_each_shape_that_it_frees():
    """The best single has one size; the other of the pair brings its size and two shapes, of which one helps."""
    random = np.random.default_rng(3)
    laws = laws_of(random, Bulldozing(), SlipSinkage(), size=2.0)
    shaped = linear.MODEL.having(Bulldozing())
    laws["Bulldozing.gamma"] = linear.law_of("Bulldozing.gamma", 3 * random.normal(size=ROWS), shaped)
    shares = {"SlipSinkage__n_1": 1.8, "Bulldozing__share": 0.7, "Bulldozing__gamma": 1.0}
    setting = linear.setting(rows_of(laws, random, **shares), laws)
    base = calibrate(setting, linear.MODEL)
    singles = compare_singles(setting, base, screen(setting, base, KINDS))
    assert singles.best.name == "SlipSinkage"
    further = screen(setting, singles.best.fit, KINDS)
    found = compare_pairs(setting, base, singles, further).ranked
    more = [len(one.fit.u) - (len(FREE) + 2) for one in found]
    assert max(more) == 2
    assert [one.fee for one in found] == pytest.approx([entry_fee(len(further) + 1) + FURTHER * each for each in more])


def rows_of_setting(setting):
    pull, depth = setting.data.rig.channels
    return np.concatenate([pull.measured / pull.sd, (depth.measured - linear.DEPTH) / depth.sd])


def test_a_set_too_small_for_its_parameters_refits_none():
    random = np.random.default_rng(4)
    laws = laws_of(random, SlipSinkage())
    setting = linear.setting(rows_of(laws, random, SlipSinkage__n_1=1.0), laws)
    few = setting.data.rows(np.isin(np.arange(linear.RUNS), (0, 23)))
    small = linear.LinearSetting(few, FREE, linear.PRIOR, 0, {name: cut(law) for name, law in laws.items()})
    base = calibrate(small, linear.MODEL)
    found = compare_singles(small, base, screen(small, base, KINDS))
    assert [len(one.fit.u) for one in found.ranked] == [3]


def cut(law):
    return linear.Law(law.coordinate, law.zero, law.slope.reshape(2, -1)[:, [0, 23]].ravel())


# --- accepted, and told apart ----------------------------------------------------------------------------------------

KIND = {"A": SlipSinkage(), "B": ExitAngle(), "C": LoadExponent(), "D": SkidSinkage()}


def candidate(name, net, held=1.0, without=2.0, fee=10.0):
    return Candidate((KIND[name],), SimpleNamespace(misfit=1.0), fee, net + fee, held, without)


def alike(*made):
    inverse = {type(effect).__name__: name for name, effect in KIND.items()}
    return "".join(inverse[one.name] for one in Comparison(made).alike)


@pytest.mark.parametrize(
    ("net", "held", "accepted"), [(1, 1.9, True), (0, 1, False), (-1, 1, False), (1, 2.0, False), (1, math.nan, False)]
)
def test_a_candidate_gains_more_than_chance_and_predicts_better(net, held, accepted):
    assert candidate("A", net, held).accepted == accepted


def test_the_best_is_the_first_accepted():
    first, second = candidate("A", 50.0, held=3.0), candidate("B", 40.0)
    assert Comparison((first, second)).best is second
    assert Comparison((first,)).best is None
    assert alike(first) == ""


def test_the_set_of_rivals():
    best = candidate("A", 100.0)
    assert alike(best, candidate("B", 100.0 - ODDS + 0.1)) == "AB"
    assert alike(best, candidate("B", 100.0 - ODDS - 0.1)) == "A"
    assert alike(candidate("A", 5.0), candidate("B", 0.1)) == "AB"
    assert alike(candidate("A", 5.0), candidate("B", -0.1)) == "A"
    near = 100.0 - ODDS + 0.1
    assert alike(best, candidate("B", near, held=MUCH * 2.0 - 0.01)) == "AB"
    assert alike(best, candidate("B", near, held=MUCH * 2.0 + 0.01)) == "A"


def test_a_rival_may_gain_less_where_it_predicts_better():
    best = candidate("A", 100.0)
    assert alike(best, candidate("B", HALF * 100 + 1, held=0.9)) == "AB"
    assert alike(best, candidate("B", HALF * 100 - 1, held=0.9)) == "A"
    assert alike(best, candidate("B", HALF * 100 + 1, held=1.1)) == "A"


# --- the answer ------------------------------------------------------------------------------------------------------


def fit_of(chi2, freedom=50, widen=1.0):
    return SimpleNamespace(chi2=chi2, problem=SimpleNamespace(freedom=freedom, widen=widen))


@pytest.mark.parametrize(
    ("base", "last", "share"),
    [(150.0, 50.0, 1.0), (150.0, 100.0, 0.5), (150.0, 150.0, 0.0), (150.0, 30.0, 1.0), (40.0, 30.0, 1.0)],
)
def test_the_share_that_was_taken_is_of_what_is_beyond_the_noise(base, last, share):
    best = SimpleNamespace(fit=fit_of(last))
    assert share_taken(fit_of(base), best) == pytest.approx(share)
    assert share_taken(fit_of(base), None) == 0.0


SURPRISING, UNLIKELY, LIKELY = (chi2_law.isf(p, 50) for p in (SURPRISE / 2, LEFT / 2, LEFT * 2))


def compared(*chi2):
    """Accepted candidates of equal gain whose fits leave these chi2."""
    pairs = zip(KIND.values(), chi2, strict=False)
    return Comparison(tuple(Candidate((effect,), fit_of(each), 1.0, 50.0, 1.0, 2.0) for effect, each in pairs))


@pytest.mark.parametrize(
    ("base", "chosen", "explained", "poor", "answer"),
    [
        (900.0, compared(50.0), 0.99, False, Answer.NAMED),
        (900.0, compared(50.0, 51.0), 0.99, False, Answer.SET),
        (900.0, compared(50.0, 51.0, 52.0), 0.99, False, Answer.SET),
        (SURPRISING, Comparison(), 0.0, False, Answer.NONE_FITS),
        (LIKELY, Comparison(), 0.0, False, Answer.NONE_NEEDED),
        (900.0, compared(UNLIKELY), ENOUGH - 0.01, False, Answer.NONE_FITS),
        (900.0, compared(UNLIKELY), ENOUGH + 0.01, False, Answer.NAMED),
        (900.0, compared(LIKELY), ENOUGH - 0.01, False, Answer.NAMED),
        (900.0, compared(50.0), 0.99, True, Answer.CANNOT_TELL),
        (900.0, None, 0.0, False, Answer.CANNOT_TELL),
    ],
)
def test_the_answer(base, chosen, explained, poor, answer):
    assert answer_of(fit_of(base), chosen, explained, poor) is answer


@pytest.mark.parametrize(("loss", "answer"), [(3.9, Answer.LIKE), (4.1, Answer.NONE_FITS), (10.0, Answer.NONE_FITS)])
def test_an_effect_that_takes_two_thirds_on_held_out_levels_is_what_is_missing_in_another_law(loss, answer):
    """Of a loss of 10, where 1 is the noise, two thirds are taken at 4."""
    single = Candidate((SlipSinkage(),), fit_of(UNLIKELY), 1.0, 50.0, loss, 10.0)
    found = answer_of(fit_of(900.0), compared(UNLIKELY), ENOUGH - 0.01, False, single)
    assert found is answer
    assert answer_of(fit_of(900.0), compared(UNLIKELY), ENOUGH + 0.01, False, single) is Answer.NAMED
    assert held_out_share(single) == pytest.approx((10.0 - loss) / 9.0)
    assert held_out_share(None) == held_out_share(dataclasses.replace(single, reference_loss=0.9)) == 0.0


def test_what_speaks_against_a_lone_name_is_in_the_headline():
    random = np.random.default_rng(6)
    laws = laws_of(random, SlipSinkage(), ExitAngle(), size=4.0)
    named = decided(rows_of(laws, random, SlipSinkage__n_1=1.2), laws)
    assert vetoed(named, ()) is named
    assert at_bounds(named) == ()
    found = vetoed(named, ("SlipSinkage.n_1 lies at its bound",))
    assert found.answer is Answer.LIKE
    assert found.effects == named.effects
    assert found.sentence.endswith("But the name does not stand alone: SlipSinkage.n_1 lies at its bound.")
    assert found.as_dict()["vetoes"] == ["SlipSinkage.n_1 lies at its bound"]
    other = dataclasses.replace(named, answer=Answer.SET)
    assert vetoed(other, ("anything",)) is other


def test_a_size_at_its_bound_does_not_stand_alone():
    random = np.random.default_rng(6)
    laws = laws_of(random, SlipSinkage(), ExitAngle(), size=4.0)
    found = decided(rows_of(laws, random, SlipSinkage__n_1=4.05), laws)
    assert found.effects[0].n_1 == 2.0
    assert (found.answer, found.vetoes) == (Answer.LIKE, ("SlipSinkage.n_1 lies at its bound",))
    usual = dataclasses.replace(found, effects=(PeakStress(share=1.0),), vetoes=())
    (side,) = [one for one in found.after.parameters if one.name == "SlipSinkage.n_1"]
    share = side._replace(name="PeakStress.share", value=1.0, low=0.9, high=1.0)
    usual = dataclasses.replace(usual, after=dataclasses.replace(found.after, parameters=(share,)))
    assert share.at_bound
    assert at_bounds(usual) == (), "there the law is as published"


# --- the whole -------------------------------------------------------------------------------------------------------


def decided(rows, laws):
    setting = linear.setting(rows, laws)
    return decide(setting, calibrate(setting, linear.MODEL), None, SILENT)


def test_a_hidden_effect_is_named_and_its_errors_fall():
    random = np.random.default_rng(6)
    laws = laws_of(random, SlipSinkage(), ExitAngle(), size=4.0)
    verdict = decided(rows_of(laws, random, SlipSinkage__n_1=1.2), laws)
    assert verdict.answer is Answer.NAMED
    assert verdict.alike == ("SlipSinkage",)
    assert verdict.effects[0].n_1 == pytest.approx(0.6, abs=0.05)
    assert verdict.explained > 0.95
    assert verdict.model.effects[-1] is verdict.effects[0]
    assert all(score.worded.outcome is Outcome.BETTER for score in verdict.scores)
    assert "consistent with SlipSinkage, which takes" in verdict.sentence
    one = next(row for row in verdict.after.parameters if row.name == "SlipSinkage.n_1")
    assert one.low < 0.6 < one.high


def test_two_that_do_the_same_are_a_set():
    random = np.random.default_rng(6)
    laws = laws_of(random, SlipSinkage(), size=4.0)
    laws |= linear.law_of_size(ExitAngle(), laws["SlipSinkage.n_1"].slope + 0.05 * random.normal(size=ROWS))
    verdict = decided(rows_of(laws, random, SlipSinkage__n_1=0.6), laws)
    assert verdict.answer is Answer.SET
    assert set(verdict.alike) == {"SlipSinkage", "ExitAngle"}
    assert len(verdict.effects) == 1
    assert "do not tell" in verdict.sentence


def test_what_is_on_no_list_is_none_of_these_and_nothing_is_added():
    random = np.random.default_rng(6)
    laws = laws_of(random, SlipSinkage(), ExitAngle())
    unlisted = np.where(np.arange(ROWS) % 2, 3.0, -3.0)
    verdict = decided(rows_of(laws, random) + unlisted, laws)
    assert verdict.answer is Answer.NONE_FITS
    assert verdict.effects == ()
    assert verdict.model == verdict.before.model
    assert all(score.worded.outcome is Outcome.NONE for score in verdict.scores)
    assert "no candidate explains it" in verdict.sentence


def test_an_effect_that_takes_a_part_only_is_mentioned_and_not_added():
    random = np.random.default_rng(6)
    laws = laws_of(random, SlipSinkage(), size=2.0)
    rows = rows_of(laws, random, SlipSinkage__n_1=1.0) + np.where(np.arange(ROWS) % 2, 2.0, -2.0)
    verdict = decided(rows, laws)
    assert verdict.answer is Answer.NONE_FITS
    assert verdict.alike == ("SlipSinkage",)
    assert 0.2 < verdict.explained < ENOUGH
    assert verdict.effects == ()
    assert f"The nearest, SlipSinkage, takes {verdict.explained:.0%}" in verdict.sentence


def test_noise_needs_no_effect_and_two_levels_cannot_tell():
    random = np.random.default_rng(8)
    laws = laws_of(random, SlipSinkage(), ExitAngle())
    rows = rows_of(laws, random)
    assert decided(rows, laws).answer is Answer.NONE_NEEDED
    setting = linear.setting(rows, laws)
    few = setting.data.rows(setting.data.level < 2)
    keep = np.flatnonzero(np.tile(setting.data.level < 2, 2))
    cut_laws = {name: linear.Law(law.coordinate, law.zero, law.slope[keep]) for name, law in laws.items()}
    small = linear.LinearSetting(few, FREE, linear.PRIOR, 0, cut_laws)
    verdict = decide(small, calibrate(small, linear.MODEL), None, SILENT)
    assert verdict.answer is Answer.CANNOT_TELL
    assert verdict.scores == ()
    assert verdict.effects == ()


# --- held-out scores -------------------------------------------------------------------------------------------------


def test_scores_are_errors_in_the_channels_units_with_their_levels(made):
    data = made[0].data
    random = np.random.default_rng(0)
    before, after = 2 * random.normal(size=(2, 2, linear.RUNS))
    for row, (score, sd) in enumerate(zip(scores(data, before, after, 0), linear.SD, strict=True)):
        assert score.before == pytest.approx(sd * np.sqrt(np.mean(before[row] ** 2)))
        assert score.after == pytest.approx(sd * np.sqrt(np.mean(after[row] ** 2)))
        assert score.floor == pytest.approx(sd)
        assert score.change == pytest.approx(score.after / score.before - 1)
        for number, level in enumerate(score.levels):
            own = data.level == number
            assert level.before == pytest.approx(sd * np.sqrt(np.mean(before[row, own] ** 2)))
            assert level.after == pytest.approx(sd * np.sqrt(np.mean(after[row, own] ** 2)))


def test_the_interval_of_a_change_is_that_of_resampled_levels(made):
    """Half of the eight levels fall from 2 to 1 SD: the binomial law gives the ends."""
    data = made[0].data
    before = np.full((2, linear.RUNS), 2.0)
    after = np.where(data.level < 4, 1.0, before)
    fell = [math.sqrt(1 - 0.75 * binom.ppf(share, 8, 0.5) / 8) - 1 for share in (0.975, 0.025)]
    for score in scores(data, before, after, 0):
        assert (score.low, score.high) == pytest.approx(fell)
    same = scores(data, before, before, 0)[0]
    assert same.worded.outcome is Outcome.NONE


# --- the choice made anew --------------------------------------------------------------------------------------------


def chosen_anew(laws, rows):
    setting = linear.setting(rows, laws)
    base = calibrate(setting, linear.MODEL)
    screened = screen(setting, base, KINDS)
    singles = compare_singles(setting, base, screened)
    further = screen(setting, singles.best.fit, KINDS) if singles.best else screened
    pairs = compare_pairs(setting, base, singles, further)
    return setting, reselect(setting.data, base, singles, pairs)


def test_an_effect_of_every_level_is_chosen_without_any_one_of_them():
    random = np.random.default_rng(6)
    laws = laws_of(random, SlipSinkage(), ExitAngle(), size=4.0)
    rows = rows_of(laws, random, SlipSinkage__n_1=1.0)
    setting, again = chosen_anew(laws, rows)
    assert [fold.chosen for fold in again.folds] == ["SlipSinkage"] * linear.LEVELS
    assert [fold.level for fold in again.folds] == list(setting.data.level_names)
    exact = linear.gaussian(rows, laws, (*FREE, "SlipSinkage.n_1")).held_out(setting.data.level)
    np.testing.assert_allclose(again.residual, exact, atol=1e-4)


def test_an_effect_of_one_level_is_not_chosen_without_it():
    random = np.random.default_rng(6)
    laws = laws_of(random, ExitAngle())
    slope = np.zeros((2, linear.RUNS))
    slope[:, -linear.REPEATS :] = 3.0
    laws |= linear.law_of_size(SlipSinkage(), slope.ravel())
    _, again = chosen_anew(laws, rows_of(laws, random, SlipSinkage__n_1=1.2))
    assert again.folds[-1].chosen == NOTHING


def test_a_fold_counts_gains_in_units_of_what_is_left():
    """With four times the noise left, 30 of chi2 by two more shapes are worth 7.5, less than their fee of 12."""
    random = np.random.default_rng(2)
    laws = laws_of(random)
    main, aside = random.choice([-1.0, 1.0], (2, ROWS))
    laws |= linear.law_of_size(SlipSinkage(), main) | linear.law_of_size(Bulldozing(), aside)
    laws["Bulldozing.gamma"] = linear.law_of("Bulldozing.gamma", main, linear.MODEL.having(Bulldozing()))
    rows = 3.0 * main + 0.8 * aside + 2 * clipped(random)
    setting = linear.setting(rows, laws)
    base = calibrate(setting, linear.MODEL)
    singles = compare_singles(setting, base, screen(setting, base, KINDS))
    by_name = {one.name: one for one in singles.ranked}
    assert by_name["Bulldozing"].fit.chi2 < by_name["SlipSinkage"].fit.chi2 - 15
    assert by_name["Bulldozing"].fee == pytest.approx(by_name["SlipSinkage"].fee + 2 * FURTHER)
    assert by_name["Bulldozing"].accepted
    assert singles.best.name == "SlipSinkage"
    again = reselect(setting.data, base, singles, Comparison())
    assert {fold.chosen for fold in again.folds} == {"SlipSinkage"}


def test_noise_chooses_nothing_in_any_fold():
    random = np.random.default_rng(8)
    laws = laws_of(random, SlipSinkage(), ExitAngle())
    _, again = chosen_anew(laws, rows_of(laws, random))
    assert {fold.chosen for fold in again.folds} == {NOTHING}


def test_a_choice_that_most_folds_do_not_make_is_a_caution():
    def said(*chosen):
        folds = tuple(Fold(str(at), one) for at, one in enumerate(chosen))
        return of_choice("A", Reselected(folds, np.zeros((2, 2))), Comparison())

    most = math.ceil(STABLE * 10)
    assert said(*["A"] * most, *["B"] * (10 - most)) == []
    (line,) = said(*["A"] * (most - 1), *["B"] * (11 - most))
    assert line == f"only {most - 1} of 10 folds choose A; the others B"
    assert said(*["A"] * 5) == ["5 levels are few: the intervals of held-out errors resample 5 numbers"]
    assert said(*["A"] * 6) == []


def test_only_the_leaders_are_held_out(made):
    setting, base, *_ = made
    found = compare_singles(setting, base, screen(setting, base, KINDS))
    judged = [math.isfinite(one.loss) for one in found.ranked]
    assert judged[:SHOWN] == [True] * SHOWN
    assert not any(one.net > 0 and not finite for one, finite in zip(found.ranked, judged, strict=True))
