"""What import-log decides where names leave it open: pairs of columns, the sense of wheels, which parts tell most."""

import math
import re

import numpy as np
import pandas as pd
import pytest

from rover_pin.logs.drive_log import read_drive_log
from rover_pin.logs.importing.import_log import import_log
from rover_pin.logs.importing.splitting import Drive, Part, chosen
from tests.logs import recordings


def imported(table, folder):
    table.to_csv(folder / "own.csv", index=False)
    made = import_log([folder / "own.csv"], "cart", folder / "log")
    return made, read_drive_log(folder / "log")


def test_x_and_y_are_of_one_source(tmp_path):
    """A better source of y alone is another marker's."""
    table = pd.read_csv(recordings.plain(recordings.truth(), tmp_path))
    made, _ = imported(table.assign(**{"mocap y [m]": 5.0}), tmp_path)
    assert any(line.startswith("body_y = y [m]") for line in made.columns), made.columns


def test_reversed_wheel_signs_of_a_slow_rover_are_corrected(tmp_path):
    """A centimetre a second, in turns a second: the sense does not hang on the size of the numbers."""
    seen = recordings.truth()
    table = pd.read_csv(recordings.plain(seen | {"t_s": 10.0 * seen["t_s"]}, tmp_path))
    for name in [each for each in table if each.startswith("wheel_")]:
        turns = table.pop(name) / (10.0 * 2.0 * math.pi)
        table[name.replace("rad/s", "rev/s")] = -turns if "r_speed" in name else turns
    _, log = imported(table, tmp_path)
    for run in log.runs:
        assert all(np.median(run[f"wheel_rate_{wheel}"]) > 0.0 for wheel in ("fl", "fr", "bl", "br"))


@pytest.mark.parametrize("at", [0, 4, 9])
def test_of_parts_alike_the_one_on_a_slope_is_kept(at):
    t = np.arange(0.0, 200.0, 0.1)
    random = np.random.default_rng(4)
    noisy = lambda middle: middle + 1e-3 * random.standard_normal(len(t))  # noqa: E731
    pitch = np.where((t >= 20.0 * at) & (t < 20.0 * at + 20.0), 0.2, 0.0)
    drive = Drive(t, noisy(1.0), noisy(0.09), noisy(0.1), pitch, noisy(0.0))
    parts = [(drive, Part(200 * k, 200 * k + 200)) for k in range(10)]
    assert at in chosen(parts, 2)


def test_a_matrix_may_lie_on_its_side(tmp_path):
    """Channels as rows or as columns: the longer way is that of time."""
    from scipy.io import savemat

    seen = recordings.truth()
    wheels = np.array([seen[f"wheel_rate_{wheel}"] for wheel in ("fl", "fr", "bl", "br")])
    logs = []
    for name, matrix in (("rows", wheels), ("columns", wheels.T)):
        (tmp_path / name).mkdir()
        table = {"t_s": seen["t_s"], "wheel_omega": matrix} | {name: seen[f"body_{name}"] for name in ("x", "y", "yaw")}
        savemat(tmp_path / name / "own.mat", table)
        import_log([tmp_path / name / "own.mat"], "cart", tmp_path / name / "log")
        logs.append(read_drive_log(tmp_path / name / "log"))
    for one, other in zip(logs[0].runs, logs[1].runs, strict=True):
        assert np.array_equal(one["wheel_rate_br"], other["wheel_rate_br"])


def test_run_begins_a_second_before_motion_and_states_duration(tmp_path):
    """The drive stands from 30 to 36 s."""
    made, log = imported(pd.read_csv(recordings.plain(recordings.truth(), tmp_path)), tmp_path)
    begins = []
    for line, run in zip(made.runs, log.runs, strict=True):
        lasts, begin = re.search(r"([\d.]+) s from ([\d.]+) s of ", line).groups()
        begins.append(float(begin))
        assert float(lasts) == pytest.approx(run.t[-1] - run.t[0], abs=0.6)
    assert min(abs(begin - 35.0) for begin in begins) < 0.25
