"""Code in a file of effects runs only where the user names that very file; nothing unpickles or evaluates."""

import ast
import dataclasses
import json
import os
import py_compile
import shutil
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from rover_pin import Soil, Wheel, scenario
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.trust import Trust
from rover_pin.cli.app import app
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.experiments.wheel_rig.model import write_model as write_rig_model
from rover_pin.loop.close import read_data, start_on
from rover_pin.simulation.model.effect_files import run_file, trusted_effects, user_effects
from rover_pin.simulation.model.toml_file import read_model, write_model
from rover_pin.sweep import read_study, sweep
from rover_pin.tuning.drives import build
from rover_pin.tuning.study_file import read_tuning

ROOT = Path(__file__).parents[1]
RIG = ROOT / "studies" / "data" / "cmu-smooth-wheel"
EFFECT = """
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar
from rover_pin.effects.effect import MotorEffect
from rover_pin.base.quantity import quantity

(Path(__file__).parent / "ran").touch()

@dataclass(frozen=True)
class NAME(MotorEffect):
    g: float = quantity(0.1, "", "assumed", 0.0, 1.0)
    neutral: ClassVar[dict[str, float]] = {"g": 0.0}
"""
ENTRY = """
[[effect]]
name = "NAME"
file = "code.py"
"""
SWEEP = """
name = "s"
scenario = "flat"
duration = 0.1
plan = { kind = "grid" }
[parameters]
soil.k = [0.01]
[settings]
model = "MODEL"
"""
TUNING = """
[[training]]
scenario = "flat"
duration = 0.1
model = "MODEL"
"""


@pytest.fixture(params=["Squeak", "WeakMotor"])
def model(request, tmp_path):
    """A model whose effect's code lies beside it, under a name of its own or of an effect of the package."""
    (tmp_path / "code.py").write_text(EFFECT.replace("NAME", request.param))
    path = write_model(scenario("flat").model, tmp_path / "model.toml")
    path.write_text(path.read_text() + ENTRY.replace("NAME", request.param))
    return path


def ran(model):
    return (model.parent / "ran").exists()


def written(model, text):
    path = model.parent / "study.toml"
    path.write_text(text.replace("MODEL", str(model)))
    return path


def tuned(model, trust=Trust()):
    return build(read_tuning(written(model, TUNING)).trusting(trust).training[0]).model


def swept(model, trust=Trust()):
    study = dataclasses.replace(read_study(written(model, SWEEP)), trust=trust)
    return sweep(study, model.parent / f"out{len(trust.effects)}", workers=1).table["error"][0]


def through_rig(model, trust=Trust()):
    path = write_rig_model(RigModel(Wheel(), Soil()), model.parent / "rig.toml")
    path.write_text(path.read_text() + "".join(model.read_text().rpartition("[[effect]]")[1:]))
    return start_on(read_data(RIG, trust), path, trust)


WAYS = {
    "read": lambda model, trust=Trust(): read_model(model, scenario("flat").model.terrain, trust),
    "scenario": lambda model, trust=Trust(): scenario("flat", model=str(model), trust=trust),
    "tuning": tuned,
    "rig": through_rig,
}


@pytest.mark.parametrize("way", WAYS)
def test_no_model_runs_code_by_itself(model, way):
    with pytest.raises(DataError, match=r"--effects .*code\.py,.*--trust"):
        WAYS[way](model)
    assert not ran(model)


@pytest.mark.parametrize("way", ["read", "scenario", "tuning"])
def test_the_named_file_runs(model, way):
    WAYS[way](model, Trust.of(model.parent / "code.py"))
    assert ran(model)


@pytest.mark.parametrize("model", ["WeakMotor"], indirect=True)
def test_a_sweep_runs_code_only_with_consent(model):
    with pytest.raises(DataError, match="runs only"):
        swept(model)
    assert not ran(model)
    assert pd.isna(swept(model, Trust.of(model.parent / "code.py")))
    assert ran(model)


