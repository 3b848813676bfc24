"""What docs/validation.md says of blind sets against the sets that were kept: each count anew from the rows."""

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
PARTS = {part.partition("\n")[0]: part.partition("\n### ")[0] for part in PAGE.split("\n## ")}
KEPT = {"Wheel-rig sets": "blind_rig.csv", "Drive logs": "blind_drives.csv"}
SETS = {part: pd.read_csv(ROOT / "studies" / "results" / name, keep_default_na=False) for part, name in KEPT.items()}
NAMED = ["named", "in the set"]
WRONG = ["wrong name", "with one that is not there"]
ONE, OTHER, TWO, NO, NOTHING = (
    "one effect", "a listed effect by another law", "two effects", "an effect on no list", "nothing",
)  # fmt: skip


def of(sets, kind, detectable=None):
    own = sets[sets.kind == kind]
    return own if detectable is None else own[own.detectable.astype(str) == str(detectable)]


def share(sets, outcomes):
    return sets.outcome.isin(outcomes).sum(), len(sets)


def held(sets):
    """How many stated intervals hold the truth, of how many."""
    found = re.findall(r"([-+.\de]+): \S+ \[(\S+), (\S+)\]", " ; ".join(sets.sizes))
    return sum(float(low) <= float(true) <= float(high) for true, low, high in found), len(found)


def numbers(column):
    return pd.to_numeric(column, errors="coerce")


def as_good(sets):
    told = sets[sets.outcome.isin([*NAMED, *WRONG]) & numbers(sets.loss_oracle).notna()]
    return (numbers(told.loss_after) <= 1.05 * numbers(told.loss_oracle)).sum(), len(told)


def better(sets):
    return (numbers(sets.loss_after) < numbers(sets.loss_before)).sum(), len(sets)


ROWS = {
    "one effect: detectable": lambda sets: (len(of(sets, ONE, True)), len(of(sets, ONE))),
    "detectable: named, or in the stated set": lambda sets: share(of(sets, ONE, True), NAMED),
    "detectable: named alone": lambda sets: share(of(sets, ONE, True), ["named"]),
    "detectable: wrong name, or one too many": lambda sets: share(of(sets, ONE, True), WRONG),
    "too small to detect: wrong name": lambda sets: share(of(sets, ONE, False), WRONG),
    "two effects, both detectable: pair named, or in the set": lambda sets: share(of(sets, TWO, True), NAMED),
    "nothing hidden: false alarm": lambda sets: share(of(sets, NOTHING), ["wrong name", "none of these"]),
    "on no list, beyond the noise: abstained": lambda sets: (
        (of(sets, NO, True).outcome != "wrong name").sum(), len(of(sets, NO, True))),
    "on no list, within the noise: something named": lambda sets: share(of(sets, NO, False), ["wrong name"]),
    "another law: detectable": lambda sets: (len(of(sets, OTHER, True)), len(of(sets, OTHER))),
    "another law, detectable: right class named, in the set, or like it": lambda sets: share(
        of(sets, OTHER, True), NAMED),
    "all sets: a wrong name standing alone": lambda sets: (
        ((sets.answer == "an effect is missing") & sets.outcome.isin(WRONG)).sum(), len(sets)),
    "95 % intervals that hold the true size": held,
    "loss on fresh runs within 5 % of the true effect's refit": lambda sets: as_good(of(sets, ONE, True)),
    "another law, detectable: loss on fresh runs less than the base's": lambda sets: better(of(sets, OTHER, True)),
    "of these, where that of the right law's refit is less too": lambda sets: better(
        of(sets, OTHER, True)[lambda rows: numbers(rows.loss_oracle) < numbers(rows.loss_before)]),
}  # fmt: skip


ALL = SETS | {"Rigs and logs together": pd.concat(SETS.values())}


@pytest.mark.parametrize("part", ALL)
@pytest.mark.parametrize("what", ROWS)
def test_a_row_is_counted_anew(what, part):
    count, whole = ROWS[what](ALL[part])
    (row,) = [line for line in PARTS[part].splitlines() if line.startswith(f"| {what}")]
    assert f"| {count} of {whole} |" in row


@pytest.mark.parametrize("part", SETS)
def test_the_page_says_how_many_sets(part):
    assert f"{len(SETS[part])} sets" in PARTS[part]
    assert SETS[part].label.is_unique


@pytest.mark.parametrize("part", SETS)
def test_every_miss_among_the_detectable_is_told(part):
    """Of listed effects and other laws: each that is neither named nor in the set stands in the text by its name."""
    sets = SETS[part]
    seen = sets[(sets.detectable.astype(str) == "True") & sets.kind.isin([ONE, OTHER, TWO])]
    for label in [*seen[~seen.outcome.isin(NAMED)].label, *sets[sets.outcome == "wrong name"].label]:
        assert label.partition(",")[0] in " ".join(PARTS[part].split()), label


FRONT = (ROOT / "README.md").read_text(encoding="utf-8").replace("**", "")


def test_front_page_states_results_of_other_laws_and_pairs():
    laws = ROWS["another law, detectable: right class named, in the set, or like it"](SETS["Wheel-rig sets"])
    pairs = ROWS["two effects, both detectable: pair named, or in the set"](SETS["Wheel-rig sets"])
    assert f"By other laws {laws[0]} of {laws[1]} rigs (80 %), of pairs {pairs[0]} of {pairs[1]}." in FRONT
