"""The page of a drive log's verdict: what stands in it for every answer, and what its tables and pictures say."""

import dataclasses
import re

import numpy as np
import pytest

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out_errors import losses_of, together
from rover_pin.effects.point_mass import PointMass
from rover_pin.estimation.residual import huber_weights
from rover_pin.experiments.drive_log.free_runs import DriveExtra, cautions, extra_of
from rover_pin.inference.cause import SIZE_SD
from rover_pin.report.drive import report as drive_report
from rover_pin.report.drive.report import at_full_duty, free_runs_section, labels_of, sides_of, write_report
from rover_pin.report.drive.runs import Sides, channel_to_show, effect_picture
from rover_pin.report.sections.causes import sensitivities, sensitivity_section
from rover_pin.report.sections.held_out import held_out_section
from rover_pin.report.sections.numbers import most_correlated, number_table
from rover_pin.report.sections.physics import channel_changes, physics_section

SECTIONS = [
    "Free runs", "3D view", "Held-out errors", "Residuals against time",
    "Added effects and their influence", "Probabilities of the causes", "Fitted numbers", "Remaining residual",
    "Detection limits", "Warnings", "The data check", "To repeat this run",
]  # fmt: skip


def headings(page):
    return re.findall(r"<h2>(.*?)</h2>\n", page)


def page_of(made, one, out):
    return write_report(one, made[0], out)[0].read_text(encoding="utf-8")


def test_the_page_holds_everything(made, verdict, tmp_path):
    page = page_of(made, verdict, tmp_path)
    assert [each for each in headings(page) if each in SECTIONS] == SECTIONS
    for said in ("no low duty", "made here", "SupplySag.R_b", "GearFriction", "seed 0", "numpy 2", "ohmic source"):
        assert said in page


QUICK = (Answer.NAMED, Answer.NONE_NEEDED)
"""The pages of the other answers are drawn with the slow tests: up to half a minute each."""


@pytest.mark.parametrize(
    "answer", [pytest.param(answer, marks=[] if answer in QUICK else [pytest.mark.slow]) for answer in Answer]
)
def test_every_answer_has_its_page(made, answered, answer, tmp_path, monkeypatch):
    monkeypatch.setattr(drive_report, "find_spec", lambda name: None)  # the scene has a test of its own
    one = answered(answer)
    page = page_of(made, one, tmp_path)
    assert f"<b>{answer.value[0].upper()}{answer.value[1:]}.</b>" in page
    added = answer in (Answer.NAMED, Answer.SET, Answer.LIKE)
    assert ('<th scope="col">after</th>' in page) == added
    drafted = answer is Answer.NONE_FITS
    assert ("draft_effect" in page, "again: try --it" in page) == (drafted, drafted)
    assert ("held-out path: RMSE" in page) == drafted
    assert ("model with supply sag" in page) == added
    assert ("Added effects" in page) == added
    assert "+0%" not in page


def test_a_page_of_poor_data_has_nothing_but_the_check(made, answered, tmp_path):
    page = page_of(made, answered(Answer.CANNOT_TELL), tmp_path)
    assert [each for each in headings(page) if each in SECTIONS] == ["Warnings", "The data check"]
    assert [each.name for each in tmp_path.iterdir()] == ["report.html"]


def test_names_are_text_whatever_they_hold(made, verdict, tmp_path):
    odd = "a_$x^$ <i>b</i>"
    extra = extra_of(verdict)
    free = tuple(each._replace(run=odd) for each in extra.free)
    one = dataclasses.replace(verdict, name="<b>small</b>", extra=DriveExtra(free, extra.residual))
    log = dataclasses.replace(made[0], metadata=dataclasses.replace(made[0].metadata, name="<b>small</b>"))
    content = free_runs_section(one).content
    assert content["table"].rows[0].cells[0] == odd
    no_scene = dataclasses.replace(one, extra=DriveExtra((), extra.residual))
    page = page_of((log,), no_scene, tmp_path)
    assert "&lt;b&gt;small&lt;/b&gt;" in page
    assert "<b>small" not in page


