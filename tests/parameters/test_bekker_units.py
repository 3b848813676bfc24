"""Bekker's constants in the units in which they are published."""

import numpy as np
import pytest

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.measurements.rig_reading import read_rig_set
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


def test_inches_without_an_exponent_are_refused():
    assert bekker_si("k_c", 2.0, "kN/m^(n+1)", None, "x") == 2000.0
    with pytest.raises(ParameterError, match=r"depends.*declare"):
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
    with pytest.raises(DataError, match=r"k_phi:.*k_phi's"):
        read_rig_set(tmp_path / "si")
