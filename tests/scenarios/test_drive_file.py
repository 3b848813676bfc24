"""A drive as a file: it drives as the settings do from which it was saved, runs no code, and names what is wrong."""

import dataclasses
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from rover_pin import Motor, Soil, load_rover, scenario
from rover_pin.base.errors import DataError, ParameterError, RoverPinError
from rover_pin.base.trust import Trust
from rover_pin.control.open_loop import ConstantDuty
from rover_pin.effects.digging_memory import DiggingMemory
from rover_pin.logs.drive_log import load_trace
from rover_pin.scenarios.drive_file import read_drive, write_drive
from rover_pin.scenarios.scenario import settings_of
from rover_pin.sweep import Grid, Study, Values, drive_case, read_study
from rover_pin.tuning.drives import build
from rover_pin.tuning.study_file import read_tuning
from tests import hostile

DRIVES = {
    "plain": ("ditch", {}),
    "random ground and random sensors": ("hills", {"control": "camera", "control.seed": 7, "rover": "cart"}),
    "a third": ("flat", {"soil.k": 0.1 / 3.0, "motor.gear": 1e3 / 7.0, "start.yaw_deg": 1.0 / 3.0}),
    "words with units": ("slope", {"soil": "table-1", "soil.k": "5mm", "control": "eq9", "gravity": "moon"}),
    "objects": ("flat", {"soil": Soil(k=0.1 / 3.0), "motor": Motor(gear=200.0)}),
    "effects": ("ditch", {"add": ["DiggingMemory.c_d=0.1,length=0.05", "WeakMotor.wheel=ml,g=0.3"]}),
    "several numbers": ("flat", {"control": "rates", "control.rates": (1.0, 1.0, 0.9, 0.9, 1.0, 1.0 / 3.0)}),
    "a route": ("flat", {"control": "route", "control.route": "1,0 2,0.5"}),
    "own soil in the rover's file": ("rocks", {"rover": "cart", "control": "limit"}),
}
CODE = f"open({hostile.CANARY!r}, 'w').close()\n"
CONTROLLER = CODE + "def controller(model):\n    return lambda reading: 0.3\n"


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write(text, name="mine.toml"):
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(text)
    return name


def is_equal(one, other):
    assert dict(one.units) == dict(other.units)
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.units)


@pytest.mark.parametrize("case", DRIVES)
def test_a_saved_drive_repeats_bit_for_bit(case):
    name, settings = DRIVES[case]
    ready = scenario(name, **{"duration": 1.0, **settings})
    again = scenario(ready.save("mine.toml"))
    assert is_equal(ready.drive(measure_error=False), again.drive(measure_error=False))


def test_the_command_line_saves_and_drives_the_same(run):
    code, _, err = run(
        "drive", "ditch", "--soil", "table-1", "--set", "duration=1", "--save", "d/mine.toml", "--out", "1"
    )
    assert code == 0, err
    assert run("drive", "d/mine.toml", "--out", "2")[0] == 0
    assert is_equal(*(load_trace(folder / "log") for folder in map(Path, "12")))


def test_a_file_states_the_drive_and_not_only_what_was_given():
    table = tomllib.loads(scenario("hills", **{"soil.k": 0.01}).save("mine.toml").read_text())
    stated = {"scenario": "hills", "rover": "nexus6", "soil": "slope-sand", "control": "none", "terrain.seed": 0}
    assert {name: table[name] for name in stated} == stated
    assert (table["duration"], table["soil.k"]) == (30.0, 0.01)


def test_dotted_keys_tables_and_units_mean_the_same():
    forms = (
        'scenario = "ditch"\nsoil.k = "5mm"\nterrain.wall_angle_deg = 40\n',
        'scenario = "ditch"\n"soil.k" = 0.005\n[terrain]\nwall_angle = "40deg"\n',
        'scenario = "ditch"\n[soil]\nk = { value = 5, unit = "mm" }\n[terrain]\nwall_angle_deg = 40.0\n',
    )
    drives = [scenario(write(text, f"{i}.toml")) for i, text in enumerate(forms)]
    assert {float(drive.model.soils[0].k) for drive in drives} == {0.005}
    assert drives[0].model.terrain == drives[1].model.terrain == drives[2].model.terrain


