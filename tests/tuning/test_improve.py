"""From data to control by one command: what is predicted, and what is said where nothing can be."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.base.errors import DataError
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.toml_file import write_model
from rover_pin.tuning.drive_score import Cost, Score
from rover_pin.tuning.improve import DEFAULT_STUDY, TUNED, UNTUNED, Prediction, improve, improvement_of, predicted_gain
from rover_pin.tuning.report import ControlScores, TuningResult
from rover_pin.tuning.study import DriveCase, TuningStudy

SMALL = """
name = "small"
estimate = "onboard"
[free]
S_d = [0.2, 0.8]
[before.hole]
[effort]
population = 5
generations = 0
keep = 1
[[training]]
scenario = "incline"
duration = 4
[[held_out]]
scenario = "flat"
duration = 3
"""


def test_one_more_draw_lies_inside_as_often_as_said():
    """Of 4000 samples of eight and one more the interval of 90 % holds the one more in 90 %."""
    random = np.random.default_rng(2)
    rows = random.normal(size=(4000, 9))
    intervals = [Prediction.of(row[:8]) for row in rows]
    values = np.mean([low <= row[8] <= high for (_, low, high), row in zip(intervals, rows, strict=True)])
    assert values == pytest.approx(0.90, abs=0.015)


@given(st.lists(st.floats(-5, 5), min_size=2, max_size=9), st.floats(-3, 3), st.floats(0.1, 10))
def test_a_prediction_moves_and_scales_with_its_values(values, shift, scale):
    plain, shifted = Prediction.of(values), Prediction.of([shift + scale * value for value in values])
    assert shifted == pytest.approx(tuple(shift + scale * number for number in plain), abs=1e-6)


def test_no_number_is_written_as_minus_zero():
    assert Prediction(-0.001, -0.004, 0.004).words() == "0.00 [0.00, 0.00]"


def result_of(now, tuned, files=("a", "a", "b", "b"), before=None):
    """Drives that pass (0) or get stuck (1) by constant duty, before and after tuning, each on the model of a file."""
    cases = tuple(DriveCase(f"{at}", "flat", (("model", file),)) for at, file in enumerate(files))
    study = dataclasses.replace(DEFAULT_STUDY, held_out=cases)
    rows = {
        name: tuple(Score(1.0 - stuck, 0.0, 0.0, stuck, 0.0, 0.0) for stuck in drives)
        for name, drives in (("constant duty", now), ("before, onboard", before or now), ("tuned, onboard", tuned))
    }
    drives = tuple(ControlScores(name, scores[:1] * len(study.training), scores) for name, scores in rows.items())
    return TuningResult(study, study.law_before, (), drives, (), 0, 0.0)


def test_gain_is_averaged_over_drives_and_scattered_over_models():
    gain = predicted_gain(result_of((1, 1, 1, 0), (0, 0, 0, 0)), "constant duty", "tuned, onboard")
    assert gain["through"].mean == pytest.approx(0.75)
    assert gain["cost saved"].mean == pytest.approx(0.75 * float(Cost().progress + Cost().stuck))
    assert gain["buried"] == (0.0, 0.0, 0.0)
    assert gain["through"].low < 0.0 < gain["through"].high


@pytest.mark.parametrize(
    ("now", "tuned", "start"),
    [
        ((1, 1, 1, 1), (0, 0, 0, 0), "gain: "),
        ((0, 0, 0, 0), (0, 0, 0, 0), "keep constant duty"),
        ((1, 1, 0, 0), (0, 0, 0, 0), "a gain is expected but not certain: "),
        ((0, 0, 0, 0), (1, 1, 1, 1), "keep constant duty"),
    ],
)
def test_no_gain_is_claimed_where_the_interval_holds_none(now, tuned, start):
    tuning = result_of(now, tuned)
    result = improvement_of(tuning, {})
    assert result.sentence.startswith(start)
    assert f"changes by {0.0 - result.gain['cost saved'].mean:.2f} [" in result.sentence
    assert result.summary()["gain is certain"] == result.is_certain == (start == "gain: ")
    assert (result.summary()["advice"] == "constant duty") == start.startswith("keep")


@pytest.mark.parametrize("before", [(1, 1, 1, 1), (0, 0, 0, 1), (0, 0, 0, 0), (1, 0, 1, 0)])
def test_the_gain_of_the_untuned_control_is_none_of_the_tuning(before):
    """Per drive the two parts add up to the whole; an untuned control that passes all leaves nothing to the tuning."""
    result = improvement_of(result_of((1, 1, 1, 1), (0, 0, 0, 0), before=before), {})
    for name, whole in result.gain.items():
        parts = result.gain_before_tuning[name].mean, result.gain_of_tuning[name].mean
        assert sum(parts) == pytest.approx(whole.mean)
    assert result.gain_before_tuning["through"].mean == pytest.approx(1 - np.mean(before))
    assert result.gain_of_tuning["through"].mean == pytest.approx(np.mean(before))
    summary = result.summary()
    for name, part in (("gain of slip control before tuning", result.gain_before_tuning),
                       ("gain of the tuning", result.gain_of_tuning)):  # fmt: skip
        assert summary[name]["cost saved"] == part["cost saved"].words()
        assert part["cost saved"].opposite.words() in result.sentence


@pytest.mark.parametrize(("before", "advice"), [((0, 0, 0, 0), UNTUNED), ((1, 1, 1, 1), TUNED), ((0, 0, 1, 1), TUNED)])
def test_a_tuning_that_adds_nothing_is_not_advised(before, advice):
    result = improvement_of(result_of((1, 1, 1, 1), (0, 0, 0, 0), before=before), {})
    assert result.advice == result.summary()["advice"] == advice
    keeps = improvement_of(result_of((0, 0, 0, 0), (1, 1, 1, 1)), {})
    assert keeps.advice == "constant duty"


def test_training_takes_models_in_turn_and_judging_takes_all(tmp_path):
    files = [write_model(scenario("flat", **{"soil.k": k}).model, tmp_path / f"{k}.toml") for k in (0.01, 0.02, 0.03)]
    cases = tuple(DriveCase(name, "flat", (("duration", 2.0),)) for name in "pqrsuv")
    study = TuningStudy("s", cases[:4], cases[4:]).on_model(*files)
    assert [case.model_file for case in study.training] == [str(files[at]) for at in (0, 1, 2, 0)]
    assert [case.model_file for case in study.held_out] == 2 * [str(file) for file in files]


def test_results_without_a_posterior_are_refused_in_a_sentence(tmp_path):
    (tmp_path / "verdict.json").write_text('{"answer": "cannot tell"}')
    with pytest.raises(DataError, match=r"posterior.*report.*tune --model"):
        improve(tmp_path, tmp_path / "out")


@pytest.mark.slow
def test_a_rig_set_becomes_gains_that_drive(run, tmp_path):
    """The command as printed: the loop, its posterior, gains and what they are expected to gain."""
    (tmp_path / "small.toml").write_text(SMALL)
    code, output, _ = run("improve", "cmu-smooth-wheel", "--study", "small.toml", "--workers", "1", "--json")
    assert code == 0
    summary = json.loads(output)
    assert summary == json.loads((tmp_path / "out/improve/improve.json").read_text())
    assert summary["hole law"]["deep"] == pytest.approx(0.2)
    assert set(summary) >= {"torque bound [N m]", "climbable at the slip limit [deg]", "through", "cost saved"}
    assert len(list((tmp_path / "out/improve/loop/posterior").glob("*.toml"))) == 8
    words = ("--control", "onboard", "--set", "control.gains=out/improve/control/gains.toml", "--set", "duration=2")
    assert run("drive", "flat", "--model", "out/improve/loop/model.toml", *words)[0] == 0
    again, output, _ = run("improve", "out/improve/loop", "--study", "small.toml", "--workers", "1", "--json")
    assert again == 0
    assert json.loads(output)["cost saved"] == summary["cost saved"]
    untuned, tuning = (summary[name] for name in ("gain of slip control before tuning", "gain of the tuning"))
    means = [float(row["cost saved"].split()[0]) for row in (untuned, tuning, summary)]
    assert means[0] + means[1] == pytest.approx(means[2], abs=0.011)
