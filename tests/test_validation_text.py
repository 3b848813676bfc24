"""What docs/validation.md says of the blind rig sets against the sets that were kept: each count anew from the rows."""

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
TEXT = " ".join(PAGE.split())
SETS = pd.read_csv(ROOT / "studies" / "results" / "blind_rig.csv", keep_default_na=False)
NAMED = ["named", "in the set"]
WRONG = ["wrong name", "with one that is not there"]


def of(kind, detectable=None):
    own = SETS[SETS.kind == kind]
    return own if detectable is None else own[own.detectable.astype(str) == str(detectable)]


def held():
    """How many stated intervals hold the truth, of how many."""
    found = re.findall(r"(\S+): \S+ \[(\S+), (\S+)\]", " ; ".join(SETS.sizes))
    return sum(float(low) <= float(true) <= float(high) for true, low, high in found), len(found)


ONE, OTHER = "one effect", "a listed effect by another law"
ROWS = {
    "one effect: detectable": lambda: (len(of(ONE, True)), len(of(ONE))),
    "detectable: named, or in the stated set": lambda: (of(ONE, True).outcome.isin(NAMED).sum(), len(of(ONE, True))),
    "detectable: named alone": lambda: ((of(ONE, True).outcome == "named").sum(), len(of(ONE, True))),
    "detectable: wrong name, or one too many": lambda: (
        of(ONE, True).outcome.isin(WRONG).sum(), len(of(ONE, True))),
    "too small to detect: wrong name": lambda: (of(ONE, False).outcome.isin(WRONG).sum(), len(of(ONE, False))),
    "two effects, both detectable: pair named, or in the set": lambda: (
        of("two effects", True).outcome.isin(NAMED).sum(), len(of("two effects", True))),
    "nothing hidden: false alarm": lambda: (
        of("nothing").outcome.isin(["wrong name", "none of these"]).sum(), len(of("nothing"))),
    "on no list, beyond the noise: abstained": lambda: (
        (of("an effect on no list", True).outcome != "wrong name").sum(), len(of("an effect on no list", True))),
    "on no list, within the noise: something named": lambda: (
        (of("an effect on no list", False).outcome == "wrong name").sum(), len(of("an effect on no list", False))),
    "another law: detectable": lambda: (len(of(OTHER, True)), len(of(OTHER))),
    "another law, detectable: right class named, in the set, or like it": lambda: (
        of(OTHER, True).outcome.isin(NAMED).sum(), len(of(OTHER, True))),
    "all sets: a wrong name standing alone": lambda: (
        ((SETS.answer == "an effect is missing") & SETS.outcome.isin(WRONG)).sum(), len(SETS)),
    "95 % intervals that hold the true size": held,
}  # fmt: skip


@pytest.mark.parametrize("what", ROWS)
def test_a_row_is_counted_anew(what):
    count, whole = ROWS[what]()
    first = PAGE.split("### ")[0]
    (row,) = [line for line in first.splitlines() if line.startswith(f"| {what}")]
    assert f"| {count} of {whole} |" in row


def test_the_page_says_how_many_sets():
    assert f"{len(SETS)} sets" in TEXT.split("###")[0]
    assert SETS.label.is_unique


def test_every_miss_among_the_detectable_is_told():
    """Of listed effects and other laws: each that is neither named nor in the set stands in the text by its name."""
    seen = SETS[(SETS.detectable.astype(str) == "True") & SETS.kind.isin([ONE, OTHER, "two effects"])]
    for label in seen[~seen.outcome.isin(NAMED)].label:
        assert label.partition(",")[0] in TEXT, label
