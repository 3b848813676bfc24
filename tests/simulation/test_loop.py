"""The compiled loop from Python: what it asks, what it tells on the way, and what it refuses to hold."""

import numpy as np
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.checkpoint import Checkpoint
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.native.control import Commands, commands_of
from rover_pin.simulation.native.loop import Loop, Outcome
from rover_pin.simulation.pace import FINEST
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start.place import Start, settled
from rover_pin.simulation.timing import Timing

MODEL = scenario("flat").model


def loop_of(steps=6, per_sample=2, **more):
    return Loop(Kernel(MODEL, settled(MODEL, Start()), 0.005, symmetric=False), 0.005, steps, per_sample, **more)


@pytest.mark.parametrize("steps", [0, 1, 2, 3])
def test_a_drive_that_goes_on_asks_where_it_ended(steps):
    loop = loop_of(per_sample=1, per_control=1)
    loop.ask()
    loop.go_on(Checkpoint(1.0, steps, FINEST))
    assert loop.run(6) is Outcome.ASKS
    assert (loop.checkpoint.steps, loop.state.t) == (steps, pytest.approx(1.0 + 0.005 * steps))


class Fixed:
    """A controller that is built in, of so many wheels and servos."""

    def __init__(self, duty, steer):
        self.commands = Commands(duty=duty, steer=steer)

    def __call__(self, reading):
        raise NotImplementedError

    def native(self, wheels):
        return self.commands


@pytest.mark.parametrize(
    ("duty", "steer", "servos", "fits"),
    [
        (0.5, 0.1, 4, True),
        (np.zeros(6), np.zeros(4), 4, True),
        (np.zeros(5), 0.1, 4, False),
        (0.5, np.zeros(3), 4, False),
        (0.5, np.zeros(3), None, True),
        (0.5, 0.0, 0, True),
        (0.5, np.zeros(3), 0, True),
    ],
)
def test_commands_of_another_rover_are_asked_for(duty, steer, servos, fits):
    """That refuses them; where nothing steers angles are not read."""
    controller = Fixed(duty, steer)
    assert commands_of(controller, 6, servos) is (controller.commands if fits else None)


def test_a_compiled_drive_tells_how_far_it_is_every_fifty_rows():
    told = []
    simulate(MODEL, ConstantDuty(0.3), 0.6, timing=Timing(0.005, 0.005, 0.005), progress=told.append)
    assert told == pytest.approx([0.25, 0.5])
