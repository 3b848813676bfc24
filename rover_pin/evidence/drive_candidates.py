"""What a drive model may lack: every known effect at every wheel, channel or place, and priors that may be wrong."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.effects.sensor_bias import SensorBias
from rover_pin.evidence.drive_bench import Bench
from rover_pin.evidence.drive_parameters import Parameter, find, owner_name, value_of
from rover_pin.motion.effect_files import AnyEffect, package_effects, reading_traction, user_effects
from rover_pin.motion.model import Model
from rover_pin.quantity import quantities

SHAPE_SD, SHAPE_SHARE = 0.5, 0.3
"""Prior SD of an effect's shape: of its logarithm, or as a share of its size where it may be negative."""
SPACING = 0.15
"""Distance between the places at which an effect with a place is tried [m]."""
FAR_FROM = 50.0
"""Ratio of neutral to default value from which an effect's size is sought on a logarithm."""
BIASED = ("body_roll", "body_pitch", "rocker_", "bogie_", "current_")
"""Channels whose zero may be wrong; those of rates are the tachogenerators' gains."""
SMOOTHING = (".x_0", ".y_0", ".v_0", ".w_s", ".theta_c", ".relaxation")
"""Quantities that round a law off at standstill, or say where a run began: no data tell them, so they stay."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One thing that may be missing: an effect at its default size, or numbers of the model freed from their priors.

    `sizes` and `shapes` are names of parameters; the effect vanishes where the sizes are neutral.
    """

    name: str
    effect: AnyEffect | None
    sizes: tuple[str, ...]
    shapes: tuple[str, ...] = ()

    @property
    def located(self) -> bool:
        """Whether it is somewhere: at a wheel, on a channel, at a place."""
        return "[" in self.name or "@" in self.name

    @property
    def kind(self) -> str:
        """The name without its place."""
        return self.name.partition("[")[0].partition("@")[0]

    def on(self, model: Model) -> Model:
        """Return the model with the effect at its default size."""
        return model if self.effect is None else model.having(self.effect)

    def parameters(self, model: Model) -> tuple[Parameter, ...]:
        """Return the free numbers of the candidate on a model that has it: sizes without, shapes with a prior."""
        return (*(size_of(model, name) for name in self.sizes), *(shape_of(model, name) for name in self.shapes))


def size_of(model: Model, name: str) -> Parameter:
    """Return the parameter of a size: u = 0 is neutral and u = 1 the default; a logarithm where neutral is far off."""
    record, quantity, about = find(model, name)
    neutral = record.neutral[quantity]
    default = float(type(record).__dataclass_fields__[quantity].default)
    reach = default - neutral
    if abs(neutral) > FAR_FROM * abs(default):
        return Parameter(name, default, 1.0, float(about.low), float(about.high), log=True, prior=False, fd=0.1)
    reach = reach or _reach(about.unit)
    return Parameter(name, neutral, reach, float(about.low), float(about.high), prior=False, fd=0.2)


def _reach(unit: str) -> float:
    """Return a size of one unit for an effect whose default for it is none: a hundredth [m, rad, ...]."""
    return {"m": 0.01, "rad": 0.01}.get(unit, 0.05)


def shape_of(model: Model, name: str) -> Parameter:
    """Return the parameter of a shape, with a prior around its present value."""
    _, quantity, about = find(model, name)
    value = value_of(model, name)
    if quantity.startswith("x_"):
        return Parameter(name, value, SPACING, float(about.low), float(about.high), fd=0.1)
    if about.low >= 0 and value > 0:
        return Parameter(name, value, SHAPE_SD, float(about.low), float(about.high), log=True)
    return Parameter(name, value, SHAPE_SHARE * (abs(value) or 1.0), float(about.low), float(about.high))


def candidates(model: Model, bench: Bench, free: Sequence[Parameter], own: str | Path | None) -> tuple[Candidate, ...]:
    """Return everything that the model may lack and its rover can have, for the channels and places of these runs.

    Parameters
    ----------
    free : sequence of Parameter
        The uncertain numbers; those that belong to an effect are candidates too, freed from their priors.
    own : path or None
        A user's effect file or folder.
    """
    freed = [
        Candidate(each.name.rpartition(".")[0], None, (each.name,))
        for each in free
        if each.prior and each.name.split(".")[0] not in ("soil", "motor")
    ]
    present = {owner_name(effect) for effect in model.all_effects}
    kinds = {kind.__name__: kind for kind in package_effects() if kind.neutral}
    kinds |= {kind.__name__: kind for kind in (user_effects(own) if own else ()) if kind.neutral}
    held = {type(effect).__name__ for effect in model.contact_effects}
    added = [
        candidate
        for name, kind in kinds.items()
        if name not in held
        for effect in variants(kind, model, bench)
        if owner_name(effect) not in present and not model.refusal(effect)
        for candidate in [_candidate(effect)]
    ]
    return (*freed, *added)


def name_of(effect: AnyEffect) -> str:
    """Return the name of an effect as a candidate: its class, its wheel or channel, and where it begins."""
    return owner_name(effect) + (f"@{float(effect.values()['x_from']):.3f}" if "x_from" in effect.places else "")


def _candidate(effect: AnyEffect) -> Candidate:
    own = owner_name(effect)
    shapes = tuple(f"{own}.{name}" for name in quantities(effect) if name not in effect.neutral)
    shapes = tuple(name for name in shapes if not name.endswith(SMOOTHING))
    return Candidate(name_of(effect), effect, tuple(f"{own}.{name}" for name in effect.neutral), shapes)


def variants(kind: type[AnyEffect], model: Model, bench: Bench) -> Iterable[AnyEffect]:
    """Return the effect at its default size, once for every wheel, channel or place where it may be."""
    effect: Any = reading_traction(kind(), model.effects)
    fields = {each.name: each for each in dataclasses.fields(effect)}
    if isinstance(effect, SensorBias):
        names = [name for name in bench.channels if name.startswith(BIASED)]
        return [effect.replace(channel=name) for name in names]
    if "wheel" in fields:
        names = _wheel_numbers(model) if isinstance(effect.wheel, int) else _wheel_names(model)
        return [effect.replace(wheel=name) for name in names]
    if "x_from" in effect.places:
        return [effect.replace(x_from=x) for x in _places(bench, float(effect.length))]
    return [effect]


def _wheel_numbers(model: Model) -> list[Any]:
    return list(range(len(model.rover.wheels)))


def _wheel_names(model: Model) -> list[Any]:
    return ["", *(wheel.name for wheel in model.rover.wheels)]


def _places(bench: Bench, length: float) -> list[float]:
    """Return where a patch may begin: all along the ground that the runs have driven."""
    xs = np.concatenate([run.commands.place[:, 0] for run in bench.runs])
    low, high = float(np.nanmin(xs)) - 0.1, float(np.nanmax(xs)) + 0.1
    count = max(1, math.ceil((high - low) / SPACING))
    return [low + SPACING * at - length / 4 for at in range(count)]
