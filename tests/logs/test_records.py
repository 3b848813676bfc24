"""Texts whose every line is of one of several records: read by their names and times, or refused by what is wrong."""

import numpy as np
import pandas as pd
import pytest

from rover_pin.base.errors import DataError
from rover_pin.importing.files.raw import read_raw
from rover_pin.importing.import_log import import_log
from tests.importing import recordings

BEGIN = pd.Timestamp("2022-06-01 13:42:57.5")


def text(
    rows=40, delimiter=";", stamp=lambda at: (BEGIN + pd.Timedelta(0.1 * at, "s")).strftime("%Y:%m:%d %H:%M:%S.%f")
):
    """A receiver at 10 Hz, a gyro at 20 Hz in lines of their own, some of them late."""
    lines = [delimiter.join(["GPS", stamp(at), str(1.0 * at), str(-2.0 * at)]) for at in range(rows)]
    rates = [
        delimiter.join(["IMU", stamp(at / 2), "Rate", "0.0", str(3.0 * at), "Level", "9.8"]) for at in range(2 * rows)
    ]
    return "\n".join([*lines[:20], *rates, *lines[20:]]) + "\n"


@pytest.mark.parametrize("delimiter", [";", ",", "\t"])
def test_cells_are_called_after_the_word_before_them(delimiter, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text(delimiter=delimiter))
    raw = read_raw(path)
    t = raw.table["t_s"].to_numpy()
    assert set(raw.table) == {"t_s", "GPS_1", "GPS_2", "IMU_Rate_1", "IMU_Rate_2", "IMU_Level"}
    assert raw.table["IMU_Rate_2"].to_numpy() == pytest.approx(60.0 * t, abs=1e-6)
    inside = t <= 3.9
    assert raw.table["GPS_2"].to_numpy()[inside] == pytest.approx(-20.0 * t[inside], abs=1e-6)
    assert "40 of GPS, 80 of IMU" in raw.notes[0]


def test_records_without_dates_are_refused_with_what_is_there(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text(stamp=lambda at: f"{1e3 * at:.0f}"))
    with pytest.raises(DataError, match=r"records \(GPS, IMU\).*'GPS' is no date \('0'\)"):
        read_raw(path)


@pytest.fixture(scope="module")
def truth():
    return recordings.truth()


def test_places_on_a_maps_grid_are_told_from_an_origin(truth, tmp_path):
    grid = {**truth, "body_x": truth["body_x"] + 174_043.2, "body_y": truth["body_y"] - 5_444_352.0}
    imported_log = import_log([recordings.plain(grid, tmp_path)], "cart", tmp_path / "log")
    assert {"body_x = x [m] -174040 [m]", "body_y = y [m] +5.44435e+06 [m]"} <= set(imported_log.columns)
    from rover_pin.experiments.drive_log.checks.log import faults
    from rover_pin.logs.drive_log import read_drive_log

    log = read_drive_log(tmp_path / "log")
    assert faults(log) == ()
    assert np.abs(log.runs[0]["body_x"] - truth["body_x"][: len(log.runs[0].t)] - 3.2).max() < 0.02


@pytest.mark.parametrize(("share", "message"), [(1.0, True), (3.4, False)])
def test_rates_computed_from_a_turn_say_nothing_of_scrub(share, message, truth, tmp_path):
    """The cart's four wheels skid: their sides must run apart by more than a turn without scrub takes."""
    scrubbed = dict(truth)
    for side in "lr":
        for axle in "fb":
            mean = np.mean([truth[f"wheel_rate_{axle}{side}"] for side in "lr"], axis=0)
            scrubbed[f"wheel_rate_{axle}{side}"] = mean + share * (truth[f"wheel_rate_{axle}{side}"] - mean)
    imported_log = import_log([recordings.plain(scrubbed, tmp_path)], "cart", tmp_path / "log")
    (track,) = [note for note in imported_log.notes if note.startswith("effective track")]
    assert ("no scrub" in track) is message
