"""What a drive log's points were worked out with is listed, and worked out again where its error is not in them."""

import logging
import math
import re
from pathlib import Path
from shutil import copytree
from unittest.mock import patch

import pytest

from rover_pin.base.errors import DataError
from rover_pin.base.jobs import time_left
from rover_pin.base.quantity import record_from
from rover_pin.contact import Soil
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.identification.dependence import with_held
from rover_pin.identification.identify import Search, identify
from rover_pin.identification.result import Held, Verdict
from rover_pin.logs import drive_log
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.data_check import checked_evidence
from rover_pin.loop.derived_points import derivation_inputs
from rover_pin.loop.identified import identified
from rover_pin.measurements.drive_points import drive_points, read_drive_points
from rover_pin.simulation.model.motor import Motor

DATA = Path(__file__).parents[2] / "studies" / "data"
LOG = DATA / "steepening-slope"


def told(folder):
    return {one.name.removeprefix("motor."): one for one in derivation_inputs(read_drive_log(folder))}


def test_a_rig_and_a_table_have_nothing_behind_their_points(tmp_path):
    table = tmp_path / "points.csv"
    table.write_text("slip,traction_factor,sd\n0.1,0.05,0.01\n0.4,0.1,0.01\n0.8,0.12,0.01\n")
    for data in (DATA / "cmu-smooth-wheel", table):
        assert derivation_inputs(checked_evidence(data).drive) == ()


def test_log_is_read_once_for_its_check_points_and_their_inputs(run):
    with patch.object(drive_log, "telling", wraps=drive_log.telling) as reading:
        code, out, _ = run("identify", LOG)
    assert code == 0
    assert "RelaxedSlip.length" in out
    assert reading.call_count == 1


def test_a_long_identification_tells_how_far_it_is(run, monkeypatch, caplog):
    monkeypatch.setattr(time_left, "SECONDS_BETWEEN_LINES", 0.0)
    with caplog.at_level(logging.INFO):
        assert run("identify", LOG)[0] == 0
    said = [record.getMessage() for record in caplog.records]
    for what in ("runs cut into windows of 2 s", "starts fitted", "held numbers moved"):
        assert any(re.match(rf"{what}: 1 of \d+, about .* left", line) for line in said), what


def test_every_number_behind_the_points_says_where_it_is_from():
    rows = told(LOG)
    assert list(rows) == [
        "supply", "resistance", "k_t", "gear", "RelaxedSlip.length", "RelaxedSlip.damping", "gravity", "mass",
    ]  # fmt: skip
    assert rows["gear"].doubt == "its declared SD, 0.02 of it, is in the points' errors"
    assert rows["gear"].low == rows["gear"].high == rows["gear"].value
    assert rows["resistance"].high - rows["resistance"].low == pytest.approx(2 * 1.959964 * 0.4770594)
    assert rows["supply"].doubt == "in the doubt of resistance"
    assert rows["k_t"].doubt == "in the doubt of gear"
    assert rows["RelaxedSlip.length"].source.startswith("assumed: contact length")
    assert rows["RelaxedSlip.length"].high == pytest.approx(RelaxedSlip().length * math.exp(1.959964 * 0.35))
    assert (rows["mass"].value, rows["mass"].source) == (pytest.approx(5.8), "the rover's, 'nexus6'")
    assert (rows["gravity"].value, rows["gravity"].doubt) == (9.81, "exact")


def changed(folder, name, without):
    """Return a copy of the log whose drive.toml has no SD of a motor's constant, or not the constant at all."""
    copytree(LOG, folder)
    path = folder / "drive.toml"
    lines = path.read_text(encoding="utf-8").splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith(f"{name} = "))
    lines[at] = "" if without == "it" else lines[at].partition(", sd")[0] + " }"
    path.write_text("\n".join(lines), encoding="utf-8")
    return folder


def test_constant_without_declared_accuracy_moves_the_points(tmp_path):
    """The torque is gear k_t i: a gear 8 % off takes phi out of an interval that knew nothing of it."""
    folder = changed(tmp_path / "log", "gear", "sd")
    points, gear, log = read_drive_points(folder), told(folder)["gear"], read_drive_log(folder)
    assert gear.high / gear.value == pytest.approx(1 + 1.959964 * 0.04)
    found = identified(
        points, points.declared_soil(Soil()), ("k", "phi"), point_inputs=derivation_inputs(log)
    ).identification
    assert found["phi"].verdict is Verdict.DEPENDS
    assert found["phi"].depends_on == ("motor.gear",)
    assert "measure it, and declare it with its sd" in found["phi"].reason
    motor = record_from(Motor, log.metadata.motor, "here")
    moved = next(one.refitted for one in found.fixed if one.fixed.name == "motor.gear")
    for side, end in enumerate((gear.low, gear.high)):
        again = drive_points(log, motor.replace(gear=end))
        fresh = identify(again, points.declared_soil(Soil()), ("k", "phi"), search=Search(starts=2))
        for name in ("k", "phi"):
            assert moved[name][side] == pytest.approx(fresh[name].value, rel=5e-3)


def test_a_constant_that_the_log_leaves_out_is_the_papers(tmp_path):
    row = told(changed(tmp_path / "log", "k_t", "it"))["k_t"]
    assert row.source == "assumed: a small DC motor"


def test_winding_resistance_is_unused_where_current_is_measured():
    points = read_drive_points(LOG)
    found = identified(
        points, points.declared_soil(Soil()), ("k", "phi"), point_inputs=derivation_inputs(read_drive_log(LOG))
    ).identification
    rows = {one.fixed.name: one for one in found.fixed}
    assert not rows["motor.resistance"].refitted
    assert rows["RelaxedSlip.length"].refitted
    low, high = rows["RelaxedSlip.length"].refitted["k"]
    assert low > found["k"].value > high, "slip that lags more was less than Eq (1) says, at the same force"


def test_points_that_cannot_be_worked_out_again_are_no_fit():
    def refused():
        raise DataError("the slip of a window scatters too much.")

    points = read_drive_points(LOG)
    held = Held("motor.gear", "", 265.0, "made", 200.0, 265.0, "made", (refused, lambda: points))
    first = identify(points, points.declared_soil(Soil()), ("k", "phi"), search=Search(starts=1))
    found = with_held(first, points, [held])
    assert math.isnan(found.fixed[0].refitted["phi"][0])
    assert found.fixed[0].refitted["phi"][1] == pytest.approx(first["phi"].value, rel=1e-4)
    assert found["phi"].depends_on == ("motor.gear",)
