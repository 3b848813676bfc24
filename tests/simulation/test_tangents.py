"""Tangents of a drive that begins in the air, by numbers that no scenario has: its height, and the rover's geometry."""

import dataclasses

import numpy as np
import pytest

from rover_pin.control.open_loop import ConstantDuty
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.driving import RunningDrive, run_compiled
from rover_pin.simulation.start import Start, set_down
from rover_pin.simulation.stepping.timing import Timing
from rover_pin.simulation.tangents import Neighbour, NoTangentError, TangentDrive

DT, DURATION, WIDTH = 1.0 / 240.0, 1.0, 1e-6
TIMING = Timing(dt=DT, control=0.05, sample=0.05)
MODEL = scenario("flat").model


def falling(model, height=0.01):
    """A drive that begins above the ground, and takes equal steps."""
    state = set_down(MODEL, Start(), False).state
    state.q[2] += height
    lengths = np.full(round(DURATION / DT), DT)
    return RunningDrive(model, state, Kernel(model, state, DT, False), ConstantDuty(0.4), TIMING, followed=lengths)


def wider(model, change):
    """The rover on wheels whose radius is changed."""
    wheels = [
        dataclasses.replace(wheel, wheel=wheel.wheel.replace(r=wheel.wheel.r + change)) for wheel in model.rover.wheels
    ]
    return dataclasses.replace(model, rover=dataclasses.replace(model.rover, wheels=tuple(wheels)))


NUMBERS = {
    "height": lambda change: falling(MODEL, 0.01 + change),
    "wheel radius": lambda change: falling(wider(MODEL, change)),
    "shear displacement": lambda change: falling(
        dataclasses.replace(MODEL, soils=tuple(soil.replace(k=soil.k + change) for soil in MODEL.soils))
    ),
}


def test_a_drive_that_touches_down_has_the_tangents_of_central_differences():
    drive = TangentDrive(falling(MODEL), DURATION)
    inputs = []
    for changed in NUMBERS.values():
        inputs.append(drive.input_slopes([Neighbour(side / (2 * WIDTH), changed(side * WIDTH)) for side in (-1, 1)]))
    rows, slopes = drive.rows(inputs)
    patches = rows["record"][:, :, 8]
    assert len(rows) == round(DURATION / TIMING.sample)
    plain = run_compiled(falling(MODEL), DURATION, None).rows
    np.testing.assert_allclose(rows["q"], plain["q"], rtol=1e-9, atol=1e-11)
    assert patches[-1].min() == 1.0
    for slope, changed in zip(slopes, NUMBERS.values(), strict=True):
        below, above = (run_compiled(changed(side * WIDTH), DURATION, None).rows for side in (-1, 1))
        for name in ("q", "v", "record", "energy", "attitude"):
            expected = (above[name] - below[name]) / (2 * WIDTH)
            scale = max(np.abs(expected).max(), 1.0)
            assert np.abs(slope[name] - expected).max() < 1e-6 * scale, name


def test_a_drive_with_another_ground_is_no_neighbour():
    drive = TangentDrive(falling(MODEL), DURATION)
    ditch = dataclasses.replace(MODEL, terrain=scenario("ditch").model.terrain)
    with pytest.raises(NoTangentError, match="lane_"):
        drive.input_slopes([Neighbour(1.0, falling(ditch))])
