"""What README and pages say of slip control and of the loop against the kept tables of studies that take minutes."""

import json
import math
import re
import tomllib
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
FILES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXT = " ".join(" ".join(path.read_text(encoding="utf-8") for path in FILES).split())
README = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
RESULTS = ROOT / "studies" / "results"
TABLE = pd.read_csv(RESULTS / "digging.csv").fillna({"R": -1.0})
N = r"(\d+)"
FURTHER = 0.01


def of(control, rows):
    """The rows of a control, by ground."""
    return rows[rows.control == control].set_index(["scene", "angle", "k", "R", "c_d"])


SOFT = TABLE[(TABLE.scene == "incline") & (TABLE.k >= 0.025) & (TABLE.c_d > 0)]
STIFF = TABLE[(TABLE.scene == "ditch") & (TABLE.loss > 0)]


def buried(control, rows=SOFT):
    return int(of(control, rows).buried.notna().sum())


def further(control):
    """How often a rover comes further than constant duty where that is buried."""
    bare = of("none", SOFT)
    gain = of(control, SOFT).x_buried - bare.x_buried
    return int((gain[bare.buried.notna()] > FURTHER).sum())


def rescued(control):
    """Out where constant duty is not; of how many."""
    stuck = of("none", STIFF).there.isna()
    return int(of(control, STIFF).there[stuck].notna().sum()), int(stuck.sum())


@pytest.mark.parametrize(
    ("said", "numbers"),
    [
        (rf"Of {N} inclines of 3 to 9 deg", [len(of("none", SOFT))]),
        (rf"constant duty is buried, sunk by half a wheel radius, in {N}", [buried("none")]),
        (rf"at a slip of 0.5 alone, which senses no slip, in {N}", [buried("T_lim(0.5) alone")]),
        (rf"estimated on board \(S_d = 0.2\) in {N}", [buried("on-board slip 0.2")]),
        (rf"S_d = 0.5 comes further than the buried rover in all {N}, the paper's 0.1 in {N}",
         [further("true slip 0.5"), further("true slip 0.1")]),
        (rf"Eq 9 sees no slip: buried in {N} of the {N} where it has a table",
         [buried("Eq 9"), int(of("Eq 9", SOFT).end_x.notna().sum())]),
        (rf"in {N} with the torque check at a slip of 0.5 instead", [buried("Eq 9, T_lim(0.5)")]),
        (rf"\(S_d = 0.2\) helps {N} of {N} drives on a stiff sand", [*rescued("true slip 0.2")]),
    ],
)  # fmt: skip
def test_a_number_is_that_of_the_table(said, numbers):
    assert [int(each) for each in re.search(said, TEXT).groups()] == numbers


def test_what_is_said_in_words():
    assert buried("T_sat alone") == buried("none") == further("true slip 0.5")
    for control in ("true slip 0.1", "true slip 0.2", "true slip 0.5"):
        assert buried(control) == 0
    sunk = of("on-board slip 0.2", SOFT)
    sunk = sunk[sunk.buried.notna()].reset_index()
    assert set(sunk.c_d) == {SOFT.c_d.max()}
    assert sunk.deepest.max() == pytest.approx(0.0225 + 0.0089, abs=5e-5)
    assert rescued("Eq 9")[0] == rescued("on-board slip 0.2")[0] == 0
    assert rescued("tacking")[0] == 9
    assert "on-board slip none, tacking 9." in TEXT
    climbs = {control: set(of(control, SOFT).there.dropna().index) for control in TABLE.control.unique()}
    assert all(climbs[control] <= climbs["none"] for control in climbs)


def test_the_readme_says_where_slip_control_helps():
    said = re.search(
        rf"of {N} inclines .*? \(k = {N} and {N} mm\), wheels end buried in {N} at constant duty, in {N} with the true "
        rf"slip, in {N} with the slip estimated on board, in {N} of {N} with the paper's Eq 9",
        README,
    )
    found = [len(of("none", SOFT)), *(round(1e3 * each) for each in sorted(SOFT.k.unique())), buried("none")]
    found += [buried("true slip 0.2"), buried("on-board slip 0.2"), buried("Eq 9")]
    found += [int(of("Eq 9", SOFT).end_x.notna().sum())]
    assert [int(each) for each in said.groups()] == found
    said = re.search(
        rf"Of {N} drives over all grounds the on-board slip buries {N} \(constant duty {N}\) and passes {N} \({N}\)",
        README,
    )
    found = [len(SLIPS), *(int(SLIPS["buried"][each].sum()) for each in ("onboard", "constant"))]
    found += [int(SLIPS["passed"][each].sum()) for each in ("onboard", "constant")]
    assert [int(each) for each in said.groups()] == found
    rising = tried(MAP[~MAP.sand.str.endswith("lost")])
    stuck = rising[rising.bare == "stuck"]
    said = re.search(rf"it rescued {N} of {N} ditches", README)
    assert [int(each) for each in said.groups()] == [(stuck.verdict == "out").sum(), len(stuck)]


