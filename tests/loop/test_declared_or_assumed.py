"""What a log declares and what is assumed of it are two things: nobody is contradicted by what nobody said."""

import json

import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.drive_log.model import base_model, nuisances, with_spread
from rover_pin.logs.drive_log import read_drive_log
from rover_pin.loop.close import close_the_loop
from tests.loop import own_log

R = 0.06
TRUTH = {"soil.k": "5mm", "effect.MotionResistance.R": R}


def numbers_of(folder):
    log = read_drive_log(folder)
    return {parameter.name: parameter for parameter in nuisances(log, with_spread(base_model(log)))}


def test_of_what_nobody_declares_only_the_order_is_known(tmp_path):
    own_log.write(tmp_path, runs=1, seconds=1.0, left_out=("resistance", "motor"), **TRUTH)
    numbers = numbers_of(tmp_path)
    assumed = {name for name, number in numbers.items() if not number.declared and "[" not in name}
    motor = {"motor.gear", "motor.resistance", "motor.supply"}
    assert assumed == {"MotionResistance.R", "MotionResistance.q", *motor}
    assert all(numbers[name].source.startswith("assumed") for name in assumed)
    assert abs(numbers["MotionResistance.R"].u(R)) < 2.0, "a prior that nobody declared leaves room for what may be"
    assert numbers["MotionResistance.q"].bounds == (-1.0, 1.0)
    assert numbers["motor.gear"].beforehand.endswith("over or times 2.72")
    assert numbers["soil.phi"].declared
    assert numbers["soil.phi"].source == "declared in [soil], its SD assumed"


def test_what_is_declared_is_known_so_well_as_that_says(tmp_path):
    own_log.write(tmp_path, runs=1, seconds=1.0, **TRUTH)
    file = tmp_path / "drive.toml"
    table = file.read_text().replace("theta_1 = {value", "theta_1 = {sd = 0.5, value")
    file.write_text(table.replace("resistance = {value", "resistance = {sd = 0.3, value"))
    numbers = numbers_of(tmp_path)
    assert numbers["soil.theta_1"].scale == 0.5
    assert numbers["motor.resistance"].source == "declared in [motor]"
    assert "MotionResistance.q" not in numbers, "declared without an SD, how resistance fades is held"
    assert numbers["MotionResistance.R"].declared
    assert numbers["MotionResistance.R"].scale == pytest.approx(0.25 * R)


@pytest.mark.nightly
@pytest.mark.parametrize("q", [0.0, 1.0])
def test_a_null_log_of_another_resistance_needs_no_effect(q, tmp_path):
    """Nothing is hidden, and drive.toml has no [resistance]: R and q are what the log tells."""
    own_log.write(tmp_path / "log", left_out=("resistance",), **TRUTH, **{"effect.MotionResistance.q": q})
    verdict = close_the_loop(tmp_path / "log", out=tmp_path / "out", jobs=2)
    assert verdict.answer is Answer.NONE_NEEDED, verdict.summary()
    report = json.loads((tmp_path / "out" / "verdict.json").read_text())["after"]["MotionResistance.R"]
    middle, reach = 0.5 * (report["low"] + report["high"]), 0.5 * (report["high"] - report["low"])
    assert abs(R - middle) < 2.576 / 1.96 * reach, "beyond 99 %, where 95 % may miss one log in 20"
    assert not report["declared"]
    assert report["source"].startswith("assumed")
    assert "MotionResistance.R 0." in verdict.summary()
    assert "assumed" in (tmp_path / "out" / "report.html").read_text()
