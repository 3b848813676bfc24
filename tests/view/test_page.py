"""HTML pages and animations of a drive: they are complete, need no network, and a missing package is reported before
any work begins.
"""

import re
from importlib import util
from pathlib import Path

import pytest
from PIL import Image

from rover_pin.cli.commands.view import read_subject
from rover_pin.logs.drive_log import save_trace
from rover_pin.scenarios.scenario import scenario
from rover_pin.view.animation import COLOURS, MAX_PICTURES, PICTURES_PER_SECOND, write_animation
from rover_pin.view.film import Film

WORDS = ("--set", "duration=1.2", "--set", "soil.k=10mm")


@pytest.mark.slow
def test_a_drive_is_written_as_a_page_and_a_moving_picture(run):
    code, out, _ = run("drive", "ditch", *WORDS, "--view", "--gif")
    assert code == 0
    assert "out/drive/view.html" in out
    page = Path("out/drive/view.html").read_text()
    assert "__VISER_EMBED_DATA__" in page
    assert re.findall("<title>(.*?)</title>", page)[0].startswith("ditch")
    panel = page[page.rindex('<aside id="rover-pin-panel"') :]
    assert "ditch" in panel
    assert "drives on" in panel
    outside = re.findall(r'(?:src|href)="(https?://[^"]+)"', page)
    assert not outside
    with Image.open("out/drive/drive.gif") as picture:
        lasts = picture.n_frames * picture.info["duration"] / 1000.0
        assert lasts == pytest.approx(1.2, abs=0.25)  # as long as the drive
        assert picture.width > 500


def test_the_page_of_a_drive_is_opened_in_the_browser(run, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert run("drive", "flat", "--set", "duration=0.2", "--open")[0] == 0
    assert opened == [Path("out/drive/view.html").resolve().as_uri()]


def test_a_missing_browser_is_reported(run, monkeypatch):
    monkeypatch.setattr("webbrowser.open", lambda page: False)
    code, _, err = run("drive", "flat", "--set", "duration=0.2", "--open")
    assert code == 0
    assert "machine; open out/drive/view.html" in err


@pytest.mark.slow
def test_a_long_moving_picture_is_shown_faster_and_stays_small(tmp_path):
    case = scenario("flat", duration=25.0)
    film = Film.of(case.drive(), case.model.rover, case.model.terrain)
    file = write_animation(tmp_path / "flat.gif", film, "flat")
    with Image.open(file) as picture:
        assert picture.n_frames == MAX_PICTURES
        assert picture.info["duration"] == 1000 // PICTURES_PER_SECOND
        assert len(picture.convert("RGB").getcolors(1 << 20)) <= COLOURS
    assert file.stat().st_size < 600_000


@pytest.mark.slow
def test_a_log_is_seen_with_another_as_its_ghost(run):
    run("drive", "flat", *WORDS)
    run("drive", "flat", *WORDS, "--control", "true", "--out", "other")
    assert run("view", "out/drive/log", "--compare", "other/log")[0] == 0
    assert "blue: flat, drives" in Path("out/view/view.html").read_text()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [(("view", "gone"), "drive log (drive.toml)"), (("view", "log", "--run", "none"), "run 'none'")],
)
def test_a_drive_that_cannot_be_shown_is_refused_in_one_sentence(run, words, sentence):
    scenario("flat", duration=0.2).write_log(scenario("flat", duration=0.2).drive(), "log")
    code, _, err = run(*words)
    assert code == 2
    assert sentence in err


def test_a_missing_viser_or_ffmpeg_is_reported_before_the_drive(run, monkeypatch):
    monkeypatch.setattr(util, "find_spec", lambda name: None)
    monkeypatch.setattr("rover_pin.cli.commands.view.find_spec", lambda name: None)
    assert 'needs viser. Run `pip install "viser>=1.0"`' in run("drive", "flat", "--view")[2]
    monkeypatch.setattr("shutil.which", lambda name, path: None)
    assert "ffmpeg" in run("drive", "flat", "--mp4")[2]
    assert not Path("out").exists()


def test_a_saved_trace_finds_its_ground_by_its_scenario(tmp_path):
    case = scenario("rocks", duration=0.5, **{"terrain.seed": 3})
    save_trace(case.drive(), tmp_path / "seen.parquet")
    subject = read_subject(tmp_path / "seen.parquet")
    assert subject.terrain == case.model.terrain
    assert subject.rover.name == "nexus6"
