"""The tuning as a whole, small: deterministic, resumable, never worse than before, honest about what it finds."""

import dataclasses

import numpy as np
import pytest

from rover_pin.control.drive_score import Cost, Score, score_trace
from rover_pin.control.evaluations import FILE, Evaluations
from rover_pin.control.slip_control import Gains
from rover_pin.control.tuning import Point, place_of, slope_of, spread, tune_gains, values
from rover_pin.control.tuning_drives import FAILED, Control, built, full_score, reduced_gradient, reduced_score
from rover_pin.control.tuning_report import digest
from rover_pin.control.tuning_study import DriveCase, Effort, TuningStudy
from rover_pin.errors import DataError, OptimisationError, ParameterError
from rover_pin.motion.trace import Trace

SAND = (("duration", 5.0), ("soil.k", 0.01), ("terrain.angle_deg", 8.0), ("terrain.start", 0.0))
INCLINE = DriveCase("incline", "incline", SAND, 0.2)
FLAT = DriveCase("flat", "flat", (("duration", 4.0),))
HELD_OUT = DriveCase("held out", "incline", (*SAND[:2], ("terrain.angle_deg", 6.0), SAND[3]))
SMALL = Effort(population=5, generations=1, starts=1, steps=2, keep=2)
STUDY = TuningStudy("small", (INCLINE, FLAT), (HELD_OUT,), {"k_p": (0.01, 5.0), "S_d": (0.05, 0.9)}, effort=SMALL)


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tuned")
    stages = []
    return tune_gains(STUDY, folder, lambda *told: stages.append(told), workers=1), folder, stages


def test_the_full_rover_decides_and_before_is_among_the_candidates(tuned):
    result = tuned[0]
    assert result.candidates[0].stage == "before"
    assert result.gains == min(result.candidates, key=lambda each: each.cost).gains
    again = [Score(*full_score(case, Control("true", values(result.gains)))) for case in STUDY.training]
    assert np.mean([score.cost(STUDY.cost) for score in again]) == min(each.cost for each in result.candidates)


def test_a_finished_tuning_is_not_run_again_and_says_the_same(tuned):
    result, folder, _ = tuned
    again = tune_gains(STUDY, folder, workers=1)
    assert again.evaluations == 0
    assert again.gains == result.gains
    assert again.verdicts() == result.verdicts()


