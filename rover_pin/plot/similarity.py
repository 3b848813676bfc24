"""The figure of a wheel rig's channels, made dimensionless, against the dimensionless groups on which they depend."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rover_pin.experiments.wheel_rig.similarity import ANGLE, LOAD, SLIP, TRAVEL, Collapse, as_number, groups, simplest
from rover_pin.measurements.rig_set import RigSet
from rover_pin.plot.sheet import new_figure, save, write_csv

LABELS = {TRAVEL: "(r omega - V) / max(r omega, V)", ANGLE: "slip angle [rad]", LOAD: "ln W / (gamma b r^2)"}
"""Name of a dimensionless group -> label of its axis. The label of any other group is its name, which is its
formula."""


def similarity_figure(data: RigSet, rows: Sequence[Collapse], out: Path) -> list[Path]:
    """Write the table similarity.csv and the figure similarity.png of a wheel rig's data into a folder, and return both
    paths.

    The table has one row for each channel and each set of dimensionless groups. The figure shows each channel against
    the single group that explains most of its variation. The colour shows a second group on which the channel depends.

    Parameters
    ----------
    data : RigSet
        The measurements.
    rows : sequence of Collapse
        For each channel and each set of groups, the fraction of the channel's variation that the groups explain.
    out : Path
        Folder of the files.
    """
    import pandas as pd

    chosen, values = simplest(list(rows)), groups(data)
    table = [
        {**row._asdict(), "groups": row.named, "chosen": chosen[row.channel] is row, "by_level": None} for row in rows
    ]
    csv = write_csv(pd.DataFrame(table).drop(columns="by_level"), out / "similarity.csv")
    figure, axes = new_figure(1, len(chosen), size=(4.4 * len(chosen), 3.9), squeeze=False)
    for axis, channel, (name, best) in zip(axes[0], data.channels, chosen.items(), strict=True):
        # The horizontal axis is the single group that explains most of the channel's variation.
        alone = [row for row in rows if row.channel == name and len(row.groups) == 1]
        first = max(alone, key=lambda row: row.share).groups[0]
        # Travel and slip are functions of each other, so a colour for the one adds nothing to an axis for the other.
        drawn = {first, name, *((TRAVEL, SLIP) if first in (TRAVEL, SLIP) else ())}
        others = [group for group in (*best.groups, *values) if group not in drawn]
        over, by = values[first], values[others[0]] if others else np.zeros(len(data.runs))
        dots = axis.scatter(over, channel.measured / as_number(data, channel)[1], c=by, cmap="viridis", s=22)
        axis.set(xlabel=LABELS.get(first, first), ylabel=name)
        axis.set_title(f"{best.named}: {best.share:.1%}" if best.groups else "collapses on no group", fontsize=9)
        axis.grid(alpha=0.3)
        if others:
            figure.colorbar(dots, ax=axis, label=LABELS.get(others[0], others[0]))
    return [csv, save(figure, out / "similarity.png")]
