"""Slopes of replays to numbers: by steps that hold still, so that a difference over next to nothing is a derivative."""

import numpy as np
import pytest

from rover_pin.base.files.samples import data_path
from rover_pin.estimation.gauss_newton import slopes_at
from rover_pin.estimation.task import Task
from rover_pin.experiments.drive_log.calibrate import experiment_on
from rover_pin.experiments.drive_log.model import base_model, with_spread
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.simulation.replay import replay

FREE = ("soil.phi", "soil.theta_1", "soil.k", "motor.gear", "MotionResistance.R")
FIFTH = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}
"""Weights of a difference whose error is of the fourth order."""


@pytest.fixture(scope="module", params=["climb-1", "flat-steps"])
def made(request):
    log = read_drive_log(data_path("steepening-slope"))
    experiment, model, numbers = experiment_on(log, with_spread(base_model(log)))
    return experiment.alone(request.param), model, [number for number in numbers if number.name in FREE]


def test_a_replay_by_the_steps_of_its_own_is_the_same_to_the_bit(made):
    experiment, model, _ = made
    (free,) = experiment.replays(model)
    again = replay(model, experiment.runs[0].commands, rest_state=experiment.rests[0], steps=free.steps)
    assert len(set(free.steps.lengths)) > 1, "steps that never change test nothing"
    assert all((again.channels[name] == values).all() for name, values in free.channels.items())
    assert (again.steps.lengths == free.steps.lengths).all()


@pytest.mark.slow
def test_slopes_are_those_of_a_difference_of_a_higher_order(made):
    """Each to 2e-4 of its channel's largest, half of the channels to 5e-6; nothing loads the battery."""
    experiment, model, numbers = made
    u, h = np.array([number.u(experiment.value(model, number.name)) for number in numbers]), 2e-5
    slopes = slopes_at(Task(experiment, None), model, numbers, u)
    for number, here in zip(numbers, u, strict=True):
        around = [experiment.with_values(model, {number.name: number.value(here + k * h)}) for k in FIFTH]
        features = experiment.predict_near([model, *around])[1:]
        reference = sum(weight * feature for weight, feature in zip(FIFTH.values(), features, strict=True)) / h
        off, size = (np.abs(rows).max(axis=(0, 2)) for rows in (slopes[number.name] - reference, reference))
        seen = np.array(experiment.channels) != "battery_V"
        share = off[seen] / size[seen]
        assert np.median(share) < 5e-6, number.name
        assert share.max() < 2e-4, number.name
