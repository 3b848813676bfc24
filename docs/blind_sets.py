"""Tables of the blind sets: every count anew from the rows that `studies/results` keeps."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from statistics import median

import pandas as pd
from scipy.stats import binomtest

NAMED = ["named", "in the set"]
WRONG = ["wrong name", "with one that is not there"]
OPEN = "a set in which nothing is"
ABSTAINED = ["nothing named", "none of these"]
ONE, OTHER, TWO, NO, NOTHING = (
    "one effect", "a listed effect by another law", "two effects", "an effect on no list", "nothing",
)  # fmt: skip
MAX_LISTED = 9
"""Sets of an answer that a row lists, besides the last."""
Count = tuple[int, int]


def of_kind(sets: pd.DataFrame, kind: str, detectable: bool | None = None) -> pd.DataFrame:
    """Return the blind sets that hide one kind."""
    rows = sets[sets.kind == kind]
    return rows if detectable is None else rows[rows.detectable.astype(str) == str(detectable)]


def share(sets: pd.DataFrame, outcomes: list[str]) -> Count:
    """Return how many sets have one of the outcomes."""
    return int(sets.outcome.isin(outcomes).sum()), len(sets)


def intervals_held(sets: pd.DataFrame) -> Count:
    """Return how many of the stated intervals hold the truth."""
    found = stated_sizes(sets)
    return sum(low <= true <= high for true, _, low, high in found), len(found)


def size_error(sets: pd.DataFrame) -> float:
    """Return by how many percent of the true size the stated sizes are off in the median."""
    return 100.0 * median(abs(size / true - 1.0) for true, size, _, _ in stated_sizes(sets))


def stated_sizes(sets: pd.DataFrame) -> list[tuple[float, ...]]:
    """Return each true size with that stated and the ends of its interval."""
    found = re.findall(r"([-+.\de]+): (\S+) \[(\S+), (\S+)\]", " ; ".join(sets.sizes))
    return [tuple(map(float, numbers)) for numbers in found]


def loss(sets: pd.DataFrame, name: str) -> pd.Series:
    """Return a loss on fresh runs, NaN where there is none."""
    return pd.to_numeric(sets[f"loss_{name}"], errors="coerce")


def as_good_as_truth(sets: pd.DataFrame) -> Count:
    """Return in how many answered sets the loss is within 5 % of the true effect's."""
    answered = sets[sets.outcome.isin([*NAMED, *WRONG]) & loss(sets, "oracle").notna()]
    return int((loss(answered, "after") <= 1.05 * loss(answered, "oracle")).sum()), len(answered)


def improved(sets: pd.DataFrame) -> Count:
    """Return in how many sets the loss is less than the base model's."""
    return int((loss(sets, "after") < loss(sets, "before")).sum()), len(sets)


def refit_improves(sets: pd.DataFrame) -> pd.DataFrame:
    """Return the sets in which the right law's refit has less loss than the base model."""
    return sets[loss(sets, "oracle") < loss(sets, "before")]


def told_unknown(sets: pd.DataFrame) -> Count:
    """Return in how many sets nothing is named, or something else is said to act."""
    return int((sets.outcome.isin(ABSTAINED) | (sets.acts_besides.astype(str) == "True")).sum()), len(sets)


def listed(sets: pd.DataFrame) -> Count:
    """Return how many sets have what they hide named, in the set, or among what stays open."""
    left_open = sets[sets.answer == "cannot tell"]
    also = sum(row.truth in row.alike.split(" or ") for row in left_open.itertuples())
    return share(sets, NAMED)[0] + also, len(sets)


