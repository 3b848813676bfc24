"""Recordings in other people's habits become the drive log of the same drive."""

import logging
import math
import tomllib

import numpy as np
import pandas as pd
import pytest

from rover_pin.base.errors import DataError
from rover_pin.base.jobs import time_left
from rover_pin.experiments.drive_log.checks.log import faults, findings, refuse_unfit
from rover_pin.importing.import_log import import_log
from rover_pin.logs.drive_log import read_drive_log
from tests.importing import recordings

TOLERANCES = {"body_x": 2e-3, "body_y": 2e-3, "body_z": 1e-6, "body_pitch": 1e-6, "body_roll": 1e-6, "body_yaw": 1e-6}
LACKS = {"geographic": ("body_z", "body_roll"), "twist": ("body_roll",)}


@pytest.fixture(scope="module")
def truth():
    return recordings.truth()


def imported(path, folder, **options):
    imported_log = import_log([path], "cart", folder / "log", **options)
    return imported_log, read_drive_log(folder / "log")


@pytest.mark.parametrize("habit", recordings.HABITS)
def test_the_same_drive_comes_out_of_every_habit(habit, truth, tmp_path):
    imported_log, log = imported(recordings.HABITS[habit](truth, tmp_path), tmp_path)
    assert len(log.runs) >= 2
    begins = [float(line.split(" s from ")[1].split(" s of ")[0]) for line in imported_log.runs]
    for run, begin in zip(log.runs, begins, strict=True):
        at = int(np.argmin(np.abs(truth["t_s"] - begin)))
        rows = slice(at, at + len(run.t))
        for name, values in truth.items():
            if name in LACKS.get(habit, ()) or name == "t_s":
                continue
            imported_values, true = run[name], values[rows]
            if name in ("body_x", "body_y"):
                imported_values, true = imported_values - imported_values[0], true - true[0]
            if name == "body_yaw":
                imported_values = imported_values - 2 * math.pi * np.round(
                    (imported_values[0] - true[0]) / (2 * math.pi)
                )
            tolerance = TOLERANCES.get(name, 1e-4)
            if habit in ("geographic", "twist") and name.startswith("wheel_rate"):
                tolerance = 0.02
            if habit == "twist" and name == "body_yaw":
                tolerance = 0.1
            if habit == "geographic" and name in ("body_x", "body_y"):
                tolerance = 1e-2
            assert imported_values == pytest.approx(true, abs=tolerance), name
    assert faults(log) == ()
    assert "their measured" in " ".join(map(str, findings(log)))
    assert_guesses_are_marked(imported_log, (tmp_path / "log" / "drive.toml").read_text())


def assert_guesses_are_marked(example, text):
    """Each column is told once, and is a guess in the TOML where it is one in what is told."""
    columns = tomllib.loads(text)["columns"]
    named = [line.split(" = ")[0] for line in example.columns]
    assert len(named) == len(set(named))
    assert set(columns) <= set(named)
    for name, line in zip(named, example.columns, strict=True):
        (local,) = [line for line in text.splitlines() if line.startswith(f"{name} = ")] or [""]
        assert ("GUESSED" in line) == ("GUESSED" in local)


@pytest.mark.parametrize("kind", recordings.BAGS)
def test_bags_of_other_writers_become_the_log_of_the_same_drive(kind, truth, tmp_path):
    """The wheels are known by their joints; the MCAP is written by the format's own library, not by the reader's."""
    for needed in ("rosbags", *(["mcap"] if kind == "mcap" else [])):
        pytest.importorskip(needed)
    imported_log, log = imported(recordings.BAGS[kind](truth, tmp_path), tmp_path)
    assert faults(log) == ()
    begin = float(imported_log.runs[0].split(" s from ")[1].split(" s of ")[0])
    at = int(np.argmin(np.abs(truth["t_s"] - begin)))
    for name in ("body_z", "body_pitch", "body_roll", "wheel_rate_fl", "wheel_rate_br"):
        assert log.runs[0][name] == pytest.approx(truth[name][at : at + len(log.runs[0].t)], abs=1e-4), name
    from_start = [
        values - values[0] for values in (log.runs[0]["body_x"], truth["body_x"][at : at + len(log.runs[0].t)])
    ]
    assert from_start[0] == pytest.approx(from_start[1], abs=1e-3)


def test_most_informative_parts_of_a_long_recording_are_kept(tmp_path):
    long = recordings.truth(seconds=900.0)
    imported_log, log = imported(recordings.plain(long, tmp_path), tmp_path, most=4)
    assert len(log.runs) == 4
    assert any("4 of " in note and "most informative" in note for note in imported_log.notes)
    reached = [float(np.ptp(run["body_pitch"])) for run in log.runs]
    assert max(reached) > 0.2


