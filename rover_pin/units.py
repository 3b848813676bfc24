"""Units that are read at the edge; inside, everything is SI."""

from __future__ import annotations

import math

LBF, INCH, FOOT = 4.4482216152605, 0.0254, 0.3048
"""Pound-force [N], inch and foot [m]."""

UNITS: dict[str, tuple[str, float]] = {
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "km": ("m", 1e3),
    "in": ("m", INCH),
    "ft": ("m", FOOT),
    "rad": ("rad", 1.0),
    "deg": ("rad", math.pi / 180.0),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "ns": ("s", 1e-9),
    "min": ("s", 60.0),
    "kg": ("kg", 1.0),
    "g": ("kg", 1e-3),
    "N": ("N", 1.0),
    "kN": ("N", 1e3),
    "lbf": ("N", LBF),
    "kgf": ("N", 9.80665),
    "N m": ("N m", 1.0),
    "mN m": ("N m", 1e-3),
    "kN m": ("N m", 1e3),
    "lbf in": ("N m", LBF * INCH),
    "lbf ft": ("N m", LBF * FOOT),
    "Pa": ("Pa", 1.0),
    "N/m^2": ("Pa", 1.0),
    "kPa": ("Pa", 1e3),
    "MPa": ("Pa", 1e6),
    "kN/m^2": ("Pa", 1e3),
    "psi": ("Pa", LBF / INCH**2),
    "m/s": ("m/s", 1.0),
    "mm/s": ("m/s", 1e-3),
    "cm/s": ("m/s", 1e-2),
    "km/h": ("m/s", 1.0 / 3.6),
    "rad/s": ("rad/s", 1.0),
    "rpm": ("rad/s", math.pi / 30.0),
    "deg/s": ("rad/s", math.pi / 180.0),
    "rev/s": ("rad/s", 2.0 * math.pi),
    "rad/m": ("rad/m", 1.0),
    "deg/m": ("rad/m", math.pi / 180.0),
    "m/s^2": ("m/s^2", 1.0),
    "V": ("V", 1.0),
    "mV": ("V", 1e-3),
    "A": ("A", 1.0),
    "mA": ("A", 1e-3),
    "ohm": ("ohm", 1.0),
    "kg/m^3": ("kg/m^3", 1.0),
    "g/cm^3": ("kg/m^3", 1e3),
    "t/m^3": ("kg/m^3", 1e3),
    "lb/ft^3": ("kg/m^3", 0.45359237 / FOOT**3),
}
"""Units read at the edge: name -> (SI name, factor). Any other unit must be the field's own, spelled the same."""
