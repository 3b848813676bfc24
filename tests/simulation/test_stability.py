"""A rest is doubted where no step survives a small push, and ready-made drives are not doubted."""

import pytest

from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.driving import Drive
from rover_pin.simulation.start.place import settled
from rover_pin.simulation.start.stability import thrown_by_a_push
from rover_pin.simulation.timing import Timing

DT = 0.0025


def at_rest(name):
    chosen = scenario(name)
    state = settled(chosen.model, chosen.start)
    return Drive(chosen.model, state, Kernel(chosen.model, state, DT, False), chosen.controller, Timing(dt=DT))


@pytest.mark.parametrize("name", ["flat", "hills", "turn", "park"])
def test_ready_made_drives_are_not_doubted(name):
    assert thrown_by_a_push(at_rest(name)) == ""


def test_push_followed_by_a_failed_step_is_reported(monkeypatch):
    drive = at_rest("flat")
    monkeypatch.setattr(Kernel, "step", lambda kernel: 1)
    assert thrown_by_a_push(drive) == "a push of 0.1 mm/s throws the rover off where it stands"
