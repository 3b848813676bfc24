"""A drive in several parts equals the uninterrupted drive to the bit, including the states of effects and
controllers."""

from __future__ import annotations

import numpy as np
import pytest

from rover_pin import scenario, simulate
from rover_pin.base.errors import SimulationError
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.effects.winding_heating import WindingHeating
from rover_pin.simulation.state import DriveEnd
from rover_pin.simulation.stepping.timing import Timing


def case_of(name, **settings):
    case = scenario(name, **settings, duration=8.0)
    return case, case.model.having(DiggingMemory(c_d=0.1)).having(WindingHeating())


def asked(controller):
    """A controller with a memory that the compiled loop must call from Python."""

    class Kept:
        def reset(self):
            controller.reset()

        def __call__(self, reading):
            return controller(reading)

    return Kept()


@pytest.mark.parametrize("control", ["none", "true", "eq9", "asked"])
def test_a_drive_in_three_parts_is_the_drive_in_one(control):
    case, model = case_of("ditch", control="true" if control == "asked" else control)
    controller, timing = asked(case.controller) if control == "asked" else case.controller, Timing(tolerance=1e-3)
    trace = simulate(model, controller, 8.0, case.start, timing, symmetric=case.symmetric)
    parts = [simulate(model, controller, 5.0, case.start, timing, symmetric=case.symmetric)]
    for duration in (0.05, 2.95):
        parts.append(simulate(model, controller, duration, parts[-1].end, timing, symmetric=case.symmetric))
    for channel in trace.channels:
        joined = np.concatenate([part[channel] for part in parts])
        assert np.array_equal(joined, trace[channel], equal_nan=True), channel


def test_a_drive_that_cannot_continue_is_reported():
    case, model = case_of("flat")
    end = simulate(model, case.controller, 0.12, case.start, Timing(control=0.05, sample=0.02)).end
    assert isinstance(end, DriveEnd)
    for words, changes in (
        ("control period 0.05 s", {"timing": Timing(control=0.05, sample=0.02)}),
        ("same timing", {"timing": Timing()}),
        ("same timing", {"timing": Timing(control=0.05, sample=0.02), "symmetric": True}),
    ):
        with pytest.raises(SimulationError, match=words):
            simulate(model, case.controller, 1.0, end, **changes)
    with pytest.raises(SimulationError, match="another number"):
        simulate(case.model, case.controller, 1.0, simulate(model, case.controller, 0.1, case.start).end)


def test_a_drive_that_failed_has_no_end_to_go_on_from():
    case = scenario("flat", control="none", duration=2.0)
    trace = simulate(case.model.replace(buried=1e-4), case.controller, 2.0, case.start)
    assert trace.attrs["stop"].startswith("buried")
    assert trace.end is None
