"""Sensors, estimate and stop within the compiled loop: to the bit what the same controller does when it is asked."""

import dataclasses

import numpy as np
import pytest

from rover_pin import scenario, simulate
from rover_pin.control.sensing.onboard_slip import OnboardSlip
from rover_pin.simulation.native.control import commands_of
from rover_pin.simulation.sensors import NoisyController, Sensors
from studies.shared.tacking import TackingControl

CONTROLS = {
    "hole law": {"control": "onboard"},
    "constant S_d": {"control": "onboard", "control.aim": "constant"},
    "limited, never stopped": {"control": "onboard", "control.stop": "never", "control.limit": "at-slip"},
    "true slip": {"control": "true", "control.aim": "hole"},
    "Eq 9": {"control": "eq9", "control.limit": "saturation"},
    "constant duty": {},
}
TACKS = "tacking"
DIGS = {"soil": "table-1", "soil.k": 0.03, "terrain.angle_deg": 9.0, "add": "DiggingMemory.c_d=0.15"}


def controller_of(name, noisy, scene="ditch", **settings):
    chosen = scenario(scene, **CONTROLS.get(name, {}), **settings)
    if name == TACKS:
        chosen = dataclasses.replace(chosen, controller=TackingControl(chosen.model.rover))
    return chosen, NoisyController(chosen.controller, Sensors(), 3) if noisy else chosen.controller


def alike(first, second):
    assert first.attrs["stop"] == second.attrs["stop"]
    for channel in first.channels:
        assert first[channel].tobytes() == second[channel].tobytes(), channel


@pytest.mark.parametrize("noisy", [True, False])
@pytest.mark.parametrize("name", [*CONTROLS, TACKS])
def test_a_control_in_the_loop_is_the_one_that_is_asked(name, noisy):
    chosen, control = controller_of(name, noisy)
    wheels = len(chosen.model.rover.wheels)
    assert commands_of(control, wheels) is not None
    trace_of_own = simulate(chosen.model, control, 8.0, chosen.start, measure_error=False)
    _, asked_control = controller_of(name, noisy)
    alike(
        trace_of_own,
        simulate(chosen.model, lambda reading: asked_control(reading), 8.0, chosen.start, measure_error=False),
    )


def test_it_stops_for_good_in_the_loop_too():
    chosen, control = controller_of("hole law", True, "incline", **DIGS)
    trace = simulate(chosen.model, control, 25.0, chosen.start, measure_error=False)
    assert control.controller.stopped
    assert trace["duty_fl"][-1] == 0.0
    _, asked_control = controller_of("hole law", True, "incline", **DIGS)
    alike(
        trace, simulate(chosen.model, lambda reading: asked_control(reading), 25.0, chosen.start, measure_error=False)
    )
    assert asked_control.controller.stopped


def test_a_drive_in_two_parts_senses_as_one():
    chosen, control = controller_of("hole law", True)
    trace = simulate(chosen.model, control, 4.0, chosen.start, measure_error=False)
    first = simulate(chosen.model, control, 1.6, chosen.start, measure_error=False)
    second = simulate(chosen.model, control, 2.4, first.end, measure_error=False)
    np.testing.assert_array_equal(np.r_[first["body_x"], second["body_x"]], trace["body_x"])


def test_what_must_be_asked_is_asked():
    class Own(OnboardSlip):
        """An estimate of a user's own."""

    chosen, control = controller_of("hole law", False)
    assert commands_of(NoisyController(NoisyController(control, Sensors(), 1), Sensors(), 2), 6) is None, (
        "noise upon noise"
    )
    camera = scenario("ditch", control="camera").controller
    assert commands_of(camera, 6) is None
    control.controller.estimate = Own.of(chosen.model)
    assert commands_of(control, 6) is None
