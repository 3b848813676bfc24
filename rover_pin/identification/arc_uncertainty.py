"""What the contact arc depends on where nothing measures it: k_1 is then as uncertain as it is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rover_pin.contact import Soil
from rover_pin.estimation.problem import Prior
from rover_pin.identification.one_sand import sand_of, sets_of
from rover_pin.measurements.channel import Evidence, Sinkage
from rover_pin.measurements.known import DECLARED_SD, UNDECLARED_SD
from rover_pin.measurements.wheel_rig import WheelRig
from rover_pin.soil.stress import modulus

MODULUS = ("k_1", "k_2", "n")
"""Constants of which any can take the arc's doubt up."""


def free_unmeasured_modulus(
    data: Evidence | Sequence[WheelRig],
    soil: Soil,
    free: Sequence[str],
    priors: Mapping[str, Prior],
    exact: frozenset[str] = frozenset(),
) -> tuple[tuple[str, ...], dict[str, Prior]]:
    """Return what is free, and the priors, with k_1 among them where the data's arc depends on an unmeasured modulus.

    Where theta_1 carries a load, F(S) shifts with r theta_1 / k: a modulus twice too high halves k and takes 7 deg off
    phi of a 110 mm wheel, with a good fit. A sinkage that any set measured tells theta_1; `exact` constants are the
    user's word.
    """
    sets, sand = sets_of(data), sand_of(data)
    sinkage_measured = any(isinstance(channel, Sinkage) for evidence in sets for channel in evidence.channels)
    loaded = any(evidence.loads.size for evidence in sets)
    if sinkage_measured or not loaded or exact.intersection(MODULUS) or {*MODULUS, "theta_1"}.intersection(free):
        return tuple(free), dict(priors)
    declared_modulus = exact.union(sand.declared).intersection((*MODULUS, "k_phi", "k_c"))
    sd = sand.doubts.get("k_1", (DECLARED_SD if declared_modulus else UNDECLARED_SD) * float(modulus(sand.wheel, soil)))
    return (*free, "k_1"), {**priors, "k_1": Prior(float(soil.k_1), sd)}
