"""A batch study at a glance: its outcomes over each parameter, and over the first two at once."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from rover_pin.simulation.trace.draw import COLOURS

MAIN_OUTCOMES = ("distance_m", "mean_slip", "energy_motor_J", "max_pitch_deg")
"""Outcomes of a drive that are shown before others."""
MOST_OUTCOMES, MOST_PARAMETERS, MOST_KINDS = 3, 4, 4
MARKERS = "os^DvP"
UNITS = {"m": "m", "s": "s", "J": "J", "deg": "deg", "W": "W", "N": "N"}
"""Ends of an outcome's name that are its unit."""


class Shown(NamedTuple):
    """A parameter as it is drawn: its values, its label, and whether its axis is logarithmic."""

    values: np.ndarray
    label: str
    log: bool = False


def study_figure(name: str, table: Any, units: Mapping[str, str], logarithmic: Sequence[str] = ()) -> Figure:
    """Return the figure of a study's table.

    Parameters
    ----------
    name : str
        Of the study.
    table : DataFrame
        As `collect` gives it: a row a case, `error` set where it failed.
    units : mapping
        Parameter -> its unit, in the study's order.
    logarithmic : sequence of str
        Parameters that were spread by their logarithms.

    Returns
    -------
    Figure
        A row of maps where two numbers or more were varied, one a kind, and a row an outcome with a column a parameter.
    """
    done = table[table["error"].isna()]
    numbers = {
        parameter: _shown_parameter(done[parameter], parameter, units[parameter], parameter in logarithmic)
        for parameter in units
        if _varies(done, parameter)
    }
    kinds, kind = _kinds(done, [parameter for parameter in units if parameter not in numbers])
    outcomes = _outcomes(done, units)
    columns = list(numbers.values())[:MOST_PARAMETERS] or [Shown(np.arange(len(done)), "case")]
    maps = len(columns) > 1 and bool(outcomes)
    heights = [1.25] * maps + [1.0] * max(len(outcomes), 1)
    figure = Figure(figsize=(10.0, 0.6 + 2.6 * sum(heights)), layout="constrained")
    failed = f", {len(table) - len(done)} failed and are not shown" if len(done) < len(table) else ""
    figure.suptitle(f"{name}: {len(table)} cases{failed}", fontsize=11)
    parts = np.atleast_1d(figure.subfigures(len(heights), 1, height_ratios=heights))
    if maps:
        _maps(parts[0], columns, done[outcomes[0]].to_numpy(float), outcomes[0], kinds, kind)
    for n, (part, outcome) in enumerate(zip(parts[maps:], outcomes, strict=False)):
        _row(part, columns, done[outcome].to_numpy(float), outcome, kinds, kind if n == 0 else "")
    return figure


def _varies(table: Any, name: str) -> bool:
    values = table[name]
    return values.dtype.kind in "fi" and values.nunique() > 1


def _shown_parameter(values: Any, name: str, unit: str, log: bool) -> Shown:
    """Return a parameter in what a reader counts in: angles in degrees."""
    numbers = values.to_numpy(float)
    if unit == "rad":
        return Shown(np.degrees(numbers), f"{name} [deg]", log)
    return Shown(numbers, f"{name} [{unit}]" if unit else name, log)


def _kinds(table: Any, names: list[str]) -> tuple[np.ndarray, str]:
    """Return which kind each case is of, by the first word that was varied, and that word's name."""
    for name in names:
        if 1 < table[name].nunique() <= len(COLOURS):
            return table[name].astype(str).to_numpy(), name
    return np.full(len(table), ""), ""


def _outcomes(table: Any, units: Mapping[str, str]) -> list[str]:
    """Return the outcomes to show: numbers that differ from case to case, what is asked of drives first."""
    inside = list(table.columns).index("key") + 1 if "key" in table.columns else 0
    names = [name for name in table.columns[inside:] if name not in units and _varies(table, name)]
    return sorted(names, key=lambda name: (name not in MAIN_OUTCOMES, _place(name), names.index(name)))[:MOST_OUTCOMES]


def _place(name: str) -> int:
    return MAIN_OUTCOMES.index(name) if name in MAIN_OUTCOMES else 0


def _label(outcome: str) -> str:
    words, _, unit = outcome.rpartition("_")
    return f"{words.replace('_', ' ')} [{UNITS[unit]}]" if unit in UNITS and words else outcome.replace("_", " ")


def _maps(part: Any, columns: list[Shown], outcome: np.ndarray, name: str, kinds: np.ndarray, kind: str) -> None:
    """Draw an outcome as a colour over the first two parameters, one map a kind."""
    x, y = columns[:2]
    drawn_kinds = list(dict.fromkeys(sorted(kinds)))[:MOST_KINDS]
    scale = Normalize(np.nanmin(outcome), np.nanmax(outcome))
    panels = part.subplots(1, len(drawn_kinds), sharey=True, squeeze=False)[0]
    for axes, category in zip(panels, drawn_kinds, strict=True):
        mask = kinds == category
        axes.scatter(x.values[mask], y.values[mask], c=outcome[mask], cmap="cividis", norm=scale, s=42, ec="k", lw=0.3)
        axes.set(xlabel=x.label, ylabel=y.label if axes is panels[0] else "")
        axes.set_title(f"{kind} = {category}" if kind else "", fontsize=9)
        _set_scales(axes, x, y)
    part.colorbar(ScalarMappable(scale, "cividis"), ax=list(panels), label=_label(name))


def _row(part: Any, columns: list[Shown], outcome: np.ndarray, name: str, kinds: np.ndarray, kind: str) -> None:
    """Draw an outcome over each parameter; kinds differ by colour and mark."""
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
                label=category,
            )
        axes.set(xlabel=column.label, ylabel=_label(name) if axes is panels[0] else "")
        _set_scales(axes, column)
    if kind:
        panels[-1].legend(title=kind, fontsize=7, title_fontsize=7)


def _set_scales(axes: Axes, x: Shown, y: Shown | None = None) -> None:
    axes.grid(alpha=0.3)
    axes.set_xscale("log" if x.log else "linear")
    if y is not None:
        axes.set_yscale("log" if y.log else "linear")
