"""The page of a verdict on a drive log: its sections for each kind of answer, and the content of its tables and
pictures.
"""

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
from rover_pin.report.drive.residuals import Sides, channel_to_show, effect_picture
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


def page_of(example, first, out):
    return write_report(first, example[0], out)[0].read_text(encoding="utf-8")


def test_the_page_holds_everything(sag_fits, verdict, tmp_path):
    page = page_of(sag_fits, verdict, tmp_path)
    assert [heading for heading in headings(page) if heading in SECTIONS] == SECTIONS
    for text in ("no low duty", "made here", "SupplySag.R_b", "GearFriction", "seed 0", "numpy 2", "ohmic source"):
        assert text in page


QUICK = (Answer.NAMED, Answer.NONE_NEEDED)
"""The pages of the other answers are drawn with the slow tests: up to half a minute each."""


@pytest.mark.parametrize(
    "answer", [pytest.param(answer, marks=[] if answer in QUICK else [pytest.mark.slow]) for answer in Answer]
)
def test_every_answer_has_its_page(sag_fits, answered, answer, tmp_path, monkeypatch):
    monkeypatch.setattr(drive_report, "find_spec", lambda name: None)  # the scene has a test of its own
    changed_verdict = answered(answer)
    page = page_of(sag_fits, changed_verdict, tmp_path)
    assert f"<b>{answer.value[0].upper()}{answer.value[1:]}.</b>" in page
    added = answer in (Answer.NAMED, Answer.SET, Answer.LIKE)
    assert ('<th scope="col">after</th>' in page) == added
    drafted = answer is Answer.NONE_FITS
    assert ("draft_effect" in page, "again: try --it" in page) == (drafted, drafted)
    assert ("held-out path: RMSE" in page) == drafted
    assert ("model with supply sag" in page) == added
    assert ("Added effects" in page) == added
    assert "+0%" not in page


def test_a_page_of_poor_data_has_nothing_but_the_check(sag_fits, answered, tmp_path):
    page = page_of(sag_fits, answered(Answer.CANNOT_TELL), tmp_path)
    assert [heading for heading in headings(page) if heading in SECTIONS] == ["Warnings", "The data check"]
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]


def test_names_are_text_whatever_they_hold(sag_fits, verdict, tmp_path):
    odd = "a_$x^$ <i>b</i>"
    extra = extra_of(verdict)
    free = tuple(free_run._replace(run=odd) for free_run in extra.free)
    changed_verdict = dataclasses.replace(verdict, name="<b>small</b>", extra=DriveExtra(free, extra.residual))
    log = dataclasses.replace(sag_fits[0], metadata=dataclasses.replace(sag_fits[0].metadata, name="<b>small</b>"))
    content = free_runs_section(changed_verdict).content
    assert content["table"].rows[0].cells[0] == odd
    no_scene = dataclasses.replace(changed_verdict, extra=DriveExtra((), extra.residual))
    page = page_of((log,), no_scene, tmp_path)
    assert "&lt;b&gt;small&lt;/b&gt;" in page
    assert "<b>small" not in page


def test_the_scene_is_of_the_run_that_strays_furthest(sag_fits, verdict):
    pytest.importorskip("viser")
    content = drive_report.ghosts(verdict, sag_fits[0], sides_of(verdict))().content
    worst = max(extra_of(verdict).free, key=lambda first: first.before)
    assert content["run"] == worst.run
    assert "orange: base model" in content["page"]
    assert "blue: with" in content["page"]
    assert not re.findall(r'(?:src|href)="(https?://[^"]+)"', content["page"])


def test_without_viser_the_page_names_the_extra_of_the_scene(sag_fits, verdict, monkeypatch, tmp_path):
    monkeypatch.setattr(drive_report, "find_spec", lambda name: None)
    text = page_of(sag_fits, verdict, tmp_path)
    assert "pip install &#34;viser&gt;=1.0&#34;" in text
    assert "<iframe" not in text


