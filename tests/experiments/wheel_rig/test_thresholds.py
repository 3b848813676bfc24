"""What the check of a rig set says, just within and just beyond each of its limits."""

import dataclasses

import numpy as np
import pytest

from rover_pin.contact import Wheel
from rover_pin.experiments.wheel_rig.checks import findings, repeat_sd, too_poor
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.measurements.channel import DrawbarPull, Sinkage, Torque
from rover_pin.measurements.rig_set import RigSet

LEVELS, SD = 6, 0.1


def rig_of(pull, levels=LEVELS, slips=None, load=15.0, others=()):
    """Drawbar pulls of `repeats` runs at each level."""
    pull = np.asarray(pull, dtype=float)
    slip = np.repeat(np.linspace(0.0, 0.6, levels) if slips is None else slips, len(pull) // levels)
    return RigSet(Wheel(r=0.05), slip, load, (DrawbarPull(pull, SD), *others))


def scattered(times):
    """Two repeats a level, whose pooled SD is so many times the stated noise."""
    return np.repeat(np.linspace(0, 1, LEVELS), 2) + np.tile([1, -1], LEVELS) * times * SD / np.sqrt(2)


def said(data):
    return " ".join(map(str, findings(RigExperiment((data,)))))


@pytest.mark.parametrize("times", [0.5, 1.0, 3.0])
def test_the_pooled_sd_of_repeats(times):
    data = rig_of(scattered(times))
    assert repeat_sd(data, data.channels[0]) == pytest.approx(times)
    alone = rig_of(np.linspace(0, 1, LEVELS))
    assert np.isnan(repeat_sd(alone, alone.channels[0]))
    assert "no level is repeated" in said(alone)
    assert "no level is repeated" not in said(data)


def test_channels_that_were_not_measured_are_named():
    assert "torque was not measured" in said(rig_of(scattered(0.5)))
    assert "sinkage was not measured" in said(rig_of(scattered(0.5)))
    both = rig_of(scattered(0.5), others=(Torque(scattered(0.5), SD), Sinkage(0.01 + 0 * scattered(1.0), 1e-3)))
    assert "was not measured" not in said(both)
    assert "no speeds" in said(both)
    assert "no speeds" not in said(dataclasses.replace(both, speeds=np.ones((2 * LEVELS, 2))))


def experiment_of(*arguments, **named):
    return RigExperiment((rig_of(*arguments, **named),))


def test_what_is_too_poor():
    enough = rig_of(scattered(0.5))
    assert too_poor(RigExperiment((enough,)), 9) == ""
    assert "12 measured values for 10 uncertain soil constants" in too_poor(RigExperiment((enough,)), 10)
    assert too_poor(experiment_of(scattered(0.5), slips=np.linspace(0.1, 0.26, LEVELS)), 2) == ""
    assert "slips span 0.14 only" in too_poor(experiment_of(scattered(0.5), slips=np.linspace(0.1, 0.24, LEVELS)), 2)
    assert too_poor(experiment_of(scattered(0.5), levels=3), 2) == ""
    assert "2 levels of slip" in too_poor(experiment_of(scattered(0.5), levels=2), 2)
