"""Exports of a drive to other programs, and the panel next to the 3D scene: numbers, links, channels, events and keys
agree with the drive.
"""

import io
import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rover_pin.logs.drive_log import load_trace
from rover_pin.scenarios.scenario import scenario
from rover_pin.view.film import Film, Subject
from rover_pin.view.page import events_of, plot_data, write_page


@pytest.fixture
def log(run):
    case = scenario("ditch", duration=1.0)
    trace = case.drive()
    case.write_log(trace, "log")
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
    assert sum(item**2 for item in base["rotation"].values()) == pytest.approx(1.0)


def test_rerun_has_every_link_and_every_channel(run, log):
    pytest.importorskip("rerun", reason="an extra of its own, too large for CI's")
    file = exported(run, "rerun")
    assert file.suffix == ".rrd"
    content = file.read_bytes()
    wheels = [f"wheel_{name}_link" for name in log.wheels]
    assert all(f"/rover/{name}".encode() in content for name in ["base_link", *wheels])
    assert all(f"/channels/{name}".encode() in content for name in log if name != "t_s")


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg on the path")
def test_a_film_plays_from_the_drives_first_second_to_its_last(run):
    assert run("drive", "flat", "--set", "duration=1", "--mp4")[0] == 0
    words = ["ffmpeg", "-v", "error", "-i", "out/drive/drive.mp4", "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    frames = subprocess.run(words, capture_output=True, check=True)
    assert frames.stderr == b""
    assert len(frames.stdout) > 10 * 600 * 250  # ten pictures of the size that they are drawn at


def test_a_missing_package_is_reported(run, log, monkeypatch):
    monkeypatch.setattr("rover_pin.cli.commands.export.find_spec", lambda name: None)
    assert 'pip install "rerun-sdk>=0.23"' in run("export", "log", "--to", "rerun")[2]
    assert 'pip install "mcap>=1.1"' in run("export", "log", "--to", "mcap")[2]


BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def filmed(name, **settings):
    case = scenario(name, **settings)
    return Film.of(case.drive(), case.model.rover, case.model.terrain)


def test_plots_have_the_channels_of_the_trace():
    film = filmed("flat", duration=0.5)
    data = plot_data(film)
    assert data["t"] == pytest.approx(film.t - film.t[0], abs=1e-3)
    lines = {plot["label"]: plot["lines"] for plot in data["plots"]}
    for channel, label, scale in (("slip", "slip S [-]", 1.0), ("sinkage", "sinkage [mm]", 1e3)):
        expected = scale * film.trace[f"{channel}_ml"][film.rows]
        assert lines[label]["ml"] == pytest.approx(expected, rel=1e-3)
    assert not data["events"]


def test_a_stuck_drive_states_its_time():
    film = filmed("ditch", soil="table-1", duration=12.0)
    (event,) = events_of(film)
    assert event.words == "stuck"
    assert f"since {event.t:.1f} s" in film.trace.attrs["outcome"]


KEYS = """<pre id="said"></pre><iframe id="f" width=900 height=700 src="SRC"></iframe><script>
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
document.getElementById("f").onload = async () => {
  const page = document.getElementById("f").contentWindow, root = page.document, times = [];
  for (let n = 0; n < 100 && !root.querySelector("#root [role=slider]"); n++) await wait(100);
  for (const key of ["Home", "ArrowRight", "ArrowRight", "ArrowLeft"]) {
    page.dispatchEvent(new page.KeyboardEvent("keydown", {key, bubbles: true}));
    await wait(300);
    times.push(Number(root.querySelector("#root [role=slider]").getAttribute("aria-valuenow")));
  }
  const cursors = [...root.querySelectorAll(".cursor")].map((line) => Number(line.getAttribute("x1")));
  document.getElementById("said").textContent = JSON.stringify({times, cursors, title: root.title});
};
</script>"""


@pytest.mark.nightly
@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
def test_arrow_keys_step_and_the_cursors_follow(tmp_path):
    case = scenario("flat", duration=1.0)
    subject = Subject("a flat", case.drive(), case.model.rover, case.model.terrain, None)
    frame = tmp_path / "frame.html"
    frame.write_text(KEYS.replace("SRC", write_page(tmp_path / "view.html", subject).as_uri()))
    options = ["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
               "--allow-file-access-from-files", "--virtual-time-budget=30000", "--dump-dom"]  # fmt: skip
    out = subprocess.run([BROWSER, *options, frame.as_uri()], capture_output=True, text=True, check=True).stdout
    report = json.loads(unescape(re.search(r'<pre id="said">(.*?)</pre>', out, re.DOTALL)[1]))
    assert report["times"] == pytest.approx([0.0, 0.05, 0.1, 0.05], abs=1e-3)
    assert report["title"] == "a flat"
    assert len(report["cursors"]) == 3
    assert np.ptp(report["cursors"]) == 0.0
    assert report["cursors"][0] == pytest.approx(44 + 290 * 0.05 / np.ptp(subject.trace.t), abs=0.1)
