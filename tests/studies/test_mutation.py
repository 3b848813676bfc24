"""The page of the mutation run tells the tables that it wrote."""

from pathlib import Path

import pandas as pd

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "studies" / "results"
ROWS = pd.read_csv(RESULTS / "mutation.csv")
LEFT = pd.read_csv(RESULTS / "mutation_survivors.csv")


def test_the_page_tells_the_last_run_of_every_room():
    page = (ROOT / "CONTRIBUTING.md").read_text().partition("## What the tests notice")[2].partition("\n## ")[0]
    told = [[each.strip() for each in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("|")]
    columns = ["room", "changes", "tried", "not noticed"]
    assert told[0] == columns
    assert told[2:] == ROWS[columns].astype(str).to_numpy().tolist()


def test_what_was_not_noticed_is_listed():
    counted = LEFT.groupby("room").size().reindex(ROWS["room"], fill_value=0)
    assert counted.tolist() == ROWS["not noticed"].tolist()
