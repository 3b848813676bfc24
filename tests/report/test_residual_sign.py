"""Residuals are measured minus predicted. Data with a residual of known sign are followed through every table and
figure.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.contact import Contact, Soil, Wheel
from rover_pin.discrepancy.held_out_errors import held_out_residual
from rover_pin.estimation.residual import residual
from rover_pin.experiments.unlisted.residual import DriveResidual, channel_residuals
from rover_pin.experiments.wheel_rig.describe import draft_effect
from rover_pin.experiments.wheel_rig.loop_data import RigData
from rover_pin.loop.close import verdict_on
from rover_pin.report.drive.residuals import Sides, channel_table, residual_panels, worst_runs
from rover_pin.report.rig.figures import residual_panels as rig_residual_panels
from rover_pin.report.rig.report import test_table as table_of_tests
from tests.experiments.drafts import SameLaw, effect_in
from tests.experiments.drive_log import linear_drive as drive
from tests.experiments.wheel_rig import linear_rig as rig


def test_model_that_predicts_too_little_has_a_positive_residual():
    assert residual(np.array([3.0]), np.array([1.0])) == [2.0]


# --- the rig report --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def deeper():
    """Return a data set whose sinkage differs from the model's by -4 mm to +4 mm, increasing with slip, and whose pull
    is the model's.
    """
    random = np.random.default_rng(0)
    rise = 4 * (rig.slip() / 0.35 - 1)
    rows = np.concatenate([np.zeros(rig.RUNS), rise]) + 0.1 * random.normal(size=2 * rig.RUNS)
    ripple = np.cos(40 * np.arange(2 * rig.RUNS))
    rig_set = rig.made(rows, {"soil.phi": rig.law_of("soil.phi", ripple)}, ("soil.phi",))
    return rig_set, verdict_on(RigData(rig_set, rig.MODEL))


def test_the_fit_and_the_levels_left_out_have_the_sign(deeper):
    rig_set, verdict = deeper
    data, fit = rig_set.sets[0], verdict.before.fit
    for table in (fit.residual, held_out_residual(fit)):
        rows = rig_set.runs["linear"].rows(table) / np.array(rig.SD)[:, None]
        assert rows[1, data.level == 0].mean() == pytest.approx(-4, abs=0.3)
        assert rows[1, data.level == rig.LEVELS - 1].mean() == pytest.approx(4, abs=0.3)


def test_the_table_of_correlations_has_the_sign(deeper):
    rows = table_of_tests(deeper[1].extra, False).rows
    (row,) = [row for row in rows if row.cells[:2] == ("sinkage", "slip")]
    assert float(row.cells[2].split()[0]) > 0.9
    assert any("slip (r = +" in caution for caution in deeper[1].cautions)


def test_the_words_on_the_residual_have_the_sign(deeper):
    _, verdict = deeper
    left = verdict.extra.before.residuals[1]
    assert left.with_slip > 0.9
    assert left.levels[0].mean == pytest.approx(-4e-3, abs=3e-4)
    assert left.levels[-1].mean == pytest.approx(4e-3, abs=3e-4)
    assert left.powers[1] == pytest.approx(8e-3 / 0.7, rel=0.1)


def test_the_figure_of_the_residual_has_the_sign(deeper):
    rig_set, verdict = deeper
    (axis,) = rig_residual_panels(rig_set.sets[0], verdict.extra.before, None)[1].axes
    assert "measured - model" in axis.get_ylabel()
    drawn = axis.containers[0].lines[0].get_ydata()
    assert drawn[0] == pytest.approx(-4, abs=0.3)
    assert drawn[-1] == pytest.approx(4, abs=0.3)


def test_the_drafted_effect_removes_the_residual(deeper, tmp_path):
    """The drafted effect adds the residual to the sinkage of the contact: h + (measured - model) is the reading of the
    rig.
    """
    rig_set, verdict = deeper
    described = rig_set.sets[0], verdict.extra.before.residuals
    drafted = draft_effect(*described)
    law = SameLaw(drafted.effect, effect_in(drafted.text, tmp_path))
    contact = Contact(0.7, 0.0, 0.01, 0.05, 0.0, 0.0, 0.06, 0.0, 0.0, Wheel(), Soil())
    assert float(law.amend(contact, ()).h) == pytest.approx(0.01 - 4e-3, abs=3e-4)


# --- the drive report ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def faster():
    """Return a log whose currents exceed the model's by 3 SD times the duty, about their mean, and whose motion is the
    model's.
    """
    random = np.random.default_rng(1)
    free = drive.nuisances()
    columns = drive.slopes(random, free, size=1e-3)
    runs = drive.runs_of(drive.SHAPE)
    duty = np.array([run.commands.duty[:, 0].reshape(drive.BLOCKS, -1).mean(axis=1) for run in runs])
    more = np.zeros(drive.SHAPE)
    more[:, 1] = 3 * (duty - duty.mean()) / duty.std()
    return drive.fitted(more + 0.1 * random.normal(size=drive.SHAPE), columns), duty


def test_the_table_of_a_drive_has_the_sign(faster):
    fitted, _ = faster
    scene = SimpleNamespace(
        fit=fitted,
        experiment=fitted.task.experiment,
        wheels=("fl",),
        replayed_row=lambda run, name: np.zeros(drive.BLOCKS * drive.ROWS_A_BLOCK),
        logged_row=lambda run, name: np.zeros(drive.BLOCKS * drive.ROWS_A_BLOCK),
    )
    left = channel_residuals(scene)
    assert left[1].correlations["duty"] > 0.99
    assert "duty (correlation +1.00)" in left[1].sentence
    rows = channel_table(DriveResidual((), left, ())).rows
    assert rows[0].cells[0] == "current fl"
    assert float(rows[0].cells[3]) > 0.99


def test_the_figure_of_a_drive_has_the_sign(faster):
    fitted, duty = faster
    run, figure = worst_runs(fitted)[0], residual_panels(Sides(fitted, fitted))[0]
    axis = next(axis for axis in figure.axes if axis.get_ylabel().startswith("current"))
    drawn = axis.lines[-1].get_ydata()
    assert np.corrcoef(drawn, duty[run])[0, 1] > 0.99
    name = fitted.task.experiment.runs[run].name
    assert figure.legends[0].get_title().get_text() == f"{name}: measured - model"
