"""The study of wheel laws: its laws reach the stated errors on held-out levels."""

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import wheel_laws as study


def test_a_braked_wheel_ploughs_by_its_volume():
    """The held-out errors are 0.57 N and 1.53 mm, with a_b = 0.98; the aim was at most 2 N and 2 mm."""
    data = study.read_rig_set(study.DATA / "cmu-smooth-wheel-skid")
    (row,) = study.compared("braked", data, {"ploughing": study.LAWS["braked"]["ploughing"]}, 1.51)[:1]
    assert row.drawbar_pull_N == pytest.approx(0.57, abs=0.1)
    assert row.sinkage_mm == pytest.approx(1.53, abs=0.2)
    fit = study.fitted(data, study.LAWS["braked"]["ploughing"], 1.51)
    assert fit.value("Ploughing.a_b") == pytest.approx(1.0, abs=0.1)


ROOT = Path(__file__).parents[2]


def read(study):
    return {name: study.read_rig_set(study.DATA / f"cmu-{folder}") for name, folder in study.FOLDERS.items()}


def test_the_authors_model_has_the_errors_of_the_table():
    """Nothing is fitted here: their sinkage carries the load, and their side force changes its sign with the slip
    angle.
    """
    rows = pd.read_csv(ROOT / "studies" / "results" / "wheel_laws.csv").set_index(["set", "law"])
    sets = read(study)
    for name, data in sets.items():
        row = study.row(name, study.AUTHORS, data, study.authors_errors(data))
        stored = rows.loc[(name, study.AUTHORS)]
        assert (row.drawbar_pull_N, row.in_sds) == pytest.approx((stored.drawbar_pull_N, stored.in_sds), rel=1e-6)
    data = sets["lugs askew"]
    mirrored = dataclasses.replace(data, slip_angle=-data.slip_angle)
    for channel, authors_error, second in zip(
        data.channels, study.authors_errors(data), study.authors_errors(mirrored), strict=True
    ):
        sense = -1.0 if channel.is_sideways else 1.0
        assert authors_error + channel.measured == pytest.approx(sense * (second + channel.measured))


def test_laws_beat_both_curves_on_all_sets_but_one():
    """The errors are those of all channels in units of their noise, from the kept table."""
    rows = pd.read_csv(ROOT / "studies" / "results" / "wheel_laws.csv")
    assert study.ahead(rows) == [name for name in study.REACH if name != "braked askew"]


def test_one_soil_predicts_each_set_from_the_others():
    """The limits hold for the median set and, doubled, for every set of the kept table."""
    rows = pd.read_csv(ROOT / "studies" / "results" / "wheel_laws.csv")
    predicted = rows[rows["set"].str.startswith(study.FROM) & (rows["law"] == "the law")]
    assert len(predicted) == 7
    for name, most in zip(("drawbar_pull_N", "sinkage_mm", "side_force_N"), study.EACH, strict=True):
        assert predicted[name].median() < most
        assert predicted[name].max() < 2 * most


def test_pressings_bend_no_set():
    """In the kept table, the error of one soil for all sets changes in no set by more than 3 % if the pressings are
    left out.
    """
    rows = pd.read_csv(ROOT / "studies" / "results" / "wheel_laws.csv").set_index(["set", "law"])["in_sds"]
    for name in study.FOLDERS:
        distance, used = (rows[before + study.ONE + name, study.LAW] for before in (study.APART, ""))
        assert distance == pytest.approx(used, rel=0.03)


@pytest.mark.slow
def test_a_braked_wheel_askew_is_predicted_from_the_others():
    """None of its runs is fitted. The errors are 1.7 N, 1.6 mm and 1.3 N; a Gaussian process is wrong by 8 N
    and 5 mm.
    """
    sets = read(study)
    chosen = {"braked askew": sets.pop("braked askew"), **sets}
    del chosen["smooth"]
    law, *_, process = itertools.islice(study.from_the_others(chosen, study.ONE_SAND[study.LAW]), 4)
    assert law[2:5] == pytest.approx((1.7, 1.6, 1.3), rel=0.15)
    assert process[3] > 4.0
    assert process[4] > 3.0


@pytest.mark.nightly
def test_side_force_and_both_signs_of_slip_are_reached():
    laws_table = study.table()
    rows = {(row.set, row.law): row for row in laws_table}
    made_of_smooth = rows["lugged from smooth", "lugs, sand on sand by the rim's m"]
    assert (made_of_smooth.drawbar_pull_N < 1.2, made_of_smooth.sinkage_mm < 4.0) == (True, True)
    table = pd.read_csv(ROOT / "studies" / "results" / "wheel_laws.csv")
    assert [(row.set, row.law) for row in laws_table] == list(zip(table["set"], table["law"], strict=True))
    for name in ("drawbar_pull_N", "sinkage_mm", "side_force_N", "in_sds"):
        np.testing.assert_allclose([getattr(row, name) for row in laws_table], table[name], rtol=0.1, atol=0.05)
    both = rows["both signs", "softening + ploughing"]
    assert (both.drawbar_pull_N < 1.5, both.sinkage_mm < 2.5) == (True, True)
    askew = rows["slip angles", "+ softening + flank + rate"]
    assert (askew.side_force_N < 0.7, askew.sinkage_mm < 2.5) == (True, True)
    lugged = rows["lugged", "softening + trench + rate"]
    assert (lugged.drawbar_pull_N < 0.7, lugged.sinkage_mm < 2.5) == (True, True)
