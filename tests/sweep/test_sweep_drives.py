"""Sweeps over real drives of the ready-made scenarios."""

import dataclasses
import math
from pathlib import Path

import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.sweep import Grid, Range, Study, Values, drive_case, read_study, sweep
from rover_pin.sweep.case import scenario_of

FLAT = Study("flat", "flat", {"soil.k": Values([0.01, 0.05]), "motor.supply": Values([7.2, 8.0])}, Grid(), duration=1.0)
STUDIES = Path(__file__).parents[2] / "studies"


def test_a_drive_that_cannot_be_is_a_row_with_its_reason(tmp_path):
    study = dataclasses.replace(FLAT, scenario="ditch", parameters={"terrain.wall_angle": Values([0.1, 0.8])})
    table = sweep(study, tmp_path / "out", workers=1).table
    assert table["error"][0].startswith("ParameterError: The ditch's walls are inclined by 5.7")
    assert table["stop"][1] == "duration"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scenario": "dich"}, "'flat':.*'dich':.*'ditch'"),
        ({"parameters": {"soil.kk": Values([1.0])}}, "'flat':.*'soil.kk'"),
        ({"settings": {"terrain.wall_angel": 1.0}}, "'terrain.wall_angel'"),
    ],
)
def test_unknown_names_are_refused_before_any_drive(tmp_path, changes, message):
    with pytest.raises(ParameterError, match=message):
        sweep(dataclasses.replace(FLAT, **changes), tmp_path / "out")


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted(STUDIES.glob("sweep_*.toml")), ids=lambda file: file.stem)
def test_shipped_studies_read_and_their_first_drives_run(file):
    study = dataclasses.replace(read_study(file), duration=0.5)
    cases = study.cases()
    assert math.isfinite(drive_case(study, cases[0])["distance_m"])
    assert math.isfinite(drive_case(study, cases[-1])["distance_m"])


def test_a_terrain_of_chance_comes_from_the_case(tmp_path):
    study = Study("hills", "hills", {"soil.k": Range(0.01, 0.05)}, Grid(2), duration=1.0, repeats=2)
    cases = [scenario_of(study, case) for case in study.cases()]
    assert len({scene.settings["terrain.seed"] for scene in cases}) == 4
    fixed = dataclasses.replace(study, settings={"terrain.seed": 3})
    assert {scenario_of(fixed, case).settings["terrain.seed"] for case in fixed.cases()} == {3}
