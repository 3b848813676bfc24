"""Scores of a blind test: what was hidden against what was answered, counted with 95 % Wilson intervals.

Question
    How often is a hidden effect named, named within a set, missed, or taken for another? How often is something named
    where nothing was hidden? How good are the sizes, and the predictions on runs that were not fitted?
Method
    Plain records, one a set, made by `blind_rig.py` (and by any other blind test), which says what of it counts as
    detectable: what is smaller cannot be found by anyone. Probabilities are of sets of listed effects or of nothing.
Result
    Run alone, it scores nine made-up records, to show the tables; the results stand in the blind tests.
What the paper says
    Nothing: it compares by eye and traces no effect.
What differs
    An answer is right where the true effect stands in the stated set, alone or with others. Sizes are scored where the
    first answer is the truth. A pair of which one alone is named is neither right nor wrong.

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
    """What was hidden in a set."""

    SINGLE = "one effect"
    PAIR = "two effects"
    NULL = "nothing"
    OFF_LIST = "an effect on no list"
    OTHER_LAW = "a listed effect by another law"


class Outcome(Enum):
    """What an answer is worth."""

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
    """A fitted size of a hidden effect with its 95 % interval, and the true one."""

    name: str
    true: float
    fitted: float
    low: float
    high: float

    @property
    def covered(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= self.true <= self.high

    @property
    def error(self) -> float:
        """|fitted / true - 1|."""
        return abs(self.fitted / self.true - 1)


@dataclass(frozen=True)
class Case:
    """One set of a blind test; names of effects are those of their classes."""

    label: str
    kind: Kind
    truth: tuple[str, ...]
    "names of the hidden effects; of another law any that is right; for what is on no list, a name for the table"
    answer: Answer
    alike: tuple[tuple[str, ...], ...]
    "the answered candidates, each the names of its effects"
    detectable: bool
    sizes: tuple[Size, ...] = ()
    before: float = math.nan
    "loss on runs that were not fitted: base model, model with the answer, model with the true effect refitted"
    after: float = math.nan
    oracle: float = math.nan
    inclusion: dict[str, float] = field(default_factory=dict)
    "probability of each effect that may act, and of the true ones"
    acts_besides: bool = False
    "whether something else is said to act, whatever is named"

    @property
    def told(self) -> bool:
        """Whether anything was named, alone, in a set or as what it is like."""
        return self.answer in (Answer.NAMED, Answer.SET, Answer.LIKE)

    @property
    def outcome(self) -> Outcome:
        """What the answer is worth."""
        if not self.told:
            return Outcome.UNKNOWN if self.answer is Answer.NONE_FITS else Outcome.SILENT
        truth, answers = set(self.truth), [set(one) for one in self.alike]
        names_none = self.kind in (Kind.NULL, Kind.OFF_LIST)
        if names_none or not any(truth & one for one in answers):
            return Outcome.OPEN if names_none and {"nothing"} in answers else Outcome.WRONG
        if self.kind is Kind.OTHER_LAW:
            right = any(one <= truth for one in answers)
            return Outcome.EXTRA if not right else Outcome.RIGHT if len(answers) == 1 else Outcome.IN_SET
        if truth in answers:
            return Outcome.RIGHT if len(answers) == 1 else Outcome.IN_SET
        return Outcome.PART if any(one < truth for one in answers) else Outcome.EXTRA


class Row(NamedTuple):
    """A share of cases with its 95 % Wilson interval, and what was aimed at."""

    what: str
    count: int
    of: int
    aim: str = ""

    @property
    def text(self) -> str:
        """The share and its interval in percent."""
        if not self.of:
            return "-"
        low, high = wilson(self.count, self.of)
        return f"{100 * self.count / self.of:.1f} % [{100 * low:.1f}, {100 * high:.1f}]"


def wilson(count: int, of: int) -> tuple[float, float]:
    """Return the 95 % Wilson interval of a share; of > 0."""
    low, high = binomtest(count, of).proportion_ci(method="wilson")
    return float(low), float(high)


def shares(cases: Sequence[Case]) -> list[Row]:
    """Return the shares that a blind test is judged by."""
    parts = {
        kind: [[case for case in cases if case.kind is kind and case.detectable is one] for one in (True, False)]
        for kind in Kind
    }
    (seen, unseen), (both, apart) = parts[Kind.SINGLE], parts[Kind.PAIR]
    (off, quiet), (other, faint), (_, null) = parts[Kind.OFF_LIST], parts[Kind.OTHER_LAW], parts[Kind.NULL]
    pairs = both + apart
    answered = [case for case in seen if case.told and math.isfinite(case.oracle)]
    sizes = [size for case in cases for size in case.sizes]
    false_alone = sum(one.answer is Answer.NAMED and one.outcome in (Outcome.WRONG, Outcome.EXTRA) for one in cases)

    def row(what: str, group: Sequence[Case], *wanted: Outcome, aim: str = "") -> Row:
        return Row(what, sum(case.outcome in wanted for case in group), len(group), aim)

    def met(what: str, group: Sequence[Case], meets: Callable[[Case], bool], aim: str = "") -> Row:
        return Row(what, sum(map(meets, group)), len(group), aim)

    right = (Outcome.RIGHT, Outcome.IN_SET)
    return [
        Row("one effect: detectable", len(seen), len(seen + unseen)),
        row("detectable: named alone", seen, Outcome.RIGHT),
        row("detectable: named, or in the stated set", seen, *right, aim=">= 97 %"),
        row("detectable: named with a second that is not there", seen, Outcome.EXTRA),
        row("detectable: wrong name", seen, Outcome.WRONG, aim="<= 2 %"),
        row("detectable: missed", seen, Outcome.SILENT, Outcome.UNKNOWN),
        row("too small to detect: wrong name", unseen, Outcome.WRONG, Outcome.EXTRA),
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
    """Return, for each true effect, how far sizes and held-out losses are off: medians and 90th percentiles."""
    rows = []
    seen = [case for case in cases if case.detectable and case.kind in (Kind.SINGLE, Kind.PAIR)]
    for name in sorted({name for case in seen for name in case.truth}):
        own = [case for case in seen if name in case.truth]
        error = [size.error for case in own for size in case.sizes if size.name.startswith(f"{name}.")]
        rows.append([name, len(own), *_spread(error), *_spread([case.after / case.oracle for case in own])])
    single = [case for case in seen if case.kind is Kind.SINGLE]
    error = [size.error for case in seen for size in case.sizes]
    rows.append(["all", len(seen), *_spread(error), *_spread([case.after / case.oracle for case in single])])
    names = ["effect", "detectable", "size_error_median", "size_error_90", "loss_to_oracle_median", "loss_to_oracle_90"]
    return pd.DataFrame(rows, columns=names)


def _spread(values: Sequence[float]) -> tuple[float, float]:
    known = [value for value in values if math.isfinite(value)]
    return (float(np.median(known)), float(np.quantile(known, 0.9))) if known else (math.nan, math.nan)


def recovered(cases: Sequence[Case]) -> float:
    """Return the median of (before - after) / (before - oracle) over the detectable single effects."""
    of = [case for case in cases if case.kind is Kind.SINGLE and case.detectable and case.before > case.oracle]
    return float(np.median([(one.before - one.after) / (one.before - one.oracle) for one in of])) if of else math.nan


def confusion(cases: Sequence[Case]) -> pd.DataFrame:
    """Return counts: rows the truth (detectable only), columns the first answer, or that there was none."""
    counts: Counter[tuple[str, str]] = Counter()
    for case in cases:
        if case.detectable or case.kind is Kind.NULL:
            first = " + ".join(sorted(case.alike[0])) if case.told else case.outcome.value
            inside = case.outcome in (Outcome.RIGHT, Outcome.IN_SET)
            counts[_truth(case), "true one, or in the set" if inside else first] += 1
    if not counts:
        return pd.DataFrame()
    table = pd.Series(counts).unstack(fill_value=0)
    return table[sorted(table.columns, key=lambda name: (not name.startswith("true"), name))]


def _truth(case: Case) -> str:
    named = {Kind.PAIR: "a pair", Kind.NULL: "nothing", Kind.OTHER_LAW: case.label.partition(",")[0]}
    return named.get(case.kind, " + ".join(case.truth))


def shares_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Return the shares as a table for readers."""
    cells = [(row.what, f"{row.count} of {row.of}", row.text, row.aim) for row in rows]
    return pd.DataFrame(cells, columns=["what", "count", "share, 95 %", "aim"])


