"""The tuning as a whole, small: deterministic, resumable, never worse than before, honest about what it finds."""

import dataclasses

import numpy as np
import pytest

from rover_pin.base.errors import DataError, OptimisationError, ParameterError
from rover_pin.control.slip_control import Gains
from rover_pin.simulation.trace.trace import Trace
from rover_pin.tuning import evaluations
from rover_pin.tuning.drive_score import Cost, Score, score_trace
from rover_pin.tuning.drives import FAILED, Control, build, full_score, reduced_score
from rover_pin.tuning.evaluations import FILE, Evaluations, key_of
from rover_pin.tuning.study import DriveCase, Effort, SlipLaw, TuningStudy
from rover_pin.tuning.trust import MAX_SLIP_ERROR, refusal, worse_checks
from rover_pin.tuning.tune import tune_gains

SAND = (("duration", 5.0), ("soil.k", 0.01), ("terrain.angle_deg", 8.0), ("terrain.start", 0.0), ("soil.phi_deg", 30.0))
INCLINE = DriveCase("incline", "incline", SAND, 0.2)
FLAT = DriveCase("flat", "flat", (("duration", 4.0),))
HELD_OUT = DriveCase("held out", "incline", (*SAND[:2], ("terrain.angle_deg", 6.0), *SAND[3:]))
SMALL = Effort(population=5, generations=1, starts=1, steps=2, keep=2)
STUDY = TuningStudy("small", (INCLINE, FLAT), (HELD_OUT,), {"k_p": (0.01, 5.0), "S_d": (0.05, 0.9)}, effort=SMALL)


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tuned")
    stages = []
    return tune_gains(STUDY, folder, lambda *message: stages.append(message), workers=1), folder, stages


def test_full_rover_decides_and_the_old_gains_are_a_candidate(tuned):
    result = tuned[0]
    assert result.candidates[0].stage == "before"
    assert result.gains == min(result.candidates, key=lambda candidate: candidate.cost).law.gains
    again = [Score(*full_score(case, Control.of("true", result.law))) for case in STUDY.training]
    assert np.mean([score.cost(STUDY.cost) for score in again]) == min(
        candidate.cost for candidate in result.candidates
    )


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


def test_report_holds_both_estimates_before_after_and_the_check(tuned):
    summary = tuned[0].summary()
    for where in ("training", "held out"):
        for control in ("constant duty", "torque check", "before, true", "tuned, true", "before, eq9", "tuned, eq9"):
            assert set(summary[f"{where}: {control}"]) == {"mean", "worst", "10 % tail", "stuck share", "buried share"}
    assert summary["reduced model on flat"]["slip RMSE"] < 0.02
    assert summary["reduced model on flat"]["speed RMSE [mm/s]"] < 3.0
    assert len(tuned[0].table()) == 6 * 3
    names = "gains.toml drives.csv candidates.csv drives.png frontier.png".split()
    assert [file.name for file in tuned[0].files] == names
    assert all(file.exists() for file in tuned[0].files)


def test_all_stuck_is_one_sentence_with_the_constant_duty_score():
    steep = DriveCase(
        "steep",
        "incline",
        (("soil", "table-1"), ("duration", 20.0), ("terrain.angle_deg", 40.0), ("terrain.start", 0.3)),
    )
    study = dataclasses.replace(STUDY, training=(steep,), held_out=())
    with pytest.raises(OptimisationError, match=r"0\.55.*1 of 1") as caught:
        tune_gains(study, workers=1)
    assert caught.value.status[0].stuck == 1.0


def test_unknown_scenario_and_control_settings_are_refused():
    with pytest.raises(ParameterError, match=r"odd:.*'dich'"):
        tune_gains(dataclasses.replace(STUDY, training=(DriveCase("odd", "dich"),)))
    with pytest.raises(ParameterError, match=r"'control.k_p'"):
        build(DriveCase("own", "flat", (("control.k_p", 1.0),)))


def test_failed_integration_costs_the_penalty_and_prints_nothing(monkeypatch, capsys):
    from rover_pin.tuning import drives
    from rover_pin.tuning.reduced_model import drive as reduced

    monkeypatch.setattr(reduced, "TOLERANCES", {"max_num_steps": 2})
    hopeless = dataclasses.replace(FLAT, name="hopeless")
    control = Control.of("true", SlipLaw(Gains()))
    assert drives.reduced_score(hopeless, control) == list(FAILED)
    assert capsys.readouterr() == ("", "")


def test_early_end_is_stuck_and_a_drive_without_rows_is_worst():
    scene = build(FLAT)
    trace = scene.drive()
    assert score_trace(trace, scene.model, 4.0).stuck == 0.0
    assert score_trace(trace, scene.model, 8.0).stuck == 1.0
    assert score_trace(Trace({"t_s": np.zeros(0)}), scene.model, 4.0) == Score(0.0, 1.0, 0.0, 1.0, 0.5, 0.0)


def test_evaluations_on_two_processes_are_those_of_one(tmp_path):
    jobs = [(FLAT, Control.of("constant", SlipLaw(Gains(delta_0=delta)))) for delta in (0.3, 0.5)]
    alone = Evaluations(None, 1, None).run("drives", full_score, jobs)
    assert Evaluations(tmp_path, 2, None).run("drives", full_score, jobs) == alone
    assert Evaluations(tmp_path, 1, None).run("drives", full_score, jobs) == alone


def test_a_damaged_or_impossible_file_of_evaluations(tmp_path):
    (tmp_path / FILE).write_text("nonsense\n")
    with pytest.raises(DataError, match=rf"{FILE}, line 1: .*damaged"):
        Evaluations(tmp_path, 1, None)
    with pytest.raises(DataError, match="another folder"):
        Evaluations(tmp_path / FILE / "below", 1, None)


