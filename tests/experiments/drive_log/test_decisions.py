"""The decisions of the loop on drive logs against the linear Gaussian model in closed form, all in milliseconds."""

import dataclasses
import importlib.util
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize_scalar
from scipy.stats import binom, norm
from scipy.stats import t as student

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.cross_validation import (
    first_order_surprises,
    losses_of,
    refitted_surprises,
    seen_again,
    without_each,
)
from rover_pin.discrepancy.decide_answer import ResidualAssessment, answer_of, chosen_without, share_taken
from rover_pin.discrepancy.held_out import held_out, together
from rover_pin.discrepancy.refit import Refit, indistinguishable_refits, joined
from rover_pin.discrepancy.refit_candidates import refit
from rover_pin.discrepancy.screen import Signature, candidate_threshold, saturated, score, signatures, started, trials
from rover_pin.discrepancy.search import Round, Search, search, threshold_after
from rover_pin.effects.dead_band import DeadBand
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.gear_friction import GearFriction
from rover_pin.effects.hard_patch import HardPatch
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.torque_saturation import TorqueSaturation
from rover_pin.effects.viscous_friction import ViscousFriction
from rover_pin.estimation.fit import fit
from rover_pin.estimation.gauss_newton import at
from rover_pin.estimation.noise import huber
from rover_pin.estimation.numbers import numbers
from rover_pin.estimation.profile import NORMAL_95
from rover_pin.estimation.random_effects.random_field import Kind, LearntSd, RandomField, random_effects_filter
from rover_pin.experiments.drive_log.candidates import candidates
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.loop.drive import is_unknown, verdict_on
from rover_pin.report.drive.report import sides_of


