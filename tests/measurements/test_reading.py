"""The reader of wheel-rig sets and traction points: it reads the shipped data, and refuses each fault of a file with
one sentence.
"""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rover_pin.base.errors import DataError
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.channel import DrawbarPull, Sinkage
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.traction_points import TractionPoints, read_traction_points

DATA = Path(__file__).parents[2] / "studies" / "data"
RIG = """
kind = "wheel-rig"
[wheel]
r = { value = 62.5, unit = "mm" }
b = { value = 0.06, unit = "m" }
[noise]
drawbar_pull = { value = 0.3, unit = "N" }
sinkage = { value = 0.6, unit = "mm" }
"""
POINTS = "run,slip,load_N,drawbar_pull_N,sinkage_m\na,0.1,25,1.0,0.01\nb,0.3,25,2.0,0.02\n"


def folder(tmp_path, rig=RIG, points=POINTS):
    (tmp_path / "rig.toml").write_text(rig)
    (tmp_path / "points.csv").write_text(points)
    return tmp_path


def test_shipped_smooth_wheel_is_read_as_its_files_say():
    rig = read_rig_set(DATA / "cmu-smooth-wheel")
    table = pd.read_csv(DATA / "cmu-smooth-wheel" / "points.csv")
    pull, sunk = rig.channels
    assert (rig.name, rig.wheel, len(rig.slip)) == ("cmu-smooth-wheel", Wheel(0.0625, 0.06), 15)
    assert isinstance(pull, DrawbarPull)
    assert isinstance(sunk, Sinkage)
    np.testing.assert_array_equal(pull.measured, table["drawbar_pull_N"])
    np.testing.assert_allclose(pull.sd, 0.0126 * table["load_N"])
    assert set(sunk.sd) == {0.0006}
    assert rig.wheel_range == {"r": (0.058, 0.0625), "b": (0.05, 0.06)}
    assert rig.levels.tolist() == table["level"].astype(str).tolist()


def test_repeats_state_the_noise_that_nobody_declares(tmp_path):
    """Four levels of three runs have 8 degrees of freedom. Two runs for each level would be too few repeats."""
    random, slips = np.random.default_rng(3), np.repeat([0.1, 0.3, 0.5, 0.7], 3)
    pull = 10 * slips + random.normal(0.0, 0.2, 12)
    rows = [f"{i},{S},25,{f:.6g},{0.01 + 0.02 * S}" for i, (S, f) in enumerate(zip(slips, pull, strict=True))]
    points = "\n".join([POINTS.splitlines()[0], *rows]) + "\n"
    undeclared = RIG.replace('drawbar_pull = { value = 0.3, unit = "N" }\n', "")
    rig = read_rig_set(folder(tmp_path, undeclared, points))
    within = [pull[slips == S].var(ddof=1) for S in (0.1, 0.3, 0.5, 0.7)]
    assert rig.channels[0].sd == pytest.approx(math.sqrt(np.mean(within)), rel=1e-4)
    assert any("drawbar_pull" in finding.what and "8 degrees" in finding.what for finding in rig.unread)
    with pytest.raises(DataError, match="noise of drawbar_pull"):
        read_rig_set(folder(tmp_path, undeclared))


def test_units_of_the_toml_are_converted(tmp_path):
    rig = read_rig_set(folder(tmp_path))
    assert rig.wheel.r == pytest.approx(0.0625)
    assert rig.channels[1].sd[0] == pytest.approx(0.0006)
    assert rig.soil() == Soil().replace(k_1=Soil().k_1 + Soil().k_2 * rig.wheel.b, k_2=0.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("25,1.0", ",1.0", r"1 \(nan\)"),
        ("25,1.0", "25,inf", r"drawbar_pull_N.*1 \(inf\)"),
        (",1.0,0.01\nb,0.3,25,2.0", ",,0.01\nb,0.3,25,", "drawbar_pull_N"),
        ("25,2.0", "-25,2.0", r"2 \(-25\)"),
        ("b,0.3", "b,-1.3", r"\[-1, 1\].*2 \(-1.3\)"),
        ("b,0.3", "b,30", "30 in row 2.*percent.*fraction"),
        ("b,0.3", "b,3", "2 .3.*over-travel-speed"),
        ("0.02\n", "20\n", "sinkage_m.*20 m in row 2,.*millimetres"),
        ("load_N", "load", "'load_N':.*'load'"),
        ("sinkage_m", "sinkage_mm", "'sinkage_mm'.*'sinkage_m'.*SI"),
        ("sinkage_m\n", "sinkage_m\nc,0.2,25,much,0.01\n", "drawbar_pull_N.*'much'.*1"),
        (POINTS, "", "points.csv:.*file"),
        (POINTS, "slip,load_N,drawbar_pull_N\n", "points.csv:.*file"),
        (POINTS, "slip,load_N\n0.1,25\n", "drawbar_pull_N"),
        (POINTS, 'slip,load_N\n"0.1,25\n', "line 2: 1 cells under 2 column names"),
        (POINTS, "slip,load_N,torque_Nm\n0.1,25,1\n", "torque.*.noise."),
    ],
)
def test_flaws_of_the_points(tmp_path, old, new, message):
    assert old in POINTS
    with pytest.raises(DataError, match=message):
        read_rig_set(folder(tmp_path, points=POINTS.replace(old, new)))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"wheel-rig"', '"drive-log"', "kind = 'drive-log'"),
        ('unit = "mm" }\nb', 'unit = "furlong" }\nb', "'furlong'"),
        ('0.6, unit = "mm"', '0.6, unit = "kPa"', "sinkage:.*'kPa'"),
        ("{ value = 0.3,", "{ sd = 0.3,", "drawbar_pull"),
        ("value = 0.3", "value = 0.0", "sd.*positive.*1"),
        ('b = { value = 0.06, unit = "m" }\n', "", "b = {.*unit = 'm' }"),
        ("value = 0.06", "value = 60.0", "Wheel.b = 60"),
        ("[noise]", "[noise", "is not TOML"),
    ],
)
def test_flaws_of_the_toml(tmp_path, old, new, message):
    assert old in RIG
    with pytest.raises(DataError, match=message):
        read_rig_set(folder(tmp_path, rig=RIG.replace(old, new)))


def test_traction_points_are_read_and_scatter_falls_with_count(tmp_path):
    path = tmp_path / "fig6.csv"
    path.write_text("slip,traction_factor,sd,count\n0.1,0.05,0.06,4\n0.5,0.2,0.06,9\n")
    points = read_traction_points(path)
    assert points.sd.tolist() == pytest.approx([0.03, 0.02])
    assert points.factor.tolist() == [0.05, 0.2]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (([], [], 0.1), "least.*measured"),
        (([[0.1]], [0.1], 0.1), "slip.*data"),
        (([0.1, math.nan], [0.1, 0.2], 0.1), "missing.*2"),
        (([0.1, 0.2], [0.1], 0.1), "different lengths"),
        (([0.1, 45.0], [0.1, 0.2], 0.1), "looks.*percent"),
        (([0.1, 0.2], [0.1, 0.2], -0.1), "sd.*positive"),
    ],
)
def test_flaws_of_traction_points(columns, message):
    with pytest.raises(DataError, match=message):
        TractionPoints(*columns)


def test_flaws_of_traction_files(tmp_path):
    path = tmp_path / "fig6.csv"
    path.write_text("slip,traction_factor,sd\n0.1,0.05,0.06\n0.5,,0.06\n")
    with pytest.raises(DataError, match=r"fig6.csv: TractionFactor:.*2"):
        read_traction_points(path)
