"""Every command that the README prints runs as printed, and the numbers that stand beside it are what it prints."""

import os
import re
import shlex
import subprocess
import sys
from functools import cache, lru_cache
from pathlib import Path
from shutil import copyfile
from tempfile import mkdtemp
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
TEXT = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
COMMAND = re.compile(r"(?<=`)(?:\.venv/bin/)?((?:rover-pin|python studies/)[^`]*)(?=`)|(studies/[\w./]+\.py)(?=`)")
PATTERNS = {"rover-pin COMMAND --help", "rover-pin close-loop DATASET", "rover-pin check-urdf my_rover.toml",
            "rover-pin new-rover my_rover.urdf",
            "rover-pin drive flat --set rover=my_rover.toml"}  # fmt: skip
"""What is printed as a pattern to fill in; `test_readme` drives the rover of the README's TOML."""


class Claim(NamedTuple):
    """A phrase of the README and of what the command prints, as patterns whose groups must agree, one by one."""

    said: str
    printed: str


class Command(NamedTuple):
    """A command of the README: what it needs before, and what the README says that comes out."""

    claims: tuple[Claim, ...] = ()
    needs: tuple[str, ...] = ()
    exit_code: int = 0


NUMBER = r"([-+]?[\d.]+(?:e-?\d+)?)"
WORD = r"[-+.\de]+"
INTERVAL = rf"{NUMBER} \[{NUMBER}, {NUMBER}\]"
LOOP = "rover-pin close-loop studies/data/cmu-smooth-wheel"
COMMANDS = {
    "rover-pin drive ditch --model out/close_loop/model.toml": Command(needs=(LOOP,)),
    "rover-pin drive flat --set form=net": Command(
        (Claim(rf"it is after {NUMBER} s at x = {NUMBER} m", rf"end time s {NUMBER} .* end x m {NUMBER}"),)
    ),
    LOOP: Command(
        (
            Claim(rf"the first with a = {INTERVAL}", rf"SlipSoftening.a = {INTERVAL}"),
            Claim(rf"sinkage error {NUMBER} -> {NUMBER} mm", rf"sinkage: RMSE {NUMBER} mm -> {NUMBER} mm"),
            Claim(rf"slip level: softening in {NUMBER} of {NUMBER}",
                  rf"SlipSoftening chosen in {NUMBER} of {NUMBER} folds"),
        )
    ),
    "python studies/motors.py": Command((
        Claim(rf"takes not {NUMBER} s but {NUMBER} s", rf"deg reached at \[s\] {NUMBER} {NUMBER}"),
    )),
    "python studies/close_the_loop.py": Command((
        Claim(rf"the base model misses by {NUMBER} mm, with softening and a relaxation over 66 mm of travel by "
              rf"{NUMBER} mm; {NUMBER} mm are left",
              rf" base at once {NUMBER} .* SlipSoftening relaxing {NUMBER} .* as measured relaxing {NUMBER} "),
    )),
    "python studies/paper_residuals.py": Command((
        Claim(rf"Table 1 breaks {NUMBER} of {NUMBER} \(Eq 7\) or {NUMBER} \(torque form\)",
              rf"Table 1 breaks {NUMBER} of {NUMBER} in the net form, {NUMBER} in the torque form"),
    )),
    "rover-pin identify studies/data/steepening-slope": Command((
        Claim(rf"k = {NUMBER} m \[{NUMBER}, {NUMBER}\]", rf"k = {NUMBER} \+- {WORD} m, 95 % in \[{NUMBER}, {NUMBER}\]"),
        Claim(rf"phi = {NUMBER} deg \[{NUMBER}, {NUMBER}\]",
              rf"phi = {NUMBER} \+- {WORD} deg, 95 % in \[{NUMBER}, {NUMBER}\]"),
    )),
    "python studies/identify_table1.py": Command((
        Claim(rf"k between {NUMBER} and {NUMBER} mm and phi between {NUMBER} and {NUMBER} deg",
              rf"net 50 (?:{WORD} ){{3}}{NUMBER} {NUMBER} {NUMBER} {NUMBER} none"),
    )),
    "rover-pin view out/drive/log --compare other/log --gif": Command(
        needs=("rover-pin drive ditch", "rover-pin drive ditch --set soil.k=0.01 --out other")
    ),
}  # fmt: skip
BY_HAND = {
    "rover-pin close-loop DATA --experiment FILE": "two placeholders; `tests/loop/test_motor_brake.py` gives both",
    "python studies/blind_rig.py": "223 loops, half an hour",
    "python studies/blind_test.py --first 90": "90 loops on drive logs, hours",
    "python studies/fig10_ditch.py": "1,200 drives, ten minutes; `test_readme_tables` reads the table that it wrote",
    "python studies/tune_gains.py": "two tunings, eight minutes; its table as well",
    "python studies/digging.py": "378 drives, ten minutes; `test_readme_tables` reads the table that it wrote",
    "rover-pin close-loop studies/data/steepening-slope --out out/loop": "five minutes; its verdict is kept, "
    "`test_readme_tables` reads it and `test_fig8_log` finds it again",
    "python studies/slip_sensing.py": "100 drives under four controls, ten minutes",
    "python studies/beyond_the_paper.py": "a tuning on the full rover, four minutes; its table as well",
    "python studies/benchmarks/drive_speed.py": "times, which hang on the machine",
    "python studies/benchmarks/ground_speed.py": "times",
    "python studies/benchmarks/replay_speed.py": "times",
    "python studies/benchmarks/process_cost.py": "times",
}
"""Commands that take too long for a test, run by hand before a release; `test_studies_run` runs them with --quick."""


