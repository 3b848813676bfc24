"""The end of Fig 8 as a closed loop: the model with digging stops rising, as its log does."""

from pathlib import Path

import fig8_loop as study
import pytest

from rover_pin.logs.drive_log import read_drive_log

STUDIES = Path(__file__).parents[2] / "studies"
CLIMBS = ["climb-1", "climb-2", "climb-steps", "climb-back"]


@pytest.fixture(scope="module")
def table():
    log = read_drive_log(STUDIES / "data" / "steepening-slope")
    return study.rows(study.driven(log, STUDIES / "results" / "steepening-slope")).set_index("run").loc[CLIMBS]


def test_the_elevation_stops_only_with_the_found_effect(table):
    """'The elevation keeps rising ... because the digging and sinking process is not modeled' (section 4.2)."""
    assert table.loc["climb-1", "late, log"] < 3.0
    logged, with_found = table["late, log"], table[f"late, {study.FOUND}"]
    for second in (study.DECLARED, study.FITTED):
        assert ((table[f"late, {second}"] - logged).abs() > (with_found - logged).abs()).all()
        assert (table[f"late, {second}"] > with_found + 5.0).all()
    assert (with_found < 5.0).all()
    assert (table[f"late, {study.DECLARED}"] > 15.0).all()


def test_the_elevation_is_nearer_than_as_declared(table):
    assert (table[f"off, {study.FOUND}"] < 0.75 * table[f"off, {study.DECLARED}"]).all()
