"""Rate-dependent shear: only shear changes, by the logarithm of the sliding speed."""

import math

import pytest

from rover_pin.contact import Load
from rover_pin.effects.rate_dependence import RateDependence

BEFORE = Load(f_t=1.0, f_y=0.5, f_n=9.0, torque=0.09, moment_z=0.02)


def test_shear_grows_by_the_logarithm_of_the_sliding_speed(patch):
    added = RateDependence(c_r=0.05, v_0=0.01).load(patch(rim=0.05, v_x=0.01), BEFORE, ())
    more = 0.05 * math.log(5.0)
    assert [float(part) for part in added] == pytest.approx([2.0 * more, 0.5 * more, 0.0, 0.09 * more, 0.02 * more])