def test_the_file_on_the_page_is_a_drive():
    page = (Path(__file__).parents[2] / "docs" / "command-line.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    drive = scenario(write(text))
    assert (drive.name, drive.duration, float(drive.model.soils[0].k)) == ("incline", 20.0, 0.005)
    assert drive.model.effect(DiggingMemory).c_d == 0.1


def test_settings_replace_those_of_the_file():
    file = write('scenario = "incline"\nterrain.angle_deg = 3\nsoil.k = 0.005\nduration = 5.0\n')
    drive = scenario(file, **{"terrain.angle": 0.2, "duration": 2.0})
    expected = scenario("incline", **{"terrain.angle": 0.2, "soil.k": 0.005})
    assert (drive.duration, drive.model.terrain) == (2.0, expected.model.terrain)
    assert float(scenario(file, soil=Soil(k=0.03)).model.soils[0].k) == 0.03
    assert {setting.name: setting.value for setting in settings_of(file)}["soil.k"] == 0.005


def test_paths_count_from_the_folder_of_the_file(monkeypatch):
    np.savetxt("ground.csv", [[0.0, 0.0], [1.0, 0.05]], delimiter=",", header="x_m,z_m", comments="")
    ready = scenario("polyline", **{"terrain.path": "ground.csv"})
    assert ready.save("mine.toml").is_file()
    Path("elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    assert scenario("../mine.toml").model.terrain == ready.model.terrain


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('scenario = "ditch"\nsoil.kk = 1\n', ["mine.toml", "'soil.kk'", "soil.k"]),
        ('scenario = "ditch"\n[terain]\ndepth = 0.1\n', ["mine.toml", "'terain.depth'", "terrain.depth"]),
        ('scenario = "ditch"\nsoil.k_mm = 5\n', ["mine.toml", "soil.k=5mm"]),
        ('scenario = "dich"\n', ["mine.toml", "'dich'", "ditch"]),
        ('scenario = "ditch"\nsoil.k = "5 kg"\n', ["mine.toml", "soil.k", "kg"]),
        ('scenario = "ditch"\nsoil.k = -1\n', ["mine.toml", "k = -1"]),
        ('scenario = "ditch"\nduration = "long"\n', ["mine.toml", "duration", "long"]),
        ('scenario = "ditch"\nduration = 2026-01-01\n', ["mine.toml", "duration"]),
        ('scenario = "ditch"\n[[control]]\nk_p = 1\n', ["mine.toml", "control"]),
        ('scenario = "ditch"\nrover = 3\n', ["mine.toml", "rover"]),
        ('scenario = "ditch"\nrover = true\n', ["mine.toml", "rover"]),
        ('scenario = "ditch"\nadd = "DigingMemory"\n', ["mine.toml", "DigingMemory", "DiggingMemory"]),
        ('scenario = "ditch"\nsoil = "table-1"\nsoil.k = 1\n', ["mine.toml", "line 3", '"soil.k"']),
        ('scenario = "ditch"\n"soil.k" = 1\nsoil.k = 2\n', ["mine.toml", "soil.k", "twice"]),
        ('scenario = ["ditch"]\nduration = 1\n', ["mine.toml", "scenario"]),
        ('scenaro = "ditch"\n', ["mine.toml", "'scenario'", "'scenaro'"]),
        ('kind = "drive-log"\nname = "flat"\n', ["mine.toml", "drive-log", "rover-pin view"]),
        ('scenario = "other.toml"\n', ["mine.toml", "other.toml"]),
        ('scenario = "ditch"\ntrust = true\n', ["mine.toml", "trust", "--trust"]),
        ("", ["mine.toml", "'scenario'"]),
    ],
)
def test_a_mistake_is_one_sentence_that_names_file_and_key(text, words, run):
    write(text)
    code, out, err = run("drive", "mine.toml")
    assert (code, out, err.count("\n")) == (2, "", 1), err
    assert [word for word in words if word not in err] == []


def test_a_mistake_in_an_option_is_not_laid_on_the_file(run):
    write('scenario = "ditch"\n')
    assert "with the settings given in addition" in run("drive", "mine.toml", "--set", "soil.kk=1")[2]
    assert "missing.toml: the file cannot be read" in run("drive", "missing.toml")[2]


@pytest.mark.parametrize(
    "command", [("drive",), ("view",), ("export",), ("map",), ("export-mjcf",), ("list", "settings")]
)
@pytest.mark.parametrize("text", ['control = "own.py"', 'add = "Own.a=1"', 'model = "model.toml"'])
def test_no_file_runs_code_without_consent(command, text, run):
    write(CONTROLLER, "own.py")
    write(CODE, "effects.py")
    model = 'kind = "drive-model"\nrover = "nexus6"\n[[effect]]\nname = "Own"\nfile = "own.py"\n'
    write(model, "model.toml")
    write(f'scenario = "flat"\nduration = 0.2\n{text}\n')
    code, out, err = run(*command, "mine.toml")
    assert (code, out) == (2, ""), err
    assert not Path(hostile.CANARY).exists()


@pytest.mark.parametrize("consent", [("--trust",), ("--effects", "own.py")])
def test_consent_lets_the_controller_of_a_file_run(consent, run):
    write(CONTROLLER, "own.py")
    saved = scenario("flat", duration=0.2, control="own.py", trust=Trust.of("own.py")).save("mine.toml")
    Path(hostile.CANARY).unlink()
    with pytest.raises(DataError, match=r"own\.py"):
        scenario(saved)
    assert not Path(hostile.CANARY).exists()
    code, _, err = run("drive", saved, *consent)
    assert code == 0, err
    assert Path(hostile.CANARY).exists()


def test_files_elsewhere_need_consent(tmp_path_factory):
    other = tmp_path_factory.mktemp("other") / "ground.csv"
    np.savetxt(other, [[0.0, 0.0], [1.0, 0.05]], delimiter=",", header="x_m,z_m", comments="")
    file = write(f"scenario = 'polyline'\nterrain.path = '{other}'\n")
    with pytest.raises(DataError, match="outside the folder"):
        scenario(file)
    assert scenario(file, trust=Trust(everything=True)).model.terrain


