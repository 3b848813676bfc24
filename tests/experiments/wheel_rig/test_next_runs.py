"""What a rig is asked to measure next is what it has not measured."""

import dataclasses
import math

import numpy as np

from rover_pin.base.files.paths import data_path
from rover_pin.experiments.wheel_rig.next_runs import LOADS, SLIPS, runs_ahead
from rover_pin.measurements.rig_reading import read_rig_set

DATA = read_rig_set(data_path("cmu-smooth-wheel"))


def is_like(run, second):
    """Whether two runs (load, slip) are of one level of slip, and loads within a factor of 1.5."""
    return abs(run[1] - second[1]) < 0.02 and 1 / 1.5 < run[0] / second[0] < 1.5


def runs(data):
    return list(zip(data.load.tolist(), data.slip.tolist(), strict=True))


def test_no_run_is_proposed_that_was_made():
    offered = runs(runs_ahead(DATA))
    assert not [run for run in offered if any(is_like(run, done) for done in runs(DATA))]
    everything = [(load * np.quantile(DATA.load, 0.5, method="lower"), slip) for load in LOADS for slip in SLIPS]
    left_out = [run for run in everything if not any(math.isclose(run[0], o[0]) and run[1] == o[1] for o in offered)]
    assert left_out
    assert all(any(is_like(run, done) for done in runs(DATA)) for run in left_out)


def test_where_all_was_measured_all_is_proposed_again():
    elsewhere = dataclasses.replace(DATA, slip=np.full_like(DATA.slip, 0.95))
    ahead = runs_ahead(elsewhere)
    again = runs_ahead(ahead)
    assert len(again.load) == len(ahead.load) == len(LOADS) * len(SLIPS)
    assert again.slip.tolist() == ahead.slip.tolist()
