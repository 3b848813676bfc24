"""What a newcomer meets first: a folder that is none, a column misspelt, a score that nothing can be claimed of."""

import re
from pathlib import Path

import pytest

from rover_pin import Model, close_the_loop, load_rover
from rover_pin.base.errors import DataError
from rover_pin.experiments.drive_log.model import DRIVEN_SAND
from rover_pin.experiments.wheel_rig.checks import findings
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.logs.drive_log import DriveLog, LogMetadata
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.simulation.model.motor import nexus6_motor
from rover_pin.terrain.shapes import flat
from tests.oracle.rig_generator import TWO_CHANNELS

ROWS = ("0.1,25,1.0,0.01", "0.3,25,2.0,0.02")
EXTRA = ("time_s", "temperature_C", "repeat", "lateral_N", "slip_angle_rad", "load_sd_N", "drawbar_pull_sd_N")


def written(tmp_path, header, rows=ROWS):
    tmp_path.mkdir(exist_ok=True)
    (tmp_path / "rig.toml").write_text(TWO_CHANNELS)
    (tmp_path / "points.csv").write_text("\n".join([header, *rows]) + "\n")
    return tmp_path


def unread(tmp_path, header, rows=ROWS):
    return [
        str(finding)
        for finding in findings(RigExperiment((read_rig_set(written(tmp_path, header, rows)),)))
        if "is not read" in finding.what
    ]


@pytest.mark.parametrize("name", ["sinkge_m", "Sinkage_m", "wheel_sinkage_m"])
def test_misspelt_column_is_named_with_the_intended_one(tmp_path, name):
    (note,) = unread(tmp_path / "set", f"slip,load_N,drawbar_pull_N,{name}")
    assert re.match(rf"set/points\.csv: .*'{name}'.*'sinkage_m'", note)


def test_columns_of_ones_own_are_no_misspelling(tmp_path):
    """Nor is one that looks like a column that is there already, or the SD of a channel."""
    rows = [",".join([row, *("0" if name == "slip_angle_rad" else "1" for name in EXTRA)]) for row in ROWS]
    assert unread(tmp_path, ",".join(["slip,load_N,drawbar_pull_N,sinkage_m", *EXTRA]), rows) == []
    assert unread(tmp_path, "slip,load_N,drawbar_pull_N,load_cell_N") == []


def test_a_model_of_another_rover_is_refused():
    """Before anything is fitted, with both rovers' wheels named."""
    cart = Model(load_rover("cart"), flat(), (DRIVEN_SAND,), nexus6_motor())
    with pytest.raises(DataError, match=r"model.*wheels.*log.* fl, fr, ml, mr, rl, rr"):
        close_the_loop(DriveLog(Path("nowhere"), LogMetadata("small"), ()), model=cart)
