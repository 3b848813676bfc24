"""What is worked out once for a rover stays as it was, whatever is driven, and is not taken for another's."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.point_mass import PointMass
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start.place import Start, settled


def kernel_of(model):
    return Kernel(model, settled(model, Start()), 0.005, symmetric=False)


def test_a_drive_and_a_rest_write_nothing_that_drives_share():
    case = scenario("turn", duration=1.0)
    shared = kernel_of(case.model).fixed
    before = {name: array.copy() for name, array in shared.keep.items()}
    plain = bytes(shared.struct)
    trace = case.drive()
    assert kernel_of(case.model).fixed is shared
    assert bytes(shared.struct) == plain
    assert not any(array.flags.writeable for array in shared.keep.values())
    assert all(np.array_equal(array, before[name]) for name, array in shared.keep.items())
    assert np.array_equal(case.drive()["body_x"], trace["body_x"])


@pytest.mark.parametrize(
    "change",
    [
        lambda model: model.having(PointMass(m=1.0, shift_x=0.02)),
        lambda model: model.having(GravityTilt(rise_x=0.05)),
        lambda model: dataclasses.replace(model, gravity=1.62),
        lambda model: dataclasses.replace(model, motor=Motor(gear=100.0, rotor_inertia=2e-8)),
    ],
    ids=["ballast", "tilt", "moon", "rotor"],
)
def test_a_drive_between_two_others_of_the_rover_changes_neither(change):
    model = scenario("flat").model
    drives = [simulate(each, lambda reading: np.full(6, 0.5), 0.5)["body_x"] for each in (model, change(model), model)]
    assert np.array_equal(drives[0], drives[2])
    assert not np.array_equal(drives[0], drives[1])