def test_the_scene_is_of_the_run_that_strays_furthest(made, verdict):
    pytest.importorskip("viser")
    content = drive_report.ghosts(verdict, made[0], sides_of(verdict))().content
    worst = max(extra_of(verdict).free, key=lambda one: one.before)
    assert content["run"] == worst.run
    assert "orange: base model" in content["page"]
    assert "blue: with" in content["page"]
    assert not re.findall(r'(?:src|href)="(https?://[^"]+)"', content["page"])


def test_without_viser_the_page_says_what_the_scene_takes(made, verdict, monkeypatch, tmp_path):
    monkeypatch.setattr(drive_report, "find_spec", lambda name: None)
    text = page_of(made, verdict, tmp_path)
    assert "pip install &#34;viser&gt;=1.0&#34;" in text
    assert "<iframe" not in text


def test_every_run_left_out_has_its_line(made, verdict):
    """The misfit of all runs is that of their blocks, and falls with the effect; the interval holds the change."""
    _, before, after = made
    was, now = together(verdict.runs)
    count = sum(one.blocks for one in verdict.runs)
    assert count == before.task.noise.count
    assert was * count == pytest.approx(losses_of(before).sum())
    assert now * count == pytest.approx(losses_of(after).sum())
    assert now < was
    for one in verdict.runs:
        assert one.low <= one.after / one.before - 1 <= one.high
    parts = held_out_section(verdict, labels_of(verdict)).content["parts"]
    assert [row.cells[0] for row in parts.rows] == [one.run for one in verdict.runs]


def test_sizes_that_would_show(verdict):
    """3 SD of a size beside the sag, which all that is probable contains; a torque limit is a threshold."""
    told = sensitivities(verdict.beliefs, verdict.named)
    assert list(told) == ["GearFriction", "WeakMotor"]
    beside = verdict.beliefs.best(("SupplySag", "WeakMotor[4]"))
    sd = beside.moments("WeakMotor[4].g")[1]
    assert 3 * SIZE_SD * sd == pytest.approx(told["WeakMotor"][0].share)
    assert told["WeakMotor"][0].size == f"g = {3 * SIZE_SD * sd * 0.02:.4g}"
    rows = sensitivity_section(verdict, labels_of(verdict)).content
    assert rows["detectable"].rows[1].cells[0] == "weak motor (wheel rl) (WeakMotor[4])"
    assert not rows["undetectable"].rows


def test_contribution_of_an_effect_is_the_prediction_without_it(made, verdict):
    """The bus voltage falls by R_b times the current of all motors: Ohm's law, not the package's sum."""
    experiment, after = made[1].task.experiment, made[2]
    first = channel_changes(after, "SupplySag")[0]
    assert first.channel == "battery_V"
    assert first.without == pytest.approx(7.2)
    run = experiment.folds.index(first.fold)
    currents = [row for row, name in enumerate(experiment.channels) if name.startswith("current_")]
    duty = [trace for trace in made[0].runs][run]
    drawn = np.nansum(after.predicted[run][currents], axis=0).max() * max(float(duty["duty_fl"].max()), 0.0)
    assert first.without - first.with_it == pytest.approx(2.0 * drawn, rel=0.1)
    said = physics_section(verdict, labels_of(verdict)).content["effects"][0]["does"][0]
    assert "bus voltage" in said


def test_at_full_duty_the_bus_drops_and_the_rover_slows(verdict):
    (effect,) = verdict.effects
    said = at_full_duty(verdict.model, effect)
    found = re.fullmatch(r"At full duty on level ground speed goes from (.*) m/s to (.*) m/s \((.*)%\) and "
                         r"bus voltage goes from 7.2 V to (.*) V \((.*)%\)\.", said)  # fmt: skip
    assert found, said
    assert float(found[2]) < float(found[1])
    assert float(found[4]) < 7.2
    assert at_full_duty(verdict.model, effect.replace(R_b=0.0)) == ""  # nothing where nothing acts


