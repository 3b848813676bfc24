"""Describe the residual of a fit to rig data, and draft an effect that would cause this residual.

The residual of each channel (measured minus predicted) is described by its mean at each slip level, and by a polynomial
of slip and load. If the polynomial explains more than chance would, `draft_effect` makes an effect from it.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.base.encode import printable
from rover_pin.base.public import brief
from rover_pin.contact import Contact, Load, Scalar, right_angle
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.effects.effect import Effect
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import correlation
from rover_pin.estimation.residual import null_gain
from rover_pin.estimation.wording import MAX_NOISE_RATIO
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.similarity import slip_of_travel
from rover_pin.measurements.channel import DrawbarPull, RigChannel, SideForce, Sinkage, Torque
from rover_pin.measurements.rig_set import RigSet
from rover_pin.simulation.model.effect_source import Coefficient, DraftedEffect, EffectSource
from rover_pin.soil.slip import slip_ratio

MAX_SLIP_POWER = 3
"""Maximum power of the slip in a polynomial. The slip is computed from the whole travel, sideways included, because
channels divided by the load then depend on r omega / V only, where r omega is the rim speed and V the speed of travel.
"""
MAX_LOAD_POWER = 2
"""Maximum power of the load in a polynomial. The offset of a load cell, for example, does not grow in proportion to the
load."""
POLYNOMIALS = (MAX_LOAD_POWER + 1) * (MAX_SLIP_POWER + 1)
"""Number of polynomials among which the best one is chosen. The more polynomials are tried, the more the best
polynomial decreases chi2 by chance."""


class Level(NamedTuple):
    """Mean residual (measured minus predicted) of one channel over the runs of one slip level."""

    name: str
    slip: float
    "mean slip of the level's runs [-]"
    load: float
    "mean load of the level's runs [N]"
    mean: float
    """mean residual, in the unit of the channel"""
    noise: float
    "SD of `mean` that follows from the stated noise"


@brief
class RigChannelResidual(NamedTuple):
    """Residual of one channel (measured minus predicted): its size, its mean at each slip level, and a fitted
    polynomial.
    """

    name: str
    unit: str
    rms: float
    """RMS of the residual in SDs of the stated noise"""
    with_slip: float
    "correlation of the residual with the slip"
    with_load: float
    "correlation of the residual with the load; NaN if the loads do not vary"
    levels: tuple[Level, ...]
    powers: tuple[float, ...]
    """coefficients of 1, S', S'^2, S'^3 in the polynomial [unit of the channel], where S' is the slip of the whole
    travel. For a side force, the polynomial is multiplied by sin beta, where beta is the slip angle."""
    of_load: tuple[float, ...]
    """coefficients of w, w^2 in the polynomial [unit of the channel], where w = load / mean load - 1"""
    explained: float
    "fraction of the residual's sum of squares that the polynomial explains"
    is_curved: bool
    """whether the polynomial explains more than chance would, compared with the remaining scatter"""
    variable: str = "S"
    "symbol of the slip: S' if runs have a slip angle, and otherwise S"
    factor: str = ""
    "factor of the polynomial in words, such as ' sin beta'"

    @property
    def is_noise(self) -> bool:
        """Whether the residual is not larger than the noise.

        The limit for the RMS of the residual is MAX_NOISE_RATIO times the stated noise, because the stated noise may be
        wrong by this factor.
        """
        return self.rms < MAX_NOISE_RATIO

    @property
    def sentence(self) -> str:
        """A sentence for the report on size and trend of the residual, and on the fitted polynomial."""
        # Lengths are printed in mm; -0.0 is printed as 0.
        scale, unit = (1e3, "mm") if self.unit == "m" else (1.0, self.unit)
        if not self.is_curved:
            size = f"{self.name}: {self.rms:.1f} times the noise"
            return f"{size}; no smooth curve of slip and load explains more than chance"
        # The trend from the first to the last slip level tells the reader more than the coefficients.
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
            f"which explains {self.explained:.0%} of the residual"
        )


def channel_residuals(data: RigSet, residual: np.ndarray) -> tuple[RigChannelResidual, ...]:
    """Return a description of the residual of every channel of a data set, in the order of the channels.

    Parameters
    ----------
    data : RigSet
        The measured runs.
    residual : array (channels, runs)
        Measured minus predicted, in SDs of the stated noise.
    """
    rows = []
    for channel, in_sds in zip(data.channels, residual, strict=True):
        is_measured, all_loads = channel.has_value, data.load
        slip, load, sd, in_sds = (
            slip_of_travel(data)[is_measured],
            all_loads[is_measured],
            channel.sd[is_measured],
            in_sds[is_measured],
        )
        # The polynomial is fitted to the residual in SDs, so its columns are weighted by 1 / sd. A side force changes
        # its sign with the slip angle, so its polynomial is multiplied by sin beta.
        missing = in_sds * sd
        varies = data.loads_vary
        share = load / all_loads.mean() - 1
        angle = data.slip_angle[is_measured]
        weight = (np.sin(angle) if channel.is_sideways else 1.0) / sd
        powers, of_load = _fit_polynomial(slip, share, in_sds, weight, varies)
        smooth = np.polynomial.polynomial.polyval(slip, powers)
        smooth = smooth + np.polynomial.polynomial.polyval(share, (0.0, *of_load))
        total = float(in_sds @ in_sds)
        unexplained = in_sds - smooth * weight
        # The decrease of chi2 must exceed the decrease that chance gives the best of all polynomials with as many
        # columns. Scatter beyond the stated noise counts as noise.
        after, columns = float(unexplained @ unexplained), len(powers) + len(of_load)
        scatter = max(1.0, after / max(in_sds.size - columns, 1))
        is_curved = total - after > scatter * (null_gain(POLYNOMIALS) + null_gain(1) * (columns - 1))
        rows.append(
            RigChannelResidual(
                channel.name,
                channel.unit,
                float(np.sqrt(np.mean(in_sds**2))),
                correlation(data.slip[is_measured], missing),
                correlation(load, missing) if varies else float("nan"),
                tuple(_level(data, channel, missing, number) for number in np.unique(data.level[is_measured]).tolist()),
                powers,
                of_load,
                1 - after / max(total, 1e-300),
                is_curved,
                "S'" if data.askew.any() else "S",
                " sin beta" * channel.is_sideways,
            )
        )
    return tuple(rows)


def _fit_polynomial(
    slip: np.ndarray, load: np.ndarray, scaled: np.ndarray, weight: np.ndarray, varies: bool
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the coefficients of the polynomial of slip and load that fits a residual with the lowest BIC.

    BIC is the Bayesian information criterion, which prefers few coefficients.

    Parameters
    ----------
    slip, load : array (runs,)
        Slip, and load / mean load - 1.
    scaled : array (runs,)
        Residual in SDs of the stated noise.
    weight : array (runs,)
        Factor on the polynomial in each run.
    varies : bool
        Whether the loads vary. Only then are powers of the load tried.

    Returns
    -------
    tuple, tuple
        Coefficients of 1, S', S'^2, ... with the slip S', and coefficients of w, w^2, ... with w = load / mean load -
        1.
    """
    best: tuple[float, tuple[float, ...], tuple[float, ...]] = (np.inf, (0.0,), ())
    # A polynomial needs more different slips and loads than it has powers.
    max_slip_power = min(MAX_SLIP_POWER, _different(slip, 2) - 2)
    max_load_power = min(MAX_LOAD_POWER, _different(load, 1) - 1) if varies else 0
    for degree, terms in itertools.product(range(max_slip_power + 1), range(max_load_power + 1)):
        columns = [slip**power for power in range(degree + 1)] + [load**power for power in range(1, terms + 1)]
        design = np.column_stack(columns) * weight[:, None]
        coefficients, *_ = np.linalg.lstsq(design, scaled, rcond=None)
        unexplained = scaled - design @ coefficients
        # Scatter beyond the stated noise counts as noise; otherwise ever higher powers would fit this scatter.
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
    """Return the number of different values after rounding. Rounding is needed because slips and loads scatter around
    their set points.
    """
    return len(np.unique(np.round(values, decimals)))


