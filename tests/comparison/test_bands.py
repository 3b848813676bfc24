"""A drive on several models: through the command line, against one drive on each, and where one ends early."""

import csv
import json
import re

import pytest

from rover_pin.comparison.bands import drive_on_models
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.toml_file import write_model


@pytest.fixture
def models(tmp_path):
    """Three sands: two that carry the drive, and one in which a wheel is buried."""
    folder = tmp_path / "posterior"
    folder.mkdir()
    for at, words in enumerate(({"soil.k": 0.01}, {"soil.k": 0.02}, {"soil.k": 0.02, "buried": 0.105})):
        write_model(scenario("flat", **words).model, folder / f"{at}.toml")
    return folder


def test_rows_are_those_of_a_drive_on_each_model(models):
    files = sorted(models.glob("*.toml"))
    drives = drive_on_models("flat", files[:2], {"duration": 2.0}, workers=1)
    for row, file in zip(drives.x, files, strict=False):
        alone = scenario("flat", duration=2.0, model=str(file)).drive(measure_error=False)
        assert row == pytest.approx(alone["body_x"], abs=1e-12)
    assert drives.stuck == (False, False)


def test_the_command_drives_a_folder_of_models(models, run):
    words = ("drive", "flat", "--model", models, "--set", "duration=2", "--json", "--out", "out")
    code, output, _ = run(*words)
    assert code == 0
    assert json.loads(output)["models"] == 3
    rows = list(csv.DictReader((models.parent / "out" / "bands.csv").read_text().splitlines()))
    assert {row["model"] for row in rows} == {"1", "2", "3"}
    assert (models.parent / "out" / "bands.png").stat().st_size > 10_000


def test_bounds_of_a_folder_have_an_interval(models, run):
    code, output, _ = run("bounds", "--model", models, "--json")
    assert code == 0
    least, low, high = map(float, re.findall(r"[-\d.]+", json.loads(output)["torque bound [N m]"]))
    assert low <= least <= high


def test_what_is_of_one_drive_is_refused(models, run):
    code, _, message = run("drive", "flat", "--model", models, "--view")
    assert code == 2
    assert "a single drive" in message
    assert "folder" in message
