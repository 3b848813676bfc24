"""Bekker's pressure-sinkage constants as the k_1, k_2 of Eq (4)."""

import math
import re

from rover_pin.base.errors import ParameterError
from rover_pin.base.units import factor_to
from rover_pin.contact import Scalar, Soil

POWERS = {"k_c": 1, "k_phi": 2}
"""k_c is a force over length^(n + 1), k_phi one over length^(n + 2)."""
WRITTEN = re.compile(r"(\S+?)\s*/\s*([a-z]+)\s*\^\s*\(?\s*n\s*([+-]\s*\d+)?\s*\)?")


def bekker_si(name: str, value: float, unit: str, n: float | None, where: str) -> float:
    """Return k_c [N/m^(n+1)] or k_phi [N/m^(n+2)] of a value in a published unit.

    Read are a force or a pressure over a power of a length that holds the exponent: kN/m^(n+1), lb/in^(n+1),
    kPa/m^(n-1), psi/in^n, N/cm^(n+2). A pressure is a force over m^2, whatever the length.

    Parameters
    ----------
    name : str
        k_c or k_phi.
    n : float or None
        The exponent, which lengths other than the metre need.

    Raises
    ------
    ParameterError
        A unit of another form or power than this constant's, or a length that needs n, with `where` it stands.
    """
    matched = WRITTEN.fullmatch(unit.strip())
    top, under = (matched[1], matched[2]) if matched else ("", "")
    pressure = math.isnan(factor_to(top, "N"))
    factor, length = factor_to(top, "Pa" if pressure else "N"), factor_to(under, "m")
    power = int((matched[3] or "0").replace(" ", "")) if matched else 0
    if math.isnan(factor * length) or power + 2 * pressure != POWERS[name]:
        over, pascals = f"/m^(n+{POWERS[name]})", "kPa/m^(n-1)" if name == "k_c" else "kPa/m^n"
        raise ParameterError(
            f"{where}: unit '{unit}' is none of {name}'s: write N{over}, kN{over}, {pascals}, or one with in or cm."
        )
    if length == 1.0:
        return value * factor
    if n is None:
        raise ParameterError(f"{where}: unit '{unit}' depends on n: declare n too, or give it in metres.")
    return value * factor / length ** (n + power)


def bekker(k_c: Scalar, k_phi: Scalar, n: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
    """Return k_1 [Pa], k_2 [Pa/m] of Eq (4) for a wheel of width b [m].

    Bekker's p = (k_c / b + k_phi) z^n is Eq (4)'s (k_1 + k_2 b) (z / b)^n with k_1 = k_c b^(n-1), k_2 = k_phi b^(n-1):
    the constants of Eq (4) belong to a width unless n = 1.

    Parameters
    ----------
    k_c : Scalar
        Cohesive modulus [N/m^(n+1)].
    k_phi : Scalar
        Frictional modulus [N/m^(n+2)].

    Source: M. G. Bekker, Introduction to Terrain-Vehicle Systems (1969); Eq (4) in Reece's form.
    """
    return k_c * b ** (n - 1), k_phi * b ** (n - 1)


def at_width(soil: Soil, b: Scalar, made_for: Scalar) -> Soil:
    """Return a soil converted by `bekker` for the width `made_for` [m], for a wheel of width b [m] instead."""
    return soil.replace(k_1=soil.k_1 * (b / made_for) ** (soil.n - 1), k_2=soil.k_2 * (b / made_for) ** (soil.n - 1))
