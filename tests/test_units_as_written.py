"""A value with its unit as one writes it: the SI number, whatever the spelling; anything else is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.errors import ParameterError
from rover_pin.quantity import written
from rover_pin.units import UNITS


@given(
    value=st.floats(-1e12, 1e12, allow_nan=False),
    unit=st.sampled_from(sorted(UNITS)),
    between=st.sampled_from(["", " ", "  "]),
)
def test_a_number_and_any_unit_is_the_si_number(value, unit, between):
    si, factor = UNITS[unit]
    assert written(f"{value!r}{between}{unit}", si, "x") == value * factor


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_alone_is_in_si_already(value):
    assert written(repr(value), "m", "x") == value == written(value, "m", "x")


@pytest.mark.parametrize(
    ("text", "si", "value"),
    [
        ("5mm", "m", 0.005),
        ("30 deg", "rad", math.pi / 6),
        ("1e-3m", "m", 1e-3),
        (".5 N m", "N m", 0.5),
        ("20mNm", "N m", 0.02),
        ("-1.2kPa", "Pa", -1200.0),
        ("10deg/m", "rad/m", math.pi / 18),
        ("3 1/s", "1/s", 3.0),
        ("7 s/m", "s/m", 7.0),
    ],
)
def test_how_one_writes_it(text, si, value):
    assert written(text, si, "x") == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "si", "sentence"),
    [
        ("5kg", "m", "x: unit 'kg' does not measure what is asked for; use one of m, mm, cm, km."),
        ("5 furlongs", "m", "x: unit 'furlongs' does not measure"),
        ("mm", "m", r"x = 'mm' is not a number \[m\]"),
        ("1.2.3", "m", "x: unit '.3' does not measure|x = '1.2.3' is not a number"),
        ("", "m", "x = '' is not a number"),
        ("5mm", "", "x: unit 'mm' does not measure"),
    ],
)
def test_what_is_none_is_refused(text, si, sentence):
    with pytest.raises(ParameterError, match=sentence):
        written(text, si, "x")
