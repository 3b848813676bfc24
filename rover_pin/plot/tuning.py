"""Figures of a tuning: the cost of each training and held-out drive under each control, and the drives that fail."""

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
from rover_pin.simulation.trace.draw import COLOURS

LOOKS = {
    "constant duty": ("|", "#000000"),
    "torque check": ("s", COLOURS[1]),
    "before": ("^", COLOURS[3]),
    "tuned": ("o", COLOURS[0]),
}
"""Beginning of a control's name -> marker and colour of this control."""


def tuning_figure(table: Any, title: str) -> Figure:
    """Return the figure of the costs of a tuning: one panel for the training drives and one for the held-out drives.

    A panel has one line for each drive and a marker for each control. Further to the left is better.

    Parameters
    ----------
    table : DataFrame
        One row for each drive under each control, with the columns `set` (training or held out), `drive`, `control` and
        `cost`.
    title : str
        Title of the figure.
    """
    sets = list(dict.fromkeys(table["set"]))
    drives = {set_name: list(dict.fromkeys(table[table["set"] == set_name]["drive"])) for set_name in sets}
    heights = [len(names) + 1 for names in drives.values()]
    figure = Figure(figsize=(10.0, 1.6 + 0.32 * sum(heights)), layout="constrained")
    figure.suptitle(figure_text(title), fontsize=10)
    panels = figure.subplots(len(sets), 1, height_ratios=heights, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, sets, strict=True):
        _panel(axes, table[table["set"] == name], drives[name])
        axes.set_title(figure_text(name), fontsize=9, loc="left")
    panels[-1].set_xlabel("cost of the drive (less is better)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure


def frontier_figure(table: Any, trials: Sequence[tuple[float, float]], estimate: str) -> Figure:
    """Return the figure of the fraction of drives that get through against the fraction of drives that bury a wheel.

    There is one panel for the training drives and one for the held-out drives. Up and to the left is better.

    Parameters
    ----------
    table : DataFrame
        One row for each drive under each control, with the columns `set` (training or held out), `drive`, `control`,
        `stuck` and `buried`.
    trials : sequence of (passed, buried)
        Fractions of the training drives that pass and that bury a wheel, for each set of gains that the search tried.
    estimate : str
        Name of the slip estimate that the control feeds back.
    """
    sets = list(dict.fromkeys(table["set"]))
    figure = Figure(figsize=(5.0 * len(sets), 4.2), layout="constrained")
    panels = figure.subplots(1, len(sets), sharex=True, sharey=True, squeeze=False)[0]
    for axes, name in zip(panels, sets, strict=True):
        if name == "training":
            passed, buried = zip(*trials, strict=True) if trials else ((), ())
            style = {"ls": "", "marker": ".", "color": "#bbbbbb", "label": "tried in the search"}
            axes.plot([100.0 * share for share in buried], [100.0 * share for share in passed], **style)
        rows = table[table["set"] == name]
        for control in ("constant duty", "torque check", f"before, {estimate}", f"tuned, {estimate}"):
            group = rows[rows["control"] == control]
            marker, colour = next(look for start, look in LOOKS.items() if control.startswith(start))
            # "Gets through" is the opposite of stuck.
            point = 100.0 * group["buried"].mean(), 100.0 * (1.0 - group["stuck"].mean())
            axes.plot(*point, ls="", marker=marker, ms=9, mec=colour, mfc=colour, mew=2.0, label=figure_text(control))
        # The table has a row for each drive and control.
        n = len(rows) // rows["control"].nunique()
        axes.set_title(f"{figure_text(name)}: {n} drives", fontsize=9, loc="left")
        axes.set_xlabel("drives that bury a wheel [%]")
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("drives that get through [%]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure


def _panel(axes: Axes, rows: Any, drives: list[str]) -> None:
    """Draw the training drives or the held-out drives: for each drive, a grey line spans its costs under all controls,
    with a marker for each control.

    The marker of a control is hollow if the control uses an estimated slip.
    """
    # The first drive is at the top.
    places = {drive: -n for n, drive in enumerate(drives)}
    for drive, group in rows.groupby("drive"):
        axes.plot([group["cost"].min(), group["cost"].max()], [places[drive]] * 2, color="#cccccc", lw=1, zorder=1)
    for control in dict.fromkeys(rows["control"]):
        group = rows[rows["control"] == control]
        marker, colour = next(look for start, look in LOOKS.items() if control.startswith(start))
        # The name of a slip control ends in its slip estimate, as in "tuned, onboard"; "true" is no estimate.
        is_estimated = ", " in control and not control.endswith("true")
        name = figure_text(f"{control} slip" if ", " in control else control)
        axes.plot(
            group["cost"], [places[drive] for drive in group["drive"]], ls="", label=name, marker=marker, ms=7,
            mec=colour, mfc="none" if is_estimated else colour, mew=1.5, zorder=2,
        )  # fmt: skip
    axes.set_yticks(list(places.values()), list(places), fontsize=8)
    axes.set_ylim(-len(drives) + 0.4, 0.6)
    axes.grid(alpha=0.3, axis="x")
