"""The figure of a batch study: its outcomes against each varied parameter, and maps over the first two parameters."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from rover_pin.base.encode import figure_text
from rover_pin.simulation.trace.draw import COLOURS

MAIN_OUTCOMES = ("distance_m", "mean_slip", "energy_motor_J", "max_pitch_deg")
"""Outcomes of a drive that the figure shows first, before other outcomes."""
MAX_OUTCOMES, MAX_PARAMETERS, MAX_KINDS = 3, 4, 4
"""The figure shows at most MAX_OUTCOMES outcomes (one row each), MAX_PARAMETERS parameters (one column each) and
MAX_KINDS kinds of case (one colour map each). It omits all others, because smaller panels could not be read."""
MARKERS = "os^DvP"
"""Markers of the kinds of case, in matplotlib's notation."""
UNITS = {"m": "m", "s": "s", "J": "J", "deg": "deg", "W": "W", "N": "N"}
"""Last part of an outcome's name, such as m in distance_m -> unit of the outcome."""


class StudyParameter(NamedTuple):
    """A varied parameter of a study: its value in each case, the label of its axis, and whether the axis is
    logarithmic.
    """

    values: np.ndarray
    label: str
    log: bool = False


def study_figure(name: str, table: Any, units: Mapping[str, str], logarithmic: Sequence[str] = ()) -> Figure:
    """Return the figure of a batch study.

    A row of maps shows the first outcome over the first two numeric parameters, one map for each kind of case. Below
    the maps, each outcome has a row with one panel for each parameter. The kinds of case are the values of the first
    varied parameter that is a text, such as the name of a soil.

    Parameters
    ----------
    name : str
        Name of the study.
    table : DataFrame
        The table that `collect` returns: one row for each case. A row of a failed case has a text in the column
        `error`.
    units : mapping of parameter -> unit
        The varied parameters in the order of the study.
    logarithmic : sequence of str
        Parameters that were sampled on a logarithmic scale.
    """
    done = table[table["error"].isna()]
    numbers: dict[str, StudyParameter] = {}
    for parameter, unit in units.items():
        # Parameters that are numbers become axes; angles are shown in degrees.
        if _varies(done, parameter):
            values, log = done[parameter].to_numpy(float), parameter in logarithmic
            if unit == "rad":
                values, unit = np.degrees(values), "deg"
            numbers[parameter] = StudyParameter(values, f"{parameter} [{unit}]" if unit else parameter, log)
    # The first varied text, such as the name of a soil, divides the cases into kinds, which differ by colour.
    words = [parameter for parameter in units if parameter not in numbers]
    kind = next((word for word in words if 1 < done[word].nunique() <= len(COLOURS)), "")
    kinds = done[kind].astype(str).to_numpy() if kind else np.full(len(done), "")
    # The outcomes are the numbers that differ from case to case: first the main ones, then the others in the order of
    # the table. They follow the column "key"; the columns before it describe the case.
    first = list(table.columns).index("key") + 1 if "key" in table.columns else 0
    varying = [column for column in table.columns[first:] if column not in units and _varies(done, column)]
    main = [column for column in MAIN_OUTCOMES if column in varying]
    outcomes = [*main, *(column for column in varying if column not in main)][:MAX_OUTCOMES]
    columns = list(numbers.values())[:MAX_PARAMETERS] or [StudyParameter(np.arange(len(done)), "case")]
    has_maps = len(columns) > 1 and bool(outcomes)
    heights = [1.25] * has_maps + [1.0] * max(len(outcomes), 1)
    figure = Figure(figsize=(10.0, 0.6 + 2.6 * sum(heights)), layout="constrained")
    failed = f", {len(table) - len(done)} failed and are not shown" if len(done) < len(table) else ""
    figure.suptitle(f"{figure_text(name)}: {len(table)} cases{failed}", fontsize=11)
    parts = np.atleast_1d(figure.subfigures(len(heights), 1, height_ratios=heights))
    if has_maps:
        # Maps of the first outcome over the first two parameters, one map for each kind of case. All maps share one
        # colour scale, so that their colours can be compared.
        (x, y), outcome = columns[:2], done[outcomes[0]].to_numpy(float)
        drawn_kinds = list(dict.fromkeys(sorted(kinds)))[:MAX_KINDS]
        scale = Normalize(np.nanmin(outcome), np.nanmax(outcome))
        panels = parts[0].subplots(1, len(drawn_kinds), sharey=True, squeeze=False)[0]
        for axes, category in zip(panels, drawn_kinds, strict=True):
            mask, label = kinds == category, y.label if axes is panels[0] else ""
            axes.scatter(
                x.values[mask], y.values[mask], c=outcome[mask], cmap="cividis", norm=scale, s=42, ec="k", lw=0.3
            )
            axes.set(xlabel=x.label, ylabel=label)
            axes.set_title(figure_text(f"{kind} = {category}") if kind else "", fontsize=9)
            _set_scales(axes, x, y)
        parts[0].colorbar(ScalarMappable(scale, "cividis"), ax=list(panels), label=_label(outcomes[0]))
    for n, (part, column) in enumerate(zip(parts[has_maps:], outcomes, strict=False)):
        _row(part, columns, done[column].to_numpy(float), column, kinds, kind if n == 0 else "")
    return figure


def _varies(table: Any, name: str) -> bool:
    """Return whether a column of a table contains numbers that differ from case to case."""
    values = table[name]
    return values.dtype.kind in "fi" and values.nunique() > 1


def _label(outcome: str) -> str:
    """Return the name of an outcome in words with its unit, such as "mean slip" or "energy motor [J]"."""
    words, _, unit = outcome.rpartition("_")
    return f"{words.replace('_', ' ')} [{UNITS[unit]}]" if unit in UNITS and words else outcome.replace("_", " ")


def _row(
    part: Any, columns: list[StudyParameter], outcome: np.ndarray, name: str, kinds: np.ndarray, kind: str
) -> None:
    """Draw a row of panels with an outcome against each parameter. Kinds of case differ by colour and marker.

    `part` is the subfigure, `name` is the name of the outcome, `kinds` has the kind of each case, and `kind` is the
    title of the legend (no legend if empty).
    """
    panels = part.subplots(1, len(columns), sharey=True, squeeze=False)[0]
    for axes, column in zip(panels, columns, strict=True):
        for n, category in enumerate(sorted(set(kinds))):
            mask = kinds == category
            axes.scatter(
                column.values[mask],
                outcome[mask],
                s=16,
                alpha=0.8,
                lw=0,
                color=COLOURS[n],
                marker=MARKERS[n % 6],
                label=figure_text(str(category)),
            )
        axes.set(xlabel=column.label, ylabel=_label(name) if axes is panels[0] else "")
        _set_scales(axes, column)
    if kind:
        panels[-1].legend(title=kind, fontsize=7, title_fontsize=7)


def _set_scales(axes: Axes, x: StudyParameter, y: StudyParameter | None = None) -> None:
    """Draw a grid, and make the axes of parameters with a logarithmic scale logarithmic."""
    axes.grid(alpha=0.3)
    axes.set_xscale("log" if x.log else "linear")
    if y is not None:
        axes.set_yscale("log" if y.log else "linear")
