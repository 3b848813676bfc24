"""The loop on the measured wheels gives the results in `studies/results/measured_wheels.csv`, which the page shows."""

from pathlib import Path

import measured_wheels as study
import pandas as pd
import pytest

from rover_pin.loop.close import close_the_loop

ROOT = Path(__file__).parents[2]
KEPT = pd.read_csv(ROOT / "studies" / "results" / "measured_wheels.csv", keep_default_na=False).set_index("data")


def numbers(text):
    """Return every name with its number: probabilities of causes, or errors of channels in their units."""
    return {
        part.split()[0]: float(part.removesuffix(" N m").rstrip(" Nm").rsplit(" ", 1)[1]) for part in text.split("; ")
    }


@pytest.mark.nightly
@pytest.mark.parametrize("data", KEPT.index)
def test_the_loop_on_measured_wheels(data):
    folders = tuple(study.DATA / folder for folder in study.SETS[data])
    row = study.row_of(data, close_the_loop(folders if len(folders) > 1 else folders[0]))
    stored = KEPT.loc[data]
    assert row["answer"] == stored["answer"]
    assert row["sets"] == stored["sets"]
    for column in ("before", "after", "together"):
        assert numbers(row[column]) == pytest.approx(numbers(stored[column]), rel=0.02), column
    probabilities = numbers(row["families"])
    assert probabilities == pytest.approx(numbers(stored["families"]), abs=0.03)
