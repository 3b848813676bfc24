"""The README's paragraph on slip control against the kept table of `python studies/digging.py`, which takes minutes."""

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
TEXT = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
TABLE = pd.read_csv(ROOT / "studies" / "results" / "digging.csv").fillna({"R": -1.0})
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
        (rf"S_d = 0.5 comes further than the buried rover in all {N}, the paper's 0.1 in {N}",
         [further("true slip 0.5"), further("true slip 0.1")]),
        (rf"Eq 9 sees no slip: buried in {N} of the {N} where it has a table",
         [buried("Eq 9"), int(of("Eq 9", SOFT).end_x.notna().sum())]),
        (rf"\(S_d = 0.2\) helps {N} of {N} drives on a stiff sand", [*rescued("true slip 0.2")]),
    ],
)  # fmt: skip
def test_a_number_is_that_of_the_table(said, numbers):
    assert [int(each) for each in re.search(said, TEXT).groups()] == numbers


def test_what_is_said_in_words():
    assert buried("T_sat alone") == buried("none") == further("true slip 0.5")
    for control in ("on-board slip 0.2", "true slip 0.1", "true slip 0.2", "true slip 0.5"):
        assert buried(control) == 0
    assert rescued("Eq 9")[0] == rescued("on-board slip 0.2")[0] == 0
    assert rescued("tacking")[0] == rescued("tacking")[1]
    climbs = {control: set(of(control, SOFT).there.dropna().index) for control in TABLE.control.unique()}
    assert all(climbs[control] <= climbs["none"] for control in climbs)


def test_half_the_step_agrees():
    again = TABLE.dropna(subset="moved")
    assert len(again) > 40
    assert again.same.astype(bool).all()
    assert again.moved.max() < 3e-3
