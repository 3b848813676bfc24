"""Runs left out of a fit to a drive log, and the shape of chi2 along one of its numbers."""

import dataclasses

import numpy as np
import pytest

from rover_pin.discrepancy.cross_validation import held_out_residual, losses_of
from rover_pin.estimation.fit import Task, fit
from rover_pin.estimation.noise import first_noise, huber
from rover_pin.estimation.numbers import profiles
from rover_pin.estimation.profile import NORMAL_95
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_runs
from rover_pin.experiments.drive_log.model import base_model, nuisances, with_spread
from rover_pin.logs.drive_log import read_drive_log
from tests.experiments.drive_log import drive_sets


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    log = read_drive_log(drive_sets.write(tmp_path_factory.mktemp("short"), runs=3, duration=6.0))
    model = with_spread(base_model(log))
    experiment = experiment_of(logged_runs(log, model.rover), model)
    free = [one for one in nuisances(log, model) if one.name in ("soil.phi", "soil.k", "motor.gear")]
    noise = first_noise(experiment.observed - experiment.predict([model])[0], np.full(len(experiment.channels), 1e-6))
    return fit(Task(experiment, noise), model, free)


def test_held_out_run_does_not_shape_its_own_prediction(fitted):
    """Whatever its log says, the fit to the others predicts the same of it."""
    experiment, honest = fitted.task.experiment, held_out_residual(fitted)
    assert experiment.runs[1].channels == experiment.channels
    wrong = experiment.runs[1].observed + 3.0 * fitted.task.noise.sd[:, None]
    runs = (experiment.runs[0], dataclasses.replace(experiment.runs[1], observed=wrong), experiment.runs[2])
    other = dataclasses.replace(fitted, task=Task(dataclasses.replace(experiment, runs=runs), fitted.task.noise))
    spoiled = held_out_residual(other)
    moved = spoiled[1] - honest[1]
    known = np.isfinite(moved)
    shift = np.broadcast_to(3.0 * fitted.task.noise.sd[:, None], moved.shape)
    assert moved[known] == pytest.approx(shift[known], rel=1e-6)


def test_runs_left_out_cost_more_than_those_that_were_fitted(fitted):
    assert huber(fitted.rows) < losses_of(fitted).sum() < 2.0 * huber(fitted.rows)


def test_chi2_is_parabolic_along_a_number_that_acts_linearly(fitted):
    (profile,) = profiles(fitted, ("motor.gear",))
    values, rises = np.array(profile.values), np.array(profile.rises)
    assert len(values) == 7
    assert np.all(np.diff(values) > 0)
    assert rises[3] == 0.0
    assert rises[[1, 5]] == pytest.approx(NORMAL_95**2, rel=0.35)
    assert rises.min() > -0.5