@pytest.mark.parametrize("model", ["Squeak"], indirect=True)
def test_the_commands_ask_too(model, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    named = ["--model", str(model)]
    for words in (["drive", "flat", *named], ["bounds", *named], ["tune"], ["sweep"]):
        study = [] if "--model" in words else [str(written(model, TUNING if words == ["tune"] else SWEEP))]
        refused = CliRunner().invoke(app, [*words, *study])
        assert isinstance(refused.exception, DataError), refused.output
        assert "runs only" in str(refused.exception)
    assert not ran(model)
    for consent in (["--effects", str(tmp_path / "code.py")], ["--trust"]):
        done = CliRunner().invoke(app, ["bounds", "--model", str(model), *consent, "--json"])
        assert done.exit_code == 0, done.exception
        assert json.loads(done.stdout)
        (tmp_path / "ran").unlink()


def test_another_file_than_the_named_one_does_not_run(model, tmp_path):
    second = tmp_path / "other"
    second.mkdir()
    shutil.copy(tmp_path / "code.py", second / "code.py")
    for trust in (Trust.of(second / "code.py"), Trust.of(second), Trust.of([tmp_path / "model.toml"])):
        with pytest.raises(DataError, match="runs only"):
            read_model(model, scenario("flat").model.terrain, trust)
    assert not ran(model)
    assert not (second / "ran").exists()


def test_a_link_counts_as_what_it_leads_to(model, tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "link.py").symlink_to(tmp_path / "code.py")
    model.write_text(model.read_text().replace('"code.py"', '"folder/link.py"'))
    with pytest.raises(DataError, match="runs only"):
        read_model(model, scenario("flat").model.terrain, Trust.of(tmp_path / "folder"))
    assert not ran(model)
    read_model(model, scenario("flat").model.terrain, Trust.of(tmp_path / "code.py"))


@pytest.mark.parametrize(
    "reach", [lambda folder: user_effects(folder), lambda folder: trusted_effects(Trust.of(folder))]
)
def test_consent_to_a_folder_does_not_follow_a_link_out_of_it(reach, model, tmp_path):
    """Every file of the folder itself runs; nobody who looked at the folder has read the linked one."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine.py").write_text("import rover_pin.effects.effect\n")
    (tmp_path / "folder" / "alias.py").symlink_to(tmp_path / "code.py")
    with pytest.raises(DataError, match=r"alias\.py is a link"):
        reach(tmp_path / "folder")
    assert not ran(model)
    (tmp_path / "folder" / "alias.py").unlink()
    (tmp_path / "folder" / "code.py").write_text((tmp_path / "code.py").read_text())
    assert len(reach(tmp_path / "folder")) == 1


@pytest.mark.parametrize("key", ["settings", "parameters"])
def test_a_study_cannot_trust_itself(model, key):
    text = SWEEP.replace(f"[{key}]\n", f"[{key}]\ntrust = {'[true]' if key == 'parameters' else 'true'}\n")
    study = read_study(written(model, text))
    (report,) = sweep(study, model.parent / "out", workers=1).table["error"]
    assert "--effects FILE or --trust" in report
    with pytest.raises(ParameterError, match="key 'trust'"):
        read_study(written(model, "trust = true\n" + SWEEP))
    with pytest.raises(ParameterError, match=r"cannot be stated in a file.*--trust"):
        build(read_tuning(written(model, TUNING + "trust = true\n")).training[0])
    assert not ran(model)


def test_no_compiled_copy_runs_in_place_of_the_text(tmp_path):
    """Python takes a copy in __pycache__ whose time and size fit: its code could be any."""
    file = tmp_path / "code.py"
    harm = "raise SystemError  "
    file.write_text(harm)
    py_compile.compile(str(file))
    when = file.stat()
    file.write_text("a = 1".ljust(len(harm)))
    os.utime(file, ns=(when.st_atime_ns, when.st_mtime_ns))
    assert run_file(file).a == 1


def test_files_of_one_name_do_not_take_each_others_place(tmp_path):
    kinds = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "code.py").write_text(EFFECT.replace("NAME", folder.title()))
        kinds += user_effects(tmp_path / folder / "code.py")
    assert [kind.__name__ for kind in kinds] == ["One", "Two"]
    assert len({kind.__module__ for kind in kinds}) == 2


def test_worker_processes_get_a_users_effect(tmp_path):
    from joblib import Parallel, delayed

    (tmp_path / "code.py").write_text(EFFECT.replace("NAME", "Squeak"))
    (kind,) = user_effects(tmp_path / "code.py")
    assert Parallel(n_jobs=2)(delayed(getattr)(kind(g=g), "g") for g in (0.25, 0.5)) == [0.25, 0.5]


FORBIDDEN_MODULES = ("pickle", "cPickle", "dill", "shelve", "marshal", "torch", "joblib.numpy_pickle")
FORBIDDEN_CALLS = (
    "eval exec compile __import__ joblib.load pickle.load pickle.loads np.fromfile yaml.load yaml.unsafe_load "
    "pd.read_pickle os.system os.popen"
).split()
RUNS_A_USERS_FILE = "effect_files.py"
"""The one file of the package that runs code which is not the package's, with the user's consent."""


def dotted(node):
    """The dotted name of what is called, as far as it is one."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def calls(tree):
    """Yield the dotted name and the keywords of every call."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield dotted(node.func), {word.arg: getattr(word.value, "value", None) for word in node.keywords}


FILES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "rover_pin").rglob("*.py"))}


def test_nothing_unpickles_or_evaluates():
    """joblib and Dask send our own objects to our own workers in memory; nothing that they send is ever in a file."""
    for path, tree in FILES.items():
        imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        imported |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        froms = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        named = {f"{node.module}.{alias.name}" for node in froms for alias in node.names}
        assert not imported & set(FORBIDDEN_MODULES), path
        assert not named & set(FORBIDDEN_CALLS), path
        for name, words in calls(tree):
            assert name not in FORBIDDEN_CALLS, path
            assert name not in ("np.load", "numpy.load") or words["allow_pickle"] is False, path
            assert not words.get("shell"), path
            if name.endswith(("exec_module", "spec_from_file_location", "source_to_code", "run_path", "load_module")):
                assert path.name == RUNS_A_USERS_FILE


OPENERS = set(
    "open read_text read_bytes fromfile memmap loadtxt genfromtxt loadmat read_csv read_parquet read_excel read_json "
    "ParquetFile from_file AnyReader ZipFile TarFile imread iterparse connect get_data buildModelFromUrdf "
    "load_mesh load_scene CDLL process_file".split()
)
"""What takes a file's name, of Python and of the libraries that read files."""
LOADERS = {"np.load", "trimesh.load", "yourdfpy.URDF.load", "json.load", "tomllib.load"}
OF_ITS_OWN = {
    "base/files/bounded.py": "os.open open zipfile.ZipFile",  # it is what bounds
    "rover/description/meshes.py": "trimesh.load",  # bytes of a file of its folder, bounded, of a known kind
    "logs/ros_bag.py": "AnyReader",  # reads as it goes
    "logs/unpacking.py": "zstd.open",  # of a bag, within an allowance of bytes
    "rover/proposal/new_rover.py": "xacro.process_file",  # only with --trust
    "simulation/model/effect_files.py": "self.get_data",  # code that the user has named
    # bytes or text in memory, read through the bounds
    "rover/description/cross_check.py": "yourdfpy.URDF.load",
    "view/triangles.py": "yourdfpy.URDF.load",
    "base/files/parquet.py": "pyarrow.parquet.ParquetFile",
    "terrain/raster.py": "Image.open memory.open",
    # what the package has written or made itself, or what comes with it
    "simulation/compiled/toolchain.py": "CPUINFO.read_text ctypes.CDLL compiled.read_bytes file.read_bytes",
    "base/code_digest.py": "file.read_bytes",
    "base/files/results_folder.py": "os.open .read_bytes",
    "base/files/whole_file.py": "temporary.open",
    "base/files/journal.py": "self.file.open",
    "view/animation.py": "Image.open rendered.read_bytes",
    "view/export.py": "rrd_file.read_bytes",
    "cli/commands/new_effect.py": ".read_text",
    "base/files/paths.py": ".read_text",
    "onboard/fmi/unit.py": ".read_bytes zipfile.ZipFile",
    "cli/commands/view.py": "webbrowser.open",
    "base/jobs/safe_environment.py": "os.open",
}
"""What opens a file without the bounds, and nothing else in the same file may."""


def test_every_reader_reads_through_the_bounds():
    for path, tree in FILES.items():
        opening = {name for name, _ in calls(tree) if name.rpartition(".")[2] in OPENERS or name in LOADERS}
        local = set(OF_ITS_OWN.get(str(path.relative_to(ROOT / "rover_pin")), "").split())
        assert opening == local, f"{path}: {opening ^ local} opens a file without `bounded`, or does so no more"


def test_a_rig_models_named_file_is_asked_for(tmp_path):
    (tmp_path / "own.py").write_text(
        (ROOT / "rover_pin" / "effects" / "slip_sinkage.py").read_text().replace("class SlipSinkage", "class Own")
    )
    path = write_rig_model(RigModel(Wheel(), Soil()), tmp_path / "rig.toml")
    path.write_text(path.read_text() + '[[effect]]\nname = "Own"\nfile = "own.py"\n')
    with pytest.raises(DataError, match="runs only"):
        read_rig_model(path)
    assert type(read_rig_model(path, Trust.of(tmp_path / "own.py")).effects[-1]).__name__ == "Own"
