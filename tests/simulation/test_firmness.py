"""How firmly a rover stands is told by the wheels that stand and are pressed in, and by soil that bears."""

import dataclasses

import numpy as np
import pytest

from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.resolution import firmness, stiffness
from rover_pin.simulation.start.place import Start, settled

MODEL = scenario("flat").model
DEPTH, LOAD = RECORD.index("sinkage"), RECORD.index("normal")


class Pressed:
    """A stepper whose wheels have these depths and loads, and others once it was pressed in."""

    def __init__(self, before, after):
        self.state, self.record = settled(MODEL, Start()), np.zeros((6, len(RECORD)))
        self.rest, self.told = float(self.state.q[2]), (before, after)

    def saved(self):
        return [self.state.q.copy(), self.record.copy()]

    def restore(self, saved):
        self.state.q[:], self.record[:] = saved

    def step(self):
        self.record[:, [DEPTH, LOAD]] = self.told[int(self.state.q[2] < self.rest)]


def rows(**changed):
    """Six wheels 5 mm deep under 10 N, pressed in by 1 um on the ground's own stiffness; some otherwise."""
    ground = stiffness(10.0, MODEL.rover.wheel, MODEL.soils[0])
    before, after = np.tile([0.005, 10.0], (6, 1)), np.tile([0.005 + 1e-6, 10.0 + 1e-6 * ground], (6, 1))
    before[0], after[0] = changed.get("first", (before[0], after[0]))
    before[1], after[1] = changed.get("second", (before[1], after[1]))
    return before, after


@pytest.mark.parametrize(
    "odd",
    [
        ((0.0, 0.0), (1e-6, 5.0)),
        ((0.005, 0.0), (0.006, 5.0)),
        ((0.005, 10.0), (0.005, 10.0)),
        ((0.005, 10.0), (0.005 - 1e-9, 9.0)),
    ],
    ids=["touches first when pressed", "bears nothing", "stays", "rises"],
)
def test_a_wheel_counts_that_stands_and_is_pressed_in(odd):
    assert firmness(Pressed(*rows(first=odd)), MODEL) == pytest.approx(1.0)
    firm = ((0.005, 10.0), (0.005 + 1e-6, 10.0 + 7e-6 * stiffness(10.0, MODEL.rover.wheel, MODEL.soils[0])))
    assert firmness(Pressed(*rows(first=odd, second=firm)), MODEL) == pytest.approx(7.0)


def test_soil_that_bears_nothing_is_no_measure_of_firmness():
    """k_1 + k_2 b below 0, as of moduli that were fitted to wheels of another width."""
    none = dataclasses.replace(MODEL, soils=tuple(soil.replace(k_1=-1e4) for soil in MODEL.soils))
    assert firmness(Pressed(*rows()), none) == 1.0
