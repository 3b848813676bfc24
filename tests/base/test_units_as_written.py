"""A value with its unit as one writes it: the SI number, whatever the spelling; anything else is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import parse_quantity
from rover_pin.base.units import UNITS, name_and_unit


@given(
    value=st.floats(-1e12, 1e12, allow_nan=False),
    unit=st.sampled_from(sorted(UNITS)),
    between=st.sampled_from(["", " ", "  "]),
)
def test_a_number_and_any_unit_is_the_si_number(value, unit, between):
    si, factor = UNITS[unit]
    assert parse_quantity(f"{value!r}{between}{unit}", si, "x") == value * factor


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
        ("1.62m/s2", "m/s^2", 1.62),
        ("1.62 m/s²", "m/s^2", 1.62),
        ("1.62 m s^-2", "m/s^2", 1.62),
        ("2 N·m", "N m", 2.0),
        ("2 N.m", "N m", 2.0),
        ("2 N*m", "N m", 2.0),
        ("2 N-m", "N m", 2.0),
        ("2 NM", "N m", 2.0),
        ("2 mNm/A", "N m/A", 0.002),
        ("2 Nms/rad", "N m s/rad", 2.0),
        ("2 kN/m", "N/m", 2000.0),
        ("2 kPa/cm", "Pa/m", 2e5),
        ("180 deg/Nm", "rad/(N m)", math.pi),
        ("10 lb", "N", 44.482216152605),
        ("10 lb", "kg", 4.5359237),
        ("10 lbf/in^2", "Pa", 68947.57293168361),
        ("20 %", "", 0.2),
        ("90°", "rad", math.pi / 2),
        ("\N{MINUS SIGN}5 mm", "m", -0.005),
        ("60 RPM", "rad/s", 2 * math.pi),
        ("5 degrees", "rad", math.pi / 36),
    ],
)
def test_how_one_writes_it(text, si, value):
    assert parse_quantity(text, si, "x") == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "si", "sentence"),
    [
        ("5kg", "m", "x:.*'kg' does not fit"),
        ("5 furlongs", "m", "x:.*'furlongs'"),
        ("mm", "m", r"x = 'mm'.*\[m\]"),
        ("1.2.3", "m", "'.3'|'1.2.3'"),
        ("", "m", "x = ''.*number"),
        ("5mm", "", "x:.*'mm' does not fit"),
        ("5 min", "m", "x:.*'min' does not fit"),
        ("5 kg", "N", "x:.*'kg'.*N, kN"),
        ("5 mpa", "Pa", "x:.*'mpa' does not fit"),  # milli or mega
        ("5 1/s", "rad/s", "x:.*'1/s' does not fit"),  # turns or radians
        ("0,5", "m", r"x = '0,5'.*\[m\]"),
        (True, "m", "x: True.*number"),
        (None, "m", "x: None.*number"),
    ],
)
def test_what_is_none_is_refused(text, si, sentence):
    with pytest.raises(ParameterError, match=sentence):
        parse_quantity(text, si, "x")


def test_a_number_alone_is_in_the_unit_that_the_option_names():
    assert (
        parse_quantity("5", "rad", "x", "deg")
        == parse_quantity(5, "rad", "x", "deg")
        == pytest.approx(math.radians(5.0))
    )
    assert parse_quantity("5 rad", "rad", "x", "deg") == 5.0


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("Torque (Nm)", "Torque", "Nm"),
        ("Torque [N.m]", "Torque", "N.m"),
        ("Torque / N·m", "Torque", "N·m"),
        ("Torque, Nm", "Torque", "Nm"),
        ("Torque in Nm", "Torque", "Nm"),
        ("travel_speed_mps", "travel_speed", "mps"),
        ("v_m/s", "v", "m/s"),
        ("Drawbar pull (mean) [N]", "Drawbar pull (mean)", "N"),
        ("compliance (rad/(N m))", "compliance", "rad/(N m)"),
        ("Slip ratio s [-]", "Slip ratio s", "-"),
        ("Load (measured)", "Load", "measured"),  # refused by who reads it: a unit that nobody knows is none
        ("moment_z", "moment_z", ""),
        ("run_id", "run_id", ""),
        ("slip angle", "slip angle", ""),
        ("in/out", "in/out", ""),
    ],
)
def test_a_column_names_its_unit(header, name, unit):
    assert name_and_unit(header) == (name, unit)
