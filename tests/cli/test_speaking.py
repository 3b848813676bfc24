"""How much is said on the way: nothing but warnings with -q, more with -v; the version; what a shell completes."""

import logging
import subprocess
import sys
from pathlib import Path

import pytest

import rover_pin
from rover_pin.cli.speaking import speak


@pytest.fixture(autouse=True)
def as_it_was():
    yield
    log = logging.getLogger("rover_pin")
    log.handlers = [each for each in log.handlers if isinstance(each, logging.NullHandler)]
    log.setLevel(logging.NOTSET)


@pytest.mark.parametrize("words", [("-q", "drive", "flat"), ("drive", "flat", "-q")])
def test_a_quiet_command_says_nothing_on_the_way(run, words):
    more = ("--set", "duration=0.5")
    run(*words, *more)
    assert run(*words, *more)[2] == ""
    assert "replaces" in run("drive", "flat", *more)[2]


def test_a_refused_run_does_not_say_that_it_replaces_anything(run):
    Path("out").mkdir()
    Path("out/report.html").write_text("an earlier one")
    code, _, err = run("close-loop", "README.md", "--out", "out")
    assert code == 2
    assert "replaces" not in err


def test_warnings_are_said_even_where_it_is_quiet(capsys):
    speak("quiet")
    logging.getLogger("rover_pin.simulation").info("on the way")
    logging.getLogger("rover_pin.simulation").warning("look out")
    assert capsys.readouterr().err == "rover-pin: warning: look out\n"


def test_the_package_says_nothing_unless_asked():
    code = "import logging, rover_pin; logging.getLogger('rover_pin.simulation').warning('look out')"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stderr == b""


def test_paths_are_never_shortened(run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    folder = "a-rather-long-name-of-a-folder/" + "and-another-that-is-as-long" * 2
    _, out, _ = run("drive", "flat", "--set", "duration=0.5", "--out", folder)
    assert f"{folder}/snapshots.png" in out.split()


def test_the_version(run):
    assert run("--version")[:2] == (0, f"rover-pin {rover_pin.__version__}\n")


def test_a_verbose_command_says_what_it_does(run):
    assert "driven: 10 rows" in run("drive", "flat", "-v", "--set", "duration=0.5")[2]
