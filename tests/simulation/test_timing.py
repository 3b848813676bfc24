"""The times of a drive: whole multiples of the step, and what halving and refining make of them."""

import pytest

from rover_pin.base.errors import SimulationError
from rover_pin.simulation.timing import Timing


@pytest.mark.parametrize("name", ["control", "sample"])
@pytest.mark.parametrize("period", [0.0, 0.0025, 0.0075, 0.0125, -0.005])
def test_a_period_is_a_whole_number_of_steps_and_one_at_least(name, period):
    with pytest.raises(SimulationError, match=f"The {name} period {period:g}.*dt = 0.005"):
        Timing(**{name: period})
    assert getattr(Timing(**{name: 0.005}), name) == 0.005
    assert getattr(Timing(**{name: 0.015}), name) == 0.015


@pytest.mark.parametrize(("allowed", "refused"), [(1e-6, 0.99e-6), (0.1, 0.101)])
def test_a_step_lies_between_a_microsecond_and_a_tenth(allowed, refused):
    assert Timing(dt=allowed, control=1.0, sample=1.0).dt == allowed
    with pytest.raises(SimulationError, match=r"it.*\[1e-06, 0.1\]"):
        Timing(dt=refused, control=1.0, sample=1.0)


@pytest.mark.parametrize("tolerance", [0.0, -1e-4, float("nan")])
def test_a_tolerance_is_a_distance(tolerance):
    with pytest.raises(SimulationError, match=r"tolerance.*positive distance"):
        Timing(tolerance=tolerance)