def _level(data: RigSet, channel: RigChannel, missing: np.ndarray, number: int) -> Level:
    """Return the mean of a residual over the runs of one slip level. `missing` holds the residual of the measured
    runs.
    """
    # The SD of a mean falls with the square root of the number of runs.
    is_in_level = (data.level == number) & channel.has_value
    noise = float(np.sqrt(np.mean(channel.sd[is_in_level] ** 2) / is_in_level.sum()))
    slip, load = data.slip[is_in_level], data.load[is_in_level]
    mean = float(missing[is_in_level[channel.has_value]].mean())
    return Level(data.level_names[number], float(slip.mean()), float(load.mean()), mean, noise)


DRAFTED_CHANNELS = {DrawbarPull.name: "pull", Torque.name: "torque", Sinkage.name: "depth", SideForce.name: "side"}
"""Channel that a drafted effect can change -> first part of the names of its coefficients."""
COEFFICIENT_BOUND = 5.0
"""Limit of the absolute value of a drafted effect's coefficients in a fit [-]. If ten times the described value of a
coefficient is larger, that is the limit."""


def draft_curve(experiment: RigExperiment, fit: Fit) -> tuple[str, Candidate] | None:
    """Draft an effect that would cause the residual of a fit, as the text of its file and as a candidate for the search
    for missing effects.

    The result is None if no residual is a smooth curve beyond chance. It is also None for several data sets, because
    their residuals may differ.
    """
    if len(experiment.sets) > 1:
        return None
    # The residual is measured minus predicted in SDs, as the polynomials need it.
    (data,) = experiment.sets
    residuals = channel_residuals(data, experiment.in_sds(fit.residual))
    if not any(map(can_draft, residuals)):
        return None
    drafted = draft_effect(data, residuals)
    return drafted.text, plain_candidate(drafted.effect)