OUTSIDE = "effect outside the library, above the noise: no name, or a note that something else acts"
SHARES: dict[str, tuple[str, Callable[[pd.DataFrame], Count]]] = {
    "one hidden effect: detectable": ("", lambda sets: (len(of_kind(sets, ONE, True)), len(of_kind(sets, ONE)))),
    "detectable effect: the answer, or in its list": (">= 97 %", lambda sets: share(of_kind(sets, ONE, True), NAMED)),
    "detectable effect: named alone": (">= 80 %", lambda sets: share(of_kind(sets, ONE, True), ["named"])),
    'detectable effect: the answer, in its list, or listed after "cannot tell"': (
        "", lambda sets: listed(of_kind(sets, ONE, True))),
    "detectable effect: a wrong name, or one name too many": (
        "<= 2 %", lambda sets: share(of_kind(sets, ONE, True), WRONG)),
    "effect too small to detect: wrong name": ("", lambda sets: share(of_kind(sets, ONE, False), WRONG)),
    "two detectable effects: the pair is the answer, or in its list": (
        ">= 85 %", lambda sets: share(of_kind(sets, TWO, True), NAMED)),
    'nothing hidden: false alarm (a name, or "none of these")': (
        "<= 2 %", lambda sets: share(of_kind(sets, NOTHING), ["wrong name", OPEN, "none of these"])),
    "effect outside the library, above the noise: no name": (
        "", lambda sets: share(of_kind(sets, NO, True), ABSTAINED)),
    OUTSIDE: (
        ">= 95 %", lambda sets: told_unknown(of_kind(sets, NO, True))),
    "effect outside the library, within the noise: a name": (
        "", lambda sets: share(of_kind(sets, NO, False), ["wrong name", OPEN])),
    "effect by another formula: detectable": (
        "", lambda sets: (len(of_kind(sets, OTHER, True)), len(of_kind(sets, OTHER)))),
    'detectable effect by another formula: right class named, in the list, or "like" it': (
        ">= 90 %", lambda sets: share(of_kind(sets, OTHER, True), NAMED)),
    "all sets: a wrong name as the only answer": ("<= 0.5 %", lambda sets: (
        int(((sets.answer == "an effect is missing") & sets.outcome.isin(WRONG)).sum()), len(sets))),
    "95 % intervals that contain the true size": ("92-98 %", intervals_held),
    "loss on fresh runs within 5 % of a fit with the true effect": (
        ">= 95 %", lambda sets: as_good_as_truth(of_kind(sets, ONE, True))),
    "detectable effect by another formula: loss on fresh runs below that of the base model": (
        ">= 95 %", lambda sets: improved(of_kind(sets, OTHER, True))),
    "of these, sets in which a fit with the right formula also has a lower loss": (
        "", lambda sets: improved(refit_improves(of_kind(sets, OTHER, True)))),
}  # fmt: skip


def shares(sets: pd.DataFrame) -> str:
    """Return the table of shares of blind sets, with 95 % Wilson intervals."""
    rows = ["| Share | Count | Per cent, 95 % interval | Target |", "| --- | --- | --- | --- |"]
    for what, (aim, counted) in SHARES.items():
        count, whole = counted(sets)
        if not whole:
            continue
        low, high = binomtest(count, whole).proportion_ci(method="wilson")
        rows.append(
            f"| {what} | {count} of {whole} | {100 * count / whole:.1f} % [{100 * low:.1f}, {100 * high:.1f}] | {aim} |"
        )
    return "\n".join(rows)


def counts(sets: pd.DataFrame) -> dict[str, tuple[str, str]]:
    """Return the counts that the front page states."""
    names = {
        "named": "detectable effect: the answer, or in its list",
        "alarms": 'nothing hidden: false alarm (a name, or "none of these")',
        "abstained": OUTSIDE,
        "intervals": "95 % intervals that contain the true size",
        "laws": 'detectable effect by another formula: right class named, in the list, or "like" it',
        "pairs": "two detectable effects: the pair is the answer, or in its list",
        "wrong": "all sets: a wrong name as the only answer",
    }
    found = {name: SHARES[what][1](sets) for name, what in names.items()}
    return {name: (str(count), str(whole)) for name, (count, whole) in found.items()}


def misses(sets: pd.DataFrame) -> str:
    """Return the table of sets that are neither right nor silent: the detectable ones, and every wrong name."""
    seen = (sets.detectable.astype(str) == "True") & sets.kind.isin([ONE, OTHER, TWO]) & ~sets.outcome.isin(NAMED)
    rows = ["| Set | Hidden | Answer | Listed causes |", "| --- | --- | --- | --- |"]
    for row in sets[seen | sets.outcome.isin([OPEN, *WRONG])].itertuples():
        label = row.label.replace("[]", "").replace("[", "(").replace("]", ")")
        rows.append(f"| {label} | {row.truth or row.kind} | {row.answer} | {abridged(row.alike) or '-'} |")
    return "\n".join(rows)


def abridged(alike: str) -> str:
    """Return the sets of an answer, of many the first and the last."""
    *first, last = alike.split(" or ")
    more = len(first) - MAX_LISTED
    return alike if more < 2 else " or ".join([*first[:MAX_LISTED], f"{more} others", last])


