"""The built-in controllers in the compiled loop against their Python classes, sample by sample: to the bit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.control.slip_control import Gains, SlipControl
from rover_pin.control.slip_estimate import TrueSlip
from rover_pin.control.torque_limit import NoLimit, TorqueLimit, TorqueLimited
from rover_pin.motion.native.control import commands_of
from rover_pin.motion.simulate import simulate
from rover_pin.scenarios import scenario

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
}


def asked(controller):
    """The same controller as one that the loop does not know."""
    return lambda reading: controller(reading)


@pytest.mark.parametrize("name", CASES)
def test_a_built_in_controller_drives_as_its_class_does(name):
    shape, settings = CASES[name]
    case = scenario(shape, **settings, duration=8.0)
    drives, kept = [], []
    assert commands_of(case.controller, 6) is not None
    for controller in (case.controller, asked(case.controller)):
        if hasattr(case.controller, "reset"):
            case.controller.reset()
        drives.append(simulate(case.model, controller, 8.0, case.start, case.timing, symmetric=case.symmetric))
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

    def held(self, duty, reading):
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
    case = scenario("flat", duration=1.0)
    assert commands_of(controller, 6) is None
    trace = simulate(case.model, controller, 1.0, case.start)
    assert np.max(np.abs(trace["duty_fl"])) <= 0.3


def test_a_limit_over_a_controlled_wheel_is_asked():
    """Two laws one over the other: the loop takes one."""
    case = scenario("flat", control="true")
    limited = TorqueLimited(case.controller, TorqueLimit.saturation(case.model))
    assert commands_of(limited, 6) is None