def test_a_killed_tuning_goes_on(tuned, tmp_path):
    """Half of the file and a torn line: what is whole counts, the rest is run again, the result is the same."""
    lines = (tuned[1] / FILE).read_bytes().splitlines(keepends=True)
    (tmp_path / FILE).write_bytes(b"".join(lines[: len(lines) // 2]) + lines[-1][:20])
    again = tune_gains(STUDY, tmp_path, workers=1)
    assert again.evaluations == len(lines) - len(lines) // 2
    assert again.gains == tuned[0].gains


def test_progress_is_told_by_stage(tuned):
    stages = tuned[2]
    assert {"search on the reduced model", "polish by gradients", "verdict of the full rover"} <= {
        each[0] for each in stages
    }
    assert all(done <= total for _, done, total in stages)


def test_the_report_holds_both_estimates_before_and_after_and_the_check(tuned):
    summary = tuned[0].summary()
    for where in ("training", "held out"):
        for control in ("constant duty", "before, true", "tuned, true", "before, eq9", "tuned, eq9"):
            assert set(summary[f"{where}: {control}"]) == {"mean", "worst", "10 % tail", "stuck share"}
    assert summary["reduced model on flat"]["slip RMSE"] < 0.02
    assert summary["reduced model on flat"]["speed RMSE [mm/s]"] < 3.0
    assert len(tuned[0].table()) == 5 * 3
    assert {file.name for file in tuned[0].files} == {"gains.toml", "drives.csv", "candidates.csv"}
    assert all(file.exists() for file in tuned[0].files)


def test_control_that_makes_things_worse_is_called_so(tuned):
    bad = Score(0.0, 1.0, 0.1, 1.0)
    drives = tuple(
        each._replace(training=(bad,) * 2) if each.control.startswith("tuned") else each for each in tuned[0].drives
    )
    told = dataclasses.replace(tuned[0], drives=drives).verdicts()
    assert "WORSE than constant duty" in told[0]


def test_all_stuck_is_one_sentence_with_the_score_of_constant_duty():
    steep = DriveCase("steep", "incline", (("duration", 20.0), ("terrain.angle_deg", 40.0), ("terrain.start", 0.3)))
    study = dataclasses.replace(STUDY, training=(steep,), held_out=())
    with pytest.raises(
        OptimisationError, match=r"stuck whatever the gains \(.*constant duty 0.55 costs .* 1 of 1"
    ) as caught:
        tune_gains(study, workers=1)
    assert caught.value.status[0].stuck == 1.0


def test_an_unknown_scenario_and_settings_of_the_control_are_refused_at_once():
    with pytest.raises(ParameterError, match="odd: There is no scenario 'dich'"):
        tune_gains(dataclasses.replace(STUDY, training=(DriveCase("odd", "dich"),)))
    with pytest.raises(ParameterError, match=r"'control.k_p' is the tuning's own"):
        built(DriveCase("own", "flat", (("control.k_p", 1.0),)))


def test_the_slope_of_the_scales_is_their_difference_quotient():
    place, step = np.array([0.3, 0.6]), 1e-6
    for j in range(2):
        shift = step * np.eye(2)[j]
        ahead, back = (np.array(values(STUDY.gains(place + sign * shift))) for sign in (1.0, -1.0))
        assert slope_of(STUDY, place)[:, j] == pytest.approx((ahead - back) / (2 * step), rel=1e-6, abs=1e-9)
    assert place_of(STUDY, STUDY.gains(place)) == pytest.approx(place)


def test_the_gradient_of_a_case_is_that_of_its_smooth_cost():
    gains = Gains(k_p=0.5, S_d=0.2)
    found = reduced_gradient(INCLINE, Control("true", values(gains)), Cost())
    ahead, back = (
        Score(*reduced_score(INCLINE, Control("true", values(gains.replace(S_d=0.2 + d))), 0.005)).cost(Cost())
        for d in (0.002, -0.002)
    )
    assert found[1] == pytest.approx((ahead - back) / 0.004, rel=0.05, abs=1e-2)


def test_points_that_are_near_each_other_count_once():
    points = [Point(np.array([u]), u, "search") for u in (0.0, 0.05, 0.3, 0.32, 0.9)]
    assert [float(each.place[0]) for each in spread(points, 3)] == [0.0, 0.3, 0.9]


def test_an_integrator_that_gives_up_costs_the_penalty_and_prints_nothing(monkeypatch, capsys):
    from rover_pin.control import reduced, tuning_drives

    monkeypatch.setattr(reduced, "TOLERANCES", {"max_num_steps": 2})
    hopeless = dataclasses.replace(FLAT, name="hopeless")
    control = Control("true", values(Gains()))
    assert tuning_drives.reduced_score(hopeless, control) == list(FAILED)
    assert tuning_drives.reduced_gradient(hopeless, control, Cost()) == [FAILED.cost(Cost())] + [0.0] * len(
        reduced.GAIN_NAMES
    )
    assert capsys.readouterr() == ("", "")


def test_a_drive_that_ends_early_is_stuck_and_one_without_rows_is_the_worst():
    scene = built(FLAT)
    trace = scene.drive()
    assert score_trace(trace, scene.model, 4.0).stuck == 0.0
    assert score_trace(trace, scene.model, 8.0).stuck == 1.0
    assert score_trace(Trace({"t_s": np.zeros(0)}), scene.model, 4.0) == Score(0.0, 1.0, 0.0, 1.0)


def test_worst_and_mean_share_the_ensembles_cost():
    assert float(Cost(worst=0.25).over(np.array([1.0, 3.0]))) == pytest.approx(0.75 * 2.0 + 0.25 * 3.0)
    scores = [Score(1.0 - i / 20, 0.0, 0.0, 0.0) for i in range(20)]
    found = digest(scores, Cost())
    assert found.worst == pytest.approx(0.95)
    assert found.tail == pytest.approx(0.925)


def test_evaluations_on_two_processes_are_those_of_one(tmp_path):
    jobs = [(FLAT, Control("constant", values(Gains(delta_0=delta)))) for delta in (0.3, 0.5)]
    alone = Evaluations(None, 1, None).run("drives", full_score, jobs)
    assert Evaluations(tmp_path, 2, None).run("drives", full_score, jobs) == alone
    assert Evaluations(tmp_path, 1, None).run("drives", full_score, jobs) == alone


def test_a_damaged_or_impossible_file_of_evaluations(tmp_path):
    (tmp_path / FILE).write_text("nonsense\n")
    with pytest.raises(DataError, match="the file is damaged"):
        Evaluations(tmp_path, 1, None)
    with pytest.raises(DataError, match="name another folder"):
        Evaluations(tmp_path / FILE / "below", 1, None)


def test_reduced_and_full_score_agree_part_by_part():
    """Progress, slip and energy of an incline, computed from integrals of CVODES and from the trace's rows."""
    control = Control("true", values(Gains(S_d=0.5)))
    reduced, full = Score(*reduced_score(INCLINE, control)), Score(*full_score(INCLINE, control))
    assert reduced.progress == pytest.approx(full.progress, abs=0.05)
    assert reduced.slip == pytest.approx(full.slip, abs=0.02)
    assert reduced.energy == pytest.approx(full.energy, rel=0.1)


def test_a_drive_shorter_than_its_tail_has_both_scores():
    """Its end speed is taken as if it had stood still before: the reduced drive is no failure."""
    short = dataclasses.replace(FLAT, settings=(("duration", 2.0),))
    reduced, full = (Score(*score(short, Control("true", values(Gains())))) for score in (reduced_score, full_score))
    assert reduced.progress == pytest.approx(full.progress, abs=0.03)
    assert reduced.stuck == pytest.approx(0.0, abs=0.01)
