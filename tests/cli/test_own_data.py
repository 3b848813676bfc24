"""Data of one's own: made a set out of a table, and checked by themselves before any fit."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from rover_pin.measurements.rig_reading import read_rig_set

DATA = Path(__file__).parents[2] / "studies" / "data"
MINE = "Slip (%),Load [N],DP [N],sinkage_mm,operator\n0,50,1.0,5,a\n20,50,8.1,6.5,a\n40,50,10.5,8,b\n60,50,11,10,b\n"
WHEEL = ("--r", "45mm", "--b", "5cm")
NOISE = ("--noise", "drawbar_pull=0.5N", "--noise", "sinkage=0.5mm")


def test_a_table_becomes_a_set_in_si(run):
    Path("mine.csv").write_text(MINE)
    code, out, _ = run("init", "mine.csv", *WHEEL, *NOISE, "--json")
    told = json.loads(out)
    assert code == 0
    assert "'operator'" in " ".join(told["columns"])
    rig = read_rig_set("mine")
    assert rig.slip == pytest.approx([0.0, 0.2, 0.4, 0.6])
    assert (rig.wheel.r, rig.wheel.b) == (0.045, 0.05)
    pull, sinkage = rig.channels
    assert sinkage.measured == pytest.approx([0.005, 0.0065, 0.008, 0.01])
    assert (np.max(pull.sd), np.max(sinkage.sd)) == (0.5, 0.0005)
    assert "mine/rig.toml" in run("init", "mine.csv", *WHEEL, *NOISE)[2]


@pytest.mark.parametrize(
    ("table", "words", "sentence"),
    [
        (MINE, (), "column drawbar_pull_sd_N, or say --noise"),
        (MINE, ("--noise", "pull=1"), "--noise"),
        (MINE, ("--noise", "drawbar_pull=1mm"), "drawbar_pull: unit 'mm' does"),
        (MINE.replace("Load [N]", "Load [kg]"), NOISE, "'Load [kg]': unit 'kg' does"),
        (MINE.replace("Load [N]", "mass"), NOISE, "load_N: name"),
        (MINE.replace("operator", "slip"), NOISE, "slip, 'slip'"),
        ("slip,load_N\n0,1\n", (), "known: name it drawbar_pull_N"),
        ("", (), "mine.csv"),
    ],
)
def test_what_makes_no_set_is_said_and_nothing_is_left(run, table, words, sentence):
    Path("mine.csv").write_text(table)
    code, _, err = run("init", "mine.csv", *WHEEL, *words)
    assert code == 2
    assert sentence in err
    assert not Path("mine").exists()


ASKEW = MINE.replace("operator", "Side force [N]").replace("sinkage_mm", "slip_angle_deg").replace("a\n", "8\n")


def test_side_force_is_kept_with_its_noise_at_a_slip_angle(run):
    Path("mine.csv").write_text(ASKEW.replace("b\n", "6\n"))
    words = ("init", "mine.csv", *WHEEL, "--noise", "drawbar_pull=0.5N")
    code, _, err = run(*words)
    assert code == 2
    assert "column lateral_sd_N, or say --noise lateral=1N" in err
    assert run(*words, "--noise", "lateral=0.5N")[0] == 0
    rig = read_rig_set("mine")
    side = rig.channels[-1]
    assert (side.column, side.measured.tolist(), np.max(side.sd)) == ("lateral_N", [8.0, 8.0, 6.0, 6.0], 0.5)
    assert rig.slip_angle == pytest.approx(np.radians([5.0, 6.5, 8.0, 10.0]))


def test_a_good_rig_set_is_told_what_it_holds_and_lacks(run):
    code, out, _ = run("check-data", DATA / "cmu-smooth-wheel", "--json")
    told = json.loads(out)
    assert code == 0
    assert told["holds"].startswith("15 runs at 5 levels")
    assert "used" in told["verdict"]
    assert any("measured" in finding for finding in told["findings"])


@pytest.mark.parametrize(
    ("written", "instead", "told"),
    [
        ('rover = "nexus6"', 'rover = "nexsu6"', "bad/drive.toml: There is no rover 'nexsu6': did you mean 'nexus6'?"),
        ("ground-0.csv", "grund.csv", "bad/drive.toml: [terrain] names the file 'grund.csv', which is not there"),
        ("k_t =", "kt =", "bad/drive.toml: [motor]: Motor has no field 'kt': did you mean 'k_t'?"),
        ("gear =", "gear = {value = 9, unit = 'deg'} #", "bad/drive.toml: [motor]: 'gear': unit 'deg'"),
    ],
)
def test_a_mistake_in_a_log_is_told_by_its_file(run, written, instead, told):
    shutil.copytree(DATA / "steepening-slope", "bad")
    file = Path("bad/drive.toml")
    assert written in file.read_text()
    file.write_text(file.read_text().replace(written, instead))
    code, _, err = run("close-loop", "bad")
    assert code == 2
    assert told in err.splitlines()[-1]


def test_a_channel_that_a_set_lacks_is_told_by_its_file(run):
    shutil.copytree(DATA / "cmu-smooth-wheel", "bad")
    file = Path("bad/points.csv")
    file.write_text(file.read_text().replace("drawbar_pull_N", "pull", 1))
    assert "bad/points.csv: drawbar_pull_N: drawbar pull was not measured; " in run("check-data", "bad")[1]


def test_a_poor_set_is_told_so_and_a_wrong_one_refused(run):
    lines = (DATA / "cmu-smooth-wheel" / "points.csv").read_text().splitlines()
    Path("poor").mkdir()
    toml = (DATA / "cmu-smooth-wheel" / "rig.toml").read_text()
    files = 'files = { points = "points.csv", penetration = "penetration.csv", transient = "sinkage_transient.csv" }'
    Path("poor/rig.toml").write_text(toml.replace(files, ""))
    Path("poor/points.csv").write_text("\n".join(lines[:7]))
    assert "poor: 2 levels" in run("check-data", "poor")[1]
    Path("poor/points.csv").write_text("\n".join([*lines[:6], lines[6].replace("0.", "x.")]))
    code, _, err = run("check-data", "poor")
    assert code == 2
    assert err.count("\n") == 1
