"""Measured sets in Parquet: the same content gives the same numbers as CSV, and a wrong file one sentence."""

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rover_pin.base.errors import DataError
from rover_pin.experiments.wheel_rig.data import read_rig_set
from rover_pin.logs.drive_log import LogMetadata, read_drive_log, write_drive_log
from rover_pin.measurements.traction_points import read_traction_points
from rover_pin.simulation.trace.files import write_parquet
from rover_pin.simulation.trace.trace import Trace

DATA = Path(__file__).parents[2] / "studies" / "data"


def in_parquet(tmp_path):
    """The shipped smooth wheel with its points and pressing trials in Parquet."""
    folder = tmp_path / "wheel"
    shutil.copytree(DATA / "cmu-smooth-wheel", folder)
    text = (folder / "rig.toml").read_text()
    for file in folder.glob("*.csv"):
        pd.read_csv(file, skipinitialspace=True).to_parquet(file.with_suffix(".parquet"))
        text = text.replace(file.name, file.with_suffix(".parquet").name)
        file.unlink()
    (folder / "rig.toml").write_text(text)
    return folder


def test_a_rig_set_in_parquet_is_the_same(tmp_path):
    one, other = read_rig_set(DATA / "cmu-smooth-wheel"), read_rig_set(in_parquet(tmp_path))
    assert np.array_equal(one.rig.slip, other.rig.slip)
    assert np.array_equal(one.rig.load, other.rig.load)
    for a, b in zip(one.rig.channels, other.rig.channels, strict=True):
        assert np.array_equal(a.measured, b.measured)
        assert np.array_equal(a.sd, b.sd)
    assert (one.level_names, one.runs, one.soil()) == (other.level_names, other.runs, other.soil())
    assert len(one.trials) == len(other.trials) > 0


def test_traction_points_in_parquet(tmp_path):
    table = pd.DataFrame({"slip": [0.1, 0.2], "traction_factor": [0.2, 0.3], "sd": [0.01, 0.01]})
    table.to_parquet(tmp_path / "points.parquet")
    assert read_traction_points(tmp_path / "points.parquet").slip.tolist() == [0.1, 0.2]


def test_a_wrong_parquet_file_is_one_sentence(tmp_path):
    folder = in_parquet(tmp_path)
    (points,) = folder.glob("points.parquet")
    points.write_text("slip,load_N\n0.1,25\n")
    with pytest.raises(DataError, match=r"points\.parquet: the file is not Parquet: .*\.") as no:
        read_rig_set(folder)
    assert "\n" not in str(no.value)
    pd.DataFrame({"slip": [0.1]}).to_parquet(points)
    with pytest.raises(DataError, match="has no column 'load_N': known are slip"):
        read_rig_set(folder)
    points.unlink()
    with pytest.raises(DataError, match=r"points\.parquet: the file cannot be read: No such file"):
        read_rig_set(folder)


def log(folder, run, units="", **channels):
    text = f'kind = "drive-log"\nname = "field"\n[[run]]\nfile = "{run}"\n{units}'
    folder.mkdir(exist_ok=True)
    (folder / "drive.toml").write_text(text)
    if run.endswith(".parquet"):
        write_parquet(folder / run, Trace(channels))
    else:
        pd.DataFrame(channels).to_csv(folder / run, index=False)
    return folder


def test_a_drive_log_in_parquet_is_the_same(tmp_path):
    random = np.random.default_rng(1)
    channels = {"t_s": np.arange(50) / 7.0, "duty_fl": random.uniform(-1, 1, 50), "body_x": random.normal(size=50)}
    channels["body_x"][10:20] = np.nan
    folder = write_drive_log(tmp_path / "csv", {"run": Trace(channels)}, LogMetadata("field"))
    (one,), (other,) = read_drive_log(folder).runs, read_drive_log(log(tmp_path / "p", "run.parquet", **channels)).runs
    assert one.units == other.units
    for name in channels:
        assert np.array_equal(one[name], other[name], equal_nan=True)


@pytest.mark.parametrize("run", ["run.csv", "run.parquet"])
def test_declared_units_are_turned_into_si(tmp_path, run):
    units = 'units = { wheel_rate_fl = "rpm", body_x = "mm", body_yaw = "deg", mast = "K" }\n'
    channels = {"t_s": [0.0, 1.0], "wheel_rate_fl": [30.0, 60.0], "body_x": [5.0, 6.0], "body_yaw": [180.0, 90.0]}
    (found,) = read_drive_log(log(tmp_path, run, units, **channels, mast=[280.0, 281.0])).runs
    assert found["wheel_rate_fl"] == pytest.approx([np.pi, 2 * np.pi])
    assert found["body_x"] == pytest.approx([5e-3, 6e-3])
    assert found["body_yaw"] == pytest.approx([np.pi, np.pi / 2])
    assert [found.unit(name) for name in ("wheel_rate_fl", "body_x", "mast")] == ["rad/s", "m", "K"]
    with pytest.raises(DataError, match=r"run\.\w+: column 'body_x': unit 'N' does not measure what is asked for"):
        read_drive_log(log(tmp_path, run, 'units = { body_x = "N" }\n', **channels))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"t_s": [0.0, 1.0, 0.5]}, "row 2: column 't_s' must increase, but 0.5 follows 1: sort the rows"),
        ({"t_s": [0.0, np.nan, 0.5]}, "row 1: column 't_s' is nan"),
        ({"duty_fl": [0.0, 55.0, 0.0]}, "row 1: duty_fl = 55 is outside [-1, 1]: give the duty as a signed share"),
        ({"duty_xx": [0.0, 0.0, 0.0]}, ""),
    ],
)
def test_mistakes_in_a_parquet_run(tmp_path, change, says):
    folder = log(tmp_path, "run.csv", t_s=[0.0])
    (folder / "drive.toml").write_text((folder / "drive.toml").read_text().replace("run.csv", "run.parquet"))
    pd.DataFrame({"t_s": [0.0, 0.5, 1.0], "duty_fl": [0.0, 0.1, 0.2], **change}).to_parquet(folder / "run.parquet")
    with pytest.raises(DataError, match=re.escape(says or "is of a wheel 'xx' that is not declared")):
        read_drive_log(folder)