def test_long_recordings_tell_how_far_they_are(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(time_left, "SECONDS_BETWEEN_LINES", 0.0)
    monkeypatch.setattr("rover_pin.importing.import_log.LARGE", 1000)
    path = recordings.plain(recordings.truth(), tmp_path)
    with caplog.at_level(logging.INFO):
        _, log = imported(path, tmp_path)
        refuse_unfit(log)
        findings(log)
    messages = [record.getMessage() for record in caplog.records]
    assert messages[0] == "reading plain.csv: 0 MB"
    for what in ("runs written", "runs read", "runs looked at for faults", "runs checked"):
        assert any(line.startswith(f"{what}: 1 of {len(log.runs)}, about ") for line in messages), what


def test_odometry_alone_is_taken_marked_and_then_refused(truth, tmp_path):
    table = pd.read_csv(recordings.plain(truth, tmp_path))
    rim = recordings.R * np.mean([table[f"wheel_{wheel}_speed [rad/s]"] for wheel in ("fl", "fr", "bl", "br")], axis=0)
    yaw = table["yaw [rad]"].to_numpy()
    table["odom_x"], table["odom_y"] = (np.cumsum(0.1 * rim * component) for component in (np.cos(yaw), np.sin(yaw)))
    table.drop(columns=["x [m]", "y [m]", "z [m]"]).to_csv(tmp_path / "odom.csv", index=False)
    imported_log, log = imported(tmp_path / "odom.csv", tmp_path)
    assert any("odom_x" in line and "odometry" in line for line in imported_log.columns)
    assert "wheels' odometry" in str(faults(log)[0])


@pytest.mark.parametrize(
    ("name", "target", "unit"),
    [
        ("motor_current_{}", "raw_current_{}", None),
        ("adc_strom_{}", "raw_current_{}", None),
        ("current_{} [mA]", "current_{}_A", "mA"),
        ("current_{}_A", "current_{}_A", None),
    ],
)
def test_currents_without_a_unit_are_counts(name, target, unit, truth, tmp_path):
    table = pd.read_csv(recordings.plain(truth, tmp_path))
    for at, wheel in enumerate(("fl", "fr", "bl", "br")):
        table[name.format(wheel)] = np.round(500.0 + at + 100.0 * np.sin(truth["t_s"]))
    table.to_csv(tmp_path / "counts.csv", index=False)
    imported_log, log = imported(tmp_path / "counts.csv", tmp_path)
    factor = 1e-3 if unit == "mA" else 1.0
    assert np.ptp(log.runs[0][target.format("br")]) == pytest.approx(200.0 * factor, rel=0.02)
    (line,) = [column for column in imported_log.columns if column.startswith(target.format("br"))]
    assert ("unknown scale" in line) == target.startswith("raw")
    assert not any("motor currents" in lack for lack in imported_log.lacks)


def without(names):
    def write(truth, folder):
        table = pd.read_csv(recordings.plain(truth, folder))
        table.drop(columns=[name for name in table if name.startswith(names)]).to_csv(folder / "less.csv", index=False)
        return folder / "less.csv"

    return write


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("x [m]", "y [m]"), "position.*--column body_x='FORMULA'"),
        (("wheel_",), "column.*known"),
        (("wheel_bl", "wheel_fl"), "column.*known"),
        (("time",), "column.*clock"),
    ],
)
def test_missing_columns_are_named_with_those_present(names, message, truth, tmp_path):
    with pytest.raises(DataError, match=message) as error:
        imported(without(names)(truth, tmp_path), tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.csv", None, "such file"),
        ("empty.csv", b"", "file.*rows"),
        ("text.csv", b"Dear all,\nplease find attached\n", "line 2: 1 cells under 2 column names"),
        ("one.csv", b"t\n1\n2\n", "1 columns.*2"),
        ("bytes.mat", b"\x00\x01", ".mat.*read"),
        ("seven.mat", b"MATLAB 7.3".ljust(124) + b"\x00\x02IM" + bytes(384) + b"\x89HDF", "save.*'-v7'"),
        ("bytes.parquet", b"PAR1", "is not Parquet"),
        ("bytes.bag", b"\x00\x01", "cannot.*read"),
        (
            "still.csv",
            b"t,x,y,yaw,w_fl,w_fr,w_bl,w_br\n" + b"".join(b"%d,0,0,0,0,0,0,0\n" % k for k in range(50)),
            "never turn",
        ),
    ],
)
def test_a_file_that_is_no_recording_is_refused_in_one_sentence(name, content, message, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=message) as error:
        imported(tmp_path / name, tmp_path)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "log").exists()


def test_nothing_is_written_over(truth, tmp_path):
    path = recordings.plain(truth, tmp_path)
    imported(path, tmp_path)
    with pytest.raises(DataError, match=r"already.*another"):
        imported(path, tmp_path)


CLOCKS = {
    "day first": lambda t: f"12.04.2026 09:31:{t:06.3f}".replace(".", ",", 3).replace("12,04,", "12.04."),
    "month first": lambda t: f"4/13/2026 9:31:{t:06.3f} UTC",
    "time of day": lambda t: f"23:59:{50 + t:06.3f}" if t < 10 else f"0:00:{t - 10:06.3f}",
}


@pytest.mark.parametrize("habit", CLOCKS)
def test_dates_in_any_language_are_the_clock_and_rpm_the_wheels(habit, tmp_path):
    """Czech: no word of it is known; the dates tell the clock, unit and corner the wheels, the wheels the way ahead."""
    t = np.arange(0.1, 40.0, 0.1)
    ahead = np.where(t < 20.0, 1.0, -1.0)
    rate = ahead * (0.8 + 0.2 * np.sin(t))
    x = np.cumsum(0.1 * 0.09 * rate)
    columns = {
        "Datum a čas": [CLOCKS[habit](second % 60) for second in t],
        "X [mm]": 1e3 * x,
        "Y [mm]": 300.0 + 0.0 * x,
    }
    columns |= {f"Otáčky {name} [RPM]": rate * 30 / math.pi for name in ("fl", "fr", "bl", "br")}
    pd.DataFrame(columns).to_csv(tmp_path / "jizda.csv", sep=";", decimal=",", index=False)
    _, log = imported(tmp_path / "jizda.csv", tmp_path)
    run = log.runs[0]
    assert np.diff(run.t) == pytest.approx(0.1, abs=1e-6)
    assert run["wheel_rate_br"] == pytest.approx(rate[: len(run.t)], abs=1e-6)
    assert run["body_yaw"] == pytest.approx(0.0, abs=1e-6)
    back = log.runs[-1]
    assert np.all(back["wheel_rate_fl"] < 0.0)
    assert back["body_yaw"] == pytest.approx(0.0, abs=1e-6)
