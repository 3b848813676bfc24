"""The two tables of the mutation study agree with each other."""

from pathlib import Path

import pandas as pd

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "studies" / "results"
ROWS = pd.read_csv(RESULTS / "mutation.csv")
LEFT = pd.read_csv(RESULTS / "mutation_survivors.csv")


def test_unnoticed_mutations_are_listed():
    counted = LEFT.groupby("room").size().reindex(ROWS["room"], fill_value=0)
    assert counted.tolist() == ROWS["not noticed"].tolist()
