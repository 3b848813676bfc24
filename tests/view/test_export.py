"""A drive for other tools says the same: every number of every row, and every link where it was."""

import io
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rover_pin.logs.saved import load_trace
from rover_pin.scenarios.scenario import scenario


@pytest.fixture
def log(run):
    made = scenario("ditch", duration=1.0)
    trace = made.drive()
    made.write_log(trace, "log")
    return trace


def exported(run, to):
    code, out, _ = run("export", "log", "--to", to, "--json")
    assert code == 0
    return Path(json.loads(out)["files"][0])


def test_csv_and_parquet_have_every_number(run, log):
    table = pd.read_csv(exported(run, "csv"))
    trace = load_trace(exported(run, "parquet"))
    assert set(table) == set(trace) == set(log)
    for name in log:
        assert np.array_equal(trace[name], log[name], equal_nan=True)
        assert np.array_equal(table[name], log[name], equal_nan=True)


def test_mcap_has_every_row_and_every_link(run, log):
    reader = pytest.importorskip("mcap.reader", reason="CI has it by the extra dev")
    messages = list(reader.make_reader(io.BytesIO(exported(run, "mcap").read_bytes())).iter_messages())
    rows = [json.loads(message.data) for _, channel, message in messages if channel.topic == "/trace"]
    assert [row["body_x"] for row in rows] == list(log["body_x"])
    frames = [json.loads(message.data)["transforms"] for _, channel, message in messages if channel.topic == "/tf"]
    logged = [message.log_time for _, channel, message in messages if channel.topic == "/tf"]
    stamps = [frame[0]["timestamp"] for frame in frames]
    assert [stamp["sec"] * 10**9 + stamp["nsec"] for stamp in stamps] == pytest.approx(logged, abs=2)
    base = frames[-1][0]
    assert base["translation"]["x"] == pytest.approx(log["body_x"][-1])
    assert sum(each**2 for each in base["rotation"].values()) == pytest.approx(1.0)


def test_rerun_has_every_link_and_every_channel(run, log):
    pytest.importorskip("rerun", reason="an extra of its own, too large for CI's")
    file = exported(run, "rerun")
    assert file.suffix == ".rrd"
    written = file.read_bytes()
    wheels = [f"wheel_{name}_link" for name in log.wheels]
    assert all(f"/rover/{name}".encode() in written for name in ["base_link", *wheels])
    assert all(f"/channels/{name}".encode() in written for name in log if name != "t_s")


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg on the path")
def test_a_film_plays_from_the_drives_first_second_to_its_last(run):
    assert run("drive", "flat", "--set", "duration=1", "--mp4")[0] == 0
    words = ["ffmpeg", "-v", "error", "-i", "out/drive/drive.mp4", "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    frames = subprocess.run(words, capture_output=True, check=True)
    assert frames.stderr == b""
    assert len(frames.stdout) > 10 * 600 * 250  # ten pictures of the size that they are drawn at


def test_what_is_missing_is_said(run, log, monkeypatch):
    monkeypatch.setattr("rover_pin.cli.commands.export.find_spec", lambda name: None)
    assert "package rerun-sdk: pip install 'rover-pin[rerun]'" in run("export", "log", "--to", "rerun")[2]
    assert "package mcap: pip install 'rover-pin[mcap]'" in run("export", "log", "--to", "mcap")[2]
