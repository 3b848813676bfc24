"""Words of a verdict for numbers, intervals and changes: no change is claimed without an added effect, and no certainty
without an interval.
"""

import dataclasses
import math

import close_the_loop as study
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.estimation.fit import covariance
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.wording import Against, Change, Outcome, against, format_value, in_words, interval
from rover_pin.experiments.wheel_rig.diagnostics import Flag, parameter_cautions
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.loop_data import RigData
from rover_pin.loop.close import verdict_on
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import Independent
from rover_pin.report.rig.report import write_report
from rover_pin.report.sections.held_out import heldout_panel
from rover_pin.report.words import Labels
from tests.experiments.wheel_rig import linear_rig as rig

MANNER = Labels("in runs that were not fitted", "runs")


# --- changes ---------------------------------------------------------------------------------------------------------


def change(before, after, low, high, floor=1.0, of="levels"):
    return Change(before, after, low, high, floor, of)


@pytest.mark.parametrize(
    ("example", "outcome", "text"),
    [
        (change(3.0, 3.0, 0.0, 0.0), Outcome.NONE, "unchanged"),
        (change(3.0, 3.0 * (1 + 1e-9), -1e-9, 2e-9), Outcome.NONE, "unchanged"),
        (change(3.0, 1.5, -0.6, -0.4), Outcome.BETTER, "-50%, 95 % [-60%, -40%]"),
        (change(3.0, 4.5, 0.4, 0.6), Outcome.WORSE, "+50%, 95 % [+40%, +60%]"),
        (change(3.0, 1.5, -0.6, 0.1), Outcome.SCATTER, "-50%, 95 % [-60%, +10%]"),
        (change(3.0, 3.3, -0.1, 0.3), Outcome.SCATTER, "+10%, 95 % [-10%, +30%]"),
        (change(3.0, 1.5, -0.5, -0.5), Outcome.UNTOLD, "-50%, no interval"),
        (change(3.0, 1.5, np.nan, np.nan), Outcome.UNTOLD, "-50%, no interval"),
        (change(1.2, 1.0, -0.3, -0.1), Outcome.AT_FLOOR, "-17%, 95 % [-30%, -10%]"),
        (change(1.2, 1.1, -0.3, 0.1), Outcome.AT_FLOOR, "-8%, 95 % [-30%, +10%]"),
        (change(1.2, 1.8, 0.1, 0.9), Outcome.WORSE, "+50%, 95 % [+10%, +90%]"),
        (change(1.2, 1.8, -0.1, 0.9), Outcome.SCATTER, "+50%, 95 % [-10%, +90%]"),
        (change(3.0, 3.012, 0.002, 0.006), Outcome.WORSE, "+0.4%, 95 % [+0.2%, +0.6%]"),
    ],
)
def test_a_change_is_worded_by_its_interval_and_its_floor(example, outcome, text):
    assert example.outcome is outcome
    assert example.text == text


# --- intervals -------------------------------------------------------------------------------------------------------


def test_an_interval_without_width_is_none():
    assert interval(0.5, 0.5, 0.5, "N m") == "0.5 N m (no interval)"
    assert interval(0.5, 0.4, 0.6, "N m") == "0.5 N m [0.4, 0.6]"
    assert interval(np.radians(30), np.radians(29), np.radians(31), "rad") == "30 deg [29, 31]"
    assert interval(6.705e-4, 5e-4, 2e-3, "A") == "0.6705 mA [0.5, 2]"
    assert interval(0.0, 0.0, 0.0, "") == "0 (no interval)"
    assert interval(1.0, np.nan, np.nan, "") == "1 (no interval)"