def test_half_the_step_agrees():
    again = TABLE.dropna(subset="moved")
    assert len(again) > 40
    same = again.same.astype(str) == "True"
    assert [f"{row.control}, {row.angle:g} deg" for row in again[~same].itertuples()] == ["on-board slip 0.2, 46 deg"]
    assert again[same].moved.max() < 3e-3


MAP = pd.read_csv(RESULTS / "fig10_map.csv")


def tried(rows):
    """The controlled drives of rows with the verdict of constant duty in the same sand at the same wall."""
    bare = rows[rows.kind == "none"].set_index(["sand", "wall_deg"]).verdict.rename("bare")
    return rows[rows.kind != "none"].join(bare, on=["sand", "wall_deg"])


def test_the_ditch_of_fig_10_is_that_of_its_map():
    losing = MAP.sand.str.endswith("lost")
    rising, falling = tried(MAP[~losing]), tried(MAP[losing & (MAP.kind != "eq9")])
    stuck, passed = rising[rising.bare == "stuck"], rising[rising.bare == "out"]
    found = [(stuck.verdict == "out").sum(), len(stuck), (passed.verdict == "stuck").sum(), len(passed)]
    said = re.search(rf"rescued {N} of {N} drives and lost {N} of {N} that constant duty passes", TEXT)
    assert [int(each) for each in said.groups()] == found
    stuck = falling[falling.bare == "stuck"]
    out = stuck[stuck.verdict == "out"]
    windows = r"in windows of ([\d.]+) and ([\d.]+) deg"
    said = re.search(rf"it rescues {N} of {N}, all but {N} with S_d = 0.2, {windows}", TEXT)
    walls = [part.wall_deg.max() - part.wall_deg.min() + 0.5 for _, part in out.groupby("sand")]
    assert [float(each) for each in said.groups()] == [len(out), len(stuck), (out.S_d != 0.2).sum(), *sorted(walls)]


HELD_OUT = pd.read_csv(RESULTS / "beyond_the_paper.csv")


def test_tacking_passes_what_is_said():
    ditches = HELD_OUT[HELD_OUT.kind == "ditch"]
    passed = ditches.groupby("control").passed.sum()
    said = re.search(
        rf"{N} of {N} held-out ditches against {N} at constant duty and {N} to {N} with Eq 9; on {N} inclines", TEXT
    )
    found = [passed["tacking"], ditches.drive.nunique(), passed["constant 0.55"]]
    found += [passed["paper, Eq 9"], passed["paper, Eq 9, tuned"], HELD_OUT[HELD_OUT.kind == "incline"].drive.nunique()]
    assert [int(each) for each in said.groups()] == found
    assert passed["constant 0.55"] >= passed["constant 1"]


def test_tacking_gains_nothing_on_inclines():
    inclines = HELD_OUT[HELD_OUT.kind == "incline"].pivot(index="drive", columns="control", values="passed")
    assert not (inclines["tacking"] & ~inclines["constant 0.55"]).any()


TUNED = pd.read_csv(RESULTS / "tune_gains.csv")
MEANS = TUNED[TUNED.set == "held out"].pivot(index="control", columns="ensemble", values="mean")


@pytest.mark.parametrize(
    ("said", "control"),
    [
        ("slopes: constant duty", "constant duty"),
        ("which senses no slip,", "torque check"),
        ("hand-set gains with the true slip", "before, true"),
        ("tuned", "tuned, true"),
        ("with Eq 9", "tuned, eq9"),
    ],
)
def test_a_cost_of_tuned_gains_is_that_of_their_table(said, control):
    found = re.search(rf"Mean cost on held-out .*? {said} ([\d.]+) / ([\d.]+)", TEXT)
    means = MEANS.loc[control, ["slopes", "ditch"]]
    assert [float(each) for each in found.groups()] == [round(float(each), 3) for each in means]


def test_the_tuned_slip_is_that_of_the_gains_found():
    said = re.search(r"The tuned S_d is ([\d.]+) / ([\d.]+), not the paper's 0.1", TEXT)
    gains = [tomllib.loads((RESULTS / f"tuned_{name}.toml").read_text()) for name in ("slopes", "ditch")]
    assert [float(each) for each in said.groups()] == [round(each["S_d"], 2) for each in gains]


def test_what_is_said_of_tuned_gains_in_words():
    """On slopes hand-set gains are worth nearly as much, the check half; among ditches both cost more than nothing."""
    worth = MEANS.loc["constant duty"] - MEANS
    share = worth.slopes / worth.slopes["tuned, true"]
    assert 0.95 < share["before, true"] < 1.0
    assert 0.45 < share["torque check"] < 0.6
    assert worth.ditch["tuned, true"] > 0.0 > max(worth.ditch["torque check"], worth.ditch["before, true"])
    held_out = TUNED[TUNED.set == "held out"].pivot(index="control", columns="ensemble", values="stuck_share")
    stuck = [round(6 * held_out.slopes["tuned, true"]), round(8 * held_out.ditch["tuned, true"])]
    said = re.search(rf"on these 5 nothing helps\), and leave {N} of the 6 and {N} of the 8 stuck", TEXT)
    assert [int(each) for each in said.groups()] == stuck
    assert held_out.min().eq(held_out.loc["tuned, true"]).all()


