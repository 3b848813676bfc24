"""The default step keeps what its docstring says, on the ditch that it is stated for."""

import dataclasses

import numpy as np
import pytest

from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.timing import ACCURACY, DT

DITCHES = {
    "stopped by the wall": scenario("ditch", soil="table-1"),
    "gets out": scenario("ditch", soil="table-1", **{"soil.k": 0.010, "cruise_slip": 0.05}),
}


def x_at(case, dt):
    return dataclasses.replace(case, timing=dataclasses.replace(case.timing, dt=dt)).drive()["body_x"]


@pytest.mark.parametrize("name", DITCHES)
def test_x_is_within_the_stated_distance_of_finer_steps(name):
    case = DITCHES[name]
    finer = x_at(case, DT / 16)
    off = {share: float(np.max(np.abs(x_at(case, share * DT) - finer))) for share in (2, 1)}
    assert off[1] <= ACCURACY
    assert off[2] <= ACCURACY, "the benchmark states the speed at twice the step too"
