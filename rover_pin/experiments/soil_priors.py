"""Choose the priors of the constants of wheel and soil: with a declared SD, with an assumed SD, or no prior at all.

The assumed SDs of the motor and of the motion resistance are here too, because `scenarios` needs them and must not load
SciPy, as the model of a drive log does.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from rover_pin.base.quantity import Record, quantities
from rover_pin.estimation.parameter import Parameter, declared_in, parameter_of

DECLARED_SD, UNDECLARED_SD = 0.35, 0.7
"""Relative SD of a soil modulus (assumed). DECLARED_SD holds for a modulus that is declared without an SD: bench tests
of one soil differ by about this much. UNDECLARED_SD holds for a modulus that is not declared: its default value may be
wrong by a factor of 2 (e^0.7 = 2.0)."""
SIZE_SD = 0.01
"""Assumed relative SD of a wheel's radius or width that is declared without an SD; it equals the assumption for drive
logs (`Sampling.wheel_error`)."""
MOTOR_SD = {"gear": 0.04, "resistance": 0.04}
"""Motor constant -> prior relative SD if the constant is declared without an SD (assumed: data sheets)."""
RESISTANCE_SD, UNDECLARED_RESISTANCE_SD, UNDECLARED_DECAY_SD = 0.25, 0.15, 1.0
"""Prior relative SD of a motion resistance R that is declared without an SD; prior SD of an R, and of its decay q, if
they are not declared (assumed: wheels on loose sand roll at 0 to 0.3 of their load; q may have any allowed value)."""
DECADES = math.log(5.0)
"""Distance between neighbouring initial guesses of log k and of log k_1 in a fit, if these constants have no prior."""
WIDE = 0.25
"""Distance between neighbouring initial guesses of phi in a fit, as a fraction of the allowed range of phi, if phi has
no prior."""
MAX_EXIT_RATIO = 0.99
"""Maximum exit ratio (exit angle divided by entry angle) in a fit. Why: at 1 the stress has a second singularity, at
which derivatives jump."""
SOFT = 1e5
"""Distance between neighbouring initial guesses of a modulus [Pa] in a fit, if the modulus has the value 0 and no
prior."""


class AssumedSd(NamedTuple):
    """Prior SDs that are assumed for a constant of wheel or soil whose value is stated without an SD."""

    declared: float
    """SD if the value is declared with the data, for example from a bench test"""
    undeclared: float
    """SD if the value is taken from another soil"""
    is_log: bool = False
    "whether `declared` and `undeclared` are SDs of the logarithm of the constant"


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
"""Name of a constant of wheel or soil -> its prior SDs if only its value is known (all assumed)."""


def known_constant(
    owner: str, record: Record, name: str, declared: Mapping[str, float], doubts: Mapping[str, float]
) -> Parameter:
    """Return a constant of soil or wheel as a parameter with a prior around its value, with its declared or an assumed
    SD.

    Parameters
    ----------
    owner, name : str
        "soil" or "wheel", and the name of the constant, such as "phi".
    declared, doubts : mapping
        Name of a constant -> its declared value, and name -> its declared SD, both in SI.
    """
    value, assumed = abs(float(getattr(record, name))), SD[name]
    # The logarithm of 0 does not exist, so a constant of 0 is fitted by its value even if it is a modulus.
    is_log = assumed.is_log and float(getattr(record, name)) > 0
    # A declared SD is absolute and is converted to a relative one if the logarithm is fitted.
    sd = assumed.declared if name in declared else assumed.undeclared
    if name in doubts:
        sd = doubts[name] / (value if is_log else 1.0)
    elif assumed.is_log and not is_log:
        sd *= value
    constant = parameter_of(f"{owner}.{name}", record, sd, is_log, declared_in(owner, name, declared, doubts))
    return replace(constant, high=MAX_EXIT_RATIO) if name == "exit_ratio" else constant


def unknown_constant(owner: str, record: Record, name: str) -> Parameter:
    """Return a constant of soil or wheel as a parameter without a prior, for a constant that the data must determine
    alone.

    The field `scale` of the parameter is the distance between neighbouring initial guesses of the constant in a fit.

    The logarithm of the constant is fitted if it is a positive modulus or length (such as k or k_1). Other constants
    are fitted by their value.
    """
    value, spec = float(getattr(record, name)), quantities(record)[name]
    # Without a prior, `scale` only sets the distance of the initial guesses, not a belief about the value.
    is_modulus = SD[name].is_log
    size = abs(value) or SOFT if is_modulus else WIDE * (spec.high - spec.low)
    is_log = is_modulus and value > 0
    return replace(parameter_of(f"{owner}.{name}", record, DECADES if is_log else size, is_log), prior=False)
