"""A logged current in counts: the line of its scale and zero, of its own motor alone."""

import numpy as np
import pytest

from rover_pin.effects.raw_current import RawCurrent

TIMES, CURRENT = np.array([0.0, 0.1, 0.2]), np.array([0.0, 0.5, -2.0])


def test_counts_are_the_current_times_a_scale_and_a_zero():
    effect = RawCurrent(scale=200.0, offset=512.0, motor="rr", channel="adc_4")
    found = effect.read(TIMES, {"current_rr_A": CURRENT, "current_fl_A": 7.0 * CURRENT})
    assert list(found) == ["adc_4"]
    assert found["adc_4"] == pytest.approx([512.0, 612.0, 112.0])
