"""The built-in controllers in the compiled loop against their Python classes, sample by sample: to the bit."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.control.slip_control import Gains, SlipControl
from rover_pin.control.slip_estimate import TrueSlip
from rover_pin.control.torque_check import NoLimit, TorqueLimit, TorqueLimited
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.command import Reading
from rover_pin.simulation.native.control import commands_of
from rover_pin.simulation.native.loop import QUESTIONS
from rover_pin.simulation.simulate import plain_simulate, simulate
from rover_pin.simulation.start.place import Start
from studies.shared.tacking import Tacking, TackingControl

CASES = {
    "none": ("ditch", {}),
    "limit": ("ditch", {"control": "limit"}),
    "limit backwards": ("flat", {"control": "limit", "control.delta": -0.7, "control.slip_limit": 0.1}),
    "eq9": ("ditch", {"control": "eq9"}),
    "eq9 backwards": ("flat", {"control": "eq9", "control.delta_0": -0.5, "control.delta_min": -0.6}),
    "true, no limit": ("ditch", {"control": "true", "control.limit": "none", "control.S_d": 0.3}),
    "true, at a slip": ("slope", {"control": "true", "control.limit": "at-slip"}),
    "turn": ("turn", {}),
    "point-turn": ("flat", {"control": "point-turn"}),
    "crab": ("flat", {"control": "crab"}),
}


def asked(controller):
    """The same controller as one that the loop does not know."""
    return lambda reading: controller(reading)


@pytest.mark.parametrize("name", CASES)
def test_a_built_in_controller_drives_as_its_class_does(name):
    shape, settings = CASES[name]
    case = scenario(shape, soil="table-1", **settings, duration=8.0)
    drives, kept = [], []
    assert commands_of(case.controller, 6) is not None
    for controller in (case.controller, asked(case.controller)):
        if hasattr(case.controller, "reset"):
            case.controller.reset()
        how = {"symmetric": case.symmetric, "measure_error": False}  # one of a user is not driven again at finer steps
        drives.append(simulate(case.model, controller, 8.0, case.start, case.timing, **how))
        kept.append(np.array(getattr(case.controller, "integral", 0.0)))
    for channel in drives[0].channels:
        assert np.array_equal(drives[0][channel], drives[1][channel], equal_nan=True), channel
    assert np.array_equal(*kept)


class Careful(ConstantDuty):
    """A controller of a user, made from one of the package's."""

    def __call__(self, reading):
        return 0.2


@dataclass(frozen=True)
class Half(NoLimit):
    """A limit of a user."""

    def duty(self, reading):
        return 0.1

    def clip_duty(self, duty, reading):
        return min(duty, 0.1)


@pytest.mark.parametrize(
    "controller",
    [
        lambda reading: 0.3,
        Careful(),
        TorqueLimited(ConstantDuty(), Half()),
        TorqueLimited(Careful(), NoLimit()),
        SlipControl(Gains(), TrueSlip(), Half()),
    ],
    ids=["function", "subclass", "limit of a user", "limited subclass", "slip control under a user's limit"],
)
def test_what_a_user_wrote_is_asked(controller):
    case = scenario("flat", soil="table-1", duration=1.0)
    assert commands_of(controller, 6) is None
    trace = simulate(case.model, controller, 1.0, case.start)
    assert np.max(np.abs(trace["duty_fl"])) <= 0.3


@pytest.mark.parametrize("limited", [False, True], ids=["free", "under a torque limit"])
@pytest.mark.parametrize("rover", ["nexus6", "cart"])
def test_tacking_in_the_loop_is_that_of_its_class(rover, limited):
    """Through the ditch, with turns to both sides."""
    case = scenario("ditch", rover=rover, **{"soil.k": 0.01})
    control = TackingControl(
        case.model.rover, Tacking(0.2, radius=0.8, alert=0.05, calm=1.5, delta=0.5, delta_climb=0.7)
    )
    whole = TorqueLimited(control, TorqueLimit.at_slip(case.model)) if limited else control
    assert commands_of(whole, len(case.model.rover.wheels)) is not None
    drives, kept = [], []
    for controller in (whole, asked(whole)):
        control.reset()
        drives.append(simulate(case.model, controller, 12.0, Start(0.0, 0.0, 0.15)))
        kept.append(control.memory.copy())
    for channel in drives[0].channels:
        assert drives[0][channel] == pytest.approx(drives[1][channel], rel=1e-8, abs=1e-8, nan_ok=True), channel
    assert np.array_equal(*kept)
    assert drives[0].attrs["stop"] == drives[1].attrs["stop"] == "duration"
    assert len(np.unique(drives[0].stack("duty"))) > 10


def test_drive_readings_are_looked_up_when_they_are_accessed():
    """Also much later, when the drive has gone on; and it is what the plain step shows."""
    case, kept = scenario("ditch", soil="table-1"), []

    def watching(reading):
        kept.append(reading)
        return 0.5 + 0.1 * math.sin(9.0 * reading.t)

    trace = simulate(case.model, watching, 20.0, case.start)
    assert len(kept) == 400 > QUESTIONS
    assert set(vars(kept[7])) == {"_rows", "_at", "_places", "_row", "t"}
    for at in (1, 150, 399):
        row = round(at * case.timing.control / case.timing.sample) - 1
        now = kept[at]
        assert now.t == pytest.approx(0.05 * at)
        assert now.attitude == tuple(trace[f"body_{angle}"][row] for angle in ("roll", "pitch", "yaw"))
        assert now.truth.slip.tolist() == [trace[f"slip_{wheel.name}"][row] for wheel in case.model.rover.wheels]
        assert now.truth.position.tolist() == [trace[f"body_{axis}"][row] for axis in "xyz"]
        assert now.wheel_rate.tolist() == [trace[f"wheel_rate_{wheel.name}"][row] for wheel in case.model.rover.wheels]


def test_the_plain_step_shows_a_controller_the_same():
    case, seen = scenario("ditch", soil="table-1"), ([], [])
    for drive, kept in zip((simulate, plain_simulate), seen, strict=True):
        drive(case.model, lambda reading, kept=kept: kept.append(reading) or 0.5, 0.15, case.start)
    for mine, theirs in zip(*seen, strict=True):
        for field in dataclasses.fields(Reading)[:-1]:
            name = field.name
            assert getattr(mine, name) == pytest.approx(getattr(theirs, name), rel=1e-9, abs=1e-11), name
        for name, told in mine.truth._asdict().items():
            assert told == pytest.approx(getattr(theirs.truth, name), rel=1e-9, abs=1e-11), name
    changed = seen[0][1].replace(current=np.ones(6))
    assert (changed.t, changed.current.tolist()) == (seen[0][1].t, [1.0] * 6)