def commands():
    """Every command of the README, once, as it is printed."""
    found = [full or f"python {script}" for full, script in COMMAND.findall(TEXT)]
    return list(dict.fromkeys(command.strip() for command in found if command not in PATTERNS))


@lru_cache(maxsize=1)
def folder():
    """A folder of the results with what a checkout has beside the README."""
    made = Path(mkdtemp(prefix="readme"))
    for name in ("studies", "urdf"):
        (made / name).symlink_to(ROOT / name)
    copyfile(ROOT / "studies" / "data" / "cmu-smooth-wheel" / "points.csv", made / "mine.csv")
    return made


@cache
def printed(command):
    """What a command prints, run after those that it needs."""
    about = COMMANDS.get(command, Command())
    for other in about.needs:
        printed(other)
    program, *words = shlex.split(command)
    start = ["-m", "rover_pin.cli"] if program == "rover-pin" else []
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]), "COLUMNS": "200"}
    got = subprocess.run(
        [sys.executable, *start, *words],
        cwd=folder(),
        env=env,
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )
    assert got.returncode == about.exit_code, got.stderr[-2000:]
    assert "Traceback" not in got.stderr
    return " ".join(got.stdout.split())


def half_a_digit(word):
    """Half a unit of the last digit that is printed."""
    mantissa, _, power = word.partition("e")
    return 0.5 * 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def agree(said, came):
    """Whether a word of the README is the word that came out, a number as far as it is printed."""
    try:
        return abs(float(said) - float(came)) <= half_a_digit(said) * (1.0 + 1e-9)
    except ValueError:
        return said == came


def test_numbers_agree_as_far_as_they_are_printed():
    assert agree("1.43", "1.429")
    assert agree("5.5", "5.528")
    assert agree("3e3", "2751")
    assert not agree("5", "3")
    assert not agree("1.43", "1.424")
    assert agree("stuck", "stuck")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_claim_stands_beside_its_command(command):
    assert command in commands()
    for claim in COMMANDS[command].claims:
        assert re.search(claim.said, TEXT), claim.said


def test_what_is_run_by_hand_is_a_command_of_the_readme():
    assert set(BY_HAND) <= set(commands())


@pytest.mark.slow
@pytest.mark.parametrize("command", [each for each in commands() if each not in BY_HAND])
def test_a_command_runs_and_prints_what_the_readme_says(command):
    came = printed(command)
    for claim in COMMANDS.get(command, Command()).claims:
        said, found = re.search(claim.said, TEXT), re.search(claim.printed, came)
        assert found, f"{claim.printed} is not printed: {came[:2000]}"
        pairs = list(zip(said.groups(), found.groups(), strict=True))
        assert all(agree(*pair) for pair in pairs), pairs