@pytest.mark.parametrize(
    ("value", "unit", "message"),
    [
        (6.705e-4, "A", "0.6705 mA"),
        (-3e-6, "V", "-3 \N{MICRO SIGN}V"),
        (49700.0, "N/m^3", "49.7 kN/m^3"),
        (0.0, "N", "0 N"),
        (2e-4, "m", "0.2 mm"),
        (2e-4, "", "0.0002"),
        (2e-4, "m^2", "0.0002 m^2"),
        (math.nan, "A", "not predicted"),
    ],
)
def test_units_scale_with_the_number(value, unit, message):
    """A number with a unit that takes a prefix has neither leading zeros nor a power of ten."""
    assert format_value(value, unit) == message
    factor, _ = in_words(unit, value)
    assert message == "not predicted" or float(message.split()[0]) == pytest.approx(factor * value)


KNOWN = Independent("phi", "rad", np.radians(38), np.radians(38), "stated")


@pytest.mark.parametrize(
    ("ends", "covered", "says"),
    [
        ((0.0, 60.0), 1.0, Against.NOTHING),
        ((3.0, 58.0), 0.92, Against.NOTHING),
        ((36.0, 60.0), 0.4, Against.AGREES),
        ((10.0, 37.0), 0.45, Against.AWAY),
        ((39.0, 41.0), 0.03, Against.AWAY),
        ((37.0, 41.0), 0.07, Against.AGREES),
    ],
)
def test_an_interval_over_the_whole_range_supports_no_claim(ends, covered, says):
    assert against(ends, (38.0, 38.0), covered) is says
    flag = Flag("phi", "rad", tuple(np.radians((20.0, *ends))), KNOWN, says)
    assert flag.agrees == (says is Against.AGREES)
    assert f"] {says.value} 38 deg (stated)" in flag.sentence
    cautioned = {Against.AWAY: "sits away from", Against.NOTHING: "is not identified"}
    (caution, *further_cautions) = parameter_cautions((), [flag]) or [""]
    assert further_cautions == []
    assert caution == "" if says is Against.AGREES else cautioned[says] in caution


def test_undetermined_constant_agrees_with_nothing():
    """Over its whole range, phi changes the channels of this set by a thousandth of their noise only."""
    random = np.random.default_rng(0)
    laws = {"soil.phi": rig.law_of("soil.phi", np.full(2 * rig.RUNS, 1e-4))}
    rig_set = rig.made(random.normal(size=2 * rig.RUNS), laws, ("soil.phi",))
    data = dataclasses.replace(rig_set.sets[0], declared={"phi": 0.6})
    verdict = verdict_on(RigData(dataclasses.replace(rig_set, sets=(data,)), rig.MODEL))
    (flag,) = verdict.extra.before.flags
    assert flag.says is Against.NOTHING
    assert "nothing of 34.38 deg" in verdict.summary()
    assert "identified" in " ".join(verdict.cautions)
    flag_found = next(flag for flag in verdict.as_dict()["extra"]["before"]["flags"])
    assert (flag_found["agrees"], flag_found["says"]) == (False, "says nothing of")


# --- verdicts to which nothing was added -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def nothing():
    """Return a verdict on simulated rig data that contain only noise: no effect is needed."""
    random = np.random.default_rng(0)
    rows, slope = (random.normal(size=2 * rig.RUNS) for _ in range(2))
    verdict = verdict_on(RigData(rig.made(rows, {"soil.phi": rig.law_of("soil.phi", slope)}), rig.MODEL))
    assert verdict.answer is Answer.NONE_NEEDED
    return verdict


# --- drives ----------------------------------------------------------------------------------------------------------


def test_undetermined_number_has_its_bounds_as_interval():
    """Next to a number that the data determine a million times better, a plain pseudo-inverse would give the variance
    0.
    """
    random = np.random.default_rng(0)
    columns = np.zeros((60, 2))
    columns[:, 0] = 1e8 * random.normal(size=60)
    free = (Parameter("soil.phi", 0.5, 1.0, 0.0, 1.0), Parameter("soil.k", 0.5, 1.0, 0.0, 1.0, prior=False))
    sd = np.sqrt(np.diag(covariance(columns, np.zeros(60), free)))
    assert sd[0] == pytest.approx(1 / np.linalg.norm(columns[:, 0]), rel=1e-6)
    assert sd[1] > 1e3


