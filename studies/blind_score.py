"""Score a blind test: compare the hidden effects with the answers, and count the outcomes with 95 % Wilson intervals.

Question
    How often does an answer name the hidden effect alone, include the effect in a set, miss it, or name another effect?
    How often does an answer name an effect where none was hidden? How accurate are the fitted sizes and the predictions
    on runs that were not fitted?
Method
    The input is one plain record for each set, from `blind_rig.py` or another blind test. The blind test also states
    which sets are detectable: no method can find a smaller effect. Probabilities are those of sets of listed effects
    and of the empty set.
Result
    This script alone scores nine invented records to show the tables. The results of the project are those of the blind
    tests.
What the paper says
    The paper compares curves by eye and identifies no effect.
What differs
    An answer is right if the stated set contains the true effect, alone or with others. Sizes are scored only where the
    first answer is the true one. If an answer names only one effect of a hidden pair, the answer counts neither as
    right nor as wrong.

Run: python studies/blind_score.py [--quick] [--out DIR]
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from kept.tables import calibration, listed, markdown
from scipy.stats import binomtest

from rover_pin.discrepancy.answer import Answer


class Kind(Enum):
    """The kind of effect that was hidden in a simulated data set."""

    SINGLE = "one effect"
    PAIR = "two effects"
    NULL = "nothing"
    OFF_LIST = "an effect on no list"
    OTHER_LAW = "a listed effect by another law"


class Outcome(Enum):
    """The score of an answer."""

    RIGHT = "named"
    IN_SET = "in the set"
    EXTRA = "with one that is not there"
    PART = "one of two"
    WRONG = "wrong name"
    OPEN = "a set in which nothing is"
    UNKNOWN = "none of these"
    SILENT = "nothing named"


@dataclass(frozen=True)
class Size:
    """The fitted size of a hidden effect with its 95 % interval, and the true size."""

    name: str
    true: float
    fitted: float
    low: float
    high: float

    @property
    def covered(self) -> bool:
        """Return whether the 95 % interval contains the true size."""
        return self.low <= self.true <= self.high

    @property
    def error(self) -> float:
        """Return the relative error |fitted / true - 1|."""
        return abs(self.fitted / self.true - 1)


@dataclass(frozen=True)
class Case:
    """One data set of a blind test (a test in which the search does not know the hidden effect). An effect's name is
    the name of its class.
    """

    label: str
    kind: Kind
    truth: tuple[str, ...]
    """Names of the hidden effects. If the effect follows another formula than the package's, all names that count as
    right; if the package's catalogue does not contain the effect, a label."""
    answer: Answer
    alike: tuple[tuple[str, ...], ...]
    """The sets of effects that the answer states as possible, each given by the names of its effects."""
    detectable: bool
    sizes: tuple[Size, ...] = ()
    before: float = math.nan
    """Held-out loss of the base model (`before`), of the model with the effects of the answer (`after`), and of the
    model that was fitted with the true effects (`oracle`)."""
    after: float = math.nan
    oracle: float = math.nan
    inclusion: dict[str, float] = field(default_factory=dict)
    """Probability of each effect that may be active, and of each true effect."""
    acts_besides: bool = False
    """Whether the answer reports that an unknown effect acts in addition to the named effects."""

    @property
    def told(self) -> bool:
        """Return whether the answer names an effect: as the only possible effect, as one of several possible effects,
        or as the effect of the catalogue that is most similar to the unknown effect.
        """
        return self.answer in (Answer.NAMED, Answer.SET, Answer.LIKE)

    @property
    def outcome(self) -> Outcome:
        """Return the score of the answer."""
        if not self.told:
            return Outcome.UNKNOWN if self.answer is Answer.NONE_FITS else Outcome.SILENT
        truth, answers = set(self.truth), [set(candidate) for candidate in self.alike]
        # Nothing on the list is right here, so every named effect is wrong unless the set includes "nothing".
        names_none = self.kind in (Kind.NULL, Kind.OFF_LIST)
        if names_none or not any(truth & candidate for candidate in answers):
            return Outcome.OPEN if names_none and {"nothing"} in answers else Outcome.WRONG
        # Several listed effects are right for a cause that follows another law; an answer may name any of them.
        if self.kind is Kind.OTHER_LAW:
            right = any(candidate <= truth for candidate in answers)
            return Outcome.EXTRA if not right else Outcome.RIGHT if len(answers) == 1 else Outcome.IN_SET
        if truth in answers:
            return Outcome.RIGHT if len(answers) == 1 else Outcome.IN_SET
        return Outcome.PART if any(candidate < truth for candidate in answers) else Outcome.EXTRA


class Row(NamedTuple):
    """A row of the table of shares: number of cases with a property, number of all cases, and the target share."""

    what: str
    count: int
    of: int
    aim: str = ""

    @property
    def text(self) -> str:
        """Return the share and its 95 % interval in percent, or "-" if there are no cases."""
        if not self.of:
            return "-"
        low, high = wilson(self.count, self.of)
        return f"{100 * self.count / self.of:.1f} % [{100 * low:.1f}, {100 * high:.1f}]"


