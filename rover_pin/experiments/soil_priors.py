"""What is known beforehand of a constant of wheel or soil: as declared, as assumed, or nothing."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from rover_pin.base.quantity import Record, quantities
from rover_pin.estimation.parameter import Parameter, declared_in, parameter_of
from rover_pin.measurements.known import DECLARED_SD, SIZE_SD, UNDECLARED_SD

DECADES = math.log(5.0)
"""How far apart starts of k and k_1 are, in their logarithm, where nothing is known of them."""
WIDE = 0.25
"""How far apart starts of phi are, as a share of its range, where nothing is known of it."""
MAX_EXIT_RATIO = 0.99
"""Greatest exit ratio of a fit: at 1 the stress ends on a second singularity, where derivatives jump."""
SOFT = 1e5
"""Size of a modulus of which not even that is known [Pa]."""


class AssumedSd(NamedTuple):
    """SD of a constant that states none."""

    declared: float
    "of one that comes with the data, as of a bench test"
    undeclared: float
    "of one that stands for another soil's"
    is_log: bool = False
    "whether it is of the logarithm"


SD = {
    "r": AssumedSd(SIZE_SD, SIZE_SD, True),
    "b": AssumedSd(SIZE_SD, SIZE_SD, True),
    "phi": AssumedSd(math.radians(2.0), math.radians(4.0)),
    "c": AssumedSd(100.0, 300.0),
    "k": AssumedSd(DECLARED_SD, UNDECLARED_SD, True),
    "k_1": AssumedSd(DECLARED_SD, UNDECLARED_SD, True),
    "k_2": AssumedSd(DECLARED_SD, UNDECLARED_SD, True),
    "n": AssumedSd(0.1, 0.3),
    "theta_1": AssumedSd(math.radians(2.0), math.radians(4.0)),
    "theta_2": AssumedSd(math.radians(2.0), math.radians(4.0)),
    "exit_ratio": AssumedSd(0.05, 0.1),
}
"""SDs of constants that state none (assumed): with the data, of another soil, and whether of the logarithm."""


def known_constant(
    owner: str, record: Record, name: str, declared: Mapping[str, float], doubts: Mapping[str, float]
) -> Parameter:
    """Return a constant around its value in `record`, with the SD that is declared, or assumed."""
    value, assumed = abs(float(getattr(record, name))), SD[name]
    is_log = assumed.is_log and float(getattr(record, name)) > 0
    sd = assumed.declared if name in declared else assumed.undeclared
    if name in doubts:
        sd = doubts[name] / (value if is_log else 1.0)
    elif assumed.is_log and not is_log:
        sd *= value
    constant = parameter_of(f"{owner}.{name}", record, sd, is_log, declared_in(owner, name, declared, doubts))
    return replace(constant, high=MAX_EXIT_RATIO) if name == "exit_ratio" else constant


def unknown_constant(owner: str, record: Record, name: str) -> Parameter:
    """Return a constant of which nothing is known: of a modulus its logarithm, or its size if not positive; else all.

    `scale` is how far apart starts are.
    """
    value, spec = float(getattr(record, name)), quantities(record)[name]
    is_modulus = SD[name].is_log
    size = abs(value) or SOFT if is_modulus else WIDE * (spec.high - spec.low)
    is_log = is_modulus and value > 0
    return replace(parameter_of(f"{owner}.{name}", record, DECADES if is_log else size, is_log), prior=False)
