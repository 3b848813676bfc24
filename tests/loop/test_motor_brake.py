"""The third experiment, in one file: what is hidden in a motor on a brake is named; a user's copy is found."""

import json
from pathlib import Path

import numpy as np
import pytest

import rover_pin.experiments.motor_brake as shipped
from rover_pin.base.errors import DataError
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.verdict import SCHEMA
from rover_pin.experiments.motor_brake import MotorBrake
from rover_pin.loop.close import close_the_loop
from rover_pin.loop.own_code import read_experiment
from tests.oracle import brake_generator as hidden

FILE = Path(shipped.__file__)


def closed(folder, **options):
    return close_the_loop(hidden.write(folder, **options), experiment="motor_brake")


def test_it_predicts_what_the_plain_generator_measures(tmp_path, monkeypatch):
    monkeypatch.setattr(hidden, "SD", (1e-12, 1e-12))
    bench = MotorBrake.read(hidden.write(tmp_path, 0, resistance=1.0))
    np.testing.assert_allclose(bench.predict([bench.base_model()])[0], bench.observed, rtol=1e-7, atol=1e-9)


def test_a_hidden_friction_is_named_with_its_size(tmp_path):
    conclusion = closed(tmp_path, seed=0, viscous=0.02)
    assert conclusion.answer is Answer.NAMED, conclusion.summary()
    assert conclusion.named == ("ViscousFriction",)
    assert 0.0 <= conclusion.provenance["seconds"] < 600.0
    size = {number.name: number for number in conclusion.after.numbers}["ViscousFriction.b_v"]
    assert size.low < 0.02 < size.high
    assert conclusion.after.misfit < 1.5 < conclusion.before.misfit
    assert set(conclusion.chosen.values()) == {"ViscousFriction"}
    assert conclusion.share > 0.8
    assert (
        f"ViscousFriction chosen in {len(conclusion.chosen)} of {len(conclusion.chosen)} folds" in conclusion.summary()
    )


@pytest.mark.parametrize("seed", range(2))
def test_without_anything_hidden_nothing_is_named(tmp_path, seed):
    assert closed(tmp_path, seed=seed).answer is Answer.NONE_NEEDED


def test_other_law_is_like_the_nearest_and_is_not_named_alone(tmp_path):
    conclusion = closed(tmp_path, seed=1, square=0.03)
    assert conclusion.answer is Answer.LIKE, conclusion.summary()
    assert conclusion.named[0] == "ViscousFriction"
    assert "something like ViscousFriction" in conclusion.sentence
    assert 0.5 < conclusion.share < 1.0


def test_user_copy_is_found_by_path_and_the_verdict_is_written(tmp_path):
    mine = tmp_path / "my_bed.py"
    mine.write_text(FILE.read_text().replace("motor on a brake", "my motor").replace("class MotorBrake", "class Mine"))
    folder, out = hidden.write(tmp_path / "data", 0, viscous=0.02), tmp_path / "out"
    conclusion = close_the_loop(folder, experiment=mine, out=out)
    report = json.loads((out / "verdict.json").read_text())
    assert conclusion.name == "my motor"
    assert (report["kind"], report["schema"], report["effects"]) == ("test-bed", SCHEMA, ["ViscousFriction"])
    assert report["command"] == f"rover-pin close-loop {folder} --out {out} --experiment {mine}"
    assert report["reduced_chi_square"]["after"] == pytest.approx(conclusion.after.misfit)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "motor_brake"),
        ("x = 1\n", r"bench.py.*none"),
        ("x = nothing\n", "bench.py, line 1: .*NameError"),
        (
            "from rover_pin.discrepancy.experiment import FileExperiment\nclass Half(FileExperiment): pass\n",
            r"bench.py.*none",
        ),
    ],
)
def test_a_file_that_is_no_experiment_is_refused(tmp_path, text, message):
    if text is not None:
        (tmp_path / "bench.py").write_text(text)
    with pytest.raises(DataError, match=message):
        read_experiment(tmp_path, tmp_path / "bench.py")
