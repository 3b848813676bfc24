"""The loop on drive logs, end to end: what is hidden is named with its size, and nothing is named where nothing is."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rover_pin import Soil, Wheel, close_the_loop, simulate
from rover_pin.base.errors import DataError
from rover_pin.discrepancy.answer import Answer
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import read_data, start_on
from rover_pin.rover.description.layout import rover_folder
from rover_pin.simulation.model.toml_file import read_model
from tests.experiments.drive_log import drive_sets

RIG = Path(__file__).parents[3] / "studies" / "data" / "cmu-smooth-wheel"


@pytest.fixture(scope="module")
def sagging(tmp_path_factory):
    return drive_sets.write(tmp_path_factory.mktemp("sagging"), [SupplySag(R_b=2.5)])


@pytest.fixture(scope="module")
def loop(sagging, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    return close_the_loop(sagging, out=out, jobs=2), out


@pytest.mark.nightly
def test_a_hidden_sag_is_named_with_its_size_and_its_error_falls(loop):
    verdict, _ = loop
    assert verdict.answer is Answer.NAMED, verdict.summary()
    assert verdict.named == ("SupplySag",)
    size = next(number for number in verdict.after.numbers if number.name == "SupplySag.R_b")
    assert size.low < 2.5 < size.high
    assert size.value == pytest.approx(2.5, rel=0.1)
    battery = next(score for score in verdict.scores if score.name == "battery_V")
    assert battery.after < 0.3 * battery.before
    free = verdict.extra.free
    assert sum(score.after for score in free) < 1.05 * sum(score.before for score in free)  # voltage, not way


@pytest.mark.nightly
def test_the_files_can_be_used_at_once(loop, sagging):
    verdict, out = loop
    document = json.loads((out / "verdict.json").read_text(encoding="utf-8"))
    assert document["named"] == ["SupplySag"]
    assert document["command"].startswith("rover-pin close-loop")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "SupplySag" in page
    log = read_drive_log(sagging)
    model = read_model(out / "model.toml", log.terrain())
    assert model.effect(SupplySag).R_b == pytest.approx(verdict.model.effect(SupplySag).R_b)
    assert simulate(model, lambda reading: 0.6, 1.0)["body_x"][-1] > 0
    assert not (out / ".resume").exists()


@pytest.mark.nightly
def test_nothing_is_named_where_nothing_is_hidden(tmp_path):
    verdict = close_the_loop(drive_sets.write(tmp_path / "log", seed=3), jobs=2)
    assert verdict.answer is Answer.NONE_NEEDED, verdict.summary()
    assert verdict.named == ()
    assert not verdict.drifted


@pytest.mark.nightly
def test_a_loop_that_was_killed_goes_on_and_says_the_same(loop, sagging, tmp_path):
    _, full = loop
    command = [sys.executable, "-m", "rover_pin.cli.app", "close-loop", str(sagging), "--out", str(tmp_path)]
    first = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    refits = (line for line in first.stderr if line.startswith("refitting"))
    next(refits), next(refits)
    first.kill()
    first.wait()
    first.stderr.close()
    files = {file: file.stat().st_mtime_ns for file in (tmp_path / ".resume").glob("*.npz")}
    assert len(files) > 3
    steps = []
    close_the_loop(sagging, out=tmp_path, progress=steps.append, jobs=2)
    assert steps[1].endswith(f"{len(files)} finished steps are kept in {tmp_path}/.resume")
    assert said(tmp_path) == said(full)
    assert (tmp_path / "model.toml").read_bytes() == (full / "model.toml").read_bytes()


def said(out):
    """The verdict as written, without when and how it was asked."""
    document = json.loads((out / "verdict.json").read_text(encoding="utf-8"))
    return {key: value for key, value in document.items() if key not in ("seconds", "command", "date", "files")}


@pytest.mark.nightly
def test_a_rover_without_a_differential_closes_the_loop_too(tmp_path):
    """The cart has neither differential nor pivots: what acts there is not tried, and its own effect is found."""
    folder = drive_sets.write(tmp_path, [SupplySag(R_b=0.4)], runs=2, duration=10.5, rover="cart")
    verdict = close_the_loop(folder, jobs=2)
    assert verdict.named == ("SupplySag",), verdict.summary()
    kinds = {name.partition("[")[0] for names in verdict.beliefs.sets for name in names}
    assert not kinds & {"DifferentialCompliance", "PivotFriction"}


def test_a_log_too_poor_says_so_instead_of_answering(tmp_path):
    folder = drive_sets.write(tmp_path, runs=1, duration=3.0)
    verdict = close_the_loop(folder)
    assert verdict.answer is Answer.CANNOT_TELL
    assert verdict.sentence
    assert (verdict.named, verdict.share) == ((), 0.0)


def test_log_of_a_user_rover_gives_a_model_readable_anywhere(tmp_path, monkeypatch):
    folder = drive_sets.write(tmp_path / "log", runs=1, duration=1.0)
    (tmp_path / "rovers").mkdir()
    for suffix in ("toml", "urdf"):
        shutil.copy(rover_folder() / f"nexus6.{suffix}", tmp_path / "rovers")
    toml = (tmp_path / "rovers" / "nexus6.toml").rename(tmp_path / "rovers" / "own.toml")
    toml.write_text(toml.read_text().replace('name = "nexus6"', 'name = "own"'))
    described = folder / "drive.toml"
    described.write_text(described.read_text().replace('rover = "nexus6"', 'rover = "../rovers/own.toml"'))
    monkeypatch.chdir(tmp_path)
    close_the_loop("log", out="out/loop")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert start_on(read_data(folder), tmp_path / "out" / "loop" / "model.toml").rover.name == "own"


def test_a_model_of_the_other_kind_is_refused(tmp_path):
    folder = drive_sets.write(tmp_path, runs=1, duration=1.0)
    log = read_drive_log(folder)
    with pytest.raises(DataError, match="RigModel"):
        close_the_loop(log, RigModel(Wheel(), Soil()))
    with pytest.raises(DataError, match="wheel"):
        close_the_loop(RIG, drive_sets.base())
