"""What `rover-pin identify` says: a fit, what it depends on, and what was measured of the same numbers elsewhere."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.problem import Prior
from rover_pin.experiments.wheel_rig.data import Independent, as_rig_set
from rover_pin.experiments.wheel_rig.known_elsewhere import Flag, flags
from rover_pin.identification.arc_uncertainty import free_unmeasured_modulus
from rover_pin.identification.dependence import with_held
from rover_pin.identification.held import held_numbers
from rover_pin.identification.identify import identify
from rover_pin.identification.one_sand import as_held, sets_of
from rover_pin.identification.result import Held, Identification
from rover_pin.measurements.channel import DrawbarPull, Evidence, RigChannel, Sinkage, Torque
from rover_pin.measurements.wheel_rig import WheelRig

OF_CHANNELS: dict[type[RigChannel], tuple[str, ...]] = {
    DrawbarPull: ("pull_tare", "crosstalk", "force_scale"),
    Torque: ("torque_tare",),
    Sinkage: ("sinkage_zero",),
}
"""Which errors of a rig are in which channel; that of the load is in all."""
BY_HAND = "--set"
"""Source of a number that the user has set."""


class Identified(NamedTuple):
    """A fit with all that it assumes."""

    identification: Identification
    elsewhere: tuple[Flag, ...]
    "fitted constants of a rig against other measurements of them, as `close-loop` has them"
    unused: tuple[str, ...] = ()
    "what the data declare of lugs and sand"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, for JSON; SI units."""
        return self.identification.as_dict() | {
            "elsewhere": [flag.as_dict() for flag in self.elsewhere],
            "unused": list(self.unused),
        }

    def report(self) -> str:
        """Return all of it as text."""
        lines = [self.identification.report(), *(f"measured elsewhere: {flag.sentence}" for flag in self.elsewhere)]
        if self.unused:
            lines.append(f"not used: {', '.join(self.unused)}, which Eqs (2)-(7) do not have; close-loop's effects do")
        return "\n".join(lines)


def identified(
    data: Evidence | Sequence[WheelRig],
    soil: Soil,
    free: Sequence[str],
    priors: Mapping[str, Prior] | None = None,
    by_hand: frozenset[str] = frozenset(),
    point_inputs: Sequence[Held] = (),
) -> Identified:
    """Fit parameters, say which the data tell, and what moves them of what was held.

    Parameters
    ----------
    data : Evidence or sequence of WheelRig
        Several rig sets are fitted together: one soil, each its own wheel, loads and noise, as `checked_evidence` reads
        them.
    soil : Soil
        Where to start, and the values of all that is not free: `sand_of(data).declared_soil(...)` where they are the
        data's.
    by_hand : set of str
        Constants of `soil` that the user has set.
    point_inputs : sequence of Held
        What the data were worked out with: `derivation_inputs` of a drive log.

    Raises
    ------
    ParameterError, DataError, OptimisationError
        As `identify`; also sets that declare different values of one constant.
    """
    rigs = [dataset for dataset in sets_of(data) if isinstance(dataset, WheelRig)]
    names, all_priors = free_unmeasured_modulus(data, soil, free, priors or {}, by_hand)
    of_rigs = [
        held_number
        for _, held_number in as_held([(rig.name, row) for rig in rigs for row in _of_the_rig(rig)], len(rigs))
    ]
    assumptions = (*held_numbers(data, soil, names, dict.fromkeys(by_hand, BY_HAND)), *of_rigs, *point_inputs)
    identification = with_held(identify(data, soil, names, all_priors), data, assumptions, all_priors)
    if len(rigs) > 1:
        whose = [rig.name for rig in rigs for _ in rig.channels]
        channels = tuple(
            channel._replace(set=name) for channel, name in zip(identification.channels, whose, strict=True)
        )
        identification = dataclasses.replace(identification, channels=channels)
    against = _elsewhere(identification, rigs)
    sources = " ".join(flag.independent.source for flag in against)
    unused = dict.fromkeys(name for rig in rigs for name, value in rig.beside.items() if value and name not in sources)
    return Identified(identification, against, tuple(unused))


def _of_the_rig(data: WheelRig) -> tuple[Held, ...]:
    """Return what the rig may add to its readings: a fit of the soil alone takes all of it as stated."""
    errors, specs = data.errors, quantities(data.errors)
    names = ["load_scale", *(name for channel in data.channels for name in OF_CHANNELS.get(type(channel), ()))]
    note = "exact: with an sd in [rig], close-loop fits it"
    rows = ((name, float(getattr(errors, name)), specs[name]) for name in names)
    return tuple(Held(f"rig.{name}", spec.unit, value, spec.source, value, value, note) for name, value, spec in rows)


def _elsewhere(identification: Identification, rigs: Sequence[WheelRig]) -> tuple[Flag, ...]:
    """Return the fitted constants against what was measured of them; of several sets, which has it."""
    finite_estimates = [estimate for estimate in identification.estimates if math.isfinite(estimate.value)]
    numbers = tuple(
        Number(estimate.name, estimate.unit, estimate.value, estimate.low, estimate.high, math.nan)
        for estimate in finite_estimates
    )
    by_source: dict[Independent, tuple[Flag, list[str]]] = {}
    for rig in rigs:
        for flag in flags(as_rig_set(rig), identification.soil, float(rig.wheel.b), numbers):
            by_source.setdefault(flag.independent, (flag, []))[1].append(rig.name)
    if len(rigs) == 1:
        return tuple(flag for flag, _ in by_source.values())
    return tuple(
        flag._replace(independent=flag.independent._replace(source=f"{flag.independent.source}: {', '.join(names)}"))
        for flag, names in by_source.values()
    )
