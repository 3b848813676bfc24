"""What `rig.toml` declares of lugs and sand, as the effects of the contact have it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rover_pin.contact import Wheel
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.effects.effect import Effect
from rover_pin.estimation.wording import shown
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.parameters.gravity import EARTH
from rover_pin.quantity import quantities

LUGS = ("h_l", "h_s")
"""Quantities of effects that are the height of lugs; a wheel without lugs shows none of these effects."""
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


def told(rig: WheelRig, effects: Sequence[Effect]) -> tuple[str, ...]:
    """Return what is declared and how these effects take it, one sentence each; what none takes is not used."""
    owners: dict[str, list[str]] = {}
    for effect in effects:
        for one in _of(effect, presets(rig)):
            owners.setdefault(one.source, []).append(f"{type(effect).__name__}.{one.name}")
    known = {one.source: one for one in presets(rig).values()}
    lines = [_said(known[source], names) for source, names in owners.items()]
    unused = [name for name, value in rig.beside.items() if value and name not in " ".join(owners)]
    return (*lines, *(f"{name} is declared, and not used: no effect that was tried has it" for name in unused))


def _said(one: Preset, names: Sequence[str]) -> str:
    takes = "holds" if one.name in HELD else "is where a fit starts with"
    return f"{one.source} {takes} {', '.join(names)} = {shown(one.value, UNITS[one.name])}"


def _of(effect: Effect, known: Mapping[str, Preset]) -> list[Preset]:
    """Return what of the presets an effect has, by name and unit."""
    about = quantities(effect)
    return [one for name, one in known.items() if name in about and about[name].unit == UNITS[name]]
