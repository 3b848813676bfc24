"""Fits to a drive log and errors on runs left out against the linear Gaussian model in closed form."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import binom, norm
from scipy.stats import t as student

from rover_pin.base.errors import OptimisationError
from rover_pin.discrepancy.candidate import plain_candidate
from rover_pin.discrepancy.held_out_errors import held_out, together
from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.estimation.fit import fit
from rover_pin.estimation.numbers import profiles
from tests.experiments.drive_log import linear_drive as linear

OWNER = linear.owner_of_rows()
EXIT = plain_candidate(ExitAngle())


def shown(columns, sizes):
    """The features that these values of numbers show beyond those of the base model."""
    return sum((value - columns[name][0]) * columns[name][1] for name, value in sizes.items())


@pytest.fixture(scope="module")
def hidden_exit():
    """A base whose numbers are fitted, an exit angle hidden in the log, and its law."""
    random = np.random.default_rng(7)
    free = linear.nuisances()
    columns = linear.slopes(random, free)
    columns["ExitAngle.e_1"] = (0.0, random.normal(size=linear.SHAPE) / ExitAngle().e_1)
    observed = shown(columns, {"soil.phi": free[0].value(0.8), "ExitAngle.e_1": 0.18}) + random.normal(
        size=linear.SHAPE
    )
    return linear.fitted(observed, columns), columns


def test_numbers_at_bounds_are_held_there_and_others_refitted():
    """Against scipy's bounded least squares: phi would leave its bounds; the other takes over."""
    random = np.random.default_rng(3)
    free = linear.nuisances()
    signs = random.choice([-1.0, 1.0], (2, *linear.SHAPE))
    slopes = (signs[0] / free[0].scale, (0.3 * signs[0] + 0.7 * signs[1]) / free[1].scale)
    columns = {parameter.name: (parameter.origin, slope) for parameter, slope in zip(free, slopes, strict=True)}
    for value, prior in ((0.62, True), (0.42, True), (0.62, False)):
        narrow = dataclasses.replace(free[0], low=0.47, high=0.58, prior=prior)
        observed = shown(columns, {"soil.phi": value}) + 0.3 * random.normal(size=linear.SHAPE)
        fitted = linear.fitted(observed, columns, (narrow, free[1]))
        exact = linear.gaussian(fitted)
        is_finite = np.isfinite(exact.sd)
        matrix = np.vstack([exact.X, np.eye(2)[is_finite]])
        right = np.concatenate([exact.y, np.zeros(is_finite.sum())])
        low, high = np.array([parameter.bounds for parameter in fitted.parameters]).T
        np.testing.assert_allclose(fitted.u, lsq_linear(matrix, right, (low, high)).x, atol=1e-6)
        assert fitted.u[0] in (pytest.approx(low[0]), pytest.approx(high[0]))


def of_runs(fitted):
    """The SD of one number that all rows tell alike, by how runs scatter: the sandwich, as Student's t has it."""
    runs = fitted.residual.sum(axis=(1, 2))
    count, run_count = fitted.rows.size, len(runs)
    widened = student.ppf(0.975, run_count - 1) / norm.ppf(0.975)
    return widened * math.sqrt(run_count / (run_count - 1) * np.sum(runs**2) + 1.0) / (count + 1.0)


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
    covered = 0
    for _ in range(400):
        run_effect = 0.1 * random.normal(size=(6, 1, 1))
        observed = run_effect * slope + random.normal(size=shape)
        fitted = linear.fitted(observed, columns, free)
        covered += abs(fitted.u[0]) <= norm.ppf(0.975) * fitted.spread[0]
    assert 0.9 <= covered / 400 <= 0.99


# --- runs left out ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sizes", "rel"), [(EXIT.cause.parameters, 1e-6), ((EXIT.size("ExitAngle.e_1"),), 1e-3)], ids=["known", "free"]
)
def test_held_out_errors_are_the_exact_ones(hidden_exit, sizes, rel):
    """A size without a prior is held near its value, three default sizes wide, which tells next to nothing."""
    base, _ = hidden_exit
    with_exit = fit(base.task, EXIT.on(base.model), (*base.parameters, *sizes))
    held_out_errors = held_out(base, with_exit, base.task.noise, 0)
    exact = [linear.gaussian(fit_found).left_out(OWNER) for fit_found in (base, with_exit)]
    count = linear.SHAPE[1] * linear.SHAPE[2]
    for run, row in enumerate(held_out_errors.runs):
        assert (row.before, row.after) == pytest.approx((exact[0][run] / count, exact[1][run] / count), rel=rel)
        assert row.low <= row.after / row.before - 1 <= row.high
    assert together(held_out_errors.runs) == pytest.approx(
        tuple(losses.sum() / (count * linear.RUNS) for losses in exact), rel=rel
    )
    squares = sum(row.before**2 for row in held_out_errors.channels) * count / linear.SHAPE[1] * linear.RUNS
    assert squares == pytest.approx(exact[0].sum(), rel=rel)


def test_the_interval_of_a_change_is_that_of_resampled_stretches():
    """Every second stretch falls from 2 to 1 SD: a run's two stretches and a channel's eight, by the binomial law."""
    columns = {parameter.name: (parameter.origin, np.zeros(linear.SHAPE)) for parameter in linear.nuisances()}
    was = np.full(linear.SHAPE, 2.0)
    now = np.where(np.arange(linear.SHAPE[2]) < 8, 1.0, was)
    fits = [linear.fitted(observed, columns) for observed in (was, now)]
    held_out_errors = held_out(*fits, fits[1].task.noise, 0)
    for run in held_out_errors.runs:
        assert (run.before, run.after) == pytest.approx((4.0, 2.5))
        assert (run.low, run.high) == pytest.approx((1 / 4 - 1, 0.0))
    fell = [math.sqrt(1 - 0.75 * binom.ppf(share, 8, 0.5) / 8) - 1 for share in (0.975, 0.025)]
    for row in held_out_errors.channels:
        assert (row.before, row.after, row.change) == pytest.approx((2.0, math.sqrt(2.5), math.sqrt(2.5) / 2 - 1))
        assert (row.low, row.high) == pytest.approx(fell)


# --- profiles --------------------------------------------------------------------------------------------------------


def test_a_profile_has_no_rise_where_the_others_do_not_settle(monkeypatch):
    """Such a point once ended the whole loop: a hole's length, depth and rest imitate one another."""
    random, free = np.random.default_rng(3), linear.nuisances()
    columns = linear.slopes(random, free)
    fitted = linear.fitted(np.clip(random.normal(size=linear.SHAPE), -2.2, 2.2), columns)

    def unsettled(*arguments, **named):
        raise OptimisationError("a refit did not settle", status=400)

    monkeypatch.setattr("rover_pin.estimation.numbers.fit", unsettled)
    (profile,) = profiles(fitted, (fitted.parameters[0].name,))
    assert [rise == 0.0 for rise in profile.rises] == [False, False, False, True, False, False, False]
    assert np.isnan(profile.rises).sum() == 6
