"""Odometry with a fitted slip, on the log of a rover that is exactly that."""

import dataclasses

import numpy as np

from rover_pin.discrepancy.held_out import ChannelScore, losses
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import logged_run
from rover_pin.experiments.drive_log.kinematic import kinematic
from rover_pin.rover.rover import load_rover
from tests.experiments.drive_log import drive_channels

ROVER = load_rover("nexus6")


def logged(run):
    return logged_run(drive_channels.log_of(run).runs[0], ROVER)


def errors(*runs):
    made = tuple(map(logged, runs))
    return {one.channel: one for one in kinematic(DriveExperiment(made, (None,) * len(made)), ROVER)}


def farther(run, times):
    """The same wheels, the rover so many times as far."""
    return run | {"body_x": times * run["body_x"]}


def test_uniform_slip_is_met_and_differing_slip_is_missed():
    one, other = (drive_channels.drive(seed, noise=0.0, hill=0.0) for seed in (0, 1))
    alike = errors(one, other)
    seen = logged(one)
    driven = np.sqrt(np.nanmean(seen.observed[seen.channels.index("path")] ** 2))
    assert alike["path"].error < 0.01 * driven  # half a row's way: the rover's own steps are longer than the rows
    assert alike["drift"].error < 1e-12
    slower = errors(one, farther(other, 0.8))
    assert slower["path"].error > 0.15 * driven


def test_a_model_that_loses_to_odometry_is_said_to_lose():
    found = errors(*(drive_channels.drive(seed, noise=0.0, hill=0.0) for seed in (0, 1)))
    score = ChannelScore("path", "m", 1e-4, 0.02, 0.01, -0.5, -0.6, -0.4)
    (said,) = losses([score], list(found.values()))
    assert "path is predicted better by a kinematic model with fitted slip of the measured wheel rates" in said
    assert losses([score._replace(after=0.0)], list(found.values())) == ()


def test_without_a_wheels_rate_there_is_no_odometry():
    run = logged(drive_channels.drive(0, noise=0.0, hill=0.0))
    bare = dataclasses.replace(run, measured={name: row for name, row in run.measured.items() if "rate_fl" not in name})
    assert kinematic(DriveExperiment((run, bare), (None, None)), ROVER) == ()
