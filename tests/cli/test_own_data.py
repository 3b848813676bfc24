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
    report = json.loads(out)
    assert code == 0
    assert "'operator'" in " ".join(report["columns"])
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
        (MINE, (), "--noise drawbar_pull=1N --noise sinkage=1m with"),
        (MINE, ("--noise", "pull=1"), "--noise"),
        (MINE, ("--noise", "drawbar_pull=1mm"), "drawbar_pull: unit 'mm' does"),
        (MINE.replace("Load [N]", "Load [mm]"), NOISE, "load_N"),
        (MINE.replace("Load [N]", "mass"), NOISE, "load_N:"),
        (MINE.replace("operator", "slip"), NOISE, "'slip' may both be slip"),
        ("slip,load_N\n0,1\n", (), "drawbar_pull_N"),
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
    assert "--noise lateral=1N" in err
    assert "lateral_sd_N" in err
    assert run(*words, "--noise", "lateral=0.5N")[0] == 0
    rig = read_rig_set("mine")
    side = rig.channels[-1]
    assert (side.column, side.measured.tolist(), np.max(side.sd)) == ("lateral_N", [8.0, 8.0, 6.0, 6.0], 0.5)
    assert rig.slip_angle == pytest.approx(np.radians([5.0, 6.5, 8.0, 10.0]))


def test_a_good_rig_set_is_told_what_it_holds_and_lacks(run):
    code, out, _ = run("check-data", DATA / "cmu-smooth-wheel", "--json")
    report = json.loads(out)
    assert code == 0
    assert report["holds"].startswith("15 runs at 5 levels")
    assert "used" in report["verdict"]
    assert any("measured" in finding for finding in report["findings"])


@pytest.mark.parametrize(
    ("correct", "instead", "message"),
    [
        ('rover = "nexus6"', 'rover = "nexsu6"', "'nexsu6': did you mean 'nexus6'?"),
        ("ground-0.csv", "grund.csv", "'grund.csv'"),
        ("k_t =", "kt =", "'kt': did you mean 'k_t'?"),
        ("gear =", "gear = {value = 9, unit = 'deg'} #", "[motor]: 'gear': unit 'deg'"),
    ],
)
def test_a_mistake_in_a_log_is_told_by_its_file(run, correct, instead, message):
    shutil.copytree(DATA / "steepening-slope", "bad")
    file = Path("bad/drive.toml")
    assert correct in file.read_text()
    file.write_text(file.read_text().replace(correct, instead))
    code, _, err = run("close-loop", "bad")
    assert code == 2
    assert "bad/drive.toml: " in err.splitlines()[-1]
    assert message in err.splitlines()[-1]


def test_a_channel_that_a_set_lacks_is_told_by_its_file(run):
    shutil.copytree(DATA / "cmu-smooth-wheel", "bad")
    file = Path("bad/points.csv")
    file.write_text(file.read_text().replace("drawbar_pull_N", "pull", 1))
    assert "bad/points.csv: drawbar_pull_N: " in run("check-data", "bad")[1]


def test_a_poor_set_is_told_so_and_a_wrong_one_refused(run):
    lines = (DATA / "cmu-smooth-wheel" / "points.csv").read_text().splitlines()
    Path("poor").mkdir()
    toml = (DATA / "cmu-smooth-wheel" / "rig.toml").read_text()
    files = 'files = { points = "points.csv", penetration = "penetration.csv", transient = "sinkage_transient.csv" }'
    Path("poor/rig.toml").write_text(toml.replace(files, ""))
    Path("poor/points.csv").write_text("\n".join(lines[:7]))
    out = run("check-data", "poor")[1]
    assert "data      poor" in out
    assert "6 runs at 2 levels" in out
    Path("poor/points.csv").write_text("\n".join([*lines[:6], lines[6].replace("0.", "x.")]))
    code, _, err = run("check-data", "poor")
    assert code == 2
    assert err.count("\n") == 1


def repeated(slips=(0.0, 0.1, 0.2, 0.4, 0.6), load="50", seed=5, repeats=3):
    """A table whose pulls scatter by 0.4 N and sinkages by 0.3 mm."""
    random = np.random.default_rng(seed)
    rows = [
        f"{slip},{load},{18 * slip - 2 + random.normal(0, 0.4):.4f},{8 + 10 * slip + random.normal(0, 0.3):.4f}"
        for slip in slips
        for _ in range(repeats)
    ]
    return "\n".join(["slip,load,DP (N),sinkage (mm)", *rows])


