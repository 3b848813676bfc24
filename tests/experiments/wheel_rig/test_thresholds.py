"""What the check of a rig set says, just within and just beyond each of its limits."""

import dataclasses

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.contact import Wheel
from rover_pin.experiments.wheel_rig.checks import findings, refuse_unfit, repeat_sd, too_poor
from rover_pin.experiments.wheel_rig.data import as_rig_set
from rover_pin.measurements.channel import DrawbarPull, Sinkage, Torque
from rover_pin.measurements.wheel_rig import WheelRig

LEVELS, SD = 6, 0.1


def rig_of(pull, levels=LEVELS, slips=None, load=15.0, others=()):
    """Drawbar pulls of `repeats` runs at each level."""
    pull = np.asarray(pull, dtype=float)
    slip = np.repeat(np.linspace(0.0, 0.6, levels) if slips is None else slips, len(pull) // levels)
    return as_rig_set(WheelRig(Wheel(r=0.05), slip, load, (DrawbarPull(pull, SD), *others)))


def scattered(times):
    """Two repeats a level, whose pooled SD is so many times the stated noise."""
    return np.repeat(np.linspace(0, 1, LEVELS), 2) + np.tile([1, -1], LEVELS) * times * SD / np.sqrt(2)


def said(data):
    return " ".join(map(str, findings(data)))


@pytest.mark.parametrize("times", [0.5, 1.0, 3.0])
def test_the_pooled_sd_of_repeats(times):
    data = rig_of(scattered(times))
    assert repeat_sd(data, data.rig.channels[0]) == pytest.approx(times)
    alone = rig_of(np.linspace(0, 1, LEVELS))
    assert np.isnan(repeat_sd(alone, alone.rig.channels[0]))
    assert "no level is repeated" in said(alone)
    assert "no level is repeated" not in said(data)


def test_too_small_a_stated_noise_is_pointed_at_from_1_6_times():
    assert "the stated noise" not in said(rig_of(scattered(1.55)))
    assert "repeats scatter 1.7 times as much as the stated noise" in said(rig_of(scattered(1.66)))


@pytest.mark.parametrize("loads", [(10.0, 20.0), (30.0, 50.0), (10.0, 11.5)])
def test_runs_of_a_level_under_other_loads_are_no_repeats(loads):
    """The set with two loads that the page asks for was told that its repeats scatter 4 times the noise."""
    data = rig_of(scattered(5.0), load=np.tile(loads, LEVELS))
    assert "the stated noise" not in said(data)
    assert "no level is repeated" in said(data)


def test_repeats_are_found_among_runs_of_two_loads():
    """Each level twice under either load, in any order: the pooled SD is that within a load."""
    pull = np.repeat(np.linspace(0, 1, LEVELS), 4) + np.tile([0.0, 1.0, 0.0, 1.0], LEVELS)
    pull += np.tile([1, 1, -1, -1], LEVELS) * 3.0 * SD / np.sqrt(2)
    data = rig_of(pull, load=np.tile([30.0, 50.0, 30.9, 49.0], LEVELS))
    assert repeat_sd(data, data.rig.channels[0]) == pytest.approx(3.0)
    assert "repeats scatter 3.0 times" in said(data)


@pytest.mark.parametrize(("off", "named"), [(4.9, False), (5.1, True)])
def test_a_run_5_sd_from_its_repeats_is_named(off, named):
    pull = np.repeat(np.linspace(0, 1, LEVELS), 3)
    pull[4] += off * SD
    assert ("run 5 lies 5 SD from its repeats" in said(rig_of(pull))) == named


def test_loads_within_half_as_much_again_count_as_alike():
    for ratio, alike in ((1.45, True), (1.55, False)):
        data = rig_of(scattered(0.5), load=np.tile([10.0, 10.0 * ratio], LEVELS))
        assert ("all loads are alike" in said(data)) == alike


def test_channels_that_were_not_measured_are_named():
    assert "torque was not measured" in said(rig_of(scattered(0.5)))
    assert "sinkage was not measured" in said(rig_of(scattered(0.5)))
    both = rig_of(scattered(0.5), others=(Torque(scattered(0.5), SD), Sinkage(0.01 + 0 * scattered(1.0), 1e-3)))
    assert "was not measured" not in said(both)
    assert "no speeds" in said(both)
    assert "no speeds" not in said(dataclasses.replace(both, speeds=np.ones((2 * LEVELS, 2))))


@pytest.mark.parametrize(("times", "refused"), [(2.9, False), (3.1, True)])
def test_forces_beyond_3_loads_are_in_a_wrong_unit(times, refused):
    for kind, unit in ((DrawbarPull, 15.0), (Torque, 15.0 * 0.05)):
        values = times * unit + 0.01 * np.arange(LEVELS)
        data = as_rig_set(WheelRig(Wheel(r=0.05), np.linspace(0, 0.6, LEVELS), 15.0, (kind(values, SD),)))
        if refused:
            with pytest.raises(DataError, match=rf"is {times:g}\d? times the load.*check the units of {kind.column}"):
                refuse_unfit(data)
        else:
            refuse_unfit(data)


def test_what_is_too_poor():
    enough = rig_of(scattered(0.5))
    assert too_poor(enough, 9) == ""
    assert "12 measured values for 10 uncertain soil constants" in too_poor(enough, 10)
    assert too_poor(rig_of(scattered(0.5), slips=np.linspace(0.1, 0.26, LEVELS)), 2) == ""
    assert "slips span 0.14 only" in too_poor(rig_of(scattered(0.5), slips=np.linspace(0.1, 0.24, LEVELS)), 2)
    assert too_poor(rig_of(scattered(0.5), levels=3), 2) == ""
    assert "2 levels of slip" in too_poor(rig_of(scattered(0.5), levels=2), 2)


def test_a_channel_that_never_moves_is_refused_from_three_values():
    two = as_rig_set(WheelRig(Wheel(), np.array([0.0, 0.5]), 15.0, (DrawbarPull(np.ones(2), SD),)))
    refuse_unfit(two)
    with pytest.raises(DataError, match="drawbar_pull_N is 1 in all 12 runs"):
        refuse_unfit(rig_of(np.ones(12)))


def test_slips_that_differ_by_a_millionth_are_one():
    moving = scattered(0.5)
    refuse_unfit(rig_of(moving, levels=2, slips=np.array([0.2, 0.3])))
    labelled = WheelRig(
        Wheel(), np.repeat([0.2, 0.2 + 5e-7], 6), 15.0, (DrawbarPull(moving, SD),), levels=np.repeat(["a", "b"], 6)
    )
    with pytest.raises(DataError, match=r"slip is 0\.2 in every run"):
        refuse_unfit(as_rig_set(labelled))