SAID = 0.0, 0.1, 0.5, 0.9, 1.0
"""Ends of the classes of stated probabilities."""


def reliability(sets: pd.DataFrame) -> str:
    """Return how often causes of a stated probability acted, as a table and a picture (SVG).

    Of sets that hide effects of the list, or nothing: every cause that was given 0.01 or more, and the true ones.
    """
    own = sets[sets.kind.isin([ONE, TWO, NOTHING])]
    said = [
        (float(chance), name in row.truth.split(" + "))
        for row in own.itertuples()
        for name, _, chance in (entry.rpartition(" ") for entry in row.inclusion.split("; ") if entry)
    ]
    rows, places, off = (
        ["| Stated probability | Causes | Mean stated probability | Share that acted |", "| --- | --- | --- | --- |"],
        [],
        0.0,
    )
    for low, high in pairwise(SAID):
        inside = [row for row in said if low <= row[0] < high or row[0] == high == SAID[-1]]
        mean, acted = (sum(row[at] for row in inside) / max(len(inside), 1) for at in (0, 1))
        rows.append(f"| {low:g} to {high:g} | {len(inside)} | {mean:.3f} | {acted:.3f} |")
        interval = binomtest(round(acted * len(inside)), max(len(inside), 1)).proportion_ci(method="wilson")
        places.append((mean, acted, interval.low, interval.high))
        off += len(inside) * abs(mean - acted) / len(said)
    return (
        "\n".join(rows)
        + "\n\nThe mean absolute difference between stated probability and share, weighted by the number of causes, "
        + f"is {off:.3f}.\n\n"
        + diagram(places)
    )


def diagram(places: list[tuple[float, float, float, float]]) -> str:
    """Return a reliability diagram: share that acted, with its 95 % interval, over the mean stated probability."""
    size, margin = 200, 40
    x, y = (lambda said: margin + size * said), (lambda acted: 10 + size * (1.0 - acted))
    marks = [
        f'<path d="M{x(mean):.1f} {y(low):.1f}V{y(high):.1f}" stroke="#1f77b4"/>'
        f'<circle cx="{x(mean):.1f}" cy="{y(acted):.1f}" r="4" fill="#1f77b4"/>'
        for mean, acted, low, high in places
    ]
    return (
        f'<svg viewBox="0 0 {size + margin + 20} {size + margin + 10}" width="320" role="img" fill="none" '
        'font-size="11" aria-label="Share that acted over the stated probability">'
        f'<rect x="{margin}" y="10" width="{size}" height="{size}" stroke="currentColor"/>'
        f'<path d="M{x(0)} {y(0)}L{x(1)} {y(1)}" stroke="currentColor" stroke-dasharray="4"/>{"".join(marks)}'
        f'<text x="{x(0.5)}" y="{y(0) + 25}" fill="currentColor" text-anchor="middle">stated probability</text>'
        f'<text x="12" y="{y(0.5)}" fill="currentColor" text-anchor="middle" transform="rotate(-90 12 {y(0.5)})">'
        "share that acted</text>"
        f'<g fill="currentColor" text-anchor="middle"><text x="{x(0)}" y="{y(0) + 12}">0</text>'
        f'<text x="{x(1)}" y="{y(0) + 12}">1</text><text x="{margin - 8}" y="16">1</text></g></svg>'
    )


def by_circumstance(sets: pd.DataFrame) -> str:
    """Return, for each circumstance of drive logs, right answers, false alarms and wrong names that stand alone."""
    names = sets.label.str.extract(r"\((\w+)\)$")[0].fillna("none")
    rows = [
        "| Circumstance | Sets | Right | False alarms | Wrong name as the only answer |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, part in sets.groupby(names, sort=False):
        real = pd.concat([of_kind(part, kind, True) for kind in (ONE, OTHER)])
        (right, seen), (alarms, nulls) = (
            share(real, NAMED),
            share(of_kind(part, NOTHING), ["wrong name", OPEN, "none of these"]),
        )
        alone = ((part.answer == "an effect is missing") & part.outcome.isin(WRONG)).sum()
        rows.append(f"| {name} | {len(part)} | {right} of {seen} | {alarms} of {nulls} | {alone} |")
    return "\n".join(rows)
