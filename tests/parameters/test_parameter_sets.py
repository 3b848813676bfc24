"""The published sets: names, conversions, sources."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.parameters import NEXUS6_WHEEL, SOILS, TABLE_1
from rover_pin.parameters.bekker import at_width, bekker
from rover_pin.scenarios.scenario import scenario
from rover_pin.soil.stress import modulus

DATA = Path(__file__).parents[2] / "studies" / "data"


def test_table_1_is_the_paper_s():
    assert (TABLE_1.c, TABLE_1.k) == (0.005, 0.05)
    assert [math.degrees(angle) for angle in (TABLE_1.phi, TABLE_1.theta_1, TABLE_1.theta_2)] == pytest.approx(
        [30.0, 35.0, -5.0]
    )
    assert 2 * NEXUS6_WHEEL.r == pytest.approx(0.09)


def test_the_literature_sand_is_what_section_4_1_quotes():
    sand = SOILS["literature-sand"]
    assert (sand.c, sand.k) == (0.0, 0.025)
    assert math.degrees(sand.phi) == pytest.approx(32.0)


@given(st.floats(0.0, 1e5), st.floats(1e3, 1e7), st.floats(0.3, 1.6), st.floats(0.01, 1.0), st.floats(1e-4, 0.1))
def test_bekker_s_pressure_is_eq_4_s(k_c, k_phi, n, b, z):
    k_1, k_2 = bekker(k_c, k_phi, n, b)
    assert (k_1 + k_2 * b) * (z / b) ** n == pytest.approx((k_c / b + k_phi) * z**n, rel=1e-12)


@pytest.mark.parametrize("name", SOILS)
def test_every_number_has_a_source_and_is_its_class_default(name):
    soil = SOILS[name]
    assert isinstance(soil, Soil)
    assert soil == type(soil)()
    assert all(about.source for about in quantities(soil).values())
    assert list(quantities(soil)) == list(quantities(Soil))


def test_small_rover_on_slope_sand_slips_as_measured_wheels_do():
    """Pull over load is the tangent of a slope: 0.2 of slip on 10.3 deg (smooth wheel) to 14.0 deg (lugged)."""

    def slip(slope, soil):
        steep = {"terrain.angle_deg": slope, "terrain.start": -9.0}
        trace = scenario("incline", soil=soil, duration=15.0, **steep).drive(measure_error=False)
        return np.average(trace.stack("slip")[-1], weights=trace.stack("normal")[-1])

    wheels = (
        pd.read_csv(DATA / name / "points.csv").set_index("slip") for name in ("ding-2011-smooth", "ding-2011-lugged")
    )
    smooth, lugged = (math.degrees(math.atan(wheel.drawbar_pull_N[0.2] / wheel.load_N[0.2])) for wheel in wheels)
    assert [smooth, lugged] == pytest.approx([10.3, 14.0], abs=0.05)
    assert slip(smooth, "slope-sand") == pytest.approx(0.22, abs=0.015)
    assert slip(lugged, "slope-sand") < 0.35
    assert slip(10.0, "table-1") > 0.98


@pytest.mark.parametrize(
    ("name", "k_c", "k_phi", "n"),
    [
        ("dry-sand", 0.99e3, 1528.43e3, 1.1),
        ("fjs-1", 1.37e3, 814e3, 1.0),
        ("hit-lss1", 15.6e3, 2407.4e3, 1.1),
        ("lunar-nominal", 1.4e3, 820e3, 1.0),
        ("mars-sand", 13.6e3, 2259.1e3, 0.92),
    ],
)
@pytest.mark.parametrize("b", [0.05, 0.2])
def test_sets_give_the_published_pressure_at_any_width(name, k_c, k_phi, n, b):
    soil = at_width(SOILS[name], b, NEXUS6_WHEEL.b)
    pressure = modulus(Wheel(b=b), soil) * (0.01 / b) ** soil.n
    assert soil.n == n
    assert pressure == pytest.approx((k_c / b + k_phi) * 0.01**n, rel=1e-12)
