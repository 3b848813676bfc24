"""Hostile names through every field that names something, through every command and every export.

Whatever a rig, a log, a rover, a joint, a column, a run, a file or an option is called, a command ends with a sentence
or with right files: nothing of the name is executed, by this program, by a compiler, a browser, a shell or a terminal.
"""

import json
import shutil
import subprocess
from html import escape
from pathlib import Path

import pytest

from rover_pin.base.encode import toml_string
from rover_pin.simulation.model.effect_files import user_effects
from tests.hostile import ALL, AS_FILE, CANARY, IN_XML, PIECES, assert_harmless_files, assert_harmless_text

ROOT = Path(__file__).parents[1]
NAMES = {name: text for name, text in PIECES.items() if name not in ("nul", "half of a pair")} | {"all": ALL}
SOME = ["all", "python", "backslashes", "control", "newlines"]
RIG = """
kind = "wheel-rig"
name = NAME
files = { points = "points.csv" }
[wheel]
r = { value = 60, unit = "mm" }
b = { value = 50, unit = "mm" }
[noise]
drawbar_pull = { value = 0.2, unit = "N" }
sinkage = { value = 0.5, unit = "mm" }
"""


@pytest.fixture
def hostile(run, tmp_path):
    """Run a command as `run` does, and look at all that it prints and writes."""

    def command(*words):
        code, out, err = run(*words)
        assert code in (0, 1, 2, 3), (words, code, err)
        assert_harmless_text(out)
        assert_harmless_text(err)
        assert not list(tmp_path.rglob(CANARY)), (words, "a name was executed")
        assert_harmless_files(tmp_path)
        return code, out, err

    return command


def cart(folder, joint="hub", rover="cart", link="tyre"):
    """A rover of four wheels under these names."""
    folder.mkdir(exist_ok=True)
    urdf, toml = ((ROOT / "urdf" / f"cart.{kind}").read_text() for kind in ("urdf", "toml"))
    for side in ("lf", "rf", "lb", "rb"):
        urdf = urdf.replace(f"hub_{side}", escape(f"{joint}_{side}").replace("\n", "&#10;").replace("\t", "&#9;"))
        urdf = urdf.replace(f"tyre_{side}", escape(f"{link}_{side}").replace("\n", "&#10;").replace("\t", "&#9;"))
        toml = toml.replace(f'"hub_{side}"', toml_string(f"{joint}_{side}"))
    (folder / "cart.urdf").write_text(urdf, encoding="utf-8")
    (folder / "own.toml").write_text(toml.replace('"cart"', toml_string(rover)), encoding="utf-8")
    return folder / "own.toml"


def rig(folder, name, level="s"):
    """A rig set whose pull and sinkage rise by more than any listed effect explains."""
    folder.mkdir(exist_ok=True)
    (folder / "rig.toml").write_text(RIG.replace("NAME", toml_string(name)), encoding="utf-8")
    quoted = " ".join(level.splitlines()).replace('"', '""')
    rows = [f'"{quoted}{at}",' + f"{at / 10},{20 + 10 * k},{5 + 8 * (at / 10) ** 3},{0.01 + 0.02 * at / 10}"
            for at in range(1, 7) for k in (0, 1)]  # fmt: skip
    (folder / "points.csv").write_text("\n".join(["level,slip,load_N,drawbar_pull_N,sinkage_m", *rows, ""]))
    return folder


@pytest.mark.parametrize("name", NAMES)
def test_a_rig_of_any_name_is_checked(hostile, tmp_path, name):
    code, _, err = hostile("check-data", rig(tmp_path / "rig", NAMES[name], NAMES[name]))
    assert code == 0, err


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_a_rig_of_any_name_ends_with_a_verdict_a_page_and_a_draft_that_can_be_tried(hostile, tmp_path, name):
    code, _, err = hostile("close-loop", rig(tmp_path / "rig", NAMES[name], NAMES[name]), "--out", "out")
    assert code == 0, err
    assert json.loads((tmp_path / "out" / "verdict.json").read_text())["answer"]
    for draft in (tmp_path / "out").glob("draft_effect/*.py"):
        (kind,) = user_effects(draft)
        assert kind.__name__ == "MeasuredRemainder"
    assert not list(tmp_path.rglob(CANARY))


def test_a_rig_in_a_folder_of_any_name(hostile, tmp_path):
    folder = rig(tmp_path / AS_FILE, "rig")
    assert hostile("check-data", folder)[0] == 0
    (folder / "rig.toml").write_text(RIG.replace("name = NAME\n", ""))
    assert hostile("check-data", folder)[0] == 0


