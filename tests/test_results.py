"""What the pages say in words of `studies/results`: fields and bounds of the kept tables."""

import importlib
import re
import tomllib
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "studies" / "results"
TRUE_SLIP = ("true slip 0.1", "true slip 0.2", "true slip 0.5")


@pytest.fixture
def fields(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return importlib.import_module("page_numbers").fields()


def kept(name):
    return pd.read_csv(RESULTS / f"{name}.csv")


def test_every_kept_table_says_what_made_it():
    report = tomllib.loads((RESULTS / "made.toml").read_text())
    assert set(report) == {path.stem for path in RESULTS.iterdir()} - {"made"}
    for metadata in report.values():
        assert (ROOT / metadata["command"].split()[-1]).exists()
        assert re.fullmatch(r"[0-9a-f]{7,40}", metadata["commit"])


@pytest.mark.parametrize("name", ["blind_rig", "blind_drives"])
def test_a_blind_set_is_counted_once(name):
    assert kept(name).label.is_unique


def test_a_known_slip_keeps_wheels_from_burying(fields):
    digging = fields["digging"]
    assert [digging[control]["buried"] for control in TRUE_SLIP] == [0, 0, 0]
    assert digging["T_sat alone"]["buried"] == digging["none"]["buried"] == digging["true slip 0.5"]["further"]
    assert digging["Eq 9"]["rescued"] == 0


def test_no_control_climbs_what_constant_duty_does_not():
    table = kept("digging")
    soft = table[(table.scene == "incline") & (table.k >= 0.025) & (table.c_d > 0)]
    climbs = {name: set(rows.dropna(subset="there")[["angle", "k", "c_d"]].itertuples(index=False, name=None))
              for name, rows in soft.groupby("control")}  # fmt: skip
    assert all(grounds <= climbs["none"] for grounds in climbs.values())


def test_half_the_step_agrees_on_all_drives():
    again = kept("digging").dropna(subset="moved")
    unchanged = again.same.astype(str) == "True"
    assert len(again) > 40
    assert unchanged.all()
    assert again[unchanged].moved.max() < 3e-3


def test_tacking_gains_nothing_on_inclines(fields):
    table = kept("beyond_the_paper")
    inclines = table[table.kind == "incline"].pivot(index="drive", columns="control", values="passed")
    assert not (inclines["tacking"] & ~inclines["constant 0.55"]).any()
    passed = fields["ditches"]["passed"]
    assert passed["constant 0.55"] >= passed["constant 1"]


def test_tuned_gains_leave_the_fewest_rovers_stuck(fields):
    table = kept("tune_gains")
    stuck = table[table.set == "held out"].pivot(index="control", columns="ensemble", values="stuck_share")
    assert stuck.min().eq(stuck.loc["tuned, true"]).all()
    for ensemble in ("slopes", "ditch"):
        cost = {name: row[ensemble] for name, row in fields["tuned"]["cost"].items()}
        assert cost["tuned, true"] < cost["before, true"] < cost["torque check"] < cost["constant duty"]
    buried = table[table.set == "held out"].pivot(index="control", columns="ensemble", values="buried_share")
    assert (buried.loc["tuned, true"] == 0.0).all()


def test_tuned_as_driven_more_rovers_get_through_on_sand():
    rows = {(row["ground"], row["control"]): row for row in kept("tune_as_driven").to_dict("records")}
    best, tuned, *others = [rows[ground, name] for ground, name in reversed(rows) if ground == "sand"]
    assert tuned["control"] == "by the hole, tuned as driven"
    assert best["through"] > tuned["through"]
    assert tuned["through"] > max(row["through"] for row in others)
    assert 0.0 < tuned["buried"] < 1.0
    assert max(row["better"] + row["worse"] for key, row in rows.items() if key[0] == "rough") < 20
    assert rows["all", best["control"]]["better"] < 50, "no numbers of this law are better on more"


def test_the_loop_on_the_drive_log_names_digging(fields):
    assert fields["log_loop"]["answer"] == "an effect is missing"
    assert fields["log_loop"]["named"] == ["DiggingMemory"]


def test_slip_sensed_on_slopes_and_hills_is_good(fields):
    onboard = fields["slip"]["onboard"]
    assert max(onboard[kind]["rms"] for kind in ("digging incline", "steepening slope", "hills")) < 0.03


def test_what_was_asked_of_the_speed_is_reached(fields):
    """The bounds that the step is held to; the table is measured, no test times anything."""
    drive, ground, replay, process = (
        fields["speed"][name] for name in ("drive_speed", "ground_speed", "replay_speed", "process_cost")
    )
    assert max(drive["off [mm]"], drive["off with k = 10 mm [mm]"]) <= 0.1
    assert drive["MuJoCo at 2 ms [s]"] / drive["ditch [s]"] >= 15.0
    assert drive["memory [MB]"] <= 150.0
    assert ground["ditch, 1,000 points and its corners [x]"] <= 1.3
    assert ground["ditch, 300 x 300 grid [x]"] <= 1.5
    assert ground["case over drive [x]"] <= 1.3
    assert ground["drive-seconds a core-second"] >= 200.0
    assert min(replay[f"{name}, former over now [x]"] for name in ("ditch", "washboard")) >= 5.0
    assert sum(replay[f"compiling {name} [s]"] for name in ("the step", "a rigid body", "a set of laws")) <= 4.0
    assert process["--help, over former [x]"] <= 0.55
    assert process["drive flat, over former [x]"] <= 0.55


def test_what_slip_control_costs_is_its_constant_aim(fields):
    rows = fields["control"]["rows"]
    constant, by_hole, onboard = rows["constant duty"], rows["by the hole, true slip"], rows["by the hole, on board"]
    assert by_hole["buried"] == rows["S_d = 0.2, true slip"]["buried"] == 0
    assert rows["S_d = 0.2, true slip"]["passed"] < onboard["passed"] < constant["passed"] < by_hole["passed"]
    assert onboard["buried"] <= 0.01 * fields["control"]["drives"] < constant["buried"]
    assert by_hole["way"] > constant["way"]


def test_a_skid_steered_rover_is_predicted_as_its_study_says():
    """What the loop keeps beats odometry on the heading everywhere, and loses the path where the rover turns."""
    table = kept("rtk_log")
    ahead, turning = table["loop"] < table["odometry"], table["runs"].str.startswith(("B", "12"))
    assert (table["base"] > table["odometry"])[turning].all()
    assert ahead[table["channel"] == "heading"].all()
    assert not ahead[turning & (table["channel"] == "path")].any()
    assert (table[["odometry", "loop"]].max(axis=1) < table["noise"])[~turning].all()
