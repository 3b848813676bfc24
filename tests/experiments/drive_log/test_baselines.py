"""Odometry with a fitted slip, on the log of a rover that is exactly that."""

import dataclasses
import re
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin import Trace, load_rover
from rover_pin.base.formula import evaluate
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out_errors import ChannelScore, LevelError
from rover_pin.discrepancy.rivals import against_rivals
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import Baseline
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.experiments.drive_log.odometry_rival import CURVE, GIVEN, odometry_baselines
from rover_pin.report.headline import full_answer
from rover_pin.report.labels import labels_of
from tests.experiments.drive_log import drive_channels

ROVER, CART = load_rover("nexus6"), load_rover("cart")
COURSE = "course(body_x, body_y, t_s)"


def logged(run):
    return logged_run(drive_channels.log_of(run).runs[0], ROVER)


def errors(*runs):
    logged_runs_of = tuple(map(logged, runs))
    return {
        baseline.channel: baseline
        for baseline in odometry_baselines(DriveExperiment(logged_runs_of, (None,) * len(logged_runs_of)), ROVER)
    }


def farther(run, times):
    """The same wheels, the rover so many times as far."""
    return run | {"body_x": times * run["body_x"]}


def test_uniform_slip_is_met_and_differing_slip_is_missed():
    first, second = (drive_channels.drive(seed, noise=0.0, hill=0.0) for seed in (0, 1))
    error_table = errors(first, second)
    logged_first = logged(first)
    driven = np.sqrt(np.nanmean(logged_first.observed[logged_first.channels.index("path")] ** 2))
    assert error_table["path"].error < 0.01 * driven  # half a row's way: the rover's own steps are longer than the rows
    assert error_table["drift"].error < 1e-12
    slower = errors(first, farther(second, 0.8))
    assert slower["path"].error > 0.15 * driven


def skidding(side, course):
    """A cart of 0.5 m/s turns at 0.4 rad/s to one side, its rims 2.5 times as far apart; a point 0.2 m behind it."""
    t, dt = np.arange(0.0, 30.0, 0.05), 0.05
    turn = 0.4 * side * ((t > 10.0) & (t < 18.0))
    yaw = np.cumsum(turn) * dt
    place = np.cumsum(0.5 * 0.9 * np.exp(1j * yaw)) * dt - 0.2 * np.exp(1j * yaw)
    channels = {"t_s": t, "body_x": place.real, "body_y": place.imag, "body_yaw": yaw}
    if course:
        channels["body_yaw"] = evaluate(COURSE, channels, "")
    for wheel in CART.wheels:
        channels[f"wheel_rate_{wheel.name}"] = (0.5 + 2.5 * 0.26 * turn * (-1 if wheel.side == "l" else 1)) / 0.11
    return logged_run(Trace(channels, {}, {"input": "rates"}), CART, course=COURSE if course else "")


@pytest.mark.parametrize("course", [False, True])
def test_slip_track_and_point_are_fitted_to_the_other_runs(course):
    runs = tuple(skidding(side, course) for side in (1, -1, 1))
    baselines = {
        baseline.channel: baseline for baseline in odometry_baselines(DriveExperiment(runs, (None,) * 3), CART)
    }
    assert set(baselines) == {"path", "heading", *([] if course else ["drift"])}
    for name, baseline in baselines.items():
        driven = np.sqrt(np.nanmean(np.concatenate([run.observed[run.channels.index(name)] for run in runs]) ** 2))
        assert baseline.error < 0.03 * driven, name
        assert len(baseline.by_fold) == 3
        assert baseline.error == pytest.approx(np.sqrt(np.mean(np.square(baseline.by_fold))), rel=0.1)


@pytest.mark.parametrize("course", [False, True])
def test_later_runs_are_predicted_by_what_was_fitted_before(course):
    before, later = (DriveExperiment(tuple(skidding(side, course) for side in sides), (None,) * len(sides))
                     for sides in ((1, -1), (-1, 1, 1)))  # fmt: skip
    for baseline in odometry_baselines(before, CART, later):
        driven = later.observed[:, later.channels.index(baseline.channel)]
        assert baseline.error < 0.03 * np.sqrt(np.nanmean(driven**2)), baseline.channel
        assert len(baseline.by_fold) == 3
        assert np.isfinite(baseline.by_fold).all()


def verdict():
    levels = tuple(LevelError(f"run-{at}", 0.02, 0.02) for at in range(4))
    path, heading = (
        ChannelScore(name, unit, 1e-4, 0.02, 0.02, 0.0, -0.1, 0.1, levels)
        for name, unit in (("path", "m"), ("heading", "rad"))
    )
    return Verdict(
        "drive-log", Answer.NONE_NEEDED, "a log", "No effect is needed.", SimpleNamespace(rover=CART),
        scores=(path, heading),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("rate_driven", "times", "first"), [(True, 0.4, True), (True, 1.2, False), (False, 0.4, False)]
)
def test_odometry_that_is_better_by_the_same_rates_is_said_first(rate_driven, times, first):
    """With both errors, whatever it is worse at; a model that is given duties has to predict the rates, too."""
    row = Baseline("path", "m", CURVE, times * 0.02, GIVEN, (times * 0.02,) * 4)
    worse = Baseline("heading", "rad", CURVE, 0.06, GIVEN, (0.06,) * 4)
    beside = against_rivals(verdict(), [row, worse], same_inputs=rate_driven)
    assert (beside.answer is Answer.INADEQUATE) is first
    assert (beside.as_dict()["rival"] != "") is first
    assert beside.as_dict()["baselines"][0]["error"] == pytest.approx(times * 0.02)
    for sentence in (beside.summary().split("No effect")[0], full_answer(beside, labels_of(beside))):
        assert ("8 mm against 20 mm" in sentence) is first
    assert any("8 mm against 20 mm" in caution for caution in beside.cautions) is (times < 1.0)


def test_without_the_rates_of_a_side_there_is_no_odometry():
    run = logged(drive_channels.drive(0, noise=0.0, hill=0.0))
    bare = dataclasses.replace(
        run, measured={name: row for name, row in run.measured.items() if not re.fullmatch("wheel_rate_.l", name)}
    )
    assert odometry_baselines(DriveExperiment((run, bare), (None, None)), ROVER) == ()