def test_what_a_file_cannot_hold_is_refused():
    held = {
        "control": ConstantDuty(0.3), "rover": load_rover("cart"), "terrain": scenario("ditch").model.terrain
    }  # fmt: skip
    for name, value in held.items():
        with pytest.raises(ParameterError, match=name):
            scenario("flat", **{name: value}).save("mine.toml")
    changed = dataclasses.replace(scenario("flat"), controller=ConstantDuty(0.3))
    with pytest.raises(ParameterError, match="changed"):
        changed.save("mine.toml")
    with pytest.raises(DataError, match=r"\.toml"):
        scenario("flat").save("mine.txt")
    assert not Path("mine.toml").exists()


def test_a_shorter_copy_is_saved_with_its_duration():
    saved = dataclasses.replace(scenario("flat"), duration=0.7).save("mine.toml")
    assert scenario(saved).duration == 0.7


@pytest.mark.parametrize("piece", sorted(set(hostile.PIECES) - {"half of a pair", "nul"}))
def test_any_text_survives_the_file(piece):
    text = hostile.PIECES[piece]
    write_drive("mine.toml", text, {"soil": text, "add": text})
    drive = read_drive("mine.toml", Trust(everything=True))
    assert (drive.scenario, drive.settings) == (text, {"soil": text, "add": text})


STUDY = 'name = "s"\nscenario = "mine.toml"\nplan = { kind = "grid" }\n[parameters]\nsoil.k = [0.004, 0.02]\n'


def test_a_sweep_varies_the_drive_of_a_file(monkeypatch):
    write('scenario = "incline"\nduration = 1.0\nterrain.angle_deg = 4\nsoil.k = 0.001\n', "s/mine.toml")
    write(STUDY, "s/study.toml")
    study = read_study("s/study.toml")
    direct = Study(
        "s", "incline", {"soil.k": Values([0.004, 0.02])}, Grid(), settings={"duration": 1.0, "terrain.angle_deg": 4}
    )
    assert [drive_case(study, case) for case in study.cases()] == [drive_case(direct, case) for case in direct.cases()]
    # The study's own duration and settings replace those of the file; the file itself is part of the study.
    other = Study("s", "s/mine.toml", {"soil.k": Values([1.0])}, Grid(), duration=2.0, settings={"terrain.angle": 0.1})
    assert (other.scenario, dict(other.settings), other.duration) == ("incline", {"terrain.angle": 0.1}, 2.0)


def test_a_study_names_the_mistyped_key_of_its_drive_file(run):
    write('scenario = "incline"\nsoil.kk = 1\n')
    write(STUDY, "study.toml")
    write('[[training]]\nscenario = "mine.toml"\n', "tune.toml")
    for command, file in (("sweep", "study.toml"), ("tune", "tune.toml")):
        code, _, err = run(command, file)
        assert (code, err.count("\n")) == (2, 1), err
        assert "mine.toml" in err
        assert "'soil.kk'" in err


def test_a_tuning_drives_the_ground_of_a_file_and_not_its_control():
    write(
        'scenario = "incline"\nduration = 3.0\ncontrol = "eq9"\n"control.k_p" = 2.0\nterrain.angle_deg = 4\n'
        "soil.k = 0.01\n"
    )
    write('[[training]]\nscenario = "mine.toml"\nterrain.angle_deg = 7\n', "tune.toml")
    (case,) = read_tuning("tune.toml").training
    expected = scenario("incline", **{"terrain.angle_deg": 7, "soil.k": 0.01})
    assert (case.scenario, build(case).duration) == ("incline", 3.0)
    assert build(case).model.terrain == expected.model.terrain
    write('[[training]]\nscenario = "mine.toml"\ncontrol = "eq9"\n', "tune.toml")
    with pytest.raises(ParameterError, match="chooses the control"):
        build(read_tuning("tune.toml").training[0])


@pytest.mark.parametrize("study", [STUDY, '[[training]]\nscenario = "../mine.toml"\n'])
def test_a_study_reads_no_drive_file_outside_its_folder(study):
    write('scenario = "incline"\n')
    write(study.replace('"mine', '"../mine'), "s/study.toml")
    read = read_study if "plan" in study else read_tuning
    with pytest.raises(RoverPinError, match="outside"):
        read("s/study.toml")
    assert read("s/study.toml", Trust(everything=True))


def test_a_drive_file_is_shown(run):
    write('scenario = "flat"\nduration = 0.3\nrover = "cart"\n')
    code, _, err = run("export", "mine.toml", "--to", "csv", "--out", "o")
    assert code == 0, err
    (table,) = Path("o").glob("*.csv")
    assert len(table.read_text().splitlines()) == 1 + len(scenario("mine.toml").drive().t)
    pytest.importorskip("viser")
    code, _, err = run("view", "mine.toml", "--out", "o")
    assert code == 0, err
    assert (Path("o") / "view.html").is_file()