def test_repeats_show_the_noise_of_channels_that_nobody_states(run):
    Path("mine.csv").write_text(repeated(repeats=6))
    code, out, err = run("init", "mine.csv", *WHEEL, "--noise", "sinkage=0.5mm", "--json")
    assert (code, err) == (0, "")
    assert any("noise of drawbar_pull" in note and "repeats" in note for note in json.loads(out)["columns"])
    pull, sinkage = read_rig_set("mine").channels
    assert pull.sd[0] == pytest.approx(0.4, rel=0.3)
    assert sinkage.sd[0] == 0.0005


def test_a_strayed_run_does_not_pass_for_noise(run):
    lines = repeated(repeats=4).splitlines()
    cells = lines[11].split(",")
    lines[11] = ",".join([*cells[:2], str(float(cells[2]) + 8.0), cells[3]])
    Path("mine.csv").write_text("\n".join(lines))
    code, out, _ = run("init", "mine.csv", *WHEEL, "--json")
    report = json.loads(out)
    assert code == 0
    assert read_rig_set("mine").channels[0].sd[0] == pytest.approx(0.4, rel=0.4)
    assert any("run 11 lies" in finding for finding in report["findings"])


def test_what_was_read_is_printed_also_where_the_table_is_refused(run):
    Path("mine.csv").write_text(MINE)
    code, out, _ = run("init", "mine.csv", *WHEEL, "--json")
    assert code == 2
    assert "'DP [N]' is drawbar_pull_N, in N" in json.loads(out)["columns"]


def test_a_set_that_no_wheel_gives_is_not_left_behind(run):
    Path("mine.csv").write_text(MINE.replace("DP [N]", "DP [kN]"))
    code, _, err = run("init", "mine.csv", *WHEEL, *NOISE)
    assert code == 2
    assert "drawbar_pull_N" in err
    assert not Path("mine").exists()


@pytest.mark.parametrize(("option", "g"), [((), 9.81), (("--gravity", "moon"), 1.62), (("--gravity", "3.7m/s^2"), 3.7)])
def test_a_mass_on_the_wheel_weighs_what_gravity_makes_of_it(option, g, run):
    Path("mine.csv").write_text(MINE.replace("Load [N]", "load (kg)"))
    code, out, _ = run("init", "mine.csv", *WHEEL, *NOISE, *option, "--json")
    assert code == 0
    rig = read_rig_set("mine")
    assert rig.load == pytest.approx(50.0 * g)
    assert (rig.gravity, rig.gravity_is_assumed) == (g, not option)
    assert any("assumed" in finding and "gravity" in finding for finding in json.loads(out)["findings"]) != bool(option)


BY_GROUND = "slip_%,load_N,drawbar_pull_N\n-50,50,-9\n0,50,1.0\n25,50,5\n100,50,10.5\n300,50,11\n"


def test_slip_over_the_travel_speed_is_converted_when_it_is_named(run):
    Path("mine.csv").write_text(BY_GROUND)
    words = ("init", "mine.csv", *WHEEL, "--noise", "drawbar_pull=0.5N")
    code, _, err = run(*words)
    assert code == 2
    assert "--slip-definition over-travel-speed" in err
    assert run(*words, "--slip-definition", "over-travel-speed")[0] == 0
    rig = read_rig_set("mine")
    # r omega / v = 0.5, 1, 1.25, 2 and 4, put into Eq (1) by hand
    assert rig.slip == pytest.approx([-0.5, 0.0, 0.2, 0.5, 0.75])
    assert any("slip_definition" in finding.what for finding in rig.unread)


def test_slip_over_the_rim_speed_is_converted_when_it_is_named(run):
    Path("mine.csv").write_text("slip,load_N,drawbar_pull_N\n-3,50,-9\n-1,50,-7\n0,50,1.0\n0.5,50,10.5\n")
    words = ("init", "mine.csv", *WHEEL, "--noise", "drawbar_pull=0.5N")
    assert run(*words)[0] == 2
    assert run(*words, "--slip-definition", "over-rim-speed")[0] == 0
    # v / (r omega) = 4, 2, 1 and 0.5
    assert read_rig_set("mine").slip == pytest.approx([-0.75, -0.5, 0.0, 0.5])
