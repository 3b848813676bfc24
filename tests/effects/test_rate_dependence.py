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


def test_a_weakening_rate_takes_grip_whether_driving_or_braking(patch):
    for rim, v_x in ((0.05, 0.02), (0.02, 0.05)):
        assert float(RateDependence(c_r=-0.1).load(patch(rim=rim, v_x=v_x), BEFORE, ()).torque) < 0.0


def test_a_rolling_wheel_has_no_rate(patch):
    assert [float(part) for part in RateDependence().load(patch(rim=0.05, v_x=0.05), BEFORE, ())] == [0.0] * 5