# --- pages and pictures ----------------------------------------------------------------------------------------------


def test_a_rigs_page_describes_its_model_file(nothing, tmp_path):
    provenance = {"command": "rover-pin close-loop x", "seconds": 1.0, "seed": 0, "versions": {"numpy": "2"}}
    verdict = dataclasses.replace(nothing, provenance=provenance)
    page = write_report(verdict, RigExperiment((rig.rig_set(np.zeros(2 * rig.RUNS)),)), tmp_path)[0].read_text()
    assert "fitted base" in " ".join(page.split())
    assert "+0%" not in page
    assert ">worse<" not in page


def scores():
    """Return the scores of three channels: a gain beyond the scatter, a loss beyond the scatter, and a change within
    the scatter.
    """
    rows = {
        "sinkage": (3e-3, 1e-3, -0.8, -0.5),
        "torque": (3e-3, 6e-3, 0.5, 1.5),
        "drawbar pull": (5e-3, 2e-3, -0.9, 0.2),
    }
    return [ChannelScore(name, "", 1e-3, b, a, a / b - 1, low, high) for name, (b, a, low, high) in rows.items()]


def test_held_out_figure_draws_no_unclaimed_change():
    left = heldout_panel(scores(), True, MANNER).axes[0]
    drawn = [line for line in left.collections if isinstance(line, LineCollection)]
    assert len(drawn[0].get_segments()) == 2
    hollow = next(line for line in left.lines if line.get_markerfacecolor() == "none")
    assert list(hollow.get_xdata()) == pytest.approx([2.0])


@pytest.mark.parametrize("largest", [1.3, 2.0, 4.9, 9.0, 30.0, 2000.0])
def test_held_out_figure_has_enough_ticks_however_short_its_axis(largest):
    made = [
        ChannelScore(f"channel {at}", "m", 1.0, error, error, 0.0, 0.0, 0.0)
        for at, error in enumerate((0.9, 1.1, largest))
    ]
    axis = heldout_panel(made, False, MANNER).axes[0]
    low, high = axis.get_xlim()
    ticks = [tick for tick in axis.get_xticks() if low <= tick <= high]
    assert 4 <= len(ticks) <= 14
    texts = [axis.xaxis.get_major_formatter()(tick, 0) for tick in ticks]
    assert len(set(texts)) == len(texts)


def test_study_figure_draws_an_arrow_only_for_a_claimed_change():
    table = pd.DataFrame(
        {"set": "made", "channel": score.name, "noise": score.floor, "held_out_before": score.before,
         "held_out_after": score.after, "said": score.claim}
        for score in scores()
    )  # fmt: skip
    (axis,) = study.draw(table).axes
    assert sorted(round(text.xyann[0], 6) for text in axis.texts) == [3.0, 3.0]
    hollow = [
        line.get_xdata()[0]
        for line in axis.lines
        if line.get_marker() == "s" and line.get_mfc() == "none" and len(line.get_xdata())
    ]
    assert hollow == pytest.approx([2.0])


def test_the_studys_transients_are_named_by_their_slips():
    slips = study.slips_of(read_rig_set(study.DATA / "cmu-smooth-wheel"))
    named = [f"S = {S}" for S in ("0.00", "0.23", "0.50", "0.75", "0.90")]
    assert slips == dict(zip(["10", "12", "20", "40", "100"], named, strict=True))
    runs = study.transient_runs(study.DATA / "cmu-smooth-wheel" / "sinkage_transient.csv")
    steady = {"measured": study.measured_steady(runs)}
    errors = study.predicted(runs, steady["measured"], "measured")
    titles = [axis.get_title() for axis in study.draw_transients(runs, steady, errors, slips).axes]
    assert titles == [f"{name}, held out" for name in named]
    assert "S = 0.23" in study.summary_of(errors, slips).columns