def test_numbers_name_the_one_they_go_with_most(verdict):
    """The correlation is that of (J^T W J + priors)^-1, here of a finite sum over its rows."""
    fitted = verdict.after.fit
    told = most_correlated(fitted)
    names = [one.name for one in fitted.parameters]
    weighted = fitted.columns * np.sqrt(huber_weights(fitted.rows))[:, None]
    normal = weighted.T @ weighted + np.diag([float(one.prior) for one in fitted.parameters])
    covariance = np.linalg.solve(normal, np.eye(len(names)))
    for row, name in enumerate(names):
        other, correlation = told[name].rsplit(" ", 1)
        at = names.index(other)
        expected = covariance[row, at] / np.sqrt(covariance[row, row] * covariance[at, at])
        assert float(correlation) == pytest.approx(expected, abs=0.006)
        others = [covariance[row, i] ** 2 / covariance[i, i] for i in range(len(names)) if i != row]
        assert max(others) == pytest.approx(covariance[row, at] ** 2 / covariance[at, at])
    cells = {row.cells[0]: row.cells[-2] for row in number_table(verdict).rows}
    assert cells == told


def test_the_first_picture_is_where_what_was_added_shows(made, verdict):
    """A sagging supply shows in the bus voltage; its drawn means are those of the residual, and fall to nothing."""
    sides = sides_of(verdict)
    one = channel_to_show(sides)
    assert one.channel == "battery_V"
    row = sides.experiment.channels.index("battery_V")
    left = [np.where(fit.task.noise.good[:, row], fit.missed[:, row], np.nan) for fit in sides]
    assert one.compared == np.isfinite(left).all(axis=0).sum()
    assert one.residual.mean(axis=1) == pytest.approx(
        [np.nanmean(side) for side in left], abs=0.05 * np.nanstd(left[0])
    )
    assert np.all(np.abs(one.residual[0]) > np.abs(one.residual[1]))
    (figure,) = effect_picture(sides).panels
    drawn = [bars[0].get_ydata() for bars in figure.axes[0].containers]
    factor = drawn[0][0] / one.residual[0, 0]
    assert np.array(drawn) == pytest.approx(factor * one.residual)
    bare = channel_to_show(Sides(made[1], made[1]))
    assert bare.gain == pytest.approx(float(np.sum((bare.residual[0] / bare.sd[0]) ** 2)))


def test_a_fitted_centre_of_mass_outside_the_rover_is_a_caution(verdict):
    fitted = verdict.after.fit
    for shift, said in ((0.124, True), (0.004, False)):
        heavy = dataclasses.replace(fitted, model=fitted.model.having(PointMass(m=0.0, shift_x=0.0, shift_z=shift)))
        one = dataclasses.replace(verdict, after=verdict.after._replace(fit=heavy))
        assert any("z = " in line for line in cautions(one, extra_of(one).free)) == said


def test_free_runs_that_stray_further_are_a_caution(verdict):
    free = tuple(each._replace(after=2.0 * each.before) for each in extra_of(verdict).free)
    assert any("diverges" in line and "run_1" in line for line in cautions(verdict, free))
    lost = tuple(each._replace(after=float("nan")) for each in free)
    assert any("end of run_1" in line for line in cautions(verdict, lost))


def test_numbers_that_drifted_or_lie_at_a_bound_stand_first(verdict):
    moved = tuple(
        one._replace(drift=4.0 * (one.name == "soil.phi"), at_bound=one.name == "SupplySag.R_b")
        for one in verdict.after.numbers
    )
    one = dataclasses.replace(verdict, after=verdict.after._replace(numbers=moved))
    assert [row.cells[0] for row in number_table(one).rows[:2]] == ["soil.phi", "SupplySag.R_b"]
    said = [*cautions(one, extra_of(one).free)]
    for name in ("soil.phi", "SupplySag.R_b"):
        assert any(line.startswith(name) for line in said)