def module(name):
    spec = importlib.util.spec_from_file_location(name, Path(__file__).parent / f"{name}.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


linear, channels = module("linear_drive"), module("drive_channels")

OWNER = linear.owner_of_rows()
SILENT = lambda line: None  # noqa: E731

ODDS, MOST, FAR, UNKNOWN, MUCH = 13.0, 3, 3.0, 90.0, 0.1
COLOURED, SOUGHT, ROUGH, STILL, MULTIPLES = 1.5, 3.0, 0.01, 0.3, (0.8, 1.2, 1.8, 2.7)
"""The limits as they are stated: to change one is a decision, and a test says so."""


def candidate(effect, place=""):
    own = type(effect).__name__
    sizes = tuple(f"{own}.{name}" for name in effect.neutral)
    return Candidate(own, effect, sizes, place=place, place_searched=bool(place))


EXIT, VISCOUS, BAND = (candidate(effect) for effect in (ExitAngle(), ViscousFriction(), DeadBand()))
FREED = Candidate("WeakMotor", None, ("WeakMotor[0].g",), place="0")


def law(random, one, size=1.0, shape=linear.SHAPE):
    """The slopes of an effect's sizes: random, `size` SDs at the default size."""
    made = {}
    for name in one.amplitudes:
        field = name.rpartition(".")[2]
        neutral = one.effect.neutral[field]
        reach = float(getattr(one.effect, field)) - neutral or 1.0
        made[name] = (neutral, size * random.normal(size=shape) / reach)
    return made


def shown(columns, sizes):
    """The features that these values of numbers show beyond those of the base model."""
    return sum((value - columns[name][0]) * columns[name][1] for name, value in sizes.items())


@pytest.fixture(scope="module")
def made():
    """A base whose numbers are fitted, an exit angle hidden in the log, and laws of three candidates."""
    random = np.random.default_rng(7)
    free = linear.nuisances()
    columns = linear.slopes(random, free)
    for one in (EXIT, VISCOUS, BAND):
        columns |= law(random, one)
    seen = shown(columns, {"soil.phi": free[0].value(0.8), "ExitAngle.e_1": 0.18}) + random.normal(size=linear.SHAPE)
    return linear.fitted(seen, columns), columns


def closed(fitted, freed=(), added=(), anchors=None):
    """The closed form with some numbers freed from their priors and the sizes of candidates added."""
    model = fitted.model
    for one in added:
        model = one.on(model)
    sizes = [one.size(name) for one in added for name in one.amplitudes]
    whole = dataclasses.replace(fitted, parameters=(*fitted.parameters, *sizes))
    return linear.gaussian(whole, freed, anchors)


def refitted(base, one):
    """The package's own fit with a candidate added to the base."""
    model = one.on(base.model)
    parameters, start = joined(base, one, model)
    return fit(base.task, model, parameters, start)


# --- the base fit ----------------------------------------------------------------------------------------------------


def test_the_fit_is_least_squares_with_priors(made):
    fitted, _ = made
    u, chi2 = closed(fitted).solved()
    np.testing.assert_allclose(fitted.u, u, atol=1e-8)
    assert fitted.chi2 == pytest.approx(chi2, rel=1e-12)
    assert fitted.misfit == pytest.approx(huber(fitted.rows) / fitted.freedom)
    np.testing.assert_allclose(fitted.covariance, closed(fitted).covariance, rtol=1e-9)


def test_intervals_are_of_the_posterior_in_coloured_noise(made):
    """And by the misfit where it is above 1: where twice the noise is left, SDs are twice as wide."""
    fitted, columns = made
    plain = np.sqrt(np.diag(closed(fitted).covariance))
    assert (fitted.spread >= math.sqrt(COLOURED) * plain * (1 - 1e-9)).all()
    poor = np.where(np.arange(linear.SHAPE[2]) % 2, 3.0, -3.0) * np.ones(linear.SHAPE)
    missed = linear.fitted(poor, columns)
    assert missed.misfit > 8.5
    expected = np.sqrt(np.diag(closed(missed).covariance) * COLOURED * missed.misfit)
    assert (missed.spread >= expected * (1 - 1e-9)).all()
    for one, sd, u in zip(numbers(missed), missed.spread, missed.u, strict=True):
        known = next(each for each in missed.parameters if each.name == one.name)
        assert one.high - one.low == pytest.approx(2 * NORMAL_95 * sd * known.scale, rel=1e-9)
        assert one.drift == pytest.approx(u)


def test_numbers_at_bounds_are_held_there_and_others_refitted():
    """Against scipy's bounded least squares: phi would leave its bounds; the other takes over."""
    random = np.random.default_rng(3)
    free = linear.nuisances()
    signs = random.choice([-1.0, 1.0], (2, *linear.SHAPE))
    slopes = (signs[0] / free[0].scale, (0.3 * signs[0] + 0.7 * signs[1]) / free[1].scale)
    columns = {one.name: (one.origin, slope) for one, slope in zip(free, slopes, strict=True)}
    for value, prior in ((0.62, True), (0.42, True), (0.62, False)):
        narrow = dataclasses.replace(free[0], low=0.47, high=0.58, prior=prior)
        seen = shown(columns, {"soil.phi": value}) + 0.3 * random.normal(size=linear.SHAPE)
        fitted = linear.fitted(seen, columns, (narrow, free[1]))
        exact = linear.gaussian(fitted)
        known = np.isfinite(exact.sd)
        matrix = np.vstack([exact.X, np.eye(2)[known]])
        right = np.concatenate([exact.y, np.zeros(known.sum())])
        low, high = np.array([one.bounds for one in fitted.parameters]).T
        np.testing.assert_allclose(fitted.u, lsq_linear(matrix, right, (low, high)).x, atol=1e-6)
        assert fitted.u[0] in (pytest.approx(low[0]), pytest.approx(high[0]))


def test_rows_beyond_4_sd_pull_as_one_of_4_sd():
    """The optimum of the Huber loss, by a plain minimiser; the spread counts a stray by its weight."""
    random = np.random.default_rng(3)
    free = linear.nuisances()[:1]
    columns = linear.slopes(random, free)
    noise = random.normal(size=linear.SHAPE)
    noise[0, 0, :3] += 40.0 * np.sign(columns["soil.phi"][1][0, 0, :3])
    fitted = linear.fitted(noise, columns, free)
    (x,) = linear.gaussian(fitted).X.T

    def loss(u):
        size = np.abs(noise.ravel() - x * u)
        return np.sum(np.where(size > 4, 8 * size - 16, size**2)) + u * u

    best = minimize_scalar(loss, bounds=(-3, 3), method="bounded", options={"xatol": 1e-10}).x
    assert fitted.u[0] == pytest.approx(best, abs=1e-3)
    weights = np.minimum(1.0, 4.0 / np.abs(noise.ravel() - x * fitted.u[0]))
    assert fitted.covariance[0, 0] == pytest.approx(1 / (np.sum(weights * x * x) + 1), rel=1e-9)


def test_rows_that_hang_together_by_stretches_widen_an_interval():
    """The sandwich of stretches, by hand: errors of 8 blocks have one sign, so their SD is sqrt(8) times the white."""
    random = np.random.default_rng(3)
    shape = (8, 2, 64)
    free = linear.nuisances()[:1]
    columns = {free[0].name: (free[0].origin, np.ones(shape) / free[0].scale)}
    seen = np.repeat(random.choice([-1.0, 1.0], (8, 1, 8)), 8, axis=2) * np.ones(shape)
    fitted = linear.fitted(seen, columns, free)
    count = fitted.rows.size
    stretches = np.add.reduceat(fitted.residual.sum(axis=1), np.arange(0, 64, 8), axis=1)
    expected = math.sqrt((64 / 63 * np.sum(stretches**2) + 1.0) / (count + 1.0) ** 2)
    alike = np.max([expected, math.sqrt(COLOURED * fitted.misfit / (count + 1)), of_runs(fitted)])
    assert fitted.spread[0] == pytest.approx(alike, rel=1e-9)
    assert expected > math.sqrt(COLOURED / (count + 1))


def of_runs(fitted):
    """The SD of one number that all rows tell alike, by how runs scatter: the sandwich, as Student's t has it."""
    runs = fitted.residual.sum(axis=(1, 2))
    count, few = fitted.rows.size, len(runs)
    widened = student.ppf(0.975, few - 1) / norm.ppf(0.975)
    return widened * math.sqrt(few / (few - 1) * np.sum(runs**2) + 1.0) / (count + 1.0)


@pytest.mark.parametrize(("runs", "counts"), [(3, False), (4, True), (8, True)])
def test_runs_that_differ_widen_an_interval_from_four_on(runs, counts):
    """Sand that is prepared anew: every run is off by its own, far from the noise, and half a run tells no more."""
    shape = (runs, 2, 64)
    free = linear.nuisances()[:1]
    columns = {free[0].name: (free[0].origin, np.ones(shape) / free[0].scale)}
    offset = np.linspace(-1.0, 1.0, runs)[:, None, None] * np.ones(shape)
    fitted = linear.fitted(offset, columns, free)
    if counts:
        assert fitted.spread[0] == pytest.approx(of_runs(fitted), rel=1e-9)
    else:
        assert fitted.spread[0] < of_runs(fitted)


def test_run_wise_intervals_cover_a_number_varying_by_run():
    """400 logs of six runs, each with its own value about the true one: 95 % intervals hold it in 90 to 99 %."""
    random = np.random.default_rng(11)
    shape, free = (6, 2, 64), linear.nuisances()[:1]
    slope = 5.0 * np.ones(shape)
    columns = {free[0].name: (free[0].origin, slope / free[0].scale)}
    held = 0
    for _ in range(400):
        own = 0.1 * random.normal(size=(6, 1, 1))
        seen = own * slope + random.normal(size=shape)
        fitted = linear.fitted(seen, columns, free)
        held += abs(fitted.u[0]) <= norm.ppf(0.975) * fitted.spread[0]
    assert 0.9 <= held / 400 <= 0.99


# --- the score test --------------------------------------------------------------------------------------------------


def test_the_score_of_a_candidate_is_the_exact_fall_of_chi2(made):
    fitted, _ = made
    rows = {row.candidate.name: row for row in score(fitted, signatures(fitted, [EXIT, FREED]))}
    for name, freed, added in (("ExitAngle", (), (EXIT,)), ("WeakMotor[0]", FREED.amplitudes, ())):
        u, chi2 = closed(fitted, freed, added).solved()
        assert rows[name].gain == pytest.approx(fitted.chi2 - chi2, rel=1e-6, abs=1e-8)
    u, _ = closed(fitted, (), (EXIT,)).solved()
    assert rows["ExitAngle"].share == pytest.approx(u[-1], rel=1e-6)
    assert started(rows["ExitAngle"], fitted) == {"ExitAngle.e_1": pytest.approx(0.3 * u[-1])}
    assert started(rows["WeakMotor[0]"], fitted) == {"WeakMotor[0].g": fitted.value("WeakMotor[0].g")}


def test_the_score_counts_from_where_the_numbers_would_be(made):
    """Of a base that is not at its optimum, with priors that pull: the fall from its optimum, not from where it is."""
    fitted, _ = made
    off = fitted.u + np.array([0.4, -0.3])
    (predicted,) = fitted.task.experiment.predict([at(fitted.task, fitted.model, fitted.parameters, off)])
    moved = dataclasses.replace(fitted, u=off, predicted=predicted)
    (row,) = score(moved, signatures(fitted, [EXIT]))
    _, chi2 = closed(fitted, (), (EXIT,)).solved()
    assert row.gain == pytest.approx(fitted.chi2 - chi2, rel=1e-6)


def test_what_the_numbers_imitate_is_not_told():
    """A signature along a number's own slope is absorbed but for its prior; one of a tenth of an SD is not visible."""
    random = np.random.default_rng(1)
    free = linear.nuisances()
    columns = linear.slopes(random, free)
    columns["ExitAngle.e_1"] = (0.0, columns["soil.phi"][1] + 1e-5 * random.normal(size=linear.SHAPE))
    faint = random.normal(size=linear.SHAPE)
    columns["ViscousFriction.b_v"] = (0.0, 0.98 * STILL / 0.01 * faint / np.linalg.norm(faint))
    columns["DeadBand.delta_0"] = (0.0, 1.05 * STILL / 0.05 * faint / np.linalg.norm(faint))
    fitted = linear.fitted(random.normal(size=linear.SHAPE), columns)
    rows = {row.candidate.name: row for row in score(fitted, signatures(fitted, [EXIT, VISCOUS, BAND]))}
    slope = columns["soil.phi"][1].ravel()
    own = slope @ slope * free[0].scale ** 2
    assert 1 - rows["ExitAngle"].absorbed == pytest.approx(1 / (1 + own), rel=0.05)
    assert rows["ViscousFriction"].visible < STILL < rows["DeadBand"].visible
    assert not rows["ViscousFriction"].is_identifiable
    assert rows["DeadBand"].is_identifiable
    assert rows["DeadBand"].smallest(9.0) == pytest.approx(3.0 / rows["DeadBand"].visible)
    assert dataclasses.replace(rows["DeadBand"], visible=0.0).smallest(9.0) == math.inf
    far = linear.fitted(6.0 * faint / np.linalg.norm(faint), columns)
    found = score(far, signatures(far, [VISCOUS, EXIT, BAND]))
    assert [row.candidate.name for row in found] == ["DeadBand", "ExitAngle", "ViscousFriction"], "untold ones last"
    assert found[2].gain > found[1].gain


def test_nonnegative_size_gains_nothing_if_the_log_wants_less():
    random = np.random.default_rng(2)
    columns = linear.slopes(random, linear.nuisances()) | law(random, VISCOUS) | law(random, EXIT)
    seen = shown(columns, {"ViscousFriction.b_v": -0.02})
    fitted = linear.fitted(seen, columns)
    rows = {row.candidate.name: row for row in score(fitted, signatures(fitted, [VISCOUS, EXIT]))}
    assert rows["ViscousFriction"].gain == 0.0
    assert rows["ViscousFriction"].share == 0.0
    far = linear.fitted(shown(columns, {"ExitAngle.e_1": 3.0}), columns)
    (row,) = score(far, signatures(far, [EXIT]))
    assert row.share == pytest.approx(1.0 / 0.3), "e_1 is at most 1, and 0.3 by default"
    near = closed(far, (), (EXIT,)).solved()[1]
    assert 0 < row.gain < far.chi2 - near


def test_candidate_sizes_are_tried_singly_and_a_limit_at_several():
    tether, threshold = candidate(TetherDrag()), candidate(TorqueSaturation())
    assert trials(tether) == [
        {"TetherDrag.f_0": 0.5, "TetherDrag.f_1": 0.0}, {"TetherDrag.f_0": 0.0, "TetherDrag.f_1": pytest.approx(0.2)},
    ]  # fmt: skip
    assert trials(threshold) == [{"TorqueSaturation.i_max": pytest.approx(0.03 * m)} for m in MULTIPLES]
    patch = candidate(HardPatch(), "0.500")
    (whole,) = trials(patch)
    assert whole == {
        name: pytest.approx(float(getattr(HardPatch(), name.rpartition(".")[2]))) for name in patch.amplitudes
    }


def test_of_several_trials_the_best_is_kept(made):
    fitted, _ = made
    random = np.random.default_rng(5)
    right = fitted.residual
    moved = [0.2 * random.normal(size=linear.SHAPE), right, -right]
    rows = score(fitted, [Signature(EXIT, {"ExitAngle.e_1": 0.3}, each, {"ExitAngle.e_1": 0.0}) for each in moved])
    assert len(rows) == 1
    assert rows[0].signature.shift is right


def test_the_most_promising_stands_first(made):
    fitted, _ = made
    gains = [row.gain for row in score(fitted, signatures(fitted, [VISCOUS, BAND, FREED, EXIT]))]
    assert gains == sorted(gains, reverse=True)
    assert gains[0] > gains[1]


def test_noise_is_told_from_what_no_candidate_explains(made):
    """With a ridge of 1e-4 of each column, so to three digits: least squares on numbers and signatures, no priors."""
    fitted, _ = made
    known = signatures(fitted, [EXIT, VISCOUS])
    left, absorbed = saturated(fitted, known)
    moved = [fitted.slopes[one.name] for one in fitted.parameters] + [each.shift for each in known]
    X = np.array(moved).reshape(len(moved), -1).T
    rest = fitted.residual.ravel() - X @ np.linalg.lstsq(X, fitted.residual.ravel(), rcond=None)[0]
    np.testing.assert_allclose(left.ravel(), rest, atol=2e-3)
    white = fitted.task.noise.white(np.array(moved)).T
    doubt = np.linalg.inv(white.T @ white)
    np.testing.assert_allclose(absorbed.variance.ravel(), np.einsum("ni,ij,nj->n", X, doubt, X), rtol=2e-2, atol=1e-6)
    tall = X.reshape(*left.shape, -1)
    beside = np.einsum("...bi,ij,...bj->...b", tall[..., 1:, :], doubt, tall[..., :-1, :])
    np.testing.assert_allclose(absorbed.lagged[..., 1:], beside, rtol=2e-2, atol=1e-6)


def test_of_what_is_left_chance_explains_what_its_sds_allow(made):
    """Against the expectation of the joint normal law: columns of known variance beside free ones."""
    fitted, _ = made
    runs, channels, blocks = linear.SHAPE
    random = np.random.default_rng(12)
    moved = np.zeros((2 * runs, *linear.SHAPE))
    fold = np.arange(2 * runs) % runs
    for column, own in enumerate(fold):
        moved[column, own] = random.normal(size=(channels, blocks))
    kinds = (Kind("grip", 0.05, ""), Kind("slope", 0.01, "rad"))
    field = RandomField(kinds, np.repeat([0, 1], runs), fold, moved)
    known = signatures(fitted, [EXIT, VISCOUS])
    for d in ((1.0, 1.0), (2.0, 0.0)):
        learnt = tuple(LearntSd(kind, one * kind.size, 0.0) for kind, one in zip(kinds, d, strict=True))
        noise = fitted.task.noise
        chance = None if d == (1.0, 1.0) else random_effects_filter(field, noise.white(moved).T, noise.good, learnt)
        task = dataclasses.replace(fitted.task, noise=dataclasses.replace(noise, random_effects=chance))
        left, _ = saturated(dataclasses.replace(fitted, task=task), known, field)
        free = np.array([fitted.slopes[one.name] for one in fitted.parameters] + [each.shift for each in known])
        X, B = (noise.white(each).T for each in (free, moved))
        rows = noise.white(fitted.residual)
        covariance = np.eye(len(rows)) + (B * np.array(d)[field.kind] ** 2) @ B.T
        whitened = np.linalg.inv(np.linalg.cholesky(covariance))
        share = np.linalg.lstsq(whitened @ X, whitened @ rows, rcond=None)[0]
        drawn = np.array(d)[field.kind] ** 2 * (B.T @ np.linalg.solve(covariance, rows - X @ share))
        wanted = fitted.residual - np.tensordot(share, free, 1) - np.tensordot(drawn, moved, 1)
        np.testing.assert_allclose(left, wanted, atol=5e-3)


def test_columns_alike_to_round_off_are_told_together(made):
    """A log without noise: two places of the ground move it alike, by millions of its SDs."""
    fitted, _ = made
    column = np.zeros((1, *linear.SHAPE))
    column[0, 0] = 1e9 * np.random.default_rng(4).normal(size=linear.SHAPE[1:])
    moved = np.concatenate([column, column, (1.0 + 1e-15) * column])
    field = RandomField((Kind("grip", 0.05, ""),), np.zeros(3, dtype=int), np.zeros(3, dtype=int), moved)
    left, absorbed = saturated(fitted, signatures(fitted, [EXIT]), field)
    once = dataclasses.replace(field, kind=field.kind[:1], fold=field.fold[:1], moved=moved[:1])
    np.testing.assert_allclose(left, saturated(fitted, signatures(fitted, [EXIT]), once)[0], atol=1e-3)
    assert np.isfinite(absorbed.variance).all()


# --- fees ------------------------------------------------------------------------------------------------------------


def chance(count):
    return 2 * math.log(count / 0.05)


def test_the_fee_is_what_chance_gains_the_best_of_so_many():
    assert candidate_threshold(EXIT, 100) == pytest.approx(COLOURED * chance(100))
    tether, patch = candidate(TetherDrag()), candidate(HardPatch(), "0.500")
    assert candidate_threshold(tether, 100) == pytest.approx(COLOURED * (chance(100) + chance(1)))
    assert candidate_threshold(patch, 100) == pytest.approx(COLOURED * (SOUGHT * chance(100) + 2 * chance(1)))
    assert candidate_threshold(EXIT, 100, taken=400.0) == pytest.approx(COLOURED * chance(100) + ROUGH * 400.0)


def test_white_noise_seldom_pays_the_fee():
    """Of 400 sets of noise, each with the best of 12 candidates, about 5 % pay the fee without its colour factor."""
    random = np.random.default_rng(0)
    best = (random.normal(size=(4000, 12)) ** 2).max(axis=1)
    assert np.mean(best > chance(12)) < 0.05
    assert np.mean(best > chance(12) / 2) > 0.05, "half the fee would let chance through"


# --- runs left out ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def with_exit(made):
    return refitted(made[0], EXIT)


def anchors(fitted):
    """Sizes are held where the whole fit has them, by FAR default sizes."""
    pairs = zip(fitted.parameters, fitted.u, strict=True)
    return {one.name: (u, FAR) for one, u in pairs if not one.prior}


def surprised(fitted, anchored=True):
    """The closed form of how badly each run is predicted by the others, numbers as uncertain as the noise leaves."""
    exact = linear.gaussian(fitted, anchors=anchors(fitted) if anchored else {})
    return exact.surprise(OWNER, COLOURED * max(fitted.misfit, 1.0))


def test_held_out_run_is_predicted_by_its_conditional_density(made, with_exit):
    np.testing.assert_allclose(first_order_surprises(made[0]), surprised(made[0], False), rtol=1e-9)
    np.testing.assert_allclose(first_order_surprises(with_exit), surprised(with_exit), rtol=1e-9)
    whole = [huber(with_exit.rows[run == OWNER]) for run in range(linear.RUNS)]
    assert (first_order_surprises(with_exit) > whole).all(), (
        "a run that is left out is met less well than one that is fitted"
    )


def test_refits_without_a_run_say_the_same(made, with_exit):
    for fitted, own in ((made[0], {}), (with_exit, anchors(with_exit))):
        exact = linear.gaussian(fitted, anchors=own).left_out(OWNER)
        assert losses_of(fitted).sum() == pytest.approx(exact.sum(), rel=1e-6)
        np.testing.assert_allclose(refitted_surprises(fitted), surprised(fitted), rtol=1e-6)


def gained(base, got):
    """The closed form of the held-out gain: all runs but the one that gains most."""
    return float(np.sort(surprised(base, False) - surprised(got.fit))[:-1].sum())


def test_the_held_out_gain_is_the_exact_one_in_sign_and_size(made):
    """What the exit angle gains on runs left out, and what a number of nothing loses there."""
    base, _ = made
    gains = []
    for one in (EXIT, VISCOUS):
        (got,) = refit(base, score(base, signatures(base, [one])), lambda one: 0.0, SILENT)
        gains.append(got.held_out)
        assert got.held_out == pytest.approx(gained(base, got), rel=1e-6)
        _, chi2 = closed(base, (), (one,)).solved()
        assert got.gain == pytest.approx(base.chi2 - chi2, rel=1e-6, abs=1e-9)
    assert gains[0] > 20
    assert gains[1] < 0


def with_a_size(shares, seed=4):
    """An exit angle that moves each run by its share, and the refit that has it."""
    random = np.random.default_rng(seed)
    columns = linear.slopes(random, linear.nuisances())
    slope = random.choice([-1.0, 1.0], linear.SHAPE) / 0.3 * np.array(shares)[:, None, None]
    columns["ExitAngle.e_1"] = (0.0, slope)
    noise = np.clip(random.normal(size=linear.SHAPE), -2, 2)
    base = linear.fitted(shown(columns, {"ExitAngle.e_1": 0.5}) + noise, columns)
    return base, *refit(base, score(base, signatures(base, [EXIT])), lambda one: 0.0, SILENT)


def test_a_size_that_one_run_alone_shows_is_not_seen_again():
    base, got = with_a_size([0.0, 0.0, 0.0, 1.0])
    assert got.gain > 50
    assert got.held_out == pytest.approx(gained(base, got), rel=1e-6)
    assert abs(got.held_out) < 5


def test_size_determined_mainly_by_one_run_is_seen_in_all():
    """They leave it open by more than that run's noise: its own miss is no more than they expect."""
    base, got = with_a_size([0.4, 0.4, 0.4, 1.0])
    assert got.held_out > 5
    assert got.held_out == pytest.approx(gained(base, got), rel=1e-6)


@pytest.mark.parametrize(
    ("falls", "left"), [((9.0, 1.0, -2.0), -1.0), ((9.0, -1.0), 8.0), ((-3.0, -1.0, -2.0), -6.0), ((4.0,), 4.0)]
)
def test_run_with_the_largest_gain_is_ignored_of_three_or_more(falls, left):
    assert seen_again(np.array(falls), np.zeros(len(falls))) == left


def test_held_out_errors_of_the_verdict_are_the_exact_ones(made, with_exit):
    found = held_out(made[0], with_exit, made[0].task.noise, 0)
    exact = [closed(made[0]).left_out(OWNER), linear.gaussian(with_exit, anchors=anchors(with_exit)).left_out(OWNER)]
    count = linear.SHAPE[1] * linear.SHAPE[2]
    for run, row in enumerate(found.runs):
        assert (row.before, row.after) == pytest.approx((exact[0][run] / count, exact[1][run] / count), rel=1e-6)
        assert row.low <= row.after / row.before - 1 <= row.high
    assert together(found.runs) == pytest.approx(tuple(each.sum() / (count * linear.RUNS) for each in exact), rel=1e-6)
    squares = sum(row.before**2 for row in found.channels) * count / linear.SHAPE[1] * linear.RUNS
    assert squares == pytest.approx(exact[0].sum(), rel=1e-6)


def test_the_interval_of_a_change_is_that_of_resampled_stretches():
    """Every second stretch falls from 2 to 1 SD: a run's two stretches and a channel's eight, by the binomial law."""
    columns = {one.name: (one.origin, np.zeros(linear.SHAPE)) for one in linear.nuisances()}
    was = np.full(linear.SHAPE, 2.0)
    now = np.where(np.arange(linear.SHAPE[2]) < 8, 1.0, was)
    fits = [linear.fitted(seen, columns) for seen in (was, now)]
    found = held_out(*fits, fits[1].task.noise, 0)
    for run in found.runs:
        assert (run.before, run.after) == pytest.approx((4.0, 2.5))
        assert (run.low, run.high) == pytest.approx((1 / 4 - 1, 0.0))
    fell = [math.sqrt(1 - 0.75 * binom.ppf(share, 8, 0.5) / 8) - 1 for share in (0.975, 0.025)]
    for row in found.channels:
        assert (row.before, row.after, row.change) == pytest.approx((2.0, math.sqrt(2.5), math.sqrt(2.5) / 2 - 1))
        assert (row.low, row.high) == pytest.approx(fell)


# --- freed numbers ---------------------------------------------------------------------------------------------------


def test_a_freed_number_loses_its_prior_and_nothing_else_does(made):
    base, _ = made
    parameters, start = joined(base, FREED, base.model)
    assert [(one.name, one.prior) for one in parameters] == [("soil.phi", True), ("WeakMotor[0].g", False)]
    np.testing.assert_allclose(start, base.u)
    parameters, start = joined(base, EXIT, EXIT.on(base.model))
    assert [(one.name, one.prior) for one in parameters] == [
        ("soil.phi", True), ("WeakMotor[0].g", True), ("ExitAngle.e_1", False),
    ]  # fmt: skip
    assert start[-1] == 1.0


def test_freeing_a_distant_number_gains_the_cost_of_its_prior():
    random = np.random.default_rng(6)
    free = linear.nuisances()
    columns = linear.slopes(random, free)
    base = linear.fitted(shown(columns, {"WeakMotor[0].g": 8 * 0.02}) + random.normal(size=linear.SHAPE), columns)
    (got,) = refit(base, score(base, signatures(base, [FREED])), lambda one: 0.0, SILENT)
    u, chi2 = closed(base, FREED.amplitudes).solved()
    assert got.gain == pytest.approx(base.chi2 - chi2, rel=1e-6)
    assert got.gain == pytest.approx(base.u[1] ** 2, rel=0.1)
    np.testing.assert_allclose(got.fit.u, u, rtol=1e-6)
    assert numbers(got.fit)[1].drift != numbers(got.fit)[1].drift, "nothing was declared of a number that is free"


# --- which are refitted ----------------------------------------------------------------------------------------------


def hidden(size, seed=8, also=()):
    """A base on a log that hides an exit angle, and may also hide others."""
    random = np.random.default_rng(seed)
    columns = linear.slopes(random, linear.nuisances())
    for one in (EXIT, VISCOUS, BAND):
        columns |= law(random, one)
    noise = random.normal(size=linear.SHAPE)
    return linear.fitted(shown(columns, {"ExitAngle.e_1": size, **dict(also)}) + noise, columns)


def test_one_that_promises_too_little_of_its_fee_is_not_refitted():
    base = hidden(0.2)
    rows = score(base, signatures(base, [EXIT, VISCOUS, BAND]))
    gain = next(row.gain for row in rows if row.candidate is EXIT)
    assert [one.name for one in refit(base, rows, lambda one: gain / 0.41, SILENT)] == ["ExitAngle"]
    assert refit(base, rows, lambda one: gain / 0.39, SILENT) == ()


def test_refits_come_best_first():
    base = hidden(0.2, also={"DeadBand.delta_0": 0.1}.items())
    found = refit(base, score(base, signatures(base, [EXIT, VISCOUS, BAND])), lambda one: 1.0, SILENT)
    nets = [one.net for one in found]
    assert nets == sorted(nets, reverse=True)
    assert found[0].name == "DeadBand"


def three_hidden():
    """A base on a log that hides three effects, which alone gain about 200, 165 and 100."""
    random = np.random.default_rng(3)
    columns = linear.slopes(random, linear.nuisances())
    sizes = {}
    for one, amplitude in ((EXIT, 1.25), (BAND, 1.135), (VISCOUS, 0.88)):
        (name,) = one.amplitudes
        reach = float(getattr(one.effect, name.rpartition(".")[2]))
        columns[name] = (0.0, random.choice([-1.0, 1.0], linear.SHAPE) / reach)
        sizes[name] = amplitude * reach
    noise = np.clip(random.normal(size=linear.SHAPE), -0.7, 0.7)
    return linear.fitted(shown(columns, sizes) + noise, columns)


def refitted_lines(base, rows):
    lines = []
    found = refit(base, rows, lambda one: 10.0, lines.append)
    return found, lines


def test_leaders_are_fitted_fully_and_distant_ones_are_not():
    base = three_hidden()
    found, lines = refitted_lines(base, score(base, signatures(base, [EXIT, VISCOUS, BAND])))
    assert [one.name for one in found] == ["ExitAngle", "DeadBand", "ViscousFriction"]
    reach = found[0].net - 40 - 0.1 * found[0].net
    assert found[0].net - 0.1 * found[0].net > found[1].net > reach > found[2].net > 0
    assert [line for line in lines if "every slope anew" in line] == [
        f"refitting with {one.name}, every slope anew" for one in found[:2]
    ]


def test_one_that_promised_more_than_any_reached_is_fitted_again():
    base = three_hidden()
    rows = score(base, signatures(base, [EXIT, VISCOUS, BAND]))
    more = [dataclasses.replace(row, gain=1000.0) if row.candidate is VISCOUS else row for row in rows]
    found, lines = refitted_lines(base, more)
    assert "refitting with ViscousFriction, which gained less than promised" in lines
    assert not any("less than promised" in line for line in lines if "Viscous" not in line)
    assert "refitting with ViscousFriction, every slope anew" in lines
    assert found[2].gain < 200


# --- accepted, and told apart ----------------------------------------------------------------------------------------


def kind_and_place(name):
    """The fields of a candidate of this name, of an effect without sizes."""
    for mark in "@[":
        if mark in name:
            kind, _, place = name.partition(mark)
            return kind, object(), (), (), place.rstrip("]"), mark == "@"
    return name, object(), ()


def made_refit(name, net, held=1.0, fee=10.0):
    return Refit(Candidate(*kind_and_place(name)), None, net + fee, fee, held)


@pytest.mark.parametrize(("net", "held", "accepted"), [(1, 1, True), (-1, 1, False), (1, -1, False), (0, 1, False)])
def test_a_candidate_gains_more_than_chance_and_predicts_better(net, held, accepted):
    assert made_refit("A", net, held).accepted == accepted


def names(found):
    return [one.name for one in indistinguishable_refits(found)]


def test_the_set_of_rivals():
    best = made_refit("A", 100.0)
    assert names([]) == []
    assert names([made_refit("A", 5.0, -1.0)]) == []
    assert names([best, made_refit("B", 100.0 - ODDS + 1)]) == ["A", "B"]
    assert names([best, made_refit("B", 100.0 - ODDS - 1)]) == ["A"]
    assert names([made_refit("A", 12.0), made_refit("B", 0.5), made_refit("C", -0.5)]) == ["A", "B"]
    assert names([best, made_refit("B", 99.0, -3.0)]) == ["A", "B"], "a near one that predicts worse is still a rival"
    assert names([made_refit("B", 120.0, -1.0), best]) == ["A", "B"], "the best is the best accepted one"


def test_places_of_one_kind_are_one_rival():
    patch = [made_refit(f"HardPatch@{x}", net) for x, net in (("0.1", 99.0), ("0.2", 98.0))]
    assert names([made_refit("A", 100.0), *patch]) == ["A", "HardPatch@0.1"]
    assert names([made_refit("HardPatch@0.0", 100.0), *patch, made_refit("B", 99.0)]) == ["HardPatch@0.0", "B"]
    wheels = [made_refit(f"WeakMotor[{wheel}]", 99.0 - wheel) for wheel in range(2)]
    assert names([made_refit("A", 100.0), *wheels]) == ["A", "WeakMotor[0]", "WeakMotor[1]"]


# --- the search ------------------------------------------------------------------------------------------------------


def searched(sizes, laws, seed=9, noise=1.0):
    random = np.random.default_rng(seed)
    columns = linear.slopes(random, linear.nuisances()) | laws(random)
    rows = noise * random.normal(size=linear.SHAPE)
    base = linear.fitted(shown(columns, sizes) + rows, columns)
    return search(base, candidates(base.model, base.task.experiment, base.parameters, None), SILENT)


def three(random):
    found = {}
    for one in (EXIT, VISCOUS, BAND):
        found |= law(random, one)
    return found


def term(strength, is_raking=False):
    best = SimpleNamespace(strength=strength, description="acts as a force", is_raking=is_raking)
    return SimpleNamespace(best=best, terms=(), wheels=())


QUIET = term(5.0)


def answered(found, left, takes_most=False):
    return answer_of(found, ResidualAssessment(is_unknown(found, left), "", described=True), takes_most)


def test_a_hidden_effect_is_found_and_named():
    found = searched({"ExitAngle.e_1": 0.5}, three)
    assert [one.name for one in found.best_refits] == ["ExitAngle"]
    assert found.last.value("ExitAngle.e_1") == pytest.approx(0.5, abs=0.06)
    assert len(found.rounds) == 2
    assert found.count > 40
    assert answered(found, QUIET) is Answer.NAMED
    assert share_taken(found) > 0.9


def test_noise_needs_no_effect():
    found = searched({}, three)
    assert found.best_refits == ()
    assert found.last is found.base
    assert answered(found, QUIET) is Answer.NONE_NEEDED


def test_two_that_do_the_same_are_a_set():
    def twins(random):
        one = law(random, EXIT)["ExitAngle.e_1"][1]
        return {"ExitAngle.e_1": (0.0, one), "ViscousFriction.b_v": (0.0, 0.3 / 0.01 * one)}

    found = searched({"ExitAngle.e_1": 0.5}, twins)
    assert {one.name for one in found.rounds[0].indistinguishable} == {"ExitAngle", "ViscousFriction"}
    assert answered(found, QUIET) is Answer.SET


def test_two_effects_are_found_one_after_the_other():
    found = searched({"ExitAngle.e_1": 0.4, "DeadBand.delta_0": 0.15}, three)
    assert {one.name for one in found.best_refits} == {"ExitAngle", "DeadBand"}
    assert len(found.rounds) == 3
    assert answered(found, QUIET) is Answer.NAMED
    first, second, third = (threshold_after(found.rounds[:done], found.count)(VISCOUS) for done in range(3))
    gains = [one.gain for one in found.best_refits]
    assert second - first == pytest.approx(ROUGH * gains[0])
    assert third - first == pytest.approx(ROUGH * sum(gains))
    fees = [one.threshold for one in found.best_refits]
    assert fees == pytest.approx(
        [
            candidate_threshold(found.best_refits[0].candidate, found.count),
            candidate_threshold(BAND, found.count, gains[0]),
        ]
    )


def test_no_more_than_so_many_are_added():
    many = (EXIT, VISCOUS, BAND, candidate(SupplySag()), candidate(GearFriction()))

    def laws(random):
        return {name: value for one in many for name, value in law(random, one).items()}

    sizes = {"ExitAngle.e_1": 0.9, "ViscousFriction.b_v": 0.03, "DeadBand.delta_0": 0.15}
    found = searched(sizes | {"SupplySag.R_b": 6.0, "GearFriction.tau_c": 0.15}, laws)
    assert len(found.rounds) == MOST + 1


# --- the answer ------------------------------------------------------------------------------------------------------


def looked(*rounds, base=100.0, last=10.0, count=20, rms=2.0):
    """A hand-made search: chi2 of the base and of the last fit, the refits of each look, the RMS left in one channel.

    Replays are wrong by 1.
    """
    experiment = SimpleNamespace(is_exact=False, least_noise=lambda model: np.ones(1))
    task = SimpleNamespace(noise=SimpleNamespace(count=count), experiment=experiment)
    about = {"task": task, "freedom": count, "parameters": (), "u": (), "model": None, "rms": np.array([rms])}
    fits = [SimpleNamespace(chi2=chi2, **about) for chi2 in (base, last)]
    made = [Round((), tuple(dataclasses.replace(one, fit=fits[1]) for one in each)) for each in rounds]
    return Search(fits[0], tuple(made), ())


ONE, RIVAL = made_refit("A", 100.0), made_refit("B", 99.0)


@pytest.mark.parametrize(
    ("found", "strength", "answer"),
    [
        (looked((ONE,), ()), 5.0, Answer.NAMED),
        (looked((ONE, RIVAL), ()), 5.0, Answer.SET),
        (looked((ONE,), (made_refit("C", 50.0), made_refit("D", 49.0)), ()), 5.0, Answer.SET),
        (looked((ONE,), (made_refit("C", 50.0),), ()), 5.0, Answer.NAMED),
        (looked(()), 5.0, Answer.NONE_NEEDED),
        (looked((made_refit("A", -3.0),)), 5.0, Answer.NONE_NEEDED),
        (looked(()), UNKNOWN + 1, Answer.NONE_FITS),
        (looked(()), UNKNOWN - 1, Answer.NONE_NEEDED),
        (looked((ONE,), ()), UNKNOWN + 1, Answer.NONE_FITS),
        (looked((made_refit("A", 2000.0),), ()), MUCH * 2000 - 1, Answer.NAMED),
        (looked((made_refit("A", 2000.0),), ()), MUCH * 2000 + 1, Answer.NONE_FITS),
        (looked((made_refit("A", 1500.0),), (made_refit("B", 500.0),), ()), MUCH * 2000 - 1, Answer.NAMED),
    ],
)
def test_the_answer(found, strength, answer):
    assert answered(found, term(strength)) is answer
    assert is_unknown(found, term(strength)) == (answer is Answer.NONE_FITS)
    assert answered(found, term(strength, is_raking=True)) is not Answer.NONE_FITS
    if answer is Answer.NONE_FITS and found.best_refits:
        assert answered(found, term(strength), takes_most=True) is Answer.LIKE
        assert answered(found, term(strength), takes_most=False) is Answer.NONE_FITS


def test_a_term_of_what_replays_are_wrong_by_is_no_effect():
    """A log without noise over a step: a torque of 0.2 mN m for two seconds was "not on the list"."""
    assert not is_unknown(looked((), rms=0.6), term(UNKNOWN + 1))
    assert answered(looked((), rms=0.6), term(UNKNOWN + 1)) is Answer.NONE_NEEDED


@pytest.mark.parametrize(
    ("base", "last", "share"), [(120.0, 20.0, 1.0), (120.0, 70.0, 0.5), (120.0, 120.0, 0.0), (120.0, 10.0, 1.0)]
)
def test_the_share_that_was_taken_is_of_what_is_beyond_the_noise(base, last, share):
    assert share_taken(looked((ONE,), (), base=base, last=last, count=20)) == pytest.approx(share)


def test_share_taken_is_all_or_none_without_excess_misfit():
    assert share_taken(looked((ONE,), (), base=15.0, last=10.0)) == 1.0
    assert share_taken(looked((), base=15.0)) == 0.0


# --- the verdict -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def log():
    return channels.log_of(*channels.GOOD)


def test_what_was_found_is_in_the_verdicts_model(log):
    found = searched({"ExitAngle.e_1": 0.5}, three)
    verdict = verdict_on(log, found, QUIET, 0, SILENT)
    assert verdict.answer is Answer.NAMED
    assert verdict.named == verdict.indistinguishable == ("ExitAngle",)
    assert [type(effect) for effect in verdict.effects] == [ExitAngle]
    assert verdict.model.effect(ExitAngle).e_1 == pytest.approx(0.5, abs=0.06)
    assert [one.name for one in verdict.after.numbers] == ["soil.phi", "WeakMotor[0].g", "ExitAngle.e_1"]
    assert [one.name for one in verdict.profiles] == ["ExitAngle.e_1"]
    assert verdict.sentence.startswith("the data are consistent with ExitAngle, which takes 9")
    assert set(verdict.chosen.values()) == {"ExitAngle"}
    assert [(one.before, one.after) for one in extra_of(verdict).free] == [pytest.approx((0.01, 0.009))] * linear.RUNS
    before, after = together(verdict.runs)
    assert after < 0.7 * before


def test_an_effect_of_one_run_is_not_chosen_without_it(log):
    """And the name does not stand where most runs choose otherwise; a refit to the others says the same."""

    def laws(random):
        own = law(random, EXIT)["ExitAngle.e_1"][1]
        own[1:] *= 0.02
        return {"ExitAngle.e_1": (0.0, own)}

    found = searched({"ExitAngle.e_1": 1.0}, laws)
    assert [one.name for one in found.added] == ["ExitAngle"]
    chosen = chosen_without(found)
    assert [chosen[name] for name in found.base.task.experiment.folds] == ["", *["ExitAngle"] * (linear.RUNS - 1)]
    good = found.base.task.noise.good.copy()
    good[0] = False
    task = dataclasses.replace(found.base.task, noise=dataclasses.replace(found.base.task.noise, good=good))
    fits = [fit(task, one.model, one.parameters, one.u, one.slopes) for one in (found.base, found.last)]
    assert without_each(found.base)[0] == pytest.approx(fits[0].chi2, rel=1e-3)
    assert fits[0].chi2 - fits[1].chi2 < found.best_refits[0].threshold


def test_effect_taking_most_is_like_the_missing_one(log):
    verdict = verdict_on(log, searched({"ExitAngle.e_1": 0.5}, three), term(1e6), 0, SILENT)
    assert (verdict.answer, verdict.named) == (Answer.LIKE, ("ExitAngle",))
    assert "its law does not hold exactly" in verdict.sentence
    assert verdict.share > 0.9


def test_what_is_doubtful_is_not_in_the_verdicts_model(log, monkeypatch):
    monkeypatch.setattr("rover_pin.discrepancy.decide_answer.TAKES_MOST", 1.1)
    found = searched({"ExitAngle.e_1": 0.5}, three)
    verdict = verdict_on(log, found, term(1e6), 0, SILENT)
    assert verdict.answer is Answer.NONE_FITS
    assert verdict.named == ()
    assert verdict.indistinguishable == ("ExitAngle",)
    assert verdict.effects == ()
    assert verdict.model is found.base.model
    assert verdict.draft is None  # no term that an effect can imitate: said without one, where the loop stopped
    assert verdict.profiles == ()
    assert verdict.before == verdict.after
    assert "something acts that is not on the list: it acts as a force" in verdict.sentence
    assert "The nearest of the list, ExitAngle, does not take it." in verdict.sentence
    assert not sides_of(verdict).added
    assert together(verdict.runs)[0] == together(verdict.runs)[1]


def test_nothing_needed_is_said_and_added(log):
    verdict = verdict_on(log, searched({}, three), QUIET, 0, SILENT)
    assert verdict.answer is Answer.NONE_NEEDED
    assert (verdict.named, verdict.indistinguishable, verdict.share) == ((), (), 0.0)
    assert set(verdict.chosen.values()) == {""}
    assert "no candidate gains more than chance" in verdict.sentence


@pytest.mark.parametrize(("share", "within"), [(1.0, True), (0.5, False)])
def test_within_the_noise_refers_to_the_scatter_of_the_samples(log, monkeypatch, share, within):
    """The residuals of this set are white with an SD of 1e-3 to 1e-2; the noise is learnt from them, as always."""
    found = searched({}, three)
    sd = found.base.residual.std(axis=(0, 2))
    monkeypatch.setattr(type(found.base.task.experiment), "floor", lambda self: share * sd)
    verdict = verdict_on(log, found, QUIET, 0, SILENT)
    assert verdict.answer is Answer.NONE_NEEDED
    assert ("within their noise" in verdict.sentence) == within
    assert [score.floor for score in verdict.scores] == pytest.approx(share * sd)
    if not within:
        assert re.search(r"more than the samples scatter: \w+ 2[.0-9]* times \(most in run-\d\)", verdict.sentence)


@pytest.mark.parametrize("told", [True, False])
def test_runs_separating_the_best_from_two_rivals_are_proposed(log, monkeypatch, told):
    def asked(best, rival, progress):
        return SimpleNamespace(sentence=f"{best[0]} or {rival[0]}", second=rival[0]) if told else None

    def alike_laws(random):
        one = law(random, EXIT)["ExitAngle.e_1"][1]
        others = (VISCOUS, BAND, candidate(GearFriction()))
        reach = {each.amplitudes[0]: float(next(iter(each.effect.values().values()))) for each in others}
        return {"ExitAngle.e_1": (0.0, one)} | {name: (0.0, 0.3 / size * one) for name, size in reach.items()}

    monkeypatch.setattr("rover_pin.loop.drive.separating_drive", asked)
    found = searched({"ExitAngle.e_1": 0.5}, alike_laws)
    verdict = verdict_on(log, found, QUIET, 0, SILENT)
    assert verdict.answer is Answer.SET
    best, *rivals = verdict.indistinguishable
    assert len(rivals) == 3
    assert [one.sentence for one in verdict.experiments] == (
        [f"{best} or {rival}" for rival in rivals[:2]] if told else []
    )
    assert verdict.sentence.startswith(
        f"these cannot be distinguished: {' or '.join(verdict.indistinguishable)}; the first takes"
    )
