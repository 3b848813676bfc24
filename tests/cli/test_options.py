"""One option, one meaning: the same name has the same type, form and help in every command that takes it."""

import json
import os
import signal
import subprocess
import sys
import time
import tomllib
from collections import defaultdict
from types import NoneType
from typing import get_args

import numpy as np
import pytest
import typer

from rover_pin import SOILS, Wheel
from rover_pin.cli.app import app
from rover_pin.soil.curves import traction_curves

COMMANDS = typer.main.get_command(app).commands
SCENE = ("rover", "soil", "gravity", "model", "add", "set", "effects", "trust")
"""Options of all commands that take a scenario."""


def options():
    """Return option -> command -> its parameter, of options with a long name."""
    table = defaultdict(dict)
    for command, parsed in COMMANDS.items():
        for parameter in parsed.params:
            for option in parameter.opts:
                if option.startswith("--"):
                    table[option][command] = parameter
    return table


def form(parameter):
    """What an option is, apart from the default that a command chooses for it."""
    annotation = parameter.type_descriptor.annotation if hasattr(parameter, "type_descriptor") else parameter.type
    kinds = set(get_args(annotation) or (annotation,)) - {NoneType}
    return parameter.help, parameter.metavar, parameter.multiple, parameter.is_flag, frozenset(map(str, kinds))


@pytest.mark.parametrize("option", sorted(options()))
def test_an_option_is_the_same_in_every_command(option):
    commands = options()[option]
    forms = {form(parameter) for parameter in commands.values()}
    assert len(forms) == 1, {command: form(parameter) for command, parameter in commands.items()}
    assert next(iter(forms))[0]


@pytest.mark.parametrize("command", ["drive", "map", "export-c", "export-fmu", "export-mjcf"])
def test_every_command_that_takes_a_scenario_takes_what_a_scenario_takes(command):
    assert [name for name in SCENE if command not in options()[f"--{name}"]] == []


@pytest.mark.parametrize("name", ["model", "rover"])
def test_who_takes_a_model_or_rover_file_takes_trust(name):
    """demo and import-log name the package's rovers or a TOML whose URDF lies beside it."""
    takes = set(options()[f"--{name}"]) - {"demo", "import-log"}
    assert takes <= set(options()["--trust"])


def run(*words, code=0):
    with pytest.raises(SystemExit) as exit_info:
        app(list(words))
    assert exit_info.value.code == code


def test_rover_means_the_same_in_a_drive_in_bounds_and_in_exports(tmp_path, capsys):
    run("drive", "flat", "--rover", "cart", "--set", "duration=0.2", "--out", str(tmp_path / "drive"), "--json")
    log = tomllib.loads((tmp_path / "drive" / "log" / "drive.toml").read_text())
    assert log["rover"] == "cart"
    run("export-mjcf", "flat", "--rover", "cart", "--out", str(tmp_path / "mjcf"), "--json")
    out = capsys.readouterr().out
    assert json.loads(out.splitlines()[-1])["rover"] == "cart"
    run("bounds", "--rover", "cart", "--set", "motor.gear=50", "--json")
    assert json.loads(capsys.readouterr().out)


def test_an_option_and_a_setting_that_contradict_are_refused(tmp_path):
    from rover_pin.base.errors import ParameterError

    words = ["drive", "flat", "--rover", "cart", "--set", "rover=nexus6", "--out", str(tmp_path)]
    with pytest.raises(ParameterError, match=r"--rover cart.*rover=nexus6"):
        app(words, standalone_mode=False)


def test_a_curve_takes_any_number_of_soil_and_wheel(tmp_path, capsys):
    run("curve", "--set", "phi=38deg", "--set", "soil.k=8mm", "--set", "wheel.b=10cm", "--out", str(tmp_path), "--json")
    rows = json.loads(capsys.readouterr().out)
    soil = SOILS["table-1"].replace(phi=np.radians(38.0), k=0.008)
    expected = traction_curves(soil, wheel=Wheel(b=0.1)).curves["torque", 0.008]
    assert rows["F(torque, k = 8 mm)"]["S=0.2"] == pytest.approx(expected[20])


DRIVE = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may start jobs with it ignored
from rover_pin.cli import app as program
from rover_pin.cli.commands import view

def slow(*words):
    print("drawing", flush=True)
    time.sleep(60)

program.write_requested = slow
sys.argv = ["rover-pin", "drive", "flat", "--set", "duration=0.2", "--gif", "--out", sys.argv[1]]
program.main()
"""


def test_ctrl_c_while_a_picture_is_drawn_names_what_is_kept(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", DRIVE, str(tmp_path / "out")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "drawing\n"
    time.sleep(0.2)
    os.kill(process.pid, signal.SIGINT)
    try:
        _, error_output = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 128 + signal.SIGINT
    for name in ("log/drive.toml", "snapshots.png", "history.png"):
        assert name in error_output
        assert (tmp_path / "out" / name).exists()
    assert "drive.gif" not in error_output