def test_every_run_left_out_has_its_line(sag_fits, verdict):
    """The chi2 of all runs follows from their half-second means, it falls with the added effect, and the interval
    contains the change.
    """
    _, before, after = sag_fits
    was, now = together(verdict.runs)
    count = sum(changed_verdict.blocks for changed_verdict in verdict.runs)
    assert count == before.task.noise.count
    assert was * count == pytest.approx(losses_of(before).sum())
    assert now * count == pytest.approx(losses_of(after).sum())
    assert now < was
    for changed_verdict in verdict.runs:
        assert changed_verdict.low <= changed_verdict.after / changed_verdict.before - 1 <= changed_verdict.high
    parts = held_out_section(verdict, labels_of(verdict)).content["parts"]
    assert [row.cells[0] for row in parts.rows] == [changed_verdict.run for changed_verdict in verdict.runs]


def test_sizes_that_would_show(verdict):
    """The smallest detectable size is 3 SD of the size next to the sagging supply, which every probable hypothesis
    contains. A torque limit is a threshold and has no such size.
    """
    sensitivity_table = sensitivities(verdict.beliefs, verdict.named)
    assert list(sensitivity_table) == ["GearFriction", "WeakMotor"]
    beside = verdict.beliefs.best(("SupplySag", "WeakMotor[4]"))
    sd = beside.moments("WeakMotor[4].g")[1]
    assert 3 * SIZE_SD * sd == pytest.approx(sensitivity_table["WeakMotor"][0].share)
    assert sensitivity_table["WeakMotor"][0].size == f"g = {3 * SIZE_SD * sd * 0.02:.4g}"
    rows = sensitivity_section(verdict, labels_of(verdict)).content
    assert rows["detectable"].rows[1].cells[0] == "weak motor (wheel rl) (WeakMotor[4])"
    assert not rows["undetectable"].rows


def test_contribution_of_an_effect_is_the_prediction_without_it(sag_fits, verdict):
    """The bus voltage falls by R_b times the current of all motors. The test computes this by Ohm's law and not by the
    package.
    """
    experiment, after = sag_fits[1].task.experiment, sag_fits[2]
    first = channel_changes(after, "SupplySag")[0]
    assert first.channel == "battery_V"
    assert first.without == pytest.approx(7.2)
    run = experiment.folds.index(first.fold)
    currents = [row for row, name in enumerate(experiment.channels) if name.startswith("current_")]
    duty = [trace for trace in sag_fits[0].runs][run]
    drawn = np.nansum(after.predicted[run][currents], axis=0).max() * max(float(duty["duty_fl"].max()), 0.0)
    assert first.without - first.with_it == pytest.approx(2.0 * drawn, rel=0.1)
    sentence = physics_section(verdict, labels_of(verdict)).content["effects"][0]["does"][0]
    assert "bus voltage" in sentence


def test_at_full_duty_the_bus_drops_and_the_rover_slows(verdict):
    (effect,) = verdict.effects
    duty = at_full_duty(verdict.model, effect)
    match = re.fullmatch(r"At full duty on level ground speed goes from (.*) m/s to (.*) m/s \((.*)%\) and "
                         r"bus voltage goes from 7.2 V to (.*) V \((.*)%\)\.", duty)  # fmt: skip
    assert match, duty
    assert float(match[2]) < float(match[1])
    assert float(match[4]) < 7.2
    assert at_full_duty(verdict.model, effect.replace(R_b=0.0)) == ""  # nothing where nothing acts


