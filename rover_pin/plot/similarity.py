"""A rig set's channels as dimensionless numbers, over the groups on which they collapse."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rover_pin.experiments.wheel_rig.similarity import ANGLE, LOAD, SLIP, TRAVEL, Collapse, as_number, groups, simplest
from rover_pin.measurements.rig_set import RigSet
from rover_pin.plot.sheet import new_figure, save, write_csv

LABELS = {TRAVEL: "(r omega - V) / max(r omega, V)", ANGLE: "slip angle [rad]", LOAD: "ln W / (gamma b r^2)"}
"""What is drawn of a group, where that is not the group itself."""


def similarity_figure(data: RigSet, rows: Sequence[Collapse], out: Path) -> list[Path]:
    """Write similarity.csv, a row a channel and set of groups, and similarity.png into `out`; return their paths.

    The figure has each channel over the group that alone explains most, coloured by another of those it collapses on.
    """
    import pandas as pd

    chosen, values = simplest(list(rows)), groups(data)
    table = [
        {**row._asdict(), "groups": row.named, "chosen": chosen[row.channel] is row, "by_level": None} for row in rows
    ]
    csv = write_csv(pd.DataFrame(table).drop(columns="by_level"), out / "similarity.csv")
    figure, axes = new_figure(1, len(chosen), size=(4.4 * len(chosen), 3.9), squeeze=False)
    for axis, channel, (name, best) in zip(axes[0], data.channels, chosen.items(), strict=True):
        alone = [row for row in rows if row.channel == name and len(row.groups) == 1]
        first = max(alone, key=lambda row: row.share).groups[0]
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
