"""What `rig.toml` declares of lugs and sand, as the effects of the contact have it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from rover_pin.contact import Wheel
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.effects.effect import Effect
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.wording import shown
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.parameters.gravity import EARTH
from rover_pin.quantity import quantities

LUGS = ("h_l", "h_s")
"""Quantities of effects that are the height of lugs; a wheel without lugs shows none of these effects."""
TRENCH, FULL_BY = "LugExcavation.h_l", 0.3
"""The number of a model that is the height of declared lugs, and its prior SD as a share of it: how full their pockets
are is assumed. Sand of one bed filled them to 0.6 to 1.3 (studies/wheel_laws.py)."""
HELD = ("gamma",)
"""Quantities that a declared number fixes; the others start from it, with the prior that they have anyway."""
UNITS = {"gamma": "N/m^3", "phi_f": "rad", "h_l": "m", "h_s": "m", "filled": ""}


class Preset(NamedTuple):
    """One number of an effect as rig.toml declares it."""

    name: str
    value: float
    source: str


def presets(rig: WheelRig) -> dict[str, Preset]:
    """Return quantity -> what the set declares of it.

    gamma = rho g, g that of the Earth; phi_f, the sand's own friction, starts from the angle of repose; h_l and h_s are
    the lugs' height; E = 1 - N w / (2 pi (r + h_l / 2)), the share of the rim's way that is pocket, not lug.
    """
    own = rig.beside
    found = {}
    if "bulk_density" in own:
        found["gamma"] = Preset("gamma", own["bulk_density"] * EARTH, "bulk_density")
    if "angle_of_repose" in own:
        found["phi_f"] = Preset("phi_f", own["angle_of_repose"], "angle_of_repose")
    if own.get("lug_height", 0.0) > 0.0:
        found |= {name: Preset(name, own["lug_height"], "lug_height") for name in LUGS}
        if own.keys() >= {"lug_width", "lug_count"}:
            found["filled"] = Preset("filled", pockets(own, rig.wheel), "lug_width and lug_count")
    return found


def pockets(own: Mapping[str, float], wheel: Wheel) -> float:
    """Return the share of the rim's way between lugs, at half their height, 0 where lugs leave no gap."""
    way = 2.0 * math.pi * (float(wheel.r) + own["lug_height"] / 2.0)
    return max(1.0 - own["lug_count"] * own["lug_width"] / way, 0.0)


def known_trench(rig: WheelRig) -> tuple[LugExcavation, ...]:
    """Return what lugs of declared height dig, which their geometry tells by conservation of volume; else nothing."""
    known = presets(rig)
    if "h_l" not in known:
        return ()
    return (LugExcavation(**{name: known[name].value for name in ("h_l", "filled") if name in known}),)


def known_heights(rig: WheelRig, experiment: Experiment, model: Any) -> Iterator[Parameter]:
    """Yield the free height of a model's lugs, if it has lugs dig, with the declared one as its prior.

    Pockets may be emptier, or heaped: a trench shows h_l E only, so the doubt of E, `FULL_BY`, is that of h_l.
    """
    if TRENCH.partition(".")[0] in experiment.records(model) and known_trench(rig):
        height = presets(rig)["h_l"].value
        free = experiment.parameter(model, TRENCH, 1.0, declared="declared with the lugs, its SD assumed")
        yield dataclasses.replace(free, origin=height, scale=FULL_BY * height, prior=True)


def preset_candidate(effect: Effect, rig: WheelRig) -> Candidate:
    """Return an effect as a candidate, its numbers as declared: what is `HELD` is not free."""
    known = _of(effect, presets(rig))
    about = quantities(effect)
    within = {one.name: min(max(one.value, about[one.name].low), about[one.name].high) for one in known}
    plain = plain_candidate(effect.replace(**within))
    held = {f"{plain.kind}.{one.name}" for one in known if one.name in HELD}
    return dataclasses.replace(plain, shapes=tuple(name for name in plain.shapes if name not in held))


def is_of_other_wheel(effect: Effect, rig: WheelRig) -> bool:
    """Return whether an effect is of lugs, and the wheel is said to have none."""
    return rig.beside.get("lug_height") == 0.0 and any(name in LUGS for name in effect.neutral)


def told(rig: WheelRig, effects: Sequence[Effect], present: Sequence[Effect] = ()) -> tuple[str, ...]:
    """Return what is declared and how effects take it, one sentence each; what none takes is not used.

    `effects` are those that were tried, `present` those that the model had from the start.
    """
    known = {one.source: one for one in presets(rig).values()}
    trench = _owners(rig, [one for one in present if isinstance(one, LugExcavation)])
    tried = _owners(rig, effects)
    lines = [f"{_said(known[source], names)}, which the model starts with" for source, names in trench.items()]
    lines += [_said(known[source], names) for source, names in tried.items()]
    used = " ".join((*trench, *tried))
    unused = [name for name, value in rig.beside.items() if value and name not in used]
    return (*lines, *(f"{name} is declared, and not used: no effect that was tried has it" for name in unused))


def _owners(rig: WheelRig, effects: Sequence[Effect]) -> dict[str, list[str]]:
    """Return which numbers of effects each declared one presets, by the name of what declares it."""
    owners: dict[str, list[str]] = {}
    for effect in effects:
        for one in _of(effect, presets(rig)):
            owners.setdefault(one.source, []).append(f"{type(effect).__name__}.{one.name}")
    return owners


def _said(one: Preset, names: Sequence[str]) -> str:
    takes = "holds" if one.name in HELD else "is where a fit starts with"
    return f"{one.source} {takes} {', '.join(names)} = {shown(one.value, UNITS[one.name])}"


def _of(effect: Effect, known: Mapping[str, Preset]) -> list[Preset]:
    """Return what of the presets an effect has, by name and unit."""
    about = quantities(effect)
    return [one for name, one in known.items() if name in about and about[name].unit == UNITS[name]]
