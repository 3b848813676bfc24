"""Tables of a blind test: Markdown, and the calibration of stated probabilities."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

SAID = 0.0, 0.1, 0.5, 0.9, 1.0
"""Limits of the classes into which `calibration` sorts the stated probabilities."""


def calibration(cases: Sequence[tuple[Mapping[str, float], Sequence[str]]]) -> pd.DataFrame:
    """Return a table that shows whether stated probabilities are right. For each class of probabilities it lists the
    number of probabilities, their mean, and the share of the causes that are true.

    Each case is given by the probabilities of its causes (name of the cause -> probability) and by the names of its
    true causes.
    """
    pairs = [(probability, name in truth) for chances, truth in cases for name, probability in chances.items()]
    rows = []
    for low, high in itertools.pairwise(SAID):
        # The last class includes a probability of exactly 1.
        inside = [row for row in pairs if low <= row[0] < high or (high == SAID[-1] and row[0] >= high)]
        if inside:
            rows.append([f"{low:g} to {high:g}", len(inside), *np.mean(inside, axis=0)])
    return pd.DataFrame(rows, columns=["said", "number", "mean_said", "share_true"])


def listed(chances: Mapping[str, float]) -> str:
    """Return a line of text with each name and its probability."""
    return "; ".join(f"{name} {probability:.2f}" for name, probability in chances.items())


def markdown(table: pd.DataFrame) -> str:
    """Return a table as Markdown."""
    cells = [[f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in row] for row in table.to_numpy()]
    lines = [list(map(str, table.columns)), ["---"] * len(table.columns), *cells]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
