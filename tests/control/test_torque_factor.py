"""The torque that a model's whole contact law asks of a wheel, settled at a slip."""

import numpy as np
import pytest

from rover_pin.control.torque_factor import torque_factors
from rover_pin.effects.post_peak import PostPeak
from rover_pin.scenarios.scenario import scenario

SLIPS = np.linspace(-1.0, 1.0, 9)


def factors(**settings):
    return torque_factors(scenario("flat", **settings).model, SLIPS)


def test_a_loss_past_the_peak_is_taken_off():
    lost = 0.4 * (1.0 - np.exp(-((SLIPS / float(PostPeak().S_w)) ** 2)))
    weakened = factors(add="PostPeak.fraction=0.4", **{"soil.k": 0.005})
    assert weakened == pytest.approx((1.0 - lost) * factors(**{"soil.k": 0.005}), abs=1e-12)


def test_a_hole_not_yet_dug_and_a_patch_elsewhere_change_nothing():
    plain = factors()
    assert factors(add="DiggingMemory") == pytest.approx(plain, abs=1e-12)
    assert factors(add="HardPatch.x_from=0.5,length=0.3,g=1") == pytest.approx(plain, abs=1e-9)


def test_a_measured_drive_has_it():
    """On the flat the logged torque over r f_n of a settled wheel is the factor at its logged slip."""
    scene = scenario("incline", duration=8.0, **{"soil.k": 0.01, "terrain.start": -5.0, "add": "PostPeak.fraction=0.3"})
    trace = scene.drive()
    radius, motor = float(scene.model.rover.wheel.r), float(scene.model.motor.constant)
    for wheel in ("fl", "ml", "rr"):
        (expected,) = torque_factors(scene.model, [trace[f"slip_{wheel}"][-1]])
        torque = motor * trace[f"current_{wheel}_A"][-1]
        assert torque / (radius * trace[f"normal_{wheel}"][-1]) == pytest.approx(expected, rel=0.02)
