"""The coordinates in which a soil is fitted: scales, bounds and logarithms by their formulas, and what they need."""

import math

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.estimation.coordinates import Linear, Log
from rover_pin.identification.soil_space import space

WHEEL, ABOUT = Wheel(r=0.06, b=0.04), quantities(Soil)


def axis(name, soil, free=()):
    return next(one for one in space((name, *free), WHEEL, soil).axes if one.name == name)


@pytest.mark.parametrize("name", ["n", "k"])
def test_what_is_positive_is_fitted_by_its_logarithm(name):
    found = axis(name, Soil())
    assert found.coordinate == Log()
    assert (found.low, found.high) == pytest.approx((math.log(ABOUT[name].low), math.log(ABOUT[name].high)))


@pytest.mark.parametrize(("name", "value"), [("phi", 0.5), ("phi", 0.1), ("phi", 0.0), ("c", 0.005), ("c", 400.0)])
def test_what_may_be_nothing_is_fitted_on_a_line(name, value):
    """Starts scatter by its size, a thousandth of its range at least and a quarter of it at most: the widest told."""
    span = ABOUT[name].high - ABOUT[name].low
    scale = min(span / 4, max(value, span / 1000))
    found = axis(name, Soil().replace(**{name: value}))
    assert isinstance(found.coordinate, Linear)
    assert found.coordinate.scale == pytest.approx(scale)
    assert found.coordinate.widest * scale == pytest.approx(span / 4)
    assert (found.low * scale, found.high * scale) == pytest.approx((ABOUT[name].low, ABOUT[name].high))


def test_a_negative_angle_scatters_by_its_size():
    """theta_2 lies behind the axle."""
    found, about = axis("theta_2", Soil(theta_2=-0.08)).coordinate, ABOUT["theta_2"]
    assert about.low < 0.0
    assert found.scale == pytest.approx(0.08)
    assert found.widest * found.scale == pytest.approx((about.high - about.low) / 4)


def test_pressure_ends_at_the_bound_of_the_free_modulus():
    soil = Soil(k_1=2e4, k_2=5e8)
    assert axis("k_1", soil).high == pytest.approx(math.log(ABOUT["k_1"].high + 2e7), abs=1e-9)


def test_the_exit_ratio_ends_before_a_second_singularity():
    found = axis("exit_ratio", Soil(exit_ratio=0.2))
    assert (found.low, found.high * found.coordinate.scale) == (0.0, pytest.approx(0.99))


def test_of_one_modulus_the_logarithm_is_that_of_the_pressure():
    """u = ln(k_1 + k_2 b) where k_1 is free, ln(k_2 + k_1 / b) where k_2 is; down to a millionth of the start."""
    soil = Soil(k_1=2e4, k_2=5e5)
    for name, value, shift in (("k_1", 2e4, 5e5 * 0.04), ("k_2", 5e5, 2e4 / 0.04)):
        found = axis(name, soil)
        assert found.coordinate.u(value) == pytest.approx(math.log(value + shift))
        assert found.coordinate.value(math.log(shift + 3.0)) == pytest.approx(3.0)
        assert (found.low, found.high) == pytest.approx(
            (math.log(1e-6 * (value + shift)), math.log(ABOUT[name].high + shift))
        )


def test_two_free_moduli_move_on_lines_of_half_the_pressure():
    soil = Soil(k_1=2e4, k_2=5e5)
    for name, whole in (("k_1", 4e4), ("k_2", 1e6)):
        found = axis(name, soil, ("k_2" if name == "k_1" else "k_1",))
        assert found.coordinate.scale == pytest.approx(whole / 2)
        assert found.coordinate.widest == pytest.approx(2.0)


def test_a_pressure_must_be_positive_however_small():
    assert axis("k_1", Soil(k_1=0.5, k_2=0.0)).coordinate.u(0.5) == pytest.approx(math.log(0.5))
    with pytest.raises(ParameterError, match=r"k_1 \+ k_2 b = 0 Pa must be positive to fit k_2"):
        axis("k_2", Soil(k_1=-400.0, k_2=1e4))


def test_the_space_starts_at_the_soil():
    free = ("k", "phi", "n", "k_1", "c")
    soil = Soil(k=0.008, phi=0.55, n=1.1, k_1=8e4, c=400.0)
    made = space(free, WHEEL, soil)
    assert made.values(made.start()) == pytest.approx([0.008, 0.55, 1.1, 8e4, 400.0])
    assert np.all(made.low < made.start())
