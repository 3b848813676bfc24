"""A rest is doubted where a small push throws the rover off, by its own speed, and by nothing else."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.driving import Drive
from rover_pin.simulation.start.place import settled
from rover_pin.simulation.start.stability import thrown_by_a_push
from rover_pin.simulation.timing import Timing

DT = 0.0025


class Growing:
    """A drive whose speed grows by e^(rate t), along x or y; one that fails after `fails` steps."""

    def __init__(self, rate, side=0, fails=math.inf):
        self.state = SimpleNamespace(v=np.zeros(6))
        self.grows, self.side, self.fails, self.steps = math.exp(rate * DT), side, fails, 0
        self.timing, self.stepper = SimpleNamespace(dt=DT), self

    def saved(self):
        return [self.state.v.copy()]

    def restore(self, saved):
        self.state.v[...] = saved[0]
        self.steps = 0

    def step(self):
        self.steps += 1
        speed = self.grows * np.linalg.norm(self.state.v)
        self.state.v[:] = 0.0
        self.state.v[self.side] = speed
        return int(self.steps > self.fails)


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("share", "told"), [(1.02, True), (0.98, False), (-1.0, False)])
def test_push_growing_beyond_driving_speed_is_reported(side, share, told):
    """A 500th of the driving speed, within a twentieth of a second: rate ln(500) / .05 s."""
    rate = share * math.log(500.0) / 0.05
    said = thrown_by_a_push(Growing(rate, side))
    assert said == ("a push of 0.1 mm/s throws the rover off where it stands" if told else "")


def test_a_push_of_one_sense_alone_is_enough():
    class OneWay(Growing):
        def step(self):
            self.state.v[0] *= 1.5 if self.state.v[0] < 0.0 else 0.5
            return 0

    assert thrown_by_a_push(OneWay(0.0))


@pytest.mark.parametrize(("fails", "told"), [(3, True), (round(0.05 / DT), False)])
def test_push_followed_by_a_failed_step_is_reported(fails, told):
    assert bool(thrown_by_a_push(Growing(0.0, fails=fails))) is told


@pytest.mark.parametrize("name", ["flat", "hills", "turn", "park"])
def test_ready_made_drives_are_not_doubted(name):
    chosen = scenario(name)
    state = settled(chosen.model, chosen.start)
    drive = Drive(chosen.model, state, Kernel(chosen.model, state, DT, False), chosen.controller, Timing(dt=DT))
    assert thrown_by_a_push(drive) == ""
