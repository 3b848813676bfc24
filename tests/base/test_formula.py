"""Formulas of columns: arithmetic and nothing else."""

import contextlib
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.base.errors import DataError
from rover_pin.base.formula import evaluate, names_in, quote

A, B = np.array([1.0, 2.0, 3.0]), np.array([0.5, -1.0, 4.0])
COLUMNS = {"a": A, "b": B, "Position X [mm]": 10 * A, "lat": np.array([48.0, 48.0001, 48.0001])}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.5 * (a + b)", 0.5 * (A + B)),
        ("a - -b ** 2 / 4", A + B**2 / 4),
        ("col('Position X [mm]') / 1000", A / 100),
        ("hypot(a, b) + pi", np.hypot(A, B) + math.pi),
        ("3", np.full(3, 3.0)),
        ("radians(a)", np.radians(A)),
    ],
)
def test_a_formula_is_arithmetic_on_columns(text, value):
    assert evaluate(text, COLUMNS, "here") == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["__import__('os').system('ls')", "a.real", "[c for c in a]", "lambda: 1", "a if b else a", "a[0]", "(1).__class__",
     "a < b", "a and b", "'text'", "f'{a}'", "a @ b", "a // b", "open('x')", "col(a)", "sin(a, b)", "sin(x=a)",
     "nowhere", "", "a +", "a; b", "exec('1')", "(a := 1)", "True"],
)  # fmt: skip
def test_anything_else_is_refused_in_one_sentence(text):
    with pytest.raises(DataError, match=r"^here") as error:
        evaluate(text, COLUMNS, "here")
    assert "\n" not in str(error.value)


def test_too_long_or_deep_formulas_are_refused_huge_ones_are_inf():
    with pytest.raises(DataError, match=r"at most 1000"):
        evaluate("a+" * 600 + "a", COLUMNS, "here")
    assert np.all(np.isinf(evaluate("9**9**9**9", COLUMNS, "here")))
    assert np.all(np.isnan(evaluate("-" * 400 + "a * (0 / 0)", COLUMNS, "here")))


@given(st.text(max_size=40))
def test_no_text_does_anything_but_give_numbers_or_a_sentence(text):
    with contextlib.suppress(DataError):
        assert evaluate(text, COLUMNS, "here").shape == (3,)


def test_the_names_in_a_formula_and_how_they_are_quoted():
    assert names_in("col('x y') + a * sin(b) + pi", "here") == ("x y", "a", "b")
    for name in ("a", "Position X [mm]", "pi", "sin", "col", 'with "quotes"'):
        assert names_in(quote(name), "here") == (name,)
        assert evaluate(quote(name), {name: A}, "here") == pytest.approx(A)


@pytest.mark.parametrize(("roll", "pitch", "yaw"), [(0.3, -0.2, 1.0), (-0.5, 1.2, -2.0), (0.0, 0.0, 3.0)])
def test_angles_of_a_quaternion_are_those_of_the_rotation(roll, pitch, yaw):
    """Against the product of three elementary quaternions, of any length."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = 2.5 * Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    columns = {name: np.array([value]) for name, value in zip("xyzw", (x, y, z, w), strict=True)}
    for name, angle in (("roll", roll), ("pitch", pitch), ("yaw", yaw)):
        assert evaluate(f"{name}(x, y, z, w)", columns, "here") == pytest.approx([angle], abs=1e-12)


def test_places_on_earth_become_metres():
    """A degree of latitude at 48 deg is 111.2 km, one of longitude 74.6 km (WGS 84's series, to 0.1 %)."""
    lat, lon = np.array([48.0, 48.001, 48.0]), np.array([11.0, 11.0, 11.001])
    assert evaluate("north(lat, lon)", {"lat": lat, "lon": lon}, "here") == pytest.approx([0, 111.2, 0], abs=0.1)
    assert evaluate("east(lat, lon)", {"lat": lat, "lon": lon}, "here") == pytest.approx([0, 0, 74.6], abs=0.1)


def test_course_is_the_travel_direction_and_held_at_standstill():
    t = np.arange(0.0, 20.0, 0.1)
    path = np.minimum(t, 10.0)
    x, y = path * math.cos(0.7), path * math.sin(0.7)
    assert evaluate("course(x, y, t)", {"x": x, "y": y, "t": t}, "here") == pytest.approx(0.7, abs=1e-9)


def test_heading_from_course_stays_when_the_rover_reverses():
    t = np.arange(0.0, 20.0, 0.1)
    v = np.where(t < 10.0, 0.1, -0.1)
    path = np.cumsum(0.1 * v)
    columns = {"x": path * math.cos(2.9), "y": path * math.sin(2.9), "t": t, "v": v}
    assert evaluate("heading(x, y, t, v)", columns, "here") == pytest.approx(2.9, abs=1e-9)