def test_every_kept_table_says_what_made_it():
    made = tomllib.loads((RESULTS / "made.toml").read_text())
    assert set(made) == {each.stem for each in RESULTS.iterdir()} - {"made"}
    for about in made.values():
        assert (ROOT / about["command"].split()[-1]).exists()
        assert re.fullmatch(r"[0-9a-f]{7,40}", about["commit"])


LOOP = json.loads((ROOT / "studies" / "results" / "steepening-slope" / "verdict.json").read_text(encoding="utf-8"))


def after(name, unit=1.0):
    """A fitted number with its interval, in the page's unit."""
    return [LOOP["after"][name][each] / unit for each in ("value", "low", "high")]


def error(name, unit):
    """The held-out error of a channel before and after."""
    (row,) = [each for each in LOOP["held_out"] if each["name"] == name]
    return [row["before"] / unit, row["after"] / unit]


def strayed(side):
    """RMS distance of free runs from the log [mm]."""
    return 1e3 * (sum(run[side] ** 2 for run in LOOP["extra"]["free_runs"]) / len(LOOP["extra"]["free_runs"])) ** 0.5


M = r"([-+]?[\d.]+)"
BAND = rf"{M} \[{M}, {M}\]"


@pytest.mark.parametrize(
    ("said", "numbers"),
    [
        (rf"Verdict: digging, c_d = {BAND}, L = {BAND} mm", [*after("DiggingMemory.c_d"),
                                                         *after("DiggingMemory.length", 1e-3)]),
        (rf"k = {BAND} mm, phi = {BAND} deg with it", [*after("soil.k", 1e-3), *after("soil.phi", math.radians(1.0))]),
        (rf"held out, the path is {M} -> {M} mm off, the elevation {M} -> {M} mm",
         [*error("path", 1e-3), *error("body_z", 1e-3)]),
        (rf"free runs stray by {M} -> {M} mm", [strayed("before"), strayed("after")]),
    ],
)  # fmt: skip
def test_the_loop_on_the_drive_log_says_what_is_said(said, numbers):
    words = re.search(said, TEXT).groups()
    for word, number in zip(words, numbers, strict=True):
        digits = len(word.partition(".")[2])
        assert float(word) == pytest.approx(number, abs=0.5001 * 10.0**-digits), (word, number)


def test_the_loop_on_the_drive_log_names_digging():
    assert LOOP["answer"] == "an effect is missing"
    assert LOOP["named"] == ["DiggingMemory"]


ERRORS = pd.read_csv(RESULTS / "slip_errors.csv").set_index(["estimate", "kind"])
SLIPS = pd.read_csv(RESULTS / "slip_drives.csv").pivot(index="drive", columns="control", values=["passed", "buried"])


def slip_error(estimate, what, kind="all"):
    return ERRORS.loc[(estimate, kind), what]


def outcomes(control):
    """Buried; lost and rescued against constant duty."""
    passed, free = SLIPS["passed"][control], SLIPS["passed"]["constant"]
    lost, rescued = ((free == 1) & (passed == 0)).sum(), ((free == 0) & (passed == 1)).sum()
    return int(SLIPS["buried"][control].sum()), int(lost), int(rescued)


@pytest.mark.parametrize(
    ("said", "numbers"),
    [
        (rf"bias of {M} and an SD of {M};", [slip_error("onboard", each) for each in ("bias", "sd")]),
        (rf"{M} in ditches, {M} on rocks. Eq 9", [slip_error("onboard", "rms", kind) for kind in ("ditch", "rocks")]),
        (rf"Eq 9: bias {M}, SD {M}; with a wrong soil {M} and {M}",
         [slip_error(name, each) for name in ("eq9", "onboard, wrong soil") for each in ("bias", "sd")]),
        (rf"{M} of {M} are buried, with constant duty {M}, Eq 9 {M}, the true slip {M}\.",
         [outcomes("onboard")[0], len(SLIPS), *(outcomes(each)[0] for each in ("constant", "eq9", "true"))]),
        (rf"Of the {M} that constant duty passes it loses {M} and rescues {M} of the others, the true slip {M} and {M}",
         [int(SLIPS["passed"]["constant"].sum()), *outcomes("onboard")[1:], *outcomes("true")[1:]]),
    ],
)  # fmt: skip
def test_slip_sensed_on_board_is_that_of_its_tables(said, numbers):
    words = re.search(said, TEXT).groups()
    for word, number in zip(words, numbers, strict=True):
        digits = len(word.partition(".")[2])
        assert float(word.rstrip(".")) == pytest.approx(number, abs=0.5001 * 10.0**-digits), (word, number)
    assert max(slip_error("onboard", "rms", kind) for kind in ("digging incline", "steepening slope", "hills")) < 0.03
