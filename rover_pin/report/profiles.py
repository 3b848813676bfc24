"""The picture of a report's profiles: how fast chi2 rises along each fitted parameter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from rover_pin.estimation.profile import NORMAL_95, Profile
from rover_pin.estimation.wording import in_words
from rover_pin.report.page import AFTER, GREY

ACROSS = 4


def profiles_figure(profiles: Sequence[Profile], intervals: Sequence[tuple[float, float]]) -> Figure:
    """Return one small panel a number: the rise of chi2, the limit of the 95 % interval, the interval [SI]."""
    count = len(profiles)
    rows = -(-count // ACROSS)
    figure = Figure(figsize=(2.65 * min(count, ACROSS) + 0.4, 2.3 * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, min(count, ACROSS), squeeze=False)).ravel()
    for axis, one, (low, high) in zip(axes, profiles, intervals, strict=False):
        factor, unit = in_words(one.unit)
        values = factor * np.array(one.values)
        axis.axvspan(factor * low, factor * high, color=GREY, alpha=0.2, lw=0)
        axis.plot(values, one.rises, "o-", color=AFTER, lw=1.4, ms=3)
        axis.axhline(NORMAL_95**2, color="k", lw=0.8, ls="--")
        axis.set(xlabel=f"{one.name.replace('.', '.' + chr(10)) if len(one.name) > 18 else one.name} [{unit or '-'}]")
        axis.set_ylim(0, 2.2 * NORMAL_95**2)
        axis.xaxis.set_major_locator(MaxNLocator(4))
        axis.grid(alpha=0.25)
    for axis in axes[count:]:
        axis.set_axis_off()
    for axis in axes[::ACROSS]:
        axis.set_ylabel("rise of chi2")
    return figure
