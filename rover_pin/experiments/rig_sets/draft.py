"""What a model leaves of a rig set, drafted as an effect file: polynomials of slip over the whole travel, and load."""

from collections.abc import Sequence

import numpy as np

from rover_pin.discrepancy.candidate import plain_candidate
from rover_pin.discrepancy.draft import Drafted
from rover_pin.estimation.fit import Fit
from rover_pin.experiments.rig_sets.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.channel_residual import RigChannelResidual, channel_residuals
from rover_pin.measurements.channel import DrawbarPull, SideForce, Sinkage, Torque
from rover_pin.measurements.rig_set import RigSet
from rover_pin.simulation.model.effect_files import effects_of_text

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


def drafted(experiment: RigExperiment, fit: Fit) -> Drafted | None:
    """Return what a fit leaves as a drafted effect; None where no smooth curve beats chance, or of several sets."""
    if len(experiment.sets) > 1:
        return None
    (data,) = experiment.sets
    residuals = channel_residuals(data, experiment.in_sds(fit.residual))
    if not any(map(can_draft, residuals)):
        return None
    text = draft_effect(data, residuals)
    (kind,) = effects_of_text(text)
    return Drafted(text, (plain_candidate(kind()),))


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
