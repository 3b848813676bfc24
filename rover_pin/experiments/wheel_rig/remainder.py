"""What a model leaves: where it lives, and a smooth description from which a person can write an effect."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.identification.identifiability import SAME_LOAD
from rover_pin.measurements.channel import DrawbarPull, RigChannel, Sinkage, Torque

DEGREES = 3
"""Highest power of the slip in a description."""

NOISE_LIKE = 1.5
"""RMS in SDs below which a channel's residual is called noise."""


class Level(NamedTuple):
    """The mean residual of one level of one channel, measured - model, in the channel's unit."""

    name: str
    slip: float
    load: float
    mean: float
    noise: float
    "SD of that mean by the stated noise"


class Remainder(NamedTuple):
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
    "coefficients of 1, S, S^2, S^3 [unit]"
    of_load: float
    "coefficient of load / mean load - 1 [unit]"
    explained: float
    "share of the residual's sum of squares that the polynomial takes"

    @property
    def is_noise(self) -> bool:
        """Whether nothing is left to describe."""
        return self.rms < NOISE_LIKE

    @property
    def said(self) -> str:
        """One sentence for a reader."""
        scale, unit = (1e3, "mm") if self.unit == "m" else (1.0, self.unit)
        if self.is_noise:
            return f"{self.name}: {self.rms:.1f} times the noise; nothing to describe"
        first, last = self.levels[0], self.levels[-1]
        trend = (
            f"measured - model goes from {scale * first.mean:+.3g} {unit} at S = {round(first.slip, 2) + 0.0:g} to "
            f"{scale * last.mean:+.3g} {unit} at S = {round(last.slip, 2) + 0.0:g}"
        )
        terms = [
            f"{scale * c:+.3g}{'' if i == 0 else ' S' if i == 1 else f' S^{i}'}" for i, c in enumerate(self.powers)
        ]
        if self.of_load:
            terms.append(f"{scale * self.of_load:+.3g} (W / mean W - 1)")
        return (
            f"{self.name}: {self.rms:.1f} times the noise; {trend}; smooth fit {' '.join(terms)} {unit}, "
            f"which takes {self.explained:.0%} of it"
        )


def remainders(data: RigSet, residual: np.ndarray) -> tuple[Remainder, ...]:
    """Return what every channel leaves, given residuals (channels, runs) in stated SDs."""
    pairs = zip(data.rig.channels, residual, strict=True)
    return tuple(_describe(data, channel, residual) for channel, residual in pairs)


def _describe(data: RigSet, channel: RigChannel, residual: np.ndarray) -> Remainder:
    slip, load = np.asarray(data.rig.slip), np.asarray(data.rig.load)
    missing = residual * channel.sd
    varies = load.max() >= SAME_LOAD * load.min()
    powers, of_load = _smooth(slip, load / load.mean() - 1, residual, channel.sd, varies)
    smooth = np.polynomial.polynomial.polyval(slip, powers) + of_load * (load / load.mean() - 1)
    total = float(residual @ residual)
    rest = (missing - smooth) / channel.sd
    return Remainder(
        channel.name,
        channel.unit,
        float(np.sqrt(np.mean(residual**2))),
        _correlation(slip, missing),
        _correlation(load, missing) if varies else float("nan"),
        tuple(_level(data, channel, missing, number) for number in range(len(data.level_names))),
        tuple(float(c) for c in powers),
        of_load,
        1 - float(rest @ rest) / max(total, 1e-300),
    )


def _smooth(
    slip: np.ndarray, load: np.ndarray, scaled: np.ndarray, sd: np.ndarray, varies: bool
) -> tuple[np.ndarray, float]:
    """Return the polynomial in slip, with a term of the load where loads vary, of the lowest BIC."""
    best, levels = (np.inf, np.zeros(1), 0.0), len(np.unique(np.round(slip, 2)))
    for degree in range(min(DEGREES, levels - 2) + 1):
        for terms in (False, True) if varies else (False,):
            columns = [slip**power for power in range(degree + 1)] + ([load] if terms else [])
            design = np.column_stack(columns) / sd[:, None]
            found, *_ = np.linalg.lstsq(design, scaled, rcond=None)
            rest = scaled - design @ found
            size = max(1.0, float(rest @ rest) / max(scaled.size - found.size, 1))
            score = float(rest @ rest) / size + scaled.size * np.log(size) + found.size * np.log(scaled.size)
            if score < best[0]:
                best = (score, found[: degree + 1], float(found[-1]) if terms else 0.0)
    return best[1], best[2]


def _level(data: RigSet, channel: RigChannel, missing: np.ndarray, number: int) -> Level:
    at = data.level == number
    noise = float(np.sqrt(np.mean(channel.sd[at] ** 2) / at.sum()))
    slip, load = np.asarray(data.rig.slip)[at], np.asarray(data.rig.load)[at]
    return Level(data.level_names[number], float(slip.mean()), float(load.mean()), float(missing[at].mean()), noise)


def _correlation(one: np.ndarray, other: np.ndarray) -> float:
    if np.ptp(one) == 0 or np.ptp(other) == 0:
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])


FACTORS = {DrawbarPull.name: "pull", Torque.name: "torque", Sinkage.name: "depth"}
"""What a draft can add; a side force hangs on the slip angle more than on S."""

DRAFT = '''"""What the model leaves of {name}, as measured: a draft for a person to replace by a cause."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.quantity import quantity


@dataclass(frozen=True)
class MeasuredRemainder(Effect):
    """f_t += f_n p(S), torque += r f_n t(S), h <- h - r d(S): polynomials of the slip.

    Source: the remainder of a closed loop on {name}; it describes and does not explain.
    """

    title: ClassVar[str] = "measured remainder"
    meaning: ClassVar[str] = "something acts that is on no list, as a wheel rig showed it"
{fields}
    neutral: ClassVar[dict[str, float]] = {{{neutral}}}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact as deep as it would be without the remainder."""
        S = contact.S
        return contact._replace(h=ca.fmax(contact.h - contact.wheel.r * ({depth}), 0.0))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what was measured beyond the load so far."""
        S = contact.S
        return Load(f_t=load.f_n * ({pull}), torque=contact.wheel.r * load.f_n * ({torque}))
'''


def draft_effect(data: RigSet, left: tuple[Remainder, ...]) -> str:
    """Return an effect file that adds the described remainder, per load and per radius, for `effects=`."""
    load, r = float(np.mean(data.rig.load)), float(data.rig.wheel.r)
    unit = {"pull": load, "torque": load * r, "depth": r}
    fields, sums = [], {"pull": "0.0", "torque": "0.0", "depth": "0.0"}
    names = []
    for one in left:
        if one.is_noise or one.name not in FACTORS:
            continue
        stem = FACTORS[one.name]
        terms = []
        for power, value in enumerate(one.powers):
            name = f"{stem}_{power}"
            names.append(name)
            fields.append(f'    {name}: Scalar = quantity({value / unit[stem]:.6g}, "", "fitted", -5.0, 5.0, "{name}")')
            terms.append(f"self.{name}" + "".join([" * S"] * power))
        sums[stem] = " + ".join(terms)
    neutral = ", ".join(f'"{name}": 0.0' for name in names)
    return DRAFT.format(name=data.rig.name, fields="\n".join(fields), neutral=neutral, **sums)
