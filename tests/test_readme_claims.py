"""Every command that README and pages print runs as printed, and the numbers beside it are what it prints."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from shutil import copyfile
from typing import NamedTuple

import pytest
import typer.main

from rover_pin.cli.app import app

ROOT = Path(__file__).parents[1]
FILES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES = {path.name: path.read_text(encoding="utf-8") for path in FILES}
TEXT = " ".join(" ".join(PAGES.values()).split())
COMMAND = re.compile(r"`((?:rover-pin |python studies/)[^`]*|studies/[\w./]+\.py)`")
GROUP = typer.main.get_group(app)
TO_FILL_IN = re.compile(r"\b(?:COMMAND|DATA|DATASET|EXPERIMENT|FILE|FOLDER|NAME|OUT|ROOM|SCENARIO)\b")
"""What a reader puts a word of his own for; `test_docs` holds the options."""


class Claim(NamedTuple):
    """A phrase of a page and of what the command prints, as patterns whose groups must agree, one by one."""

    said: str
    printed: str
    factor: float = 1.0
    "of what is printed, to the unit in which it is said"


class Command(NamedTuple):
    """A command of the pages: what it needs before, and what they say that comes out."""

    claims: tuple[Claim, ...] = ()
    needs: tuple[str, ...] = ()
    exit_code: int = 0


NUMBER = r"([-+]?[\d.]+(?:e-?\d+)?)"
WORD = r"[-+.\de]+"
INTERVAL = rf"{NUMBER} \[{NUMBER}, {NUMBER}\]"
LOOP = "rover-pin close-loop cmu-smooth-wheel"
OPENED = f"{LOOP} --open"
DITCH = "rover-pin drive ditch --set duration=30 --open"
NEW = "rover-pin new-rover my_rover.urdf"
INIT = "rover-pin init mine.csv --r 45mm --b 50mm --noise drawbar_pull=0.5N --noise sinkage=0.5mm"
IMPORT = "rover-pin import-log steepening-slope/climb-1.csv steepening-slope/flat-steps.csv --out imported"
COMMANDS = {
    OPENED: Command((
            Claim(rf"sinkage was wrong by {NUMBER} mm and is now wrong by {NUMBER} mm",
                  rf"sinkage: RMSE {NUMBER} mm -> {NUMBER} mm"),
    )),
    "rover-pin check-data imported": Command(needs=(IMPORT,)),
    DITCH: Command((Claim(rf"climbs out and `drives on at {NUMBER} m/s`", rf"drives on at {NUMBER} m/s"),)),
    "rover-pin check-urdf cart": Command((
        Claim(r"`stands` and whether its motors move it: (yes), and (yes)", r"stands (yes): .* moves (yes): "),
    )),
    "rover-pin check-urdf my_rover.toml": Command(needs=(NEW,)),
    "rover-pin drive flat --set rover=my_rover.toml": Command(needs=(NEW,)),
    "rover-pin check-data mine": Command(needs=(INIT,)),
    "rover-pin close-loop mine": Command(needs=(INIT,)),
    "rover-pin export out/drive/log --to mcap": Command(needs=(DITCH,)),
    "rover-pin drive ditch --model out/close_loop/model.toml": Command(needs=(LOOP,)),
    "rover-pin drive flat --soil table-1 --set form=net": Command(
        (Claim(rf"it is after {NUMBER} s at x = {NUMBER} m", rf"end time s {NUMBER} .* end x m {NUMBER}"),)
    ),
    LOOP: Command(
        (
            Claim(rf"the first with a = {INTERVAL}", rf"SlipSoftening.a = {INTERVAL}"),
            Claim(rf"sinkage error {NUMBER} -> {NUMBER} mm", rf"sinkage: RMSE {NUMBER} mm -> {NUMBER} mm"),
            Claim(rf"slip level: softening in {NUMBER} of {NUMBER}",
                  rf"SlipSoftening chosen in {NUMBER} of {NUMBER} folds"),
            Claim(rf"each fold's own choice misses sinkage by {NUMBER} mm",
                  rf"with each fold's own choice: drawbar pull {WORD} N, sinkage {NUMBER} mm"),
            Claim(rf"\(softening in all of them by {NUMBER}\)", rf"sinkage: RMSE {WORD} mm -> {NUMBER} mm"),
        )
    ),
    "python studies/motors.py": Command((
        Claim(rf"takes not {NUMBER} s but {NUMBER} s", rf"deg reached at \[s\] {NUMBER} {NUMBER}"),
    )),
    "python studies/wheel_laws.py": Command((
        Claim(rf"\| braked \| ploughing \| {NUMBER} / {NUMBER} \| {NUMBER} / {NUMBER} \|",
              rf"braked; reach .*? ploughing +{NUMBER} +{NUMBER} .*? quadratic +{NUMBER} +{NUMBER} "),
    )),
    "python studies/close_the_loop.py": Command((
        Claim(rf"the base model misses by {NUMBER} mm, with softening and a relaxation over 66 mm of travel by "
              rf"{NUMBER} mm; {NUMBER} mm are left",
              rf" base at once {NUMBER} .* SlipSoftening relaxing {NUMBER} .* as measured relaxing {NUMBER} "),
        Claim(rf"\| lugged wheel \| exponent \+ rate, chosen in 4 of 5 folds .*?\| {NUMBER} / {NUMBER} \|",
              rf"cmu-grousered-wheel: an effect is missing .*?with SlipSinkage and RateDependence.*?drawbar pull: RMSE "
              rf"{WORD} N -> {NUMBER} N .*?sinkage: RMSE {WORD} mm -> {NUMBER} mm"),
        Claim(rf"like ploughing, chosen in {NUMBER} of 4 folds, .*? own choice {NUMBER} / {NUMBER}\)",
              rf"cmu-smooth-wheel-skid: like .*?Ploughing chosen in {NUMBER} of 4 folds; held-out RMSE with each "
              rf"fold's own choice: drawbar pull {NUMBER} N, sinkage {NUMBER} mm"),
        Claim(rf"like ploughing, .*?\) \| {NUMBER} / {NUMBER} \|",
              rf"cmu-smooth-wheel-skid: like an effect of the list something like Ploughing is missing.*?"
              rf"drawbar pull: RMSE {WORD} N -> {NUMBER} N .*?sinkage: RMSE {WORD} mm -> {NUMBER} mm"),
    )),
    "python studies/paper_residuals.py": Command((
        Claim(rf"Table 1 breaks {NUMBER} of {NUMBER} \(Eq 7\) or {NUMBER} \(torque form\)",
              rf"Table 1 breaks {NUMBER} of {NUMBER} in the net form, {NUMBER} in the torque form"),
    )),
    "rover-pin close-loop demo-drive-log": Command(
        (Claim(rf"f_0 = {NUMBER} N \[{NUMBER} N, {NUMBER} N\] where 2 N",
               rf"TetherDrag.f_0 = {NUMBER} N \[{NUMBER} N, {NUMBER} N\]"),),
        needs=("rover-pin demo drive-log --hidden TetherDrag.f_0=2",),
    ),
    "rover-pin identify cmu-smooth-wheel --free k,phi,k_1": Command((
        Claim(rf"phi = {NUMBER} deg, which goes from {NUMBER} to {NUMBER} deg with the exit ratio",
              rf"phi = {NUMBER} \+- {WORD} deg, [^:]*: depends on the assumed exit_ratio "
              rf"\(it becomes {NUMBER} to {NUMBER} deg\)"),
        Claim(rf"which they miss by {NUMBER} N alone", rf"drawbar pull: RMSE {NUMBER} N over 15 points"),
        Claim(rf'K_eff comes out at {NUMBER} kPa/m\^n, and "(sits away from)" the {NUMBER} to {NUMBER} of',
              rf"K_eff = {NUMBER} kPa/m\^n [^\]]*\] (sits away from) {NUMBER} kPa/m\^n to {NUMBER} kPa"),
    )),
    "rover-pin identify cmu-smooth-wheel cmu-smooth-wheel-skid --free k,phi,k_1": Command((
        Claim(rf"alone, they then miss by {NUMBER} N", rf"cmu-smooth-wheel: drawbar pull: RMSE {NUMBER} N over 15"),
    )),
    "rover-pin identify steepening-slope": Command((
        Claim(rf"k = {NUMBER} mm and phi = [\d.]+ deg; the simulator",
              rf"k = {NUMBER} \+- {WORD} m, [^:]*: depends on the assumed theta_1 ", 1e3),
        Claim(rf"k = [\d.]+ mm and phi = {NUMBER} deg; the simulator [\w ]+\. phi is `(found)`",
              rf"phi = {NUMBER} \+- {WORD} deg, [^:]*: (found) "),
        Claim(rf"between {NUMBER} and {NUMBER} deg k becomes",
              rf"theta_1 = 35 deg \(declared with the data\), {NUMBER} to {NUMBER} deg"),
        Claim(rf"deg k becomes {NUMBER} to {NUMBER} mm",
              rf"depends on the assumed theta_1 \(it becomes {NUMBER} to {NUMBER} m\)", 1e3),
        Claim(rf"within 4 deg of it k goes from {NUMBER} to {NUMBER} mm",
              rf"depends on the assumed theta_1 \(it becomes {NUMBER} to {NUMBER} m\)", 1e3),
        Claim(rf"k = {NUMBER} m \[{NUMBER}, {NUMBER}\]", rf"k = {NUMBER} \+- {WORD} m, 95 % in \[{NUMBER}, {NUMBER}\]"),
        Claim(rf"phi = {NUMBER} deg \[{NUMBER}, {NUMBER}\]",
              rf"phi = {NUMBER} \+- {WORD} deg, 95 % in \[{NUMBER}, {NUMBER}\]"),
    )),
    "python studies/identify_table1.py": Command((
        Claim(rf"k between {NUMBER} and {NUMBER} mm and phi between {NUMBER} and {NUMBER} deg",
              rf"net 50 (?:{WORD} ){{3}}{NUMBER} {NUMBER} {NUMBER} {NUMBER} none"),
    )),
    "rover-pin compare out/drive/log other/log": Command(needs=(DITCH, "rover-pin drive ditch --out other")),
    "rover-pin view out/drive/log --compare other/log --gif": Command(
        needs=(DITCH, "rover-pin drive ditch --out other")
    ),
}  # fmt: skip
BY_HAND = {
    "python studies/blind_rig.py": "307 loops, 40 minutes of CPU; `test_validation_text` reads its sets",
    "python studies/blind_test.py --under any": "100 loops, 80 minutes of CPU; `test_validation_text` reads its sets",
    "python studies/blind_pendulum.py": "30 loops, six minutes of CPU; `tests/loop/test_pendulum.py` reads its sets",
    "python studies/fig10_ditch.py": "1,200 drives, ten minutes; `test_readme_tables` reads the table that it wrote",
    "python studies/tune_gains.py": "two tunings, a minute of CPU; its table as well",
    "python studies/digging.py": "570 drives, four minutes of CPU; `test_readme_tables` reads the table that it wrote",
    "rover-pin close-loop steepening-slope --out out/loop": "five minutes; its verdict is kept, "
    "`test_readme_tables` reads it and `test_fig8_log` finds it again",
    "python studies/slip_sensing.py": "100 drives under four controls, six minutes of CPU",
    "python studies/beyond_the_paper.py": "a tuning on the full rover, three minutes of CPU; its table as well",
    "python studies/benchmarks/long_log.py": "a loop on an hour's recording, three minutes of CPU",
    "python studies/benchmarks/drive_speed.py": "times, which hang on the machine",
    "python studies/benchmarks/ground_speed.py": "times",
    "python studies/benchmarks/process_cost.py --quick": "times",
    "python studies/benchmarks/replay_speed.py": "times, beside a former version of a clone with its history",
}
"""Commands that take too long for a test, run by hand before a release; `test_studies_run` runs them with --quick."""


ELSEWHERE = {
    "python3 -m venv .venv": "`.ci/run`, as printed",
    ". .venv/bin/activate": "`.ci/run`, as printed",
    'pip install -e ".[view]"': "`.ci/run` installs what has it",
    'pip install -e ".[dev]"': "`.ci/run`, as printed",
    'pytest -n 2 -m "not nightly"': "`.ci/run`, as printed",
    "pytest -n 2": "part of it",
    "ruff check .": "`.ci/run`",
    "ruff format --check .": "`.ci/run`",
    "mypy": "`.ci/run`",
    "mkdocs build": "`.ci/run`",
    "pytest test_sticky_soil.py": "`tests/cli` runs the test of a new effect",
}
"""Lines for a shell that are no command of the package, and who runs them."""


def lines():
    """Every line for a shell: those of blocks, and commands of the package and studies between backquotes."""
    for text in PAGES.values():
        for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL):
            for line in filter(None, (line.split("#")[0].strip() for line in block.splitlines())):
                yield from line.split(" && ")
        for found in COMMAND.findall(" ".join(re.sub(r"```.*?```", "", text, flags=re.DOTALL).split())):
            yield found if found.startswith(("rover-pin", "python")) else f"python {found}"


def only_named(line):
    """Whether a line names the program, or a command of it that wants more, as `rover-pin check-data`."""
    words = line.split()
    if words == ["rover-pin"]:
        return True
    if words[0] != "rover-pin" or len(words) != 2 or words[1].startswith("-"):
        return False
    return any(each.required and each.param_type_name == "argument" for each in GROUP.commands[words[1]].params)


def commands():
    """Every command of README and pages, once, as it is printed."""
    found = dict.fromkeys(line for line in lines() if not TO_FILL_IN.search(line) and not only_named(line))
    return [line for line in found if line not in ELSEWHERE]


@pytest.fixture
def folder(tmp_path):
    """A folder of results, of this test alone, with what a reader is said to have."""
    copyfile(ROOT / "studies" / "data" / "cmu-smooth-wheel" / "points.csv", tmp_path / "mine.csv")
    copyfile(ROOT / "urdf" / "cart.urdf", tmp_path / "my_rover.urdf")
    return tmp_path


def printed(command, folder):
    """What a command prints, run after those that it needs, and no others."""
    about = COMMANDS.get(command, Command())
    for other in about.needs:
        printed(other, folder)
    for name in ("studies", "urdf"):  # of a checkout only what is named
        if f"{name}/" in command and not (folder / name).exists():
            (folder / name).symlink_to(ROOT / name)
    program, *words = shlex.split(command)
    start = ["-m", "rover_pin.cli.app"] if program == "rover-pin" else []
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    env = {**os.environ, "PYTHONPATH": path, "COLUMNS": "200", "BROWSER": "true"}  # opens nothing
    got = subprocess.run(
        [sys.executable, *start, *words], cwd=folder, env=env, capture_output=True, text=True, timeout=1800, check=False
    )
    assert got.returncode == about.exit_code, got.stderr[-2000:]
    assert "Traceback" not in got.stderr
    return " ".join(got.stdout.split())


def half_a_digit(word):
    """Half a unit of the last digit that is printed."""
    mantissa, _, power = word.partition("e")
    return 0.5 * 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def agree(said, came, factor=1.0):
    """Whether a word of a page is the word that came out, a number as far as it is printed."""
    try:
        return abs(float(said) - factor * float(came)) <= half_a_digit(said) * (1.0 + 1e-9)
    except ValueError:
        return said == came


def test_numbers_agree_as_far_as_they_are_printed():
    assert agree("1.43", "1.429")
    assert agree("5.5", "5.528")
    assert agree("3e3", "2751")
    assert agree("1.5", "0.001495", 1e3)
    assert not agree("5", "3")
    assert not agree("1.43", "1.424")
    assert agree("stuck", "stuck")


def test_every_line_for_a_shell_is_accounted_for():
    known = [*commands(), *ELSEWHERE]
    others = [each for each in lines() if each not in known and not TO_FILL_IN.search(each) and not only_named(each)]
    assert not others
    assert all(each.startswith(("rover-pin ", "python studies/")) for each in commands())
    assert set(ELSEWHERE) <= set(lines())


@pytest.mark.parametrize("command", COMMANDS)
def test_a_claim_stands_beside_its_command(command):
    assert command in commands()
    for claim in COMMANDS[command].claims:
        assert re.search(claim.said, TEXT), claim.said


def test_what_is_run_by_hand_is_a_command_of_the_pages():
    assert set(BY_HAND) <= set(commands())


@pytest.mark.slow
@pytest.mark.parametrize("command", [each for each in commands() if each not in BY_HAND])
def test_a_command_runs_and_prints_what_the_pages_say(command, folder):
    came = printed(command, folder)
    for claim in COMMANDS.get(command, Command()).claims:
        said, found = re.search(claim.said, TEXT), re.search(claim.printed, came)
        assert found, f"{claim.printed} is not printed: {came[:2000]}"
        pairs = list(zip(said.groups(), found.groups(), strict=True))
        assert all(agree(*pair, claim.factor) for pair in pairs), pairs
