"""What the benchmarks measured last, with which tests compare what the documents say: studies/results/speed.csv."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

TABLE = Path(__file__).parents[1] / "results" / "speed.csv"


def reader(doc: str, quick: str) -> argparse.ArgumentParser:
    """Return the parser of a benchmark's options: `--quick`, with what it does, and `--keep`."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--keep", action="store_true", help="put the numbers into studies/results/speed.csv")
    return parser


def keep(found: Mapping[str, float]) -> None:
    """Put a benchmark's numbers into the table, in place of those that it put there before."""
    benchmark = Path(sys.argv[0]).stem
    kept = pd.read_csv(TABLE) if TABLE.exists() else pd.DataFrame({"benchmark": [], "name": [], "value": []})
    new = pd.DataFrame({"benchmark": benchmark, "name": list(found), "value": list(found.values())})
    table = pd.concat([kept[kept.benchmark != benchmark], new]).sort_values("benchmark", kind="stable")
    table.to_csv(TABLE, index=False, float_format="%.4g")
