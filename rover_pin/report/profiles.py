"""The pictures of a report's profiles: how fast chi2 rises along each fitted parameter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from rover_pin.estimation.profile import NORMAL_95, Profile
from rover_pin.estimation.wording import in_words
from rover_pin.report.svg import AFTER, GREY


def profiles_figure(profiles: Sequence[Profile], intervals: Sequence[tuple[float, float]]) -> tuple[Figure, ...]:
    """Return one small panel a number: the rise of chi2, the limit of the 95 % interval, the interval [SI]."""
    return tuple(_panel(profile, ends) for profile, ends in zip(profiles, intervals, strict=True))


def _panel(profile: Profile, ends: tuple[float, float]) -> Figure:
    figure = Figure(figsize=(2.7, 2.3), layout="constrained")
    axis = figure.subplots()
    factor, unit = in_words(profile.unit)
    low, high = ends
    axis.axvspan(factor * low, factor * high, color=GREY, alpha=0.2, lw=0)
    axis.plot(factor * np.array(profile.values), profile.rises, "o-", color=AFTER, lw=1.4, ms=3)
    axis.axhline(NORMAL_95**2, color="k", lw=0.8, ls="--")
    name = profile.name.replace(".", ".\n") if len(profile.name) > 18 else profile.name
    axis.set(xlabel=f"{name} [{unit or '-'}]", ylabel="rise of chi2", ylim=(0, 2.2 * NORMAL_95**2))
    axis.xaxis.set_major_locator(MaxNLocator(4))
    axis.grid(alpha=0.25)
    return figure
