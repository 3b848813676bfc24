"""What a shell completes as one types: names, and the settings of the drive that is being typed."""

import os
import subprocess
import sys

import pytest
import typer
from typer._completion_classes import BashComplete

from rover_pin.cli.app import app

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
    ("words", "found"),
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
def test_a_shell_completes(words, found):
    assert sorted(completed(words)) == found


def test_bash_and_zsh_are_answered():
    bash = {"COMP_WORDS": "rover-pin drive ditch --set terrain.wall", "COMP_CWORD": "4"}
    assert asked({"_ROVER_PIN_COMPLETE": "complete_bash", **bash}).split() == ["terrain.wall_angle="]
    zsh = {"_TYPER_COMPLETE_ARGS": "rover-pin drive flat --soil fj"}
    assert "fjs-1" in asked({"_ROVER_PIN_COMPLETE": "complete_zsh", **zsh})
