"""Drive logs, measured and simulated alike: there and back, and every mistake in them named."""

import re

import numpy as np
import pytest

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.toml_file import read_toml, toml_text
from rover_pin.logs.drive_log import LogMetadata, load_trace, read_drive_log, write_drive_log
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain import shapes
from rover_pin.terrain.files import write_terrain

HEAD = 'kind = "drive-log"\nname = "field"\n'
RUN = '[[run]]\nfile = "climb.csv"\n'
CSV = "t_s,duty_fl,wheel_rate_fl,body_vx\n0.0,0.5,1.1,0.05\n0.1,0.5,1.2,\n"


@pytest.fixture
def log(tmp_path):
    def make(toml=HEAD + RUN, csv=CSV, name="climb.csv"):
        (tmp_path / "drive.toml").write_text(toml)
        (tmp_path / name).write_text(csv)
        return tmp_path

    return make


MEASURED = """
kind = "drive-log"
name = "field"
source = "test field"
licence = "CC0"
missing = ["battery"]
gravity = { value = 1.62, unit = "m/s^2" }
[terrain]
polyline = "ground.csv"
patch = [{ x_from = 1.0, ground = 1 }]
[soil]
phi = { value = 30.0, unit = "deg", sd = 2.0 }
[noise]
wheel_rate = { value = 0.02, unit = "rad/s" }
[[run]]
file = "climb.csv"
start = { x = 1.0, yaw = 0.5 }
purpose = "climb"
[[run]]
file = "again.csv"
"""


def test_a_measured_log(log):
    folder = log(MEASURED)
    log(MEASURED, name="again.csv")
    log(MEASURED, "x_m,z_m\n0,0\n1,0.1\n", "ground.csv")
    log_read = read_drive_log(folder)
    assert (log_read.metadata.name, log_read.metadata.gravity, log_read.metadata.licence) == ("field", 1.62, "CC0")
    assert log_read.metadata.soil["phi"]["sd"] == 2.0
    first, second = log_read.runs
    assert first.attrs["start"] == {"x": 1.0, "y": 0.0, "yaw": 0.5}
    assert (first.attrs["purpose"], first.attrs["gravity_mps2"], second.attrs["file"]) == ("climb", 1.62, "again.csv")
    assert first["wheel_rate_fl"].tolist() == [1.1, 1.2]
    assert np.isnan(first["body_vx"][1])
    assert log_read.run("again") is log_read.run("again.csv") is second
    terrain = log_read.terrain()
    assert terrain.height(0.5, 0.0) == pytest.approx(0.05)
    assert terrain.ground_at(np.array([0.5, 1.5]), 0.0).tolist() == [0, 1]
    assert log_read.rover == "nexus6"


@pytest.mark.parametrize("terrain", [shapes.ditch(), shapes.rocks(2), shapes.hills(1)], ids=["lane", "lanes", "grid"])
def test_a_simulated_log_there_and_back(tmp_path, terrain):
    t = np.arange(20) / 7.0
    traces = {
        "one": Trace({"t_s": t, "slip_fl": np.sin(t), "odd": t}, {"odd": "K"}, {"stop": "duration", "purpose": "p"}),
        "two": Trace({"t_s": t, "duty_rr": np.cos(t)}),
    }
    metadata = LogMetadata(
        "pair", "made here", gravity=1.62, wheels=("fl", "rr"), terrain=write_terrain(tmp_path, terrain)
    )
    log_read = read_drive_log(write_drive_log(tmp_path, traces, metadata))
    assert log_read.metadata == metadata
    assert log_read.terrain() == terrain
    for trace, again in zip(traces.values(), log_read.runs, strict=True):
        assert again.units == trace.units
        assert {**again.attrs, **trace.attrs} == again.attrs
        for name in trace.channels:
            assert np.array_equal(trace[name], again[name])
    with pytest.raises(DataError, match="has 2 runs"):
        load_trace(tmp_path)


@pytest.mark.parametrize(
    ("toml", "says"),
    [
        ("kind = \n", "TOML: Invalid value (at line 1, column 8)"),
        ('kind = "wheel-rig"\n' + RUN, "kind = 'wheel-rig', but"),
        (RUN, "kind = None"),
        ('kind = "drive-log"\n' + RUN, "name"),
        (HEAD, "no run"),
        (HEAD + "run = 3\n", "no run"),
        (HEAD + "gravty = 1.62\n" + RUN, "you mean 'gravity'?"),
        (HEAD + 'gravity = "moon"\n' + RUN, "gravity = 'moon'"),
        (HEAD + 'gravity = { value = 9.81, unit = "N" }\n' + RUN, "unit 'N' does"),
        (HEAD + "soil = 3\n" + RUN, "soil = 3"),
        (HEAD + "rover = 3\n" + RUN, "rover = 3"),
        (HEAD + 'wheels = "fl"\n' + RUN, "wheels = 'fl'"),
        (HEAD + 'wheels = ["fr", "rl"]\n' + RUN, "column 'duty_fl'"),
        (HEAD + "[[run]]\n", "file None"),
        (HEAD + RUN + '[[run]]\nfile = "no.csv"\n', "file 'no.csv'"),
        (HEAD + RUN + "begin = 3\n", "unknown key 'begin'"),
        (HEAD + RUN + "start = [0, 0]\n", "run 1 has start = [0, 0]: give"),
        (HEAD + RUN + "start = { x_m = 0 }\n", "run 1 has start = {'x_m': 0}: give"),
        (HEAD + RUN + 'start = { x = "a" }\n', "[m] and yaw [rad]"),
        (HEAD + RUN + "attrs = 3\n", "1 has attrs = 3: give"),
    ],
)
def test_mistakes_in_the_description(log, toml, says):
    with pytest.raises(DataError, match=re.escape(says)):
        read_drive_log(log(toml))


