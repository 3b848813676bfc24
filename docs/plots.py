"""Pictures of the pages: drawn from `studies/results` when the site is built, as the numbers are put in.

Each name in `PICTURES` is a file of `plots/` in the site.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

from blind_sets import SHARES
from matplotlib.figure import Figure
from mkdocs.structure.files import File, Files
from page_numbers import MEASURED, kept, study_of
from page_tables import CONTROLS
from scipy.stats import binomtest

BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#bbbbbb"
"""Colours that a colour-blind reader tells from each other (Okabe and Ito)."""


def on_files(files: Files, config: Any) -> Files:
    """Add the pictures."""
    for name, draw in PICTURES.items():
        written = io.BytesIO()
        draw().savefig(written, format=name.partition(".")[2])
        files.append(File.generated(config, f"plots/{name}", content=written.getvalue()))
    return files


def control() -> Figure:
    """Return what becomes of the drives of each controller."""
    drives = kept("controllers")
    figure = Figure(figsize=(8.0, 2.6), layout="constrained")
    axes = figure.subplots()
    for row, name in enumerate(reversed(CONTROLS)):
        part = drives[drives.control == name]
        passed, buried = int(part.passed.sum()), int(part.buried.sum())
        widths = (passed, len(part) - passed - buried, buried)
        lefts = (0, passed, len(part) - buried)
        axes.barh([row] * 3, widths, left=lefts, color=(BLUE, GREY, ORANGE), height=0.7)
    axes.set_yticks(range(len(CONTROLS)), reversed(CONTROLS))
    axes.set(xlabel="drives", xlim=(0, len(drives[drives.control == CONTROLS[0]])))
    for colour, label in ((BLUE, "passed"), (GREY, "neither"), (ORANGE, "buried")):
        axes.barh(0, 0, color=colour, label=label)
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    return figure


def shares() -> Figure:
    """Return the shares of blind sets with 95 % intervals, each next to its target."""
    aims = {what: aim for what, (aim, _) in SHARES.items() if aim}
    figure = Figure(figsize=(8.0, 0.46 * len(aims) + 1.0), layout="constrained")
    axes = figure.subplots()
    tables = {
        "wheel rigs": kept("blind_rig", keep_default_na=False),
        "logs": kept("blind_drives", keep_default_na=False),
    }
    for (label, sets), colour, shift in zip(tables.items(), (BLUE, ORANGE), (0.15, -0.15), strict=True):
        for row, what in enumerate(reversed(aims)):
            count, whole = SHARES[what][1](sets)
            if whole:
                interval = binomtest(count, whole).proportion_ci(method="wilson")
                axes.plot([100 * interval.low, 100 * interval.high], [row + shift] * 2, color=colour)
                axes.plot(100 * count / whole, row + shift, "o", color=colour)
        axes.plot([], [], "o-", color=colour, label=f"{label}, {len(sets)} sets")
    for row, aim in enumerate(reversed(aims.values())):
        low, high = aim_range(aim)
        axes.fill_between([low, high], row - 0.4, row + 0.4, color="0.85", lw=0, label="target" if row == 0 else None)
    axes.set_yticks(range(len(aims)), [what.replace(":", ":\n", 1) for what in reversed(aims)], fontsize=9.5)
    axes.set(xlabel="share of sets, 95 % interval [%]", xlim=(-2, 102))
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    return figure


def aim_range(aim: str) -> tuple[float, float]:
    """Return the range [%] of an aim as the table writes it: `>= 97 %`, `<= 2 %`, `92-98 %`."""
    words = aim.removesuffix(" %")
    if words[:2] in (">=", "<="):
        limit = float(words[2:])
        return (limit, 100.0) if words.startswith(">=") else (0.0, limit)
    low, high = words.split("-")
    return float(low), float(high)


def wheels() -> Figure:
    """Return held-out errors on measured wheels in SDs of the noise: the law, and two curves without physics."""
    table = kept("wheel_laws").set_index(["set", "law"]).in_sds
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    axes = figure.subplots()
    named = {"the law": MEASURED, "quadratic": dict.fromkeys(MEASURED, "quadratic")}
    named["Gaussian process"] = dict.fromkeys(MEASURED, "Gaussian process")
    for (label, laws), colour, shift in zip(named.items(), (BLUE, GREY, ORANGE), (-0.27, 0.0, 0.27), strict=True):
        heights = [table[name, law] for name, law in laws.items()]
        axes.bar([at + shift for at in range(len(MEASURED))], heights, width=0.25, color=colour, label=label)
    axes.set_xticks(range(len(MEASURED)), MEASURED, rotation=20, ha="right")
    axes.set(ylabel="held-out error [SDs of the noise]")
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    return figure


def ditches() -> Figure:
    """Return the map of Fig 10, as its study draws it."""
    drawn: Figure = study_of("fig10_ditch").draw_map(kept("fig10_map"))
    return drawn


PICTURES: dict[str, Callable[[], Figure]] = {
    "control.svg": control,
    "shares.svg": shares,
    "wheels.svg": wheels,
    "ditches.png": ditches,
}
