"""How much is said on the way, and what a shell completes as one types: names, and settings of the drive."""

import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer._completion_classes import BashComplete

import rover_pin
from rover_pin.cli.app import app
from rover_pin.cli.speaking import speak


@pytest.fixture(autouse=True)
def as_it_was():
    yield
    log = logging.getLogger("rover_pin")
    log.handlers = [handler for handler in log.handlers if isinstance(handler, logging.NullHandler)]
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


CODE = "from rover_pin.cli.app import app; app(prog_name='rover-pin')"


def completed(words):
    """The items that the program itself offers where the last of these words is being typed."""
    shell = BashComplete(typer.main.get_command(app), {}, "rover-pin", "_ROVER_PIN_COMPLETE")
    *args, begun = words.split(" ")
    return {item.value: item.help for item in shell.get_completions(args, begun)}


def asked(variables):
    done = subprocess.run(
        [sys.executable, "-c", CODE], capture_output=True, text=True, env={**os.environ, **variables}, check=False
    )
    assert done.stderr == ""
    return done.stdout


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("drive di", ["ditch"]),
        ("drive flat --soil fj", ["fjs-1"]),
        ("drive ditch --set terrain.wall", ["terrain.wall_angle="]),
        ("drive flat --set terrain.wall", []),
        ("drive ditch --set control.lim", ["control.limit="]),
        (
            "drive flat --add DiggingMemory --set effect.Digg",
            [f"effect.DiggingMemory.{name}=" for name in ("c_d", "deepest", "length", "v_0")],
        ),
        ("drive flat --set slip=algebraic --set effect.Relaxed", []),
        ("drive flat --set slip=al", ["slip=algebraic"]),
        ("drive flat --set nonsense=1 --set soil.", []),
        ("drive flat --add Digg", ["DiggingMemory"]),
        ("drive flat --add DiggingMemory.", [f"DiggingMemory.{name}=" for name in ("c_d", "deepest", "length", "v_0")]),
        ("list effects Digg", ["DiggingMemory"]),
        ("list settings washb", ["washboard"]),
        ("list settings washboard --set terrain.wave", ["terrain.wavelength="]),
        ("identify data --set k_", ["k_1=", "k_2="]),
        ("identify data --set terrain", []),
    ],
)
def test_a_shell_completes(words, expected):
    assert sorted(completed(words)) == expected


def test_bash_and_zsh_are_answered():
    bash = {"COMP_WORDS": "rover-pin drive ditch --set terrain.wall", "COMP_CWORD": "4"}
    assert asked({"_ROVER_PIN_COMPLETE": "complete_bash", **bash}).split() == ["terrain.wall_angle="]
    zsh = {"_TYPER_COMPLETE_ARGS": "rover-pin drive flat --soil fj"}
    assert "fjs-1" in asked({"_ROVER_PIN_COMPLETE": "complete_zsh", **zsh})
