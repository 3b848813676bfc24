"""What a model leaves: where it lives, and a smooth description from which a person can write an effect."""

import itertools
from typing import NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.noise import null_gain
from rover_pin.estimation.wording import NOISE_LIKE
from rover_pin.experiments.wheel_rig.similarity import slip_of_travel
from rover_pin.measurements.channel import RigChannel
from rover_pin.measurements.rig_set import RigSet

DEGREES = 3
"""Highest power of the slip in a description: of the whole travel, as channels over load collapse on r omega / V."""

LOAD_DEGREES = 2
"""Highest power of the load: a cell's offset need not grow in proportion to it."""
FORMS = (LOAD_DEGREES + 1) * (DEGREES + 1)
"""Polynomials among which one is chosen."""


class Level(NamedTuple):
    """The mean residual of one level of one channel, measured - model, in the channel's unit."""

    name: str
    slip: float
    load: float
    mean: float
    noise: float
    "SD of that mean by the stated noise"


@brief
class RigChannelResidual(NamedTuple):
    """What one channel leaves: its size in SDs, where it lives, and measured - model as a polynomial."""

    name: str
    unit: str
    rms: float
    "in stated SDs; 1 is the noise"
    with_slip: float
    "correlation with slip"
    with_load: float
    "correlation with load; NaN where loads are alike"
    levels: tuple[Level, ...]
    powers: tuple[float, ...]
    "coefficients of 1, S', S'^2, S'^3 [unit], S' the slip of the whole travel; of a side force times sin beta"
    of_load: tuple[float, ...]
    "coefficients of w, w^2 with w = load / mean load - 1 [unit]"
    explained: float
    "share of the residual's sum of squares that the polynomial takes"
    is_curved: bool
    "whether that is more than chance, in units of what it leaves"
    variable: str = "S"
    "S', where runs are askew, and not the slip along the heading"
    factor: str = ""
    "what the polynomial is multiplied by"

    @property
    def is_noise(self) -> bool:
        """Whether what is left is about as large as the noise."""
        return self.rms < NOISE_LIKE

    @property
    def sentence(self) -> str:
        """One sentence for a reader."""
        scale, unit = (1e3, "mm") if self.unit == "m" else (1.0, self.unit)
        if not self.is_curved:
            return (
                f"{self.name}: {self.rms:.1f} times the noise; no smooth curve of slip and load takes more than chance"
            )
        first, last = self.levels[0], self.levels[-1]
        trend = (
            f"measured - model goes from {scale * first.mean:+.3g} {unit} at S = {round(first.slip, 2) + 0.0:g} to "
            f"{scale * last.mean:+.3g} {unit} at S = {round(last.slip, 2) + 0.0:g}"
        )
        terms = [
            f"{scale * c:+.3g}" + (f" {self.variable}" + f"^{i}" * (i > 1)) * (i > 0) for i, c in enumerate(self.powers)
        ]
        terms += [
            f"{scale * c:+.3g} (W / mean W - 1){'' if i == 1 else f'^{i}'}" for i, c in enumerate(self.of_load, start=1)
        ]
        return (
            f"{self.name}: {self.rms:.1f} times the noise; {trend}; smooth fit {' '.join(terms)} {unit}{self.factor}, "
            f"which takes {self.explained:.0%} of it"
        )


def channel_residuals(data: RigSet, residual: np.ndarray) -> tuple[RigChannelResidual, ...]:
    """Return what every channel leaves, given residuals (channels, runs) in stated SDs."""
    pairs = zip(data.channels, residual, strict=True)
    return tuple(_describe(data, channel, residual) for channel, residual in pairs)


def _describe(data: RigSet, channel: RigChannel, residual: np.ndarray) -> RigChannelResidual:
    is_measured, all_loads = channel.has_value, data.load
    slip, load, sd, residual = (
        slip_of_travel(data)[is_measured],
        all_loads[is_measured],
        channel.sd[is_measured],
        residual[is_measured],
    )
    missing = residual * sd
    varies = data.loads_vary
    share = load / all_loads.mean() - 1
    angle = data.slip_angle[is_measured]
    weight = (np.sin(angle) if channel.is_sideways else 1.0) / sd
    powers, of_load = _smooth(slip, share, residual, weight, varies)
    smooth = np.polynomial.polynomial.polyval(slip, powers) + np.polynomial.polynomial.polyval(share, (0.0, *of_load))
    total = float(residual @ residual)
    unexplained = residual - smooth * weight
    return RigChannelResidual(
        channel.name,
        channel.unit,
        float(np.sqrt(np.mean(residual**2))),
        _correlation(data.slip[is_measured], missing),
        _correlation(load, missing) if varies else float("nan"),
        tuple(_level(data, channel, missing, number) for number in np.unique(data.level[is_measured]).tolist()),
        powers,
        of_load,
        1 - float(unexplained @ unexplained) / max(total, 1e-300),
        _exceeds_noise(total, float(unexplained @ unexplained), residual.size, len(powers) + len(of_load)),
        "S'" if data.askew.any() else "S",
        " sin beta" * channel.is_sideways,
    )


def _exceeds_noise(before: float, after: float, count: int, columns: int) -> bool:
    """Return whether these columns, of the best of FORMS forms, take more of chi2 than chance does."""
    unit = max(1.0, after / max(count - columns, 1))
    return before - after > unit * (null_gain(FORMS) + null_gain(1) * (columns - 1))


def _smooth(
    slip: np.ndarray, load: np.ndarray, scaled: np.ndarray, weight: np.ndarray, varies: bool
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the polynomials in slip and, where loads vary, in load, of the lowest BIC."""
    best: tuple[float, tuple[float, ...], tuple[float, ...]] = (np.inf, (0.0,), ())
    most = min(DEGREES, _different(slip, 2) - 2)
    of_load = min(LOAD_DEGREES, _different(load, 1) - 1) if varies else 0
    for degree, terms in itertools.product(range(most + 1), range(of_load + 1)):
        columns = [slip**power for power in range(degree + 1)] + [load**power for power in range(1, terms + 1)]
        design = np.column_stack(columns) * weight[:, None]
        coefficients, *_ = np.linalg.lstsq(design, scaled, rcond=None)
        unexplained = scaled - design @ coefficients
        size = max(1.0, float(unexplained @ unexplained) / max(scaled.size - coefficients.size, 1))
        score = (
            float(unexplained @ unexplained) / size
            + scaled.size * np.log(size)
            + coefficients.size * np.log(scaled.size)
        )
        if score < best[0]:
            best = (score, tuple(coefficients[: degree + 1].tolist()), tuple(coefficients[degree + 1 :].tolist()))
    return best[1], best[2]


def _different(values: np.ndarray, decimals: int) -> int:
    """Return how many values differ where they are rounded: a carriage's slips and loads are never quite alike."""
    return len(np.unique(np.round(values, decimals)))


def _level(data: RigSet, channel: RigChannel, missing: np.ndarray, number: int) -> Level:
    at = (data.level == number) & channel.has_value
    noise = float(np.sqrt(np.mean(channel.sd[at] ** 2) / at.sum()))
    slip, load = data.slip[at], data.load[at]
    mean = float(missing[at[channel.has_value]].mean())
    return Level(data.level_names[number], float(slip.mean()), float(load.mean()), mean, noise)


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    return float(np.corrcoef(first, second)[0, 1])
