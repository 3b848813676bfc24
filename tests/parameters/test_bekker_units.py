"""Bekker's constants in the units in which they are published."""

import re

import numpy as np
import pytest

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.quantity import to_si
from rover_pin.measurements.wheel_rig import read_wheel_rig
from rover_pin.parameters.bekker import bekker_si

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


def test_dry_sand_is_the_same_in_both_units_of_its_table():
    """Wong, Ground Vehicles, Table 2.3: 0.99 kN/m^(n+1) = 0.1 lb/in^(n+1), 1528.43 = 3.9, n = 1.1."""
    metric, imperial = (
        bekker_si("k_phi", 1528.43, "kN/m^(n+2)", 1.1, "x"),
        bekker_si("k_phi", 3.9, "lb/in^(n+2)", 1.1, "x"),
    )
    assert imperial == pytest.approx(metric, rel=0.02)
    assert bekker_si("k_c", 0.1, "lb/in^(n+1)", 1.1, "x") == pytest.approx(990.0, rel=0.02)


@pytest.mark.parametrize(
    ("name", "unit"), [("k_c", "kN/m^(n+2)"), ("k_phi", "kPa"), ("k_phi", "kPa/m"), ("k_c", "s/m^(n+1)")]
)
def test_a_unit_of_another_power_is_refused(name, unit):
    with pytest.raises(ParameterError, match=re.escape(f"'{unit}'") + f".*{name}.*N/m"):
        bekker_si(name, 1.0, unit, 1.1, "x")


def test_inches_without_an_exponent_are_refused():
    assert bekker_si("k_c", 2.0, "kN/m^(n+1)", None, "x") == 2000.0
    with pytest.raises(ParameterError, match=r"depends.*declare"):
        bekker_si("k_c", 2.0, "lb/in^(n+1)", None, "x")


@pytest.mark.parametrize(
    ("value", "unit", "expected", "si"),
    [(2.0, "in", "m", 0.0508), (1.0, "lbf", "N", POUND), (1.0, "psi", "Pa", 6894.757),
     (1.0, "lbf in", "N m", 0.1129848),
     (1.0, "lbf ft", "N m", 1.3558179), (100.0, "lb/ft^3", "kg/m^3", 1601.846)],
)  # fmt: skip
def test_units_of_old_papers_are_read(value, unit, expected, si):
    assert to_si(value, unit, expected, "x") == pytest.approx(si, rel=1e-6)


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
        read.append(read_wheel_rig(tmp_path / name))
    assert read[0].declared == pytest.approx(read[1].declared)
    assert float(read[0].wheel.r) == pytest.approx(0.157353)
    assert np.allclose(read[0].channels[0].sd, 0.1 * POUND)
    (tmp_path / "si" / "rig.toml").write_text((tmp_path / "si" / "rig.toml").read_text().replace("n+2)'", "n+1)'"))
    with pytest.raises(DataError, match=r"k_phi:.*k_phi's"):
        read_wheel_rig(tmp_path / "si")
