"""Tables of a blind test: as Markdown, and of how often what was said to act with a probability did act."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

SAID = 0.0, 0.1, 0.5, 0.9, 1.0
"""Ends of the classes of probabilities."""


def calibration(told: Sequence[tuple[Mapping[str, float], Sequence[str]]]) -> pd.DataFrame:
    """Return, of probabilities by name beside the true names: number, mean and share of true ones in each class."""
    said = [(chance, name in truth) for chances, truth in told for name, chance in chances.items()]
    rows = []
    for low, high in itertools.pairwise(SAID):
        inside = [row for row in said if low <= row[0] < high or (high == SAID[-1] and row[0] >= high)]
        if inside:
            rows.append([f"{low:g} to {high:g}", len(inside), *np.mean(inside, axis=0)])
    return pd.DataFrame(rows, columns=["said", "number", "mean_said", "share_true"])


def listed(chances: Mapping[str, float]) -> str:
    """Return probabilities by name in a line."""
    return "; ".join(f"{name} {chance:.2f}" for name, chance in chances.items())


def markdown(table: pd.DataFrame) -> str:
    """Return a table as Markdown."""
    cells = [[f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in row] for row in table.to_numpy()]
    lines = [list(map(str, table.columns)), ["---"] * len(table.columns), *cells]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