def wilson(count: int, of: int) -> tuple[float, float]:
    """Return the 95 % Wilson interval of the share count / of, for of > 0."""
    low, high = binomtest(count, of).proportion_ci(method="wilson")
    return float(low), float(high)


def shares(cases: Sequence[Case]) -> list[Row]:
    """Return the shares that summarise a blind test."""
    # Cases by kind, first the detectable ones and then the others.
    parts = {
        kind: [[case for case in cases if case.kind is kind and case.detectable is item] for item in (True, False)]
        for kind in Kind
    }
    (detectable, undetectable), (both, single_of_pair) = parts[Kind.SINGLE], parts[Kind.PAIR]
    (off, quiet), (other, faint), (_, null) = parts[Kind.OFF_LIST], parts[Kind.OTHER_LAW], parts[Kind.NULL]
    pairs = both + single_of_pair
    answered = [case for case in detectable if case.told and math.isfinite(case.oracle)]
    # Effects on no list: `off` exceeds the noise and `quiet` does not.
    sizes = [size for case in cases for size in case.sizes]
    false_alone = sum(item.answer is Answer.NAMED and item.outcome in (Outcome.WRONG, Outcome.EXTRA) for item in cases)

    def row(what: str, group: Sequence[Case], *wanted: Outcome, aim: str = "") -> Row:
        return Row(what, sum(case.outcome in wanted for case in group), len(group), aim)

    def met(what: str, group: Sequence[Case], meets: Callable[[Case], bool], aim: str = "") -> Row:
        return Row(what, sum(map(meets, group)), len(group), aim)

    right = (Outcome.RIGHT, Outcome.IN_SET)
    return [
        Row("one effect: detectable", len(detectable), len(detectable + undetectable)),
        row("detectable: named alone", detectable, Outcome.RIGHT),
        row("detectable: named, or in the stated set", detectable, *right, aim=">= 97 %"),
        row("detectable: named with a second that is not there", detectable, Outcome.EXTRA),
        row("detectable: wrong name", detectable, Outcome.WRONG, aim="<= 2 %"),
        row("detectable: missed", detectable, Outcome.SILENT, Outcome.UNKNOWN),
        row("too small to detect: wrong name", undetectable, Outcome.WRONG, Outcome.EXTRA),
        Row("two effects: both detectable", len(both), len(pairs)),
        row("both detectable: pair named, or in the set", both, *right),
        row("both detectable: one of the two", both, Outcome.PART),
        row("two effects: a wrong name or a third", pairs, Outcome.WRONG, Outcome.EXTRA),
        row("nothing hidden: something named (false alarm)", null, Outcome.WRONG, Outcome.OPEN, aim="<= 2 %"),
        row("nothing hidden: called unknown", null, Outcome.UNKNOWN),
        row("on no list, beyond the noise: abstained", off, Outcome.UNKNOWN, Outcome.SILENT),
        met("the same, or something acts besides", off, lambda case: not case.told or case.acts_besides, ">= 95 %"),
        row("on no list, within the noise: something named", quiet, Outcome.WRONG, Outcome.OPEN),
        Row("another law: detectable", len(other), len(other + faint)),
        row("another law, detectable: the right class named, in the set, or like it", other, *right, aim=">= 80 %"),
        row("another law, detectable: a wrong name", other, Outcome.WRONG, Outcome.EXTRA),
        row("another law, too small: a wrong name", faint, Outcome.WRONG, Outcome.EXTRA),
        Row("all sets: a wrong name standing alone", false_alone, len(cases), "<= 2 %"),
        met("loss on fresh runs within 5 % of the true effect's", answered, _as_good, ">= 95 %"),
        met("another law: loss on fresh runs less than the base's", other, _better),
        Row("95 % intervals that hold the true size", sum(s.covered for s in sizes), len(sizes), "90 to 99 %"),
    ]


_as_good: Callable[[Case], bool] = lambda case: case.after <= 1.05 * case.oracle  # noqa: E731
_better: Callable[[Case], bool] = lambda case: case.after < case.before  # noqa: E731


def quality(cases: Sequence[Case]) -> pd.DataFrame:
    """Return a table with one row for each true effect: the median and the 90th percentile of the size errors and of
    the held-out losses.
    """
    rows = []
    detectable = [case for case in cases if case.detectable and case.kind in (Kind.SINGLE, Kind.PAIR)]
    # One row for each true effect; an effect of a pair enters its own row.
    for name in sorted({name for case in detectable for name in case.truth}):
        matching = [case for case in detectable if name in case.truth]
        error = [size.error for case in matching for size in case.sizes if size.name.startswith(f"{name}.")]
        rows.append([name, len(matching), *_spread(error), *_spread([case.after / case.oracle for case in matching])])
    # Over all sets, the ratio of losses uses single effects only.
    single = [case for case in detectable if case.kind is Kind.SINGLE]
    error = [size.error for case in detectable for size in case.sizes]
    rows.append(["all", len(detectable), *_spread(error), *_spread([case.after / case.oracle for case in single])])
    names = ["effect", "detectable", "size_error_median", "size_error_90", "loss_to_oracle_median", "loss_to_oracle_90"]
    return pd.DataFrame(rows, columns=names)


