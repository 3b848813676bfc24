"""`import-log` by its command: what it prints, what it says is missing, and errors in one sentence."""

import json
from pathlib import Path

import pytest

from tests.importing import recordings


def test_a_recording_becomes_a_log_that_check_data_takes(run):
    recordings.german(recordings.truth(), Path())
    code, out, err = run("import-log", "Messung.csv", "--rover", "cart", "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert report["next"] == "rover-pin close-loop Messung"
    assert any(note.startswith("Messung.csv: columns") for note in report["notes"])
    assert any("no duties" in lack for lack in report["lacks"])
    assert run("check-data", "Messung")[0] == 0


def test_odometry_is_written_down_and_then_refused(run):
    import numpy as np

    truth = recordings.truth()
    rim = recordings.R * np.mean([truth[f"wheel_rate_{wheel}"] for wheel in ("fl", "fr", "bl", "br")], axis=0)
    for name, function in (("body_x", np.cos), ("body_y", np.sin)):
        truth[name] = np.cumsum(0.1 * rim * function(truth["body_yaw"]))
    recordings.plain(truth, Path())
    code, out, err = run("import-log", "plain.csv", "--rover", "cart")
    assert code == 2
    assert "written" in out
    assert "wheels' odometry" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--column", "body_x"), "NAME=FORMULA"),
        (("--column", "body_x=x", "--column", "body_z"), "--column body_z"),
        (("--column", "body_x=x", "--column", "body_x=y"), "--column body_x=y"),
        (("--column", "body_x=open('x')"), "function 'open'"),
        (("--column", "body_zz=z"), "--column body_zz"),
        (("--column", "wheel_rate_f1=1"), "you mean 'wheel_rate_f"),
        (("--column", "body_x=body_yz"), "column 'body_yz'"),
        (("--rover", "nowhere.toml"), "nowhere"),
    ],
)
def test_errors_are_one_sentence(run, words, message):
    recordings.plain(recordings.truth(), Path())
    code, _, err = run("import-log", "plain.csv", "--rover", "cart", *words)
    assert code == 2
    assert message in err
    assert err.count("\n") == 1


def test_a_file_of_a_sample_is_imported_by_its_name(run):
    code, out, err = run("import-log", "steepening-slope/climb-1.csv")
    assert (code, err) == (0, "")
    assert "written   climb-1/drive.toml" in out
    assert not Path("steepening-slope").exists()
    code, _, err = run("import-log", "steepening-slope")
    assert code == 2
    assert "metadata.yaml" in err