@pytest.mark.parametrize("name", NAMES)
def test_a_table_of_any_column_is_read_or_refused(hostile, tmp_path, name):
    head = '"' + NAMES[name].replace('"', '""') + '"'
    rows = [f"x,{at / 10},20,{5 + at},0.01" for at in range(6)]
    table = "\n".join([f"{head},slip,load_N,drawbar_pull_N,sinkage_m", *rows, ""])
    (tmp_path / "table.csv").write_text(table, encoding="utf-8")
    hostile("init", "table.csv", "--r", "60mm", "--b", "50mm", "--out", "made", "--noise", "drawbar_pull=0.2N")
    log = "\n".join([f"t_s,{head},x,y", *(f"{at / 10},1,{at / 100},0" for at in range(60)), ""])
    (tmp_path / "log.csv").write_text(log, encoding="utf-8")
    hostile("import-log", "log.csv", "--rover", "cart", "--out", "log")


def test_tables_of_any_file_name(hostile, tmp_path):
    for name in ("table", "log"):
        (tmp_path / f"{AS_FILE}{name}.csv").write_text(
            "\n".join(["slip,load_N,drawbar_pull_N", *(f"{at / 10},20,{5 + at}" for at in range(6)), ""])
        )
    hostile("init", f"{AS_FILE}table.csv", "--r", "60mm", "--b", "50mm", "--noise", "drawbar_pull=0.2N")
    hostile("import-log", f"{AS_FILE}log.csv", "--rover", "cart")


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A short drive of the cart as a drive log."""
    folder = tmp_path_factory.mktemp("driven")
    from rover_pin import scenario

    chosen = scenario("flat", rover="cart", duration=1.0)
    chosen.write_log(chosen.drive(), folder / "log")
    return folder / "log"


def log_called(driven, folder, name, file="run"):
    """A copy of the log under another name, of the log and of its run."""
    shutil.copytree(driven, folder)
    toml = (folder / "drive.toml").read_text()
    (run,) = folder.glob("run*.csv")
    lines = [f"name = {toml_string(name)}" if line.startswith("name =") else line for line in toml.split("\n")]
    (folder / "drive.toml").write_text("\n".join(lines).replace(f'"{run.name}"', toml_string(f"{file}.csv")))
    run.rename(folder / f"{file}.csv")
    return folder


@pytest.mark.parametrize("name", SOME)
def test_a_log_of_any_name_is_checked_compared_and_exported(hostile, driven, tmp_path, name):
    log = log_called(driven, tmp_path / "log", NAMES[name], NAMES[name].replace("/", "_").replace("\n", "_")[:100])
    assert hostile("check-data", log)[0] in (0, 2)
    assert hostile("compare", log, log)[0] == 0
    assert hostile("export", log)[0] == 0
    hostile("export", log, "--run", NAMES[name])


@pytest.mark.slow
def test_a_log_of_any_name_is_seen_and_watched(hostile, driven, tmp_path):
    log = log_called(driven, tmp_path / "log", ALL, AS_FILE[:100])
    assert hostile("view", log, "--gif")[0] == 0
    assert hostile("watch", log)[0] == 0
    assert hostile("close-loop", log, "--workers", "1")[0] in (0, 2)


def test_options_of_any_text_are_refused_in_a_sentence(hostile, tmp_path):
    for words in (
        ("drive", ALL), ("drive", "flat", "--set", ALL), ("drive", "flat", "--set", f"{ALL}=1"),
        ("drive", "flat", "--soil", ALL), ("drive", "flat", "--add", ALL), ("drive", "flat", "--control", ALL),
        ("drive", "flat", "--gravity", ALL), ("drive", "flat", "--model", ALL), ("drive", "flat", "--effects", ALL),
        ("drive", "flat", "--set", f"rover={ALL}"), ("drive", "flat", "--set", f"terrain.path={ALL}"),
        ("curve", "--soil", ALL), ("curve", "--k", ALL), ("list", "soils", ALL), ("list", "effects", ALL),
        ("bounds", "--set", f"{ALL}=1"), ("map", ALL), ("map", "flat", "--box", ALL), ("map", "flat", "--model", ALL),
        ("sweep", ALL), ("tune", ALL), ("improve", ALL), ("compare", ALL, ALL), ("view", ALL), ("watch", ALL),
        ("close-loop", ALL), ("close-loop", "--experiment", ALL, ALL), ("close-loop", ALL, "--fail-on", ALL),
        ("identify", ALL), ("check-data", ALL), ("check-urdf", ALL), ("new-rover", ALL), ("new-effect", ALL),
        ("init", ALL, "--r", ALL, "--b", ALL), ("import-log", ALL), ("demo", ALL), ("demo", "rig", "--hidden", ALL),
        ("export", ALL), ("export-c", ALL), ("export-fmu", ALL), ("export-mjcf", ALL), (ALL,), ("drive", f"--{ALL}"),
    ):  # fmt: skip
        code, _, err = hostile(*words)
        assert code == 2, (words[0], err)
        assert err.startswith("rover-pin: ")


@pytest.mark.slow
def test_results_go_into_a_folder_of_any_name(hostile, tmp_path):
    out = tmp_path / AS_FILE
    assert hostile("drive", "flat", "--set", "duration=0.2", "--out", out)[0] == 0
    assert hostile("demo", "rig", "--out", tmp_path / f"{AS_FILE}r")[0] == 0
    assert hostile("check-data", tmp_path / f"{AS_FILE}r")[0] == 0
    assert hostile("new-effect", "StickySoil", "--out", tmp_path / f"{AS_FILE}e")[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_a_sweep_of_any_name(hostile, tmp_path, name):
    study = 'scenario = "flat"\nduration = 0.1\nplan = { kind = "grid" }\n[parameters]\nsoil.k = [0.01, 0.02]\n'
    (tmp_path / "study.toml").write_text(f"name = {toml_string(NAMES[name])}\n{study}", encoding="utf-8")
    hostile("sweep", "study.toml", "--workers", "1", "--out", "out")


@pytest.mark.parametrize("name", SOME)
def test_a_rover_of_any_name_is_checked_and_proposed(hostile, tmp_path, name):
    joint = "".join(letter for letter in NAMES[name] if letter in IN_XML)
    toml = cart(tmp_path / "own", joint, NAMES[name], joint)
    hostile("check-urdf", toml)
    hostile("new-rover", tmp_path / "own" / "cart.urdf", "--out", "proposed.toml")


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_a_rover_of_any_name_is_written_for_other_tools(hostile, tmp_path, name):
    joint = "".join(letter for letter in NAMES[name] if letter in IN_XML)
    rover = f"rover={cart(tmp_path / 'own', joint, NAMES[name], joint)}"
    for control in ("eq9", "onboard", "cmd-vel"):
        out = tmp_path / control
        code, _, err = hostile("export-c", "flat", "--control", control, "--set", rover, "--out", out)
        assert code == 0, err
        program = [str(out / file) for file in ("rover_control.c", "test_vectors.c")]
        build = [
            "cc",
            "-std=c11",
            "-Wall",
            "-Werror",
            "-O1",
            "-ffp-contract=off",
            *program,
            "-lm",
            "-o",
            str(out / "x"),
        ]
        subprocess.run(build, check=True, cwd=tmp_path)
        subprocess.run([str(out / "x"), str(out / "vectors.csv")], check=True, cwd=tmp_path, capture_output=True)
        for source in out.glob("ros2/*.cpp"):
            check_strings(source, tmp_path)
    assert hostile("export-fmu", "flat", "--control", "eq9", "--set", rover, "--out", "fmu")[0] == 0
    assert hostile("export-mjcf", "flat", "--set", rover, "--out", "mjcf")[0] == 0
    assert not list(tmp_path.rglob(CANARY))


def check_strings(source, folder):
    """The tables of names of the ROS 2 controller compile, and nothing but them stands in their lines."""
    lines = [line for line in source.read_text().split("\n") if line.startswith("const std::")]
    text = "\n".join(["#include <array>", "#include <string>", "#include <vector>", "#define ROVER_WHEELS 4", *lines,
                      "int main() { return WHEELS.size() == 4 && IMU == \"imu\" ? 0 : 1; }", ""])  # fmt: skip
    (folder / "names.cpp").write_text(text)
    subprocess.run(
        ["c++", "-std=c++17", str(folder / "names.cpp"), "-o", str(folder / "names")], check=True, cwd=folder
    )
    subprocess.run([str(folder / "names")], check=True, cwd=folder)
    (folder / "names").unlink()


@pytest.mark.slow
def test_a_model_of_any_file_name_gives_bands_and_a_map(hostile, tmp_path):
    from rover_pin import scenario
    from rover_pin.simulation.model.toml_file import write_model

    folder = tmp_path / AS_FILE
    folder.mkdir()
    for at in (1, 2):
        write_model(scenario("flat").model, folder / f"{AS_FILE[:100]}{at}.toml")
    assert hostile("drive", "flat", "--model", folder, "--set", "duration=0.2", "--out", "out")[0] == 0
    hostile("map", "flat", "--model", folder, "--box", "0,1,0,1", "--spacing", "1", "--headings", "1", "--workers", "1")
