"""The published sets: names, sources, and Bekker's constants in the units in which they are published."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin import SOILS, Soil, Wheel, scenario
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.quantity import quantities
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.parameters import NEXUS6_WHEEL, TABLE_1
from rover_pin.parameters.bekker import at_width, bekker, bekker_si
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
    assert all(quantity.source for quantity in quantities(soil).values())
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


PUBLISHED = [
    ("dry-sand", 0.99e3, 1528.43e3, 1.1),
    ("fjs-1", 1.37e3, 814e3, 1.0),
    ("hit-lss1", 15.6e3, 2407.4e3, 1.1),
    ("lunar-nominal", 1.4e3, 820e3, 1.0),
    ("mars-sand", 13.6e3, 2259.1e3, 0.92),
]
"""Name of each soil that is published with Bekker's constants, k_c [N/m^(n+1)], k_phi [N/m^(n+2)] and n."""


@pytest.mark.parametrize(("name", "k_c", "k_phi", "n"), PUBLISHED)
@pytest.mark.parametrize("b", [0.05, 0.2])
def test_sets_give_the_published_pressure_at_any_width(name, k_c, k_phi, n, b):
    soil = at_width(SOILS[name], b, NEXUS6_WHEEL.b)
    pressure = modulus(Wheel(b=b), soil) * (0.01 / b) ** soil.n
    assert soil.n == n
    assert pressure == pytest.approx((k_c / b + k_phi) * 0.01**n, rel=1e-12)


def test_every_soil_with_bekker_s_constants_is_compared_with_them():
    converted = [name for name, soil in SOILS.own.items() if "k_c" in quantities(soil)["k_1"].source]
    assert converted == [name for name, *_ in PUBLISHED]


POUND, INCH = 0.45359237 * 9.80665, 0.0254


@pytest.mark.parametrize(
    ("name", "unit", "si"),
    [
        ("k_c", "N/m^(n+1)", 1.0),
        ("k_c", "kN/m^(n+1)", 1e3),
        ("k_c", "kPa/m^(n-1)", 1e3),
        ("k_c", "lb/in^(n+1)", POUND / INCH**2.1),
        ("k_c", "psi/in^(n-1)", POUND / INCH**2.1),
        ("k_c", "N/cm^(n + 1)", 100.0**2.1),
        ("k_phi", "kN/m^(n+2)", 1e3),
        ("k_phi", "kPa/m^n", 1e3),
        ("k_phi", "lbf/in^(n+2)", POUND / INCH**3.1),
    ],
)
def test_a_modulus_is_read_as_published(name, unit, si):
    assert bekker_si(name, 1.0, unit, 1.1, "x") == pytest.approx(si, rel=1e-12)


def test_inches_without_an_exponent_are_refused():
    assert bekker_si("k_c", 2.0, "kN/m^(n+1)", None, "x") == 2000.0
    with pytest.raises(ParameterError, match=r"lb/in.*power of n"):
        bekker_si("k_c", 2.0, "lb/in^(n+1)", None, "x")


def test_a_set_in_published_units_is_that_in_si(tmp_path):
    points = "slip,load_N,drawbar_pull_N\n0.1,80,5\n0.3,80,15\n"
    soils = {
        "si": "n = { value = 1.1 }\nk_c = { value = 15600.0 }\nk_phi = { value = 2407400.0, unit = 'N/m^(n+2)' }",
        "as-published": "k_c = { value = 15.6, unit = 'kPa/m^(n-1)' }\n"
        "k_phi = { value = 2407.4, unit = 'kPa/m^n' }\nn = 1.1",
    }
    read = []
    for name, soil in soils.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "points.csv").write_text(points)
        (tmp_path / name / "rig.toml").write_text(
            "kind = 'wheel-rig'\n[wheel]\nr = { value = 6.195, unit = 'in' }\nb = { value = 16.5, unit = 'cm' }\n"
            f"[soil]\n{soil}\n[noise]\ndrawbar_pull = {{ value = 0.1, unit = 'lbf' }}\n"
        )
        read.append(read_rig_set(tmp_path / name))
    assert read[0].declared == pytest.approx(read[1].declared)
    assert float(read[0].wheel.r) == pytest.approx(0.157353)
    assert np.allclose(read[0].channels[0].sd, 0.1 * POUND)
    (tmp_path / "si" / "rig.toml").write_text((tmp_path / "si" / "rig.toml").read_text().replace("n+2)'", "n+1)'"))
    with pytest.raises(DataError, match=r"k_phi: unit 'N/m\^\(n\+1\)'"):
        read_rig_set(tmp_path / "si")
