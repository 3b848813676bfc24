"""A new kind of data needs one class: the loop finds it, runs on it and writes its results without another edit."""

import dataclasses
import json

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.experiments.motor_brake import MotorBrake
from rover_pin.loop.close import close, loop_data, verdict_on
from rover_pin.loop.own_code import experiment_of_folder, package_experiments
from rover_pin.loop.verdict_file import LoopRequest
from rover_pin.measurements.checks import Finding
from rover_pin.simulation.model.motor import Motor


@dataclasses.dataclass(frozen=True, eq=False)
class Tide(MotorBrake):
    """A kind of data that no other file knows."""

    kind = "tide"

    def insufficient(self):
        return "one tide is too few" if len(self.folds) < 2 else ""

    def findings(self):
        return (Finding("a gap", "run 1", "fill it"),)

    def extra(self, verdict, question, progress=print, seed=0):
        return dataclasses.replace(verdict, cautions=(*verdict.cautions, f"seed {seed} of {question.name}"))


def tide(folds):
    random = np.random.default_rng(1)
    duty = np.linspace(0.3, 1.0, 6) * np.ones((folds, 1))
    load = 0.1 * np.linspace(0.0, 1.0, 6)[None] + np.zeros((folds, 1))
    empty = MotorBrake(Motor(), tuple(map(str, range(folds))), np.stack([duty, load], 1), np.zeros((folds, 2, 6)),
                       np.array([0.02, 0.003]))  # fmt: skip
    observed = empty.predict([empty.base_model()])[0]
    noise = empty.sd[:, None] * random.normal(size=observed.shape)
    return Tide(empty.motor, empty.folds, empty.inputs, observed + noise, empty.sd)


def test_the_packages_experiments_are_found_by_looking(tmp_path):
    assert {"motor_brake", "pendulum", "slip_slope"} <= set(package_experiments())
    assert "traction_factors" not in package_experiments()
    assert experiment_of_folder(tmp_path) is None
    (tmp_path / "slope.toml").write_text("")
    assert experiment_of_folder(tmp_path) == "slip_slope"


def test_data_that_cannot_answer_say_so_under_their_own_kind(tmp_path):
    request = LoopRequest("tides", out=tmp_path)
    close(loop_data(tide(1), request), request)
    report = json.loads((tmp_path / "verdict.json").read_text())
    assert (report["kind"], report["answer"]) == ("tide", Answer.CANNOT_TELL.value)
    assert report["sentence"] == "one tide is too few"
    assert (tmp_path / "report.html").exists()


@pytest.mark.slow
def test_a_verdict_has_what_its_kind_of_data_adds():
    verdict = verdict_on(tide(4), (), seed=7)
    assert (verdict.kind, verdict.answer) == ("tide", Answer.NONE_NEEDED)
    assert "seed 7 of motor on a brake" in verdict.cautions
    assert [finding.where for finding in verdict.findings] == ["run 1"]
