"""What holds of the compiled step by itself: taken back, mirrored, with other soils, without a differential."""

import dataclasses

import numpy as np
import pytest

from rover_pin.effects.supply_sag import SupplySag
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.plain.step import Plain
from rover_pin.simulation.start.place import Start, settled
from tests.simulation import kernel_cases as cases

ROVER, CASES = cases.ROVER, cases.CASES


@pytest.mark.parametrize("kind", [Kernel, Plain])
def test_steps_that_are_taken_back_leave_nothing_behind(kind):
    """A motor whose current and supply, and gears whose wind-up, the next step reads as well."""
    made = CASES["two-widths"][0].having(SupplySag())
    state = settled(made, Start())
    stepper = kind(made, state, 0.005, False)
    stepper.duty[:] = np.linspace(0.4, 0.9, 6)
    for _ in range(5):
        stepper.step()
    saved = stepper.saved()
    ends = []
    for _ in range(2):
        stepper.restore(saved)
        assert [stepper.step() for _ in range(4)] == [0] * 4
        ends.append([stepper.misjudged, *(each.tobytes() for each in stepper.saved())])
    assert ends[0] == ends[1]


def test_changed_soils_act_as_if_present_from_the_start():
    made, start = CASES["eq-1"]
    firmer = tuple(soil.replace(phi=soil.phi * 1.1) for soil in made.soils)
    state = settled(made, start)
    other = state.copy()
    kernel = Kernel(made, state, 0.005, symmetric=False)
    fresh = Kernel(dataclasses.replace(made, soils=firmer), other, 0.005, symmetric=False)
    kernel.set_soils(np.array([list(soil.values().values()) for soil in firmer]))
    for _ in range(100):
        kernel.duty[:] = fresh.duty[:] = 0.7
        assert (kernel.step(), fresh.step()) == (0, 0)
    assert np.array_equal(state.q, other.q)
    assert np.array_equal(kernel.record, fresh.record)