def test_numbers_name_the_one_they_go_with_most(verdict):
    """The correlations follow from (J^T W J + priors)^-1, which the test computes as a finite sum over the rows."""
    fitted = verdict.after.fit
    correlated = most_correlated(fitted)
    names = [parameter.name for parameter in fitted.parameters]
    weighted = fitted.columns * np.sqrt(huber_weights(fitted.rows))[:, None]
    normal = weighted.T @ weighted + np.diag([float(parameter.prior) for parameter in fitted.parameters])
    covariance = np.linalg.solve(normal, np.eye(len(names)))
    for row, name in enumerate(names):
        second, correlation = correlated[name].rsplit(" ", 1)
        at = names.index(second)
        expected = covariance[row, at] / np.sqrt(covariance[row, row] * covariance[at, at])
        assert float(correlation) == pytest.approx(expected, abs=0.006)
        others = [covariance[row, i] ** 2 / covariance[i, i] for i in range(len(names)) if i != row]
        assert max(others) == pytest.approx(covariance[row, at] ** 2 / covariance[at, at])
    cells = {row.cells[0]: row.cells[-2] for row in number_table(verdict).rows}
    assert cells == correlated


def test_the_first_picture_shows_the_influence_of_the_added_effect(sag_fits, verdict):
    """A sagging supply changes the bus voltage most. The drawn means are the means of the residual, and fall to zero
    with the effect.
    """
    sides = sides_of(verdict)
    channel_shown = channel_to_show(sides)
    assert channel_shown.channel == "battery_V"
    row = sides.experiment.channels.index("battery_V")
    left = [np.where(fit.task.noise.good[:, row], fit.missed[:, row], np.nan) for fit in sides]
    assert channel_shown.compared == np.isfinite(left).all(axis=0).sum()
    assert channel_shown.residual.mean(axis=1) == pytest.approx(
        [np.nanmean(side) for side in left], abs=0.05 * np.nanstd(left[0])
    )
    assert np.all(np.abs(channel_shown.residual[0]) > np.abs(channel_shown.residual[1]))
    (figure,) = effect_picture(sides).panels
    drawn = [bars[0].get_ydata() for bars in figure.axes[0].containers]
    factor = drawn[0][0] / channel_shown.residual[0, 0]
    assert np.array(drawn) == pytest.approx(factor * channel_shown.residual)
    bare = channel_to_show(Sides(sag_fits[1], sag_fits[1]))
    assert bare.gain == pytest.approx(float(np.sum((bare.residual[0] / bare.sd[0]) ** 2)))


def test_a_fitted_centre_of_mass_outside_the_rover_is_a_caution(verdict):
    fitted = verdict.after.fit
    for shift, is_caution in ((0.124, True), (0.004, False)):
        heavy = dataclasses.replace(fitted, model=fitted.model.having(PointMass(m=0.0, shift_x=0.0, shift_z=shift)))
        changed_verdict = dataclasses.replace(verdict, after=verdict.after._replace(fit=heavy))
        assert any("z = " in line for line in cautions(changed_verdict, extra_of(changed_verdict).free)) == is_caution


def test_free_runs_that_stray_further_are_a_caution(verdict):
    free = tuple(free_run._replace(after=2.0 * free_run.before) for free_run in extra_of(verdict).free)
    assert any("diverges" in line and "run_1" in line for line in cautions(verdict, free))
    lost = tuple(free_run._replace(after=float("nan")) for free_run in free)
    assert any("end of run_1" in line for line in cautions(verdict, lost))


def test_numbers_that_drifted_or_lie_at_a_bound_come_first(verdict):
    drifted = tuple(
        number._replace(drift=4.0 * (number.name == "soil.phi"), at_bound=number.name == "SupplySag.R_b")
        for number in verdict.after.numbers
    )
    changed_verdict = dataclasses.replace(verdict, after=verdict.after._replace(numbers=drifted))
    assert [row.cells[0] for row in number_table(changed_verdict).rows[:2]] == ["soil.phi", "SupplySag.R_b"]
    caution_list = [*cautions(changed_verdict, extra_of(changed_verdict).free)]
    for name in ("soil.phi", "SupplySag.R_b"):
        assert any(line.startswith(name) for line in caution_list)
