"""Tuning with the estimator, its noise and the hole law in the loop; through the command line, as printed."""

import csv
import json
import tomllib

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.control.slip_control import HOLE_GAINS, Gains, HoleLaw, load_gains, load_hole, save_gains
from rover_pin.scenarios.scenario import scenario
from rover_pin.tuning.drives import Control, build, drive_full, full_score
from rover_pin.tuning.study import DriveCase, SlipLaw
from rover_pin.tuning.study_file import read_tuning

DIGS = (("soil", "table-1"), ("duration", 12.0), ("add", "DiggingMemory.c_d=0.1"), ("terrain.angle_deg", 8.0))
SLOPE = DriveCase("slope", "incline", (*DIGS, ("terrain.start", 0.0)))
LAW = SlipLaw(HOLE_GAINS, HoleLaw())
STUDY = """
name = "sensed"
estimate = "onboard"
noise_seeds = 2
[free]
k_p = [0.3, 3.0]
hole.deep = [0.12, 0.4]
[before.hole]
S_deep = 0.15
[effort]
population = 5
generations = 0
keep = 1
[[training]]
name = "slope"
scenario = "incline"
soil = "table-1"
duration = 6
add = "DiggingMemory.c_d=0.1"
terrain.angle_deg = 8
[[held_out]]
scenario = "flat"
duration = 4
"""


def file_of(folder, text=STUDY):
    path = folder / "study.toml"
    path.write_text(text)
    return path


def test_a_study_of_the_hole_law_is_read_and_placed(tmp_path):
    study = read_tuning(file_of(tmp_path))
    assert study.free["hole.deep"] == (0.12, 0.4)
    assert study.before == HOLE_GAINS
    law = study.law([1.0, 0.5])
    assert law.number("k_p") == pytest.approx(3.0)
    assert law.hole == HoleLaw(S_deep=0.15, deep=0.26)
    assert not study.has_reduced_model


def test_a_sensed_drive_depends_on_its_seed_and_repeats():
    first_score, second_score = (full_score(SLOPE, Control.of("onboard", LAW, seed)) for seed in (1, 2))
    assert first_score != second_score
    assert first_score == full_score(SLOPE, Control.of("onboard", LAW, 1))
    assert np.allclose(first_score, second_score, atol=0.15)


def test_the_tuned_drive_is_that_of_the_scenario_without_noise():
    """True slip, hole law: the same drive as the words for it make, row by row."""
    trace = drive_full(SLOPE, Control.of("true", LAW).controller(build(SLOPE).model))
    words = {"control": "true", "control.aim": "hole", **dict(SLOPE.settings)}
    assert trace["body_x"] == pytest.approx(
        scenario("incline", **words).drive(measure_error=False)["body_x"], abs=1e-12
    )


def test_a_file_of_gains_brings_its_hole_law(tmp_path):
    hole = HoleLaw(S_deep=0.2, deep=0.3)
    path = save_gains(Gains(S_d=0.5), tmp_path / "gains.toml", hole=hole)
    assert load_gains(path) == Gains(S_d=0.5)
    assert load_hole(path, 0.06) == hole.replace(r=0.06)
    control = scenario("flat", control="true", **{"control.gains": str(path)}).controller
    assert control.hole == hole
    plain = save_gains(Gains(S_d=0.5), tmp_path / "plain.toml")
    assert load_hole(plain, 0.06) is None
    board = scenario("flat", control="onboard", **{"control.gains": str(plain)}).controller
    assert board.controller.hole is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("hole.deep =", "hole.depe =", r"'hole.depe':.*'hole.deep'"),
        ("hole.deep = [0.12, 0.4]", "hole.deep = [0.12, 4]", r"hole.deep must lie in"),
        ("noise_seeds = 2", "noise_seeds = 0", r"noise_seeds = 0.*1"),
        ("[before.hole]\nS_deep = 0.15", "[before]\nk_i = 3", r"'hole.deep'"),
        ('"onboard"', '"onbord"', r"'onbord' is.*'onboard'"),
        ("S_deep = 0.15", "S_depe = 0.15", r"\[before.hole\].*'S_depe'.*'S_deep'"),
        ("[effort]", "[cost]\nburied = 1.0\n[effort]", r"no field 'buried'"),
    ],
)
def test_what_is_wrong_in_a_study_is_one_sentence(tmp_path, old, new, message):
    assert old in STUDY
    with pytest.raises(ParameterError, match=message):
        read_tuning(file_of(tmp_path, STUDY.replace(old, new)))


@pytest.mark.slow
def test_tune_drives_what_sensors_say(tmp_path, run):
    code, output, _ = run("tune", file_of(tmp_path), "--out", tmp_path / "out", "--workers", 1, "--json")
    summary = json.loads(output)
    assert code == 0
    assert summary["tuned by"] == "onboard slip"
    assert summary["hole law"]["S_deep"] == 0.15
    assert {"training: tuned, onboard", "held out: before, onboard"} <= set(summary)
    assert any("training" in line and "incline" in line and "constant duty" in line for line in summary["where"])
    table = list(csv.DictReader((tmp_path / "out" / "drives.csv").read_text().splitlines()))
    local = [row for row in table if row["control"] == "tuned, onboard"]
    rows = [(row["set"], row["seed"]) for row in local]
    assert rows == [("training", "1"), ("training", "2"), ("held out", "3"), ("held out", "4")]
    gains = tomllib.loads((tmp_path / "out" / "gains.toml").read_text())
    assert gains["hole"]["deep"] == summary["hole law"]["deep"]
    assert (tmp_path / "out" / "frontier.png").stat().st_size > 1000
    words = ("--control", "onboard", "--set", f"control.gains={tmp_path}/out/gains.toml", "--set", "duration=2")
    assert run("drive", "flat", *words, "--out", tmp_path / "drive")[0] == 0