@pytest.mark.parametrize(
    ("csv", "says"),
    [
        ("", "climb.csv"),
        ("time,duty_fl\n0,0\n", "column 't_s'"),
        ("t_s,duty_fl\n0,0\n1,full\n", "climb.csv, line 3: column 'duty_fl' has 'full'"),
        ("t_s,duty_fl\n0,0\n,0\n", "climb.csv, line 3: column 't_s' is nan"),
        ("t_s,duty_fl\n0,0\n1,0\n1,0\n", "climb.csv, line 4: column 't_s'"),
        ("t_s,duty_fl\n0,0\n1,55\n", "climb.csv, line 3: duty_fl = 55 is outside [-1, 1]"),
        ("t_s,duty_lf\n0,0\n1,0\n", "column 'duty_lf'"),
        ("t_s,current_x_A\n0,0\n1,0\n", "column 'current_x_A'"),
    ],
)
def test_mistakes_in_a_run(log, csv, says):
    with pytest.raises(DataError, match=re.escape(says)):
        read_drive_log(log(csv=csv))


def test_text_in_parquet_names_the_row(log):
    pandas = pytest.importorskip("pandas")
    folder = log(HEAD + '[[run]]\nfile = "climb.parquet"\n')
    pandas.DataFrame({"t_s": [0.0, 1.0], "duty_fl": ["0.5", "full"]}).to_parquet(folder / "climb.parquet")
    with pytest.raises(DataError, match=r"climb\.parquet, row 1: .*'duty_fl'.*'full'"):
        read_drive_log(folder)
    pandas.DataFrame({"t_s": []}).to_parquet(folder / "climb.parquet")
    with pytest.raises(DataError, match="rows"):
        read_drive_log(folder)


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ("patch = []\n", "polyline, polylines"),
        ('polyline = "a"\ngrid = "b"\n', "polyline, grid"),
        ('polylin = "a"\n', "you mean 'polyline'?"),
        ('polylines = "a"\n', "polylines ="),
        ('polyline = "no.csv"\n', "file 'no.csv'"),
        ('polyline = "climb.csv"\n', "no column 'x_m'"),
        ('polylines = ["g.csv", "g.csv"]\n', "[terrain]: Lanes have 2 profiles"),
        ('polyline = "g.csv"\npatch = [3]\n', "patch = 3,"),
        ('polyline = "g.csv"\npatch = [["ground"]]\n', "patch = ['ground'],"),
        ('polyline = "g.csv"\npatch = [{ ground = 1, to = 2 }]\n', "patch = {'ground': 1, 'to': 2},"),
        ('polyline = "g.csv"\npatch = [{ ground = 1, x_to = "a" }]\n', "x_from and x_to"),
        ('polyline = "g.csv"\npatch = [{ ground = -1 }]\n', "soil indices `ground`"),
    ],
)
def test_mistakes_in_the_terrain(log, table, says):
    folder = log(HEAD + "[terrain]\n" + table + RUN)
    (folder / "g.csv").write_text("x_m,z_m\n0,0\n1,0\n")
    with pytest.raises(DataError, match=re.escape(says)):
        read_drive_log(folder).terrain()


def test_other_refusals(tmp_path, log):
    with pytest.raises(DataError, match=r"drive\.toml"):
        read_drive_log(tmp_path / "nowhere")
    with pytest.raises(ParameterError, match=r"'clim':.*'climb'\?"):
        read_drive_log(log()).run("clim")
    with pytest.raises(DataError, match=r"needs.*least"):
        write_drive_log(tmp_path / "new", {}, LogMetadata("new"))
    with pytest.raises(DataError, match=r"'a/b'.*file"):
        write_drive_log(tmp_path / "new", {"a/b": Trace({"t_s": [0.0]})}, LogMetadata("new"))
    with pytest.raises(DataError, match=r"cannot.*read"):
        read_toml(tmp_path / "no.toml")
    assert not (tmp_path / "new").exists()


def test_toml_there_and_back(tmp_path):
    table = {
        "text": 'a "b" \\ \n\t\x7f é',
        "numbers": [1, -2.5, 1e-300, float("inf"), True],
        "array": np.array([1.5, 2.5]),
        "left out": None,
        "t": {"a b": {"c": [{"d": 1}, {"e": "f"}]}, "none": None, "empty": {}},
        "rows": [{"x": 1}, {"y": {"z": False}}],
    }
    path = tmp_path / "a.toml"
    path.write_text(toml_text(table), encoding="utf-8")
    again = read_toml(path)
    assert again.pop("array") == [1.5, 2.5]
    expected = {key: value for key, value in table.items() if key not in ("array", "left out")}
    assert again == {**expected, "t": {"a b": table["t"]["a b"], "empty": {}}}
