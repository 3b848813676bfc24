"""What a model leaves of a rig set: where it lives, smooth curves that describe it, and these as a drafted effect."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import correlation, null_gain
from rover_pin.estimation.wording import NOISE_LIKE
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.similarity import slip_of_travel
from rover_pin.measurements.channel import DrawbarPull, RigChannel, SideForce, Sinkage, Torque
from rover_pin.measurements.rig_set import RigSet
from rover_pin.simulation.model.effect_files import effects_of_text

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
        correlation(data.slip[is_measured], missing),
        correlation(load, missing) if varies else float("nan"),
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


FACTORS = {DrawbarPull.name: "pull", Torque.name: "torque", Sinkage.name: "depth", SideForce.name: "side"}
"""What a draft can add."""

DRAFT = '''"""What the model leaves of {name}, as measured: a draft for a person to replace by a cause."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.contact import Contact, Load, Scalar, right_angle
from rover_pin.effects.effect import Effect
from rover_pin.base.quantity import quantity
from rover_pin.soil.slip import slip_ratio


@dataclass(frozen=True)
class MeasuredRemainder(Effect):
    """f_t += f_n p(S), torque += r f_n t(S), f_y += f_n s(S) sin beta, h <- h - r d(S): S the slip of the whole travel.

    p, t, s and d are polynomials, the first three of the load as well.
    Source: the residual of a closed loop on {name}; it describes and does not explain.
    """

    title: ClassVar[str] = "measured residual"
    meaning: ClassVar[str] = "something acts that is on no list, as a wheel rig showed it"
{fields}
    neutral: ClassVar[dict[str, float]] = {{{neutral}}}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact as deep as it would be without the residual."""
        S, _ = of_travel(contact)
        return contact._replace(h=ca.fmax(contact.h - contact.wheel.r * ({depth}), 0.0))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what was measured beyond the load so far."""
        S, sine = of_travel(contact)
        torque = contact.wheel.r * load.f_n * ({torque})
        return Load(f_t=load.f_n * ({pull}), f_y=load.f_n * sine * ({side}), torque=torque)


def of_travel(contact: Contact) -> tuple[Scalar, Scalar]:
    """Return (r omega - V) / max(r omega, V), V the speed over the ground, and the sine of the slip angle."""
    rim, along = 1.0 + ca.fmin(contact.S, 0.0), 1.0 - ca.fmax(contact.S, 0.0)
    travel = right_angle(along, contact.S_y)
    return slip_ratio(rim, travel), -contact.S_y / ca.fmax(travel, 1e-9)
'''


BOUND = 5.0
"""Largest coefficient that a draft allows, or ten times what it starts from."""


def draft_curve(experiment: RigExperiment, fit: Fit) -> tuple[str, Candidate] | None:
    """Return what a fit leaves as a drafted effect; None where no smooth curve beats chance, or of several sets."""
    if len(experiment.sets) > 1:
        return None
    (data,) = experiment.sets
    residuals = channel_residuals(data, experiment.in_sds(fit.residual))
    if not any(map(can_draft, residuals)):
        return None
    text = draft_effect(data, residuals)
    (kind,) = effects_of_text(text)
    return text, plain_candidate(kind())


def can_draft(residual: RigChannelResidual) -> bool:
    """Return whether a channel leaves a smooth curve beyond chance that an effect can add."""
    return residual.is_curved and residual.name in FACTORS


def draft_effect(data: RigSet, residuals: Sequence[RigChannelResidual]) -> str:
    """Return an effect file that adds the described residuals, per load and per radius, for `effects=`."""
    load, r = float(np.mean(data.load)), float(data.wheel.r)
    unit = {"pull": load, "torque": load * r, "depth": r, "side": load}
    amplitudes: dict[str, float] = {}
    sums = dict.fromkeys(unit, "0.0")
    for residual in filter(can_draft, residuals):
        stem = FACTORS[residual.name]
        names = {f"{stem}_{power}": f"self.{stem}_{power}" + " * S" * power for power in range(len(residual.powers))}
        amplitudes |= dict(zip(names, np.array(residual.powers) / unit[stem], strict=True))
        if stem != "depth":  # a contact is amended before it knows its load
            share = f" * (load.f_n / {load:.6g} - 1.0)"
            of_load = {f"{stem}_W{power}": c / unit[stem] for power, c in enumerate(residual.of_load, start=1)}
            names |= {name: f"self.{name}" + power * share for power, name in enumerate(of_load, start=1)}
            amplitudes |= of_load
        sums[stem] = " + ".join(names.values())
    fields = "\n".join(_field(name, size) for name, size in amplitudes.items())
    neutral = ", ".join(f'"{name}": 0.0' for name in amplitudes)
    return DRAFT.format(name=data.name, fields=fields, neutral=neutral, **sums)


def _field(name: str, size: float) -> str:
    bound = max(BOUND, 10 * abs(size))
    return f'    {name}: Scalar = quantity({size:.6g}, "", "fitted", {-bound:.6g}, {bound:.6g}, "{name}")'
