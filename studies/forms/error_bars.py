"""Draw one error for each set, over all channels in units of their noise: the base, the law, and curves."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from forms.authors import AUTHORS
from forms.curves import BASELINES
from forms.one_soil import APART, FROM, ONE

BARS = {
    "base": ("#c9d6db", "base: the first law of each set's table"),
    "law": ("#1f6f8b", "law: the last one, named on the left"),
    "one soil": ("#7fb3c4", "laws of all sets with one soil under all wheels"),
    "quadratic": ("#d9a441", "quadratic"),
    "Gaussian process": ("#8f8f8f", "Gaussian process"),
    AUTHORS: ("#b5533c", "the authors' model, fitted to these runs"),
}
"""Bars of a set from top to bottom: colour and legend text."""
HEIGHT = 0.17


def last_law(errors: pd.Series) -> str:
    """Return the last law of a set's errors (by law) that is neither a curve nor the authors' model."""
    return str([law for law in errors.index if law not in (*BASELINES, AUTHORS)][-1])


def by_set(frame: pd.DataFrame) -> dict[str, tuple[str, dict[str, float]]]:
    """Return set -> its last law and the error in SDs of each bar; "one soil" if all sets were fitted together."""
    by_name: dict[str, tuple[str, dict[str, float]]] = {}
    for key, rows in frame.groupby("set", sort=False):
        name, errors = str(key), rows.set_index("law")["in_sds"]
        law = last_law(errors)
        # Sets that are predicted from others have no bar.
        if name.startswith((FROM, APART)):
            continue
        if name.startswith(ONE):
            by_name[name.removeprefix(ONE)][1]["one soil"] = float(errors[law])
        else:
            bars = {"base": float(errors.iloc[0]), "law": float(errors[law])}
            by_name[name] = law, bars | {bar: float(errors[bar]) for bar in BARS if bar in errors}
    return by_name


def draw_error_bars(frame: pd.DataFrame) -> plt.Figure:
    """Draw the held-out error of each set over all channels, each in units of its noise; 1 is the noise."""
    sets = by_set(frame)
    figure, axis = plt.subplots(figsize=(8.6, 1.1 + 0.95 * len(sets)), layout="constrained")
    in_legend: set[str] = set()
    for at, (_, errors) in enumerate(sets.values()):
        present = [bar for bar in BARS if bar in errors]
        for place, bar in enumerate(present):
            # The bars of a set are centred on its row.
            y, (colour, words) = at + (place - (len(present) - 1) / 2) * HEIGHT, BARS[bar]
            axis.barh(y, errors[bar], 0.9 * HEIGHT, color=colour, label="" if bar in in_legend else words)
            axis.annotate(f"{errors[bar]:.1f}", (errors[bar], y), (3, 0), textcoords="offset points", va="center",
                          fontsize=7)  # fmt: skip
            in_legend.add(bar)
    # An error of 1 is the noise of the measurement.
    axis.axvline(1.0, color="black", linewidth=0.8)
    axis.annotate("noise", (1.0, 1.0), (0, 2), xycoords=("data", "axes fraction"), textcoords="offset points",
                  ha="center", fontsize=8)  # fmt: skip
    axis.set_yticks(np.arange(len(sets)), [f"{name}\n{law}" for name, (law, _) in sets.items()], fontsize=8)
    axis.set(xlabel="held-out error of all channels, each in its noise [SD]", ylim=(len(sets) - 0.45, -0.55))
    axis.margins(x=0.06)
    axis.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside upper center", ncols=2, frameon=False, fontsize=8.5)
    return figure
