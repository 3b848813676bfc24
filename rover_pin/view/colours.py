"""The colours of slip: blue where a wheel brakes, pale where it rolls, through orange to dark red where it only spins.

They differ in lightness too, so that they are distinct without colours.
"""

import numpy as np

STOPS: tuple[tuple[float, tuple[float, float, float]], ...] = (
    (-1.0, (0.13, 0.30, 0.62)),
    (0.0, (0.93, 0.93, 0.86)),
    (0.5, (0.95, 0.62, 0.18)),
    (1.0, (0.55, 0.05, 0.10)),
)
"""Slip -> red, green, blue in 0..1; linear in between."""
UNKNOWN = (0.45, 0.47, 0.50)
STEPS = 20
"""Colours of a unit of slip: a wheel's is sent anew only where it changes by one."""


def slip_colour(slip: float) -> tuple[float, float, float]:
    """Return the colour of a slip; grey where it is not known."""
    if not np.isfinite(slip):
        return UNKNOWN
    at = [stop[0] for stop in STOPS]
    rounded = round(slip * STEPS) / STEPS
    r, g, b = (float(np.interp(rounded, at, [stop[1][i] for stop in STOPS])) for i in range(3))
    return r, g, b


def in_bytes(colour: tuple[float, float, float]) -> tuple[int, int, int]:
    """Return a colour as three whole numbers from 0 to 255."""
    r, g, b = (round(255.0 * channel) for channel in colour)
    return r, g, b


def css_gradient() -> str:
    """Return the colours from slip -1 to 1 as a CSS gradient."""
    stops = (f"rgb{in_bytes(colour)} {50.0 * (at + 1.0):g}%" for at, colour in STOPS)
    return f"linear-gradient(to right, {', '.join(stops)})"