def publish(cases: Sequence[Case], out: Path) -> None:
    """Print the tables, and write them as Markdown and every case as CSV."""
    out.mkdir(parents=True, exist_ok=True)
    tables = [shares_table(shares(cases)), confusion(cases).reset_index(names="hidden"), quality(cases)]
    own = [case for case in cases if case.kind in (Kind.SINGLE, Kind.PAIR, Kind.NULL)]
    tables.append(calibration([(case.inclusion, case.truth) for case in own]))
    for table in tables:
        print(table.to_string(index=False), end="\n\n")
    print(f"share of the excess loss that is recovered, median: {recovered(cases):.3f}")
    (out / "scores.md").write_text("\n\n".join(markdown(table) for table in tables) + "\n", encoding="utf-8")
    pd.DataFrame([_flat(case) for case in cases]).to_csv(out / "cases.csv", index=False, float_format="%.6g")
    print(f"written: {out / 'scores.md'} and {out / 'cases.csv'}")


def _flat(case: Case) -> dict[str, object]:
    return {
        "label": case.label,
        "kind": case.kind.value,
        "truth": " + ".join(case.truth),
        "answer": case.answer.value,
        "alike": " or ".join(" + ".join(one) for one in case.alike),
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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the same: it takes no time")
    parser.add_argument("--out", type=Path, default=Path("out/blind_score"))
    options = parser.parse_args()
    right = Size("Digging.c", 0.05, 0.052, 0.04, 0.06)
    digs, alike = ("Digging",), (("Digging",),)
    made = [Case(f"made {i}", Kind.SINGLE, digs, Answer.NAMED, alike, True, (right,), 3.0, 1.02, 1.0) for i in range(7)]
    made += [Case("made 7", Kind.SINGLE, digs, Answer.NONE_NEEDED, (), False)]
    publish([*made, Case("made 8", Kind.NULL, (), Answer.NAMED, alike, False)], options.out)


if __name__ == "__main__":
    main()
