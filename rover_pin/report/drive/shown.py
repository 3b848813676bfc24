"""The picture of the first screen: what one channel leaves, along what it goes with, where the added effect shows."""

from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from rover_pin.estimation.wording import in_words
from rover_pin.experiments.unlisted.actions import Scene
from rover_pin.experiments.unlisted.residual import signals
from rover_pin.report.drive.runs import LOOKS, Sides, words_of
from rover_pin.report.section import Picture
from rover_pin.report.words import as_text

PARTS, LEAST = 12, 4
"""Parts of as many half seconds each into which a signal is cut, of few half seconds fewer; half seconds of a part."""
SIGNALS = {"duty": "mean duty [-]", "slip": "mean slip [-]", "pitch": "pitch [deg]", "place": "x [m]",
           "time": "time in the run [s]"}  # fmt: skip


class Shown(NamedTuple):
    """What one channel leaves in each part along one signal, before and after."""

    channel: str
    signal: str
    along: np.ndarray
    "mean of the signal (parts,)"
    left: np.ndarray
    "mean of measured - model (2, parts), in the channel's unit"
    sd: np.ndarray
    "of that mean, by the scatter in its part (2, parts)"
    compared: int
    "half seconds that are compared"

    @property
    def gain(self) -> float:
        """How far the sum of squares of the means, in their SDs, falls; how large it is where nothing was added."""
        before, after = np.sum((self.left / self.sd[-1]) ** 2, axis=1)
        return float(before - after if before != after else before)


def shown(sides: Sides) -> Shown | None:
    """Return the channel and the signal along which what was added takes most; None where too little is compared."""
    table = signals(Scene(sides.after))
    chosen = [
        _along(sides, row, name, table[name]) for row in range(len(sides.experiment.channels)) for name in SIGNALS
    ]
    return max(filter(None, chosen), key=lambda section: section.gain, default=None)


def _along(sides: Sides, row: int, name: str, signal: np.ndarray) -> Shown | None:
    left = np.array([np.where(fit.task.noise.good[:, row], fit.missed[:, row], np.nan) for fit in sides])
    compared = np.isfinite(left).all(axis=0) & np.isfinite(signal)
    count = min(PARTS, int(compared.sum()) // LEAST)
    if count < 2 or np.ptp(signal[compared]) == 0.0:
        return None
    parts = np.array_split(np.argsort(signal[compared], kind="stable"), count)
    values = [left[:, compared][:, part] for part in parts]
    means, sds = (np.array([of(value, axis=1) for value in values]).T for of in (np.mean, np.std))
    sds = np.maximum(sds, np.finfo(float).tiny) / np.sqrt([len(part) for part in parts])
    along = np.array([signal[compared][part].mean() for part in parts])
    return Shown(sides.experiment.channels[row], name, along, means, sds, int(compared.sum()))


def effect_picture(sides: Sides) -> Picture | None:
    """Return the means of that channel's residual with their SDs: the base model, and that with what was added."""
    section = shown(sides)
    if section is None:
        return None
    channel, signal = words_of(section.channel), SIGNALS[section.signal]
    factor, unit = in_words(sides.experiment.unit(section.channel), float(np.abs(section.left).max()))
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    axis = figure.subplots()
    along = np.degrees(section.along) if section.signal == "pitch" else section.along
    for left, sd, (colour, style, label) in zip(section.left, section.sd, LOOKS[: 1 + sides.added], strict=False):
        axis.errorbar(along, factor * left, factor * sd, color=colour, ls=style, marker="o", ms=4, lw=1.3, capsize=2,
                      label=label)  # fmt: skip
    axis.axhline(0, color="k", lw=0.9, label="as measured")
    axis.set(xlabel=signal, ylabel=f"{as_text(channel)}:\nmeasured - model [{unit or '-'}]")
    axis.grid(alpha=0.25)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=8.5)
    where = "it shows most" if sides.added else "most is left"
    blocks = f"{section.compared} half seconds of {len(sides.experiment.runs)} runs in {len(along)} parts"
    errors = [f"{factor * float(np.sqrt(np.mean(left**2))):.2g} {unit}" for left in section.left]
    alt = f"Measured minus model of {channel} against {signal}, RMS of the means: {errors[0]}"
    alt += f" before, {errors[1]} after." if sides.added else "."
    return Picture((figure,), alt, f"Where {where}: {channel}, means with their SDs; {blocks}.")
