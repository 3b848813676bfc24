"""A start at rest is pushed, to see whether it stays; one that slides is not, and what throws it off is told."""

from types import SimpleNamespace

import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation import simulate as module
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start.place import RESTS, SLIDES

DOUBT = "a push throws it off"


@pytest.mark.parametrize(
    ("standing", "doubt", "told"), [(RESTS, DOUBT, [DOUBT]), (RESTS, "", []), (SLIDES, DOUBT, []), ("", DOUBT, [])]
)
def test_a_start_at_rest_alone_is_pushed(standing, doubt, told, monkeypatch):
    monkeypatch.setattr(module, "begun", lambda asked, state: state)
    monkeypatch.setattr(module, "thrown_by_a_push", lambda drive: doubt)
    state = SimpleNamespace(copy=lambda: "a copy")
    assert module._Again(None, state, standing).pushed() == told


@pytest.mark.parametrize("settle", [True, False])
def test_what_a_push_throws_off_is_told_of_the_drive(settle, monkeypatch):
    """Also where half the step goes the same way; not where doubts are not to be settled."""
    monkeypatch.setattr(module._Again, "pushed", lambda self: [DOUBT])
    monkeypatch.setattr(module._Again, "halved", lambda self, rows, stop: None)
    trace = simulate(scenario("flat").model, ConstantDuty(0.3), 0.2, settle_doubts=settle)
    assert any(DOUBT in each for each in trace.attrs["warnings"]) is settle
