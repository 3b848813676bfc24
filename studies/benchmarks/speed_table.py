"""The latest results of the benchmarks, with which tests compare the documents: studies/results/speed.csv."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

TABLE = Path(__file__).parents[1] / "results" / "speed.csv"


def reader(doc: str, quick: str) -> argparse.ArgumentParser:
    """Return the parser of a benchmark's options: `--quick`, with the given help text, and `--keep`."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--keep", action="store_true", help="put the numbers into studies/results/speed.csv")
    return parser


def keep(measured: Mapping[str, float]) -> None:
    """Write a benchmark's numbers to the table, in place of its earlier numbers."""
    benchmark = Path(sys.argv[0]).stem
    stored = pd.read_csv(TABLE) if TABLE.exists() else pd.DataFrame({"benchmark": [], "name": [], "value": []})
    new = pd.DataFrame({"benchmark": benchmark, "name": list(measured), "value": list(measured.values())})
    table = pd.concat([stored[stored.benchmark != benchmark], new]).sort_values("benchmark", kind="stable")
    table.to_csv(TABLE, index=False, float_format="%.4g")
