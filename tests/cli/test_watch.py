"""`watch` by its command: the shipped log, a stranger's, and what is no log."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rover_pin import scenario

STUDIES = Path(__file__).parents[2] / "studies"
LOG, MODEL = STUDIES / "data" / "steepening-slope", STUDIES / "results" / "steepening-slope" / "model.toml"


def watched(run, *words):
    code, out, err = run("watch", *words, "--json")
    assert (code, err) == (0, "")
    return json.loads(out), pd.read_csv("out/watch/watch.csv")


def test_the_shipped_climb_digs_in_and_is_warned_of(run):
    """With the model that the loop made of the log: from 20 s on the slip grows, at 36 s it exceeds 0.7."""
    result, table = watched(run, "steepening-slope", "--run", "climb-1", "--model", str(MODEL))
    assert 24.0 < float(table.t_s[table.alarm > 0].min()) < 36.0
    assert len(result["alarms"]) == 1
    assert "digging" in result["alarms"][0]
    assert table[["p_stuck", "p_buried"]].stack().between(0.0, 1.0).all()
    assert table.p_stuck[table.t_s < 18.0].max() < 0.3
    assert Path("out/watch/watch.png").stat().st_size > 10_000


def test_a_drive_on_the_flat_is_not_warned_of(run):
    assert watched(run, "steepening-slope", "--run", "flat-steps")[0]["alarms"] == []


def strangers_log(folder, keep=("wheel_rate", "current", "body_roll", "body_pitch")):
    """A rover that buries itself on a slope, at 10 Hz: rates, currents and attitude, and nothing else."""
    settings = {"soil.k": 0.03, "terrain.angle_deg": 9.0, "terrain.start": 0.5, "add": ("DiggingMemory.c_d=0.15",)}
    trace = scenario("incline", soil="table-1", duration=25.0, **settings).drive()
    columns = {"t_s": trace.t} | {name: values for name, values in trace.channels.items() if name.startswith(keep)}
    folder.mkdir()
    pd.DataFrame(columns)[:: max(1, round(0.1 / (trace.t[1] - trace.t[0])))].to_csv(folder / "drive.csv", index=False)
    soil = '[soil]\nk = { value = 30.0, unit = "mm" }\n'
    text = f'kind = "drive-log"\nname = "theirs"\nrover = "nexus6"\n{soil}[[run]]\nfile = "drive.csv"\n'
    (folder / "drive.toml").write_text(text)
    return trace


def test_a_stranger_s_rates_currents_and_attitude_suffice(run):
    trace = strangers_log(Path("theirs"))
    result, table = watched(run, "theirs")
    assert trace.attrs["stop"].startswith("buried")
    assert table.alarm.iloc[-1] == 1.0
    assert trace.t[-1] - 8.0 < table.t_s[table.alarm > 0].min() < trace.t[-1] - 1.0
    # The log declares k alone: the other numbers that decide a forecast are named with the values that are used.
    for words, line in zip(
        (("phi", "k_1"), ("supply", "gear"), ("R = ",), ("scale",), ("duties",), ("walls",)),
        result["assumed"],
        strict=True,
    ):
        assert all(word in line for word in words)
    assert "k, " not in result["assumed"][0]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("theirs",), "current_"),
        (("theirs", "--run", "climb"), "'climb'"),
        (("nowhere",), "drive.toml"),
        (("notes.txt",), "drive.toml"),
    ],
)
def test_what_cannot_be_watched_is_one_sentence(run, words, sentence):
    strangers_log(Path("theirs"), keep=("wheel_rate", "body_"))
    Path("notes.txt").write_text("nothing")
    code, _, err = run("watch", *words)
    assert code == 2
    assert sentence in err
    assert err.count("\n") == 1
    assert not Path("out/watch/watch.csv").exists()


def test_a_broken_channel_is_named(run):
    shutil.copytree(LOG, "mine")
    table = pd.read_csv("mine/climb-1.csv")
    table["body_pitch"] = np.nan
    table.to_csv("mine/climb-1.csv", index=False)
    code, _, err = run("watch", "mine")
    assert code == 2
    assert "body_pitch" in err
