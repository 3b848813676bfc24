"""What comes with the package is found by name, from a folder of the user's own and from the wheel alone."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from rover_pin import close_the_loop
from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import data_path, sample_names
from rover_pin.base.jobs.safe_environment import SAFE_PATH
from rover_pin.loop.data_check import check_data
from rover_pin.scenarios.catalogue import samples

ROOT = Path(__file__).parents[1]
DATA = ROOT / "studies" / "data"


@pytest.mark.parametrize("name", sorted(folder.name for folder in DATA.iterdir()))
def test_each_sample_is_checked_by_name_elsewhere(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert check_data(name) == check_data(DATA / name)


def test_a_folder_of_the_user_goes_before_a_sample(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cmu-smooth-wheel").mkdir()
    assert data_path("cmu-smooth-wheel") == Path("cmu-smooth-wheel")
    assert data_path("..") == Path("..")
    assert data_path("elsewhere/cmu-smooth-wheel") == Path("elsewhere/cmu-smooth-wheel")
    assert data_path("cmu-smooth-wheel/rig.toml") == DATA / "cmu-smooth-wheel" / "rig.toml"
    (tmp_path / "cmu-smooth-wheel" / "rig.toml").touch()
    assert data_path("cmu-smooth-wheel/rig.toml") == Path("cmu-smooth-wheel/rig.toml")
    for name in ("", ".", "..", "cmu-smooth-wheel/../../data", "steepening-slope/none.csv"):
        assert data_path(name) == Path(name)


@pytest.mark.parametrize("call", [close_the_loop, check_data])
def test_a_misspelt_sample_is_offered(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError, match="'cmu-smooth-wheel'"):
        call("cmu-smoth-wheel")
    with pytest.raises(DataError) as refused:
        call("elsewhere/cmu-smoth-wheel")
    assert "sample" not in str(refused.value)


@pytest.mark.slow
def test_the_wheel_alone_has_samples_and_rovers(tmp_path):
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", tmp_path / "wheel", ROOT]
    subprocess.run([*pip], check=True)
    with zipfile.ZipFile(next((tmp_path / "wheel").glob("*.whl"))) as wheel:
        wheel.extractall(tmp_path / "installed")
    stranger = tmp_path / "stranger"
    stranger.mkdir()
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "installed"), SAFE_PATH: "1"}
    recordings = ["steepening-slope/climb-1.csv", "steepening-slope/flat-steps.csv", "--out", "imported"]
    lines = (["check-data", "steepening-slope"], ["check-urdf", "cart"], ["list", "samples"])
    for words in (*lines, ["import-log", *recordings], ["check-data", "imported"]):
        command = [sys.executable, "-m", "rover_pin.cli.app", *words]
        printed = subprocess.run(command, cwd=stranger, env=environment, text=True, capture_output=True)
        assert printed.returncode == 0, printed.stderr
        assert str(ROOT) not in printed.stdout


def test_samples_are_the_measured_sets(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert sample_names() == sorted(folder.name for folder in DATA.iterdir())
    assert [entry.name for entry in samples()] == sample_names()
    assert all(entry.facts["source"] for entry in samples())