def test_an_evaluation_of_other_code_is_run_again(tmp_path, monkeypatch):
    """The laws of a drive had changed and a folder of before still answered."""
    jobs, key = [(FLAT, Control.of("constant", SlipLaw(Gains())))], key_of(full_score, (1,))
    before = Evaluations(tmp_path, 1, None)
    before.run("drives", full_score, jobs)
    monkeypatch.setattr(evaluations, "key_of_code", lambda others: "another program")
    assert key_of(full_score, (1,)) != key
    after = Evaluations(tmp_path, 1, None)
    after.run("drives", full_score, jobs)
    assert (before.fresh, after.fresh) == (1, 1)


def test_reduced_and_full_score_agree_part_by_part():
    """Progress, slip and energy of an incline, computed from integrals of CVODES and from the trace's rows."""
    control = Control.of("true", SlipLaw(Gains(S_d=0.5)))
    reduced, full = Score(*reduced_score(INCLINE, control)), Score(*full_score(INCLINE, control))
    assert reduced.progress == pytest.approx(full.progress, abs=0.05)
    assert reduced.slip == pytest.approx(full.slip, abs=0.02)
    assert reduced.energy == pytest.approx(full.energy, rel=0.1)
    assert reduced.sinkage == pytest.approx(full.sinkage, abs=0.01)


DIGS = (("soil", "table-1"), ("duration", 30.0), ("add", "DiggingMemory.c_d=0.1"), ("terrain.angle_deg", 7.0))
DIGGING = DriveCase("digging slope", "incline", DIGS)
LOOSE = (("soil", "table-1"), ("effect.MotionResistance.R", 0.028), ("soil.k", 0.01))
BEFORE_A_WALL = DriveCase("ditch", "ditch", (("duration", 14.0), *LOOSE, ("terrain.wall_angle_deg", 40.0)))


def test_digging_drive_is_buried_in_both_models_at_a_cost():
    """Constant duty buries a wheel within 30 s; the law that holds S at 0.3 does not. Score by score, both models."""
    bare, fixed = Control.of("true", SlipLaw(Gains(k_p=0.0, k_i=0.0))), Control.of("true", SlipLaw(Gains(S_d=0.3)))
    for control, buried in ((bare, 1.0), (fixed, 0.0)):
        reduced, full = Score(*reduced_score(DIGGING, control)), Score(*full_score(DIGGING, control))
        assert full.buried == buried
        assert reduced.buried == pytest.approx(buried, abs=0.05)
        assert reduced.stuck == pytest.approx(full.stuck, abs=0.12)  # held, it all but stands: 0.89 of the smooth count
        assert reduced.sinkage == pytest.approx(full.sinkage, abs=0.025)  # of r; 0.022 where it is buried
        assert reduced.cost(Cost()) == pytest.approx(full.cost(Cost()), abs=0.1)
    deeper = Score(*full_score(DIGGING, bare)).sinkage - Score(*full_score(DIGGING, fixed)).sinkage
    assert deeper > 0.05


def test_fewest_burials_are_chosen_whatever_else_it_costs():
    """Property: of any two sets of drives that with fewer burials is chosen; without any the cost decides."""
    random = np.random.default_rng(4)
    scores = random.random((200, 9, len(Score._fields)))
    at = Score._fields.index("buried")
    scores[..., at] = random.random((200, 9)) < random.random((200, 1))
    for cost in (Cost(), Cost(worst=0.5), Cost(progress=0.1, stuck=3.0)):
        choice, burials = cost.choice(scores), scores[..., at].sum(axis=1)
        assert np.all(np.diff(burials[np.argsort(choice)]) >= 0)
        costs = np.array([[Score(*drive).cost(cost) for drive in drives] for drives in scores[burials == 0]])
        assert choice[burials == 0] == pytest.approx(cost.over(costs))


def test_a_drive_that_ended_early_stays_as_deep_as_it_was():
    """Its sinkage is the mean over the time that it was to last, its last value held."""
    scene = build(FLAT)
    trace = scene.drive()
    half, full = (score_trace(trace, scene.model, duration).sinkage for duration in (8.0, 4.0))
    last = float(np.mean(trace.stack("sinkage")[-1])) / 0.045
    assert half == pytest.approx(0.5 * (full + last), rel=0.02)


def test_the_reduced_model_is_checked_where_the_rover_moves():
    """A rover that the gains before hold at a wall is easily modelled; the check takes the worse of two gains."""
    study = dataclasses.replace(STUDY, training=(INCLINE, BEFORE_A_WALL), held_out=())
    incline, ditch = worse_checks(study, Evaluations(None, 1, None))
    assert incline.slip < MAX_SLIP_ERROR
    assert incline.trusted
    assert ditch.slip > 2.0 * MAX_SLIP_ERROR
    assert not ditch.trusted
    assert refusal([incline]) == ""
    assert f" {ditch.slip:.3f} (RMSE, limit 0.05) on ditch" in refusal([incline, ditch])
    assert "ditch and 1" in refusal([ditch, ditch])


def test_full_rover_is_searched_if_the_reduced_model_is_wrong():
    study = dataclasses.replace(
        STUDY,
        training=(INCLINE, BEFORE_A_WALL),
        held_out=(),
        effort=Effort(population=5, generations=0, starts=1, steps=1, keep=1),
    )
    stages = []
    result = tune_gains(study, None, lambda stage, done, total: stages.append((stage, done, total)), workers=1)
    assert ("search on the full rover", 5, 5) in stages
    assert ("search on the reduced model", 5, 5) in stages
    assert "1 of 2 drives" in result.search_notes[0]
    assert [candidate.stage for candidate in result.candidates] == ["before", "search", "polish"]
    assert set(result.search_notes) <= set(result.summary()["verdict"])
