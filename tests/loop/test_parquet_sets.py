"""Measured sets in Parquet: the same content gives the same numbers as CSV, and a wrong file one sentence."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rover_pin.base.errors import DataError
from rover_pin.logs.drive_log import LogMetadata, read_drive_log, write_drive_log
from rover_pin.measurements.rig_reading import read_rig_set
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
    csv_set, parquet_set = read_rig_set(DATA / "cmu-smooth-wheel"), read_rig_set(in_parquet(tmp_path))
    assert np.array_equal(csv_set.slip, parquet_set.slip)
    assert np.array_equal(csv_set.load, parquet_set.load)
    for a, b in zip(csv_set.channels, parquet_set.channels, strict=True):
        assert np.array_equal(a.measured, b.measured)
        assert np.array_equal(a.sd, b.sd)
    assert (csv_set.level_names, csv_set.runs, csv_set.soil()) == (
        parquet_set.level_names,
        parquet_set.runs,
        parquet_set.soil(),
    )
    assert len(csv_set.trials) == len(parquet_set.trials) > 0


def test_a_wrong_parquet_file_is_one_sentence(tmp_path):
    folder = in_parquet(tmp_path)
    (points,) = folder.glob("points.parquet")
    points.write_text("slip,load_N\n0.1,25\n")
    with pytest.raises(DataError, match=r"points\.parquet: .*Parquet") as no:
        read_rig_set(folder)
    assert "\n" not in str(no.value)
    pd.DataFrame({"slip": [0.1]}).to_parquet(points)
    with pytest.raises(DataError, match=r"'load_N'.*slip"):
        read_rig_set(folder)
    points.unlink()
    with pytest.raises(DataError, match=r"points\.parquet: .*No such file"):
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
    (csv_run,), (parquet_run,) = (
        read_drive_log(folder).runs,
        read_drive_log(log(tmp_path / "p", "run.parquet", **channels)).runs,
    )
    assert csv_run.units == parquet_run.units
    for name in channels:
        assert np.array_equal(csv_run[name], parquet_run[name], equal_nan=True)
