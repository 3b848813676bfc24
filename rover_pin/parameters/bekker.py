"""Convert Bekker's pressure-sinkage constants k_c and k_phi to the constants k_1 and k_2 of Eq (4).

Eq (4) is the law of normal stress in the paper on slip control of the rover Nexus 6: p = (k_1 + k_2 b) (z / b)^n at the
sinkage z under a wheel of width b.
"""

import math
import re
from collections.abc import Mapping
from typing import Any

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import refuse_strange, to_si
from rover_pin.base.units import factor_to
from rover_pin.contact import Scalar, Soil

POWERS = {"k_c": 1, "k_phi": 2}
"""Power of length in the denominator of a Bekker constant's unit, apart from the sinkage exponent n. The constant k_c
is a force divided by length^(n + 1), and k_phi is a force divided by length^(n + 2)."""
WRITTEN = re.compile(r"(\S+?)\s*/\s*([a-z]+)\s*\^\s*\(?\s*n\s*([+-]\s*\d+)?\s*\)?")
"""Pattern of a published unit of k_c or k_phi: a force or pressure divided by a power of a length that contains n."""


def bekker_si(name: str, value: float, unit: str, n: float | None, where: str) -> float:
    """Return Bekker's constant k_c [N/m^(n+1)] or k_phi [N/m^(n+2)] from its value in a published unit.

    The unit is a force or a pressure divided by a power of a length that contains the sinkage exponent n: kN/m^(n+1),
    lb/in^(n+1), kPa/m^(n-1), psi/in^n, N/cm^(n+2). A pressure counts as a force divided by m^2, also if the length is
    not in metres.

    Parameters
    ----------
    name : str
        k_c or k_phi.
    value : float
        Value of the constant in the published unit.
    unit : str
        The unit as published.
    n : float or None
        Sinkage exponent. It is needed if the length is not in metres.
    where : str
        Location of the number for an error message: file and key.

    Raises
    ------
    ParameterError
        The unit has another form or another power than this constant, or its length needs n and n is None.

    Examples
    --------
    >>> bekker_si("k_c", 1.0, "kN/m^(n+1)", None, "sand.toml")
    1000.0
    """
    # A unit such as kN/m^(n+1): the part before the slash, the length, and the number that is added to n.
    matched = WRITTEN.fullmatch(unit.strip())
    top, under = (matched[1], matched[2]) if matched else ("", "")
    pressure = math.isnan(factor_to(top, "N"))
    factor, length = factor_to(top, "Pa" if pressure else "N"), factor_to(under, "m")
    # A pressure is a force over m^2, which adds 2 to the power of length.
    power = int((matched[3] or "0").replace(" ", "")) if matched else 0
    # An unknown unit makes the product NaN. A known unit must have the power of length of this constant.
    if math.isnan(factor * length) or power + 2 * pressure != POWERS[name]:
        over, pascals = f"/m^(n+{POWERS[name]})", "kPa/m^(n-1)" if name == "k_c" else "kPa/m^n"
        raise ParameterError(
            f"{where}: unit '{unit}' is not a unit of {name}: write N{over}, kN{over} or {pascals}; the length may "
            "also be in or cm."
        )
    # In metres the power of length does not matter, so n is not needed.
    if length == 1.0:
        return value * factor
    if n is None:
        raise ParameterError(
            f"{where}: unit '{unit}' has a length to a power of n: state n as well, or use the length m."
        )
    return value * factor / length ** (n + power)