def can_draft(residual: RigChannelResidual) -> bool:
    """Return whether an effect can be drafted from the residual of a channel.

    The residual must be a smooth curve beyond chance, and the channel must be one that an effect can change.
    """
    return residual.is_curved and residual.name in DRAFTED_CHANNELS


def draft_effect(data: RigSet, residuals: Sequence[RigChannelResidual]) -> DraftedEffect:
    """Return an effect that adds the described residuals to the model, as the text of its file and as an object.

    The effect changes the drawbar pull, the torque, the sinkage and the side force by polynomials of the slip S' of the
    whole travel. All polynomials except the one for the sinkage also depend on the wheel load.

    Parameters
    ----------
    data : RigSet
        The runs that the residuals belong to. The coefficients are made dimensionless by the mean load and the wheel
        radius.
    residuals : sequence of RigChannelResidual
        The residuals of the channels. Descriptions with `can_draft` False are omitted.
    """
    # Scales of the coefficients: load for forces, load times radius for torques, radius for the sinkage.
    mean_load, r = float(np.mean(data.load)), float(data.wheel.r)
    unit = {"pull": mean_load, "torque": mean_load * r, "depth": r, "side": mean_load}
    # Numbers are rounded as the text shows them, so that the text and the object are one effect.
    load_code = f"{mean_load:.6g}"
    # Names of the coefficients of 1, S', S'^2, ... and of w, w^2, ... with w = load / mean load - 1, by channel.
    slip_names: dict[str, tuple[str, ...]] = dict.fromkeys(unit, ())
    load_names: dict[str, tuple[str, ...]] = dict.fromkeys(unit, ())
    sizes: dict[str, float] = {}
    for residual in filter(can_draft, residuals):
        stem = DRAFTED_CHANNELS[residual.name]
        by_slip = {f"{stem}_{power}": size / unit[stem] for power, size in enumerate(residual.powers)}
        # A contact is amended before it knows its load, so the sinkage cannot depend on the load.
        load_powers = residual.of_load if stem != "depth" else ()
        by_load = {f"{stem}_W{power}": size / unit[stem] for power, size in enumerate(load_powers, start=1)}
        slip_names[stem], load_names[stem] = tuple(by_slip), tuple(by_load)
        sizes |= {name: _six_digits(size) for name, size in (by_slip | by_load).items()}

    def code(stem: str) -> str:
        products = [f"self.{name}" + " * S" * power for power, name in enumerate(slip_names[stem])]
        share = f" * (load.f_n / {load_code} - 1.0)"
        products += [f"self.{name}" + power * share for power, name in enumerate(load_names[stem], start=1)]
        return " + ".join(products) or "0.0"

    def polynomial(effect: Effect, stem: str, S: Scalar, share: Scalar) -> Scalar:
        total: Scalar = 0.0
        for variable, names, first in ((S, slip_names[stem], 0), (share, load_names[stem], 1)):
            for power, name in enumerate(names, start=first):
                product = getattr(effect, name)
                for _ in range(power):
                    product = product * variable
                total = total + product
        return total

    def amend(self: Effect, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        S, _ = of_travel(contact)
        return contact._replace(h=ca.fmax(contact.h - contact.wheel.r * polynomial(self, "depth", S, 0.0), 0.0))

    def load(self: Effect, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        S, sine = of_travel(contact)
        share = load.f_n / float(load_code) - 1.0
        pull, side, torque = (polynomial(self, stem, S, share) for stem in ("pull", "side", "torque"))
        return Load(f_t=load.f_n * pull, f_y=load.f_n * sine * side, torque=contact.wheel.r * load.f_n * torque)

    name = printable(data.name)
    # The bounds are symmetric and wide, so that a fit may also reduce or reverse the described residual.
    bounds = {key: _six_digits(max(COEFFICIENT_BOUND, 10 * abs(size))) for key, size in sizes.items()}
    source = EffectSource(
        "MeasuredRemainder",
        Effect,
        f"Residual of a model on the wheel rig data {name}: a draft, to be replaced by an effect with a physical law.",
        "f_t += f_n p(S), torque += r f_n t(S), f_y += f_n s(S) sin beta, h <- h - r d(S): S the slip of the whole "
        "travel.",
        f"p, t, s and d are polynomials, the first three of the load as well.\n    Source: the residual of a model on "
        f"{name}. The effect describes this residual and does not explain it.",
        "measured residual",
        "something acts that is on no list, as a wheel rig showed it",
        tuple(Coefficient(key, size, "", "fitted", -bounds[key], bounds[key], key) for key, size in sizes.items()),
        dict.fromkeys(sizes, 0.0),
        {
            "amend": "S, _ = of_travel(contact)\n"
            f"return contact._replace(h=ca.fmax(contact.h - contact.wheel.r * ({code('depth')}), 0.0))",
            "load": "S, sine = of_travel(contact)\n"
            f"torque = contact.wheel.r * load.f_n * ({code('torque')})\n"
            f"return Load(f_t=load.f_n * ({code('pull')}), f_y=load.f_n * sine * ({code('side')}), torque=torque)",
        },
        helpers=(of_travel,),
    )
    return DraftedEffect(source.text, source.effect({"amend": amend, "load": load}))


def of_travel(contact: Contact) -> tuple[Scalar, Scalar]:
    """Return the slip of the whole travel and sin beta at a contact, where beta is the slip angle between heading and
    travel.

    With the rim speed r omega and the travel speed V, this slip is (r omega - V) / max(r omega, V).
    """
    rim, along = 1.0 + ca.fmin(contact.S, 0.0), 1.0 - ca.fmax(contact.S, 0.0)
    travel = right_angle(along, contact.S_y)
    return slip_ratio(rim, travel), -contact.S_y / ca.fmax(travel, 1e-9)


def _six_digits(value: float) -> float:
    """Return a number rounded to six significant digits, as the text of a drafted effect shows it."""
    return float(f"{value:.6g}")
