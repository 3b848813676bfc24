"""What import-log decides where names leave it open: pairs of columns, the sense of wheels, which parts tell most."""

import math
import re

import numpy as np
import pandas as pd
import pytest

from rover_pin.importing.import_log import import_log
from rover_pin.logs.drive_log import read_drive_log
from tests.importing import recordings


def imported(table, folder):
    table.to_csv(folder / "own.csv", index=False)
    imported_log = import_log([folder / "own.csv"], "cart", folder / "log")
    return imported_log, read_drive_log(folder / "log")


def test_reversed_wheel_signs_of_a_slow_rover_are_corrected(tmp_path):
    """A centimetre a second, in turns a second: the sense does not hang on the size of the numbers."""
    truth = recordings.truth()
    table = pd.read_csv(recordings.plain(truth | {"t_s": 10.0 * truth["t_s"]}, tmp_path))
    for name in [line for line in table if line.startswith("wheel_")]:
        turns = table.pop(name) / (10.0 * 2.0 * math.pi)
        table[name.replace("rad/s", "rev/s")] = -turns if "r_speed" in name else turns
    _, log = imported(table, tmp_path)
    for run in log.runs:
        assert all(np.median(run[f"wheel_rate_{wheel}"]) > 0.0 for wheel in ("fl", "fr", "bl", "br"))


def test_run_begins_a_second_before_motion_and_states_duration(tmp_path):
    """The drive stands from 30 to 36 s."""
    imported_log, log = imported(pd.read_csv(recordings.plain(recordings.truth(), tmp_path)), tmp_path)
    begins = []
    for line, run in zip(imported_log.runs, log.runs, strict=True):
        lasts, begin = re.search(r"([\d.]+) s from ([\d.]+) s of ", line).groups()
        begins.append(float(begin))
        assert float(lasts) == pytest.approx(run.t[-1] - run.t[0], abs=0.6)
    assert min(abs(begin - 35.0) for begin in begins) < 0.25