def _spread(values: Sequence[float]) -> tuple[float, float]:
    """Return median and 90th percentile of the finite values; NaN if there are none."""
    finite = [value for value in values if math.isfinite(value)]
    return (float(np.median(finite)), float(np.quantile(finite, 0.9))) if finite else (math.nan, math.nan)


def recovered(cases: Sequence[Case]) -> float:
    """Return the median of (before - after) / (before - oracle) over the sets with one detectable hidden effect: the
    fraction of the possible improvement that the answer achieves.
    """
    of = [case for case in cases if case.kind is Kind.SINGLE and case.detectable and case.before > case.oracle]
    return (
        float(np.median([(item.before - item.after) / (item.before - item.oracle) for item in of])) if of else math.nan
    )


def confusion(cases: Sequence[Case]) -> pd.DataFrame:
    """Return a table that counts the answers. The rows are the detectable true effects, and the sets without a hidden
    effect. The first column counts the right answers, and the other columns count all other answers by the first effect
    that they state, or by their score if they state no effect.
    """
    counts: Counter[tuple[str, str]] = Counter()
    for case in cases:
        # A cause below the noise says nothing about the names, so it is left out.
        if case.detectable or case.kind is Kind.NULL:
            first = " + ".join(sorted(case.alike[0])) if case.told else case.outcome.value
            inside = case.outcome in (Outcome.RIGHT, Outcome.IN_SET)
            counts[_truth(case), "true one, or in the set" if inside else first] += 1
    if not counts:
        return pd.DataFrame()
    table = pd.Series(counts).unstack(fill_value=0)
    # Right answers come first, the other names in alphabetical order.
    return table[sorted(table.columns, key=lambda name: (not name.startswith("true"), name))]


def _truth(case: Case) -> str:
    """Return the row of the confusion table that a case belongs to."""
    named = {Kind.PAIR: "a pair", Kind.NULL: "nothing", Kind.OTHER_LAW: case.label.partition(",")[0]}
    return named.get(case.kind, " + ".join(case.truth))


def shares_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Return the shares as a table of text."""
    cells = [(row.what, f"{row.count} of {row.of}", row.text, row.aim) for row in rows]
    return pd.DataFrame(cells, columns=["what", "count", "share, 95 %", "aim"])


def publish(cases: Sequence[Case], out: Path) -> None:
    """Print the tables, and write them as Markdown and every case as a CSV row."""
    out.mkdir(parents=True, exist_ok=True)
    tables = [shares_table(shares(cases)), confusion(cases).reset_index(names="hidden"), quality(cases)]
    # Unlisted effects and other laws have no true name, so they do not enter the calibration.
    listed_cases = [case for case in cases if case.kind in (Kind.SINGLE, Kind.PAIR, Kind.NULL)]
    tables.append(calibration([(case.inclusion, case.truth) for case in listed_cases]))
    for table in tables:
        print(table.to_string(index=False), end="\n\n")
    print(f"share of the excess loss that is recovered, median: {recovered(cases):.3f}")
    (out / "scores.md").write_text("\n\n".join(markdown(table) for table in tables) + "\n", encoding="utf-8")
    pd.DataFrame([_flat(case) for case in cases]).to_csv(out / "cases.csv", index=False, float_format="%.6g")
    print(f"written: {out / 'scores.md'} and {out / 'cases.csv'}")


def _flat(case: Case) -> dict[str, object]:
    """Return a case as one row of cases.csv."""
    return {
        "label": case.label,
        "kind": case.kind.value,
        "truth": " + ".join(case.truth),
        "answer": case.answer.value,
        "alike": " or ".join(" + ".join(candidate) for candidate in case.alike),
        "outcome": case.outcome.value,
        "detectable": case.detectable,
        "loss_before": case.before,
        "loss_after": case.after,
        "loss_oracle": case.oracle,
        "inclusion": listed(case.inclusion),
        "acts_besides": case.acts_besides,
        "sizes": "; ".join(f"{s.name} {s.true:.5g}: {s.fitted:.5g} [{s.low:.5g}, {s.high:.5g}]" for s in case.sizes),
    }


def main() -> None:
    """Score nine invented data sets, and print and write the tables of the scores."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the same: it takes no time")
    parser.add_argument("--out", type=Path, default=Path("out/blind_score"))
    options = parser.parse_args()
    # Seven right answers, one miss and one false alarm.
    right = Size("Digging.c", 0.05, 0.052, 0.04, 0.06)
    digs, names = ("Digging",), (("Digging",),)
    cases = [
        Case(f"made {i}", Kind.SINGLE, digs, Answer.NAMED, names, True, (right,), 3.0, 1.02, 1.0) for i in range(7)
    ]
    cases += [Case("made 7", Kind.SINGLE, digs, Answer.NONE_NEEDED, (), False)]
    publish([*cases, Case("made 8", Kind.NULL, (), Answer.NAMED, names, False)], options.out)


if __name__ == "__main__":
    main()