def bekker(k_c: Scalar, k_phi: Scalar, n: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
    """Return the constants k_1 [Pa] and k_2 [Pa/m] of Eq (4) from Bekker's constants, for a wheel of width b [m].

    Bekker's pressure at the sinkage z, p = (k_c / b + k_phi) z^n, equals the pressure of Eq (4), p = (k_1 + k_2 b) (z /
    b)^n, if k_1 = k_c b^(n-1) and k_2 = k_phi b^(n-1). The constants of Eq (4) are therefore valid for one width only,
    except for n = 1.

    Parameters
    ----------
    k_c : Scalar
        Cohesive modulus [N/m^(n+1)].
    k_phi : Scalar
        Frictional modulus [N/m^(n+2)].
    n : Scalar
        Sinkage exponent [-].
    b : Scalar
        Width of the wheel [m].

    Source: M. G. Bekker, Introduction to Terrain-Vehicle Systems (1969); Eq (4) in Reece's form.

    Examples
    --------
    >>> bekker(1e3, 5e5, 1.0, 0.05)
    (1000.0, 500000.0)
    """
    return k_c * b ** (n - 1), k_phi * b ** (n - 1)


def from_bekker(table: Mapping[str, Any], b: Scalar, where: str, n: float | None = None) -> dict[str, Any]:
    """Return a table of soil constants with k_1 [Pa] and k_2 [Pa/m] of Eq (4) in place of Bekker's k_c and k_phi.

    Eq (4) is the pressure p = (k_1 + k_2 b) (z / b)^n at the sinkage z. A table without k_c and k_phi is returned
    unchanged.

    Parameters
    ----------
    table : mapping
        Name of each constant -> its number in SI, or an entry `{ value, unit }`. The unit of k_c and of k_phi must be
        one that `bekker_si` accepts.
    b : Scalar
        Width [m] of the wheel; the constants k_1 and k_2 hold for this width.
    where : str
        Location of the table for an error message: file and key.
    n : float, optional
        Sinkage exponent from another table, if this table has no n.

    Raises
    ------
    ParameterError
        One of k_c, k_phi and n is missing, or k_1 or k_2 is also given.
    """
    given = [name for name in POWERS if name in table]
    if not given:
        return dict(table)
    # Two statements of one stiffness could contradict each other, so they are refused.
    both = [name for name in ("k_1", "k_2") if name in table]
    if both:
        raise ParameterError(
            f"{where}: {given[0]} and {both[0]} both state the soil's stiffness: leave one of them out."
        )
    # The exponent converts the units and the constants, so all three constants must be given together.
    entry = table.get("n", n)
    exponent = entry.get("value") if isinstance(entry, Mapping) else entry
    missing = [name for name in POWERS if name not in given] + (["n"] if exponent is None else [])
    if missing:
        raise ParameterError(
            f"{where}: {given[0]} needs {' and '.join(missing)} as well: state all of Bekker's constants k_c, k_phi "
            "and n, or k_1 = k_c b^(n-1) and k_2 = k_phi b^(n-1) of Eq (4) instead, where b is the width of the wheel "
            "in metres."
        )
    if isinstance(exponent, bool) or not isinstance(exponent, (int, float)):
        raise ParameterError(f"{where}: n = {exponent!r} is not a number.")
    # Each constant is converted by its own unit; without a unit, it is taken in SI.
    constants = {}
    for name in given:
        written = table[name] if isinstance(table[name], Mapping) else {"value": table[name]}
        refuse_strange(written, f"{where}: {name}")
        unit = str(written.get("unit", f"N/m^(n+{POWERS[name]})"))
        number = to_si(written.get("value"), "", "", f"{where}: {name}")
        constants[name] = bekker_si(name, number, unit, float(exponent), f"{where}: {name}")
    # From here on only Eq (4) is used, so k_c and k_phi are removed from the table.
    k_1, k_2 = bekker(constants["k_c"], constants["k_phi"], float(exponent), b)
    return {**{name: value for name, value in table.items() if name not in POWERS}, "k_1": k_1, "k_2": k_2}


def at_width(soil: Soil, b: Scalar, made_for: Scalar) -> Soil:
    """Return a soil whose constants k_1 and k_2 of the normal stress hold for a wheel of width b [m].

    The constants of the given soil hold for the width `made_for` [m]; see `bekker` for their dependence on the width.
    """
    # k_c and k_phi are the same for all widths, and k_1, k_2 are proportional to b^(n-1).
    return soil.replace(k_1=soil.k_1 * (b / made_for) ** (soil.n - 1), k_2=soil.k_2 * (b / made_for) ** (soil.n - 1))
