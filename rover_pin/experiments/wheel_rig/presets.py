"""What `rig.toml` declares of lugs and sand, as the effects of the contact have it."""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from rover_pin.base.quantity import quantities
from rover_pin.contact import Wheel
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.effects.effect import Effect
from rover_pin.effects.lug_excavation import LugExcavation
from rover_pin.estimation.parameter import Parameter, parameter_of
from rover_pin.estimation.wording import format_value
from rover_pin.measurements.rig_set import RigSet
from rover_pin.parameters.gravity import EARTH

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


def presets(rig: RigSet) -> dict[str, Preset]:
    """Return quantity -> what the set declares of it.

    gamma = rho g, g that of the Earth; phi_f, the sand's own friction, starts from the angle of repose; h_l and h_s are
    the lugs' height; E = 1 - N w / (2 pi (r + h_l / 2)), the share of the rim's way that is pocket, not lug.
    """
    declared_values = rig.beside
    declared_presets = {}
    if "bulk_density" in declared_values:
        declared_presets["gamma"] = Preset("gamma", declared_values["bulk_density"] * EARTH, "bulk_density")
    if "angle_of_repose" in declared_values:
        declared_presets["phi_f"] = Preset("phi_f", declared_values["angle_of_repose"], "angle_of_repose")
    if declared_values.get("lug_height", 0.0) > 0.0:
        declared_presets |= {name: Preset(name, declared_values["lug_height"], "lug_height") for name in LUGS}
        if declared_values.keys() >= {"lug_width", "lug_count"}:
            declared_presets["filled"] = Preset(
                "filled", pockets(declared_values, rig.wheel), "lug_width and lug_count"
            )
    return declared_presets


def pockets(declared_values: Mapping[str, float], wheel: Wheel) -> float:
    """Return the share of the rim's way between lugs, at half their height, 0 where lugs leave no gap."""
    way = 2.0 * math.pi * (float(wheel.r) + declared_values["lug_height"] / 2.0)
    return max(1.0 - declared_values["lug_count"] * declared_values["lug_width"] / way, 0.0)


def known_trench(rig: RigSet) -> tuple[LugExcavation, ...]:
    """Return what lugs of declared height dig, which their geometry tells by conservation of volume; else nothing."""
    declared_presets = presets(rig)
    if "h_l" not in declared_presets:
        return ()
    return (
        LugExcavation(**{name: declared_presets[name].value for name in ("h_l", "filled") if name in declared_presets}),
    )


def known_heights(rig: RigSet, records: Mapping[str, Any]) -> Iterator[Parameter]:
    """Yield the free height of a model's lugs, if it has lugs dig, with the declared one as its prior.

    Pockets may be emptier, or heaped: a trench shows h_l E only, so the doubt of E, `FULL_BY`, is that of h_l.
    """
    owner = TRENCH.partition(".")[0]
    if owner in records and known_trench(rig):
        height = presets(rig)["h_l"].value
        free = parameter_of(TRENCH, records[owner], 1.0, declared="declared with the lugs, its SD assumed")
        yield dataclasses.replace(free, origin=height, scale=FULL_BY * height)


def preset_candidate(effect: Effect, rig: RigSet) -> Candidate:
    """Return an effect as a candidate, its numbers as declared: what is `HELD` is not free."""
    declared_presets = _of(effect, presets(rig))
    specs = quantities(effect)
    within = {
        preset.name: min(max(preset.value, specs[preset.name].low), specs[preset.name].high)
        for preset in declared_presets
    }
    plain = plain_candidate(effect.replace(**within))
    fixed_names = {f"{plain.kind}.{preset.name}" for preset in declared_presets if preset.name in HELD}
    return dataclasses.replace(plain, shapes=tuple(name for name in plain.shapes if name not in fixed_names))


def is_of_other_wheel(effect: Effect, rig: RigSet) -> bool:
    """Return whether an effect is of lugs, and the wheel is said to have none."""
    return rig.beside.get("lug_height") == 0.0 and any(name in LUGS for name in effect.neutral)


def describe_declared(rig: RigSet, effects: Sequence[Effect], present: Sequence[Effect] = ()) -> tuple[str, ...]:
    """Return what is declared and how effects take it, one sentence each; what none takes is not used.

    `effects` are those that were tried, `present` those that the model had from the start.
    """
    presets_by_source = {preset.source: preset for preset in presets(rig).values()}
    trench = _owners(rig, [effect for effect in present if isinstance(effect, LugExcavation)])
    tried = _owners(rig, effects)
    lines = [
        f"{_preset_text(presets_by_source[source], names)}, which the model starts with"
        for source, names in trench.items()
    ]
    lines += [_preset_text(presets_by_source[source], names) for source, names in tried.items()]
    used = " ".join((*trench, *tried))
    unused = [name for name, value in rig.beside.items() if value and name not in used]
    return (*lines, *(f"{name} is declared, and not used: no effect that was tried has it" for name in unused))


def _owners(rig: RigSet, effects: Sequence[Effect]) -> dict[str, list[str]]:
    """Return which numbers of effects each declared one presets, by the name of what declares it."""
    owners: dict[str, list[str]] = {}
    for effect in effects:
        for preset in _of(effect, presets(rig)):
            owners.setdefault(preset.source, []).append(f"{type(effect).__name__}.{preset.name}")
    return owners


def _preset_text(preset: Preset, names: Sequence[str]) -> str:
    takes = "holds" if preset.name in HELD else "is where a fit starts with"
    return f"{preset.source} {takes} {', '.join(names)} = {format_value(preset.value, UNITS[preset.name])}"


def _of(effect: Effect, declared_presets: Mapping[str, Preset]) -> list[Preset]:
    """Return what of the presets an effect has, by name and unit."""
    specs = quantities(effect)
    return [preset for name, preset in declared_presets.items() if name in specs and specs[name].unit == UNITS[name]]
