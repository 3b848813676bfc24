"""The paper's statements on F(S), as limits on numbers that F alone determines. The SDs are assumed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

SLIPS = np.linspace(0.0, 1.0, 51)


class Statement(NamedTuple):
    """A sentence of the paper as a limit on a number of F(S)."""

    words: str
    short: str
    number: Callable[[np.ndarray], float]
    low: float
    high: float
    sd: float

    def residual(self, F: np.ndarray) -> float:
        """Return the distance of the number from its limits [SD]: the nearer limit minus the number, and 0 inside."""
        value = self.number(F)
        return (max(self.low - value, 0.0) + min(self.high - value, 0.0)) / self.sd


def degrees(F: float) -> float:
    """Return the slope [deg] that a traction factor holds."""
    return math.degrees(math.atan(F))


def slip_on(slope_deg: float) -> Callable[[np.ndarray], float]:
    """Return the function of F that gives the steady slip on a slope: the first S with F(S) = tan(slope), else 1."""
    required = math.tan(math.radians(slope_deg))

    def slip(F: np.ndarray) -> float:
        # A rover that drives on the slope without slip has slip 0.
        """Return the first S with F(S) = tan(slope), by linear interpolation."""
        if F[0] >= required:
            return 0.0
        # The first slip at which the traction suffices; F may fall again at a higher slip.
        over = np.flatnonzero(required <= F)
        if not over.size:
            return 1.0 + float(required - F.max())  # a slope for the search where no slip holds
        at = int(over[0])
        return float(np.interp(required, F[at - 1 : at + 1], SLIPS[at - 1 : at + 1]))

    return slip


def at(F: np.ndarray, S: float) -> float:
    """Return F at a slip."""
    return float(np.interp(S, SLIPS, F))


STATEMENTS = (
    Statement("Fig 6: 'an increasing trend'", "F rises", lambda F: float(np.diff(F).min()), 0.0, math.inf, 0.002),
    Statement("Fig 6: 'traction force exists even at S = 1'", "F(1) > 0", lambda F: at(F, 1.0), 0.0, math.inf, 0.01),
    Statement("Fig 10: 0.05 m/s, 'S equals to almost 0'", "slip on the flat", slip_on(0.0), 0.0, 0.05, 0.05),
    Statement("Fig 8: 'stays near 0' before 12 deg", "slip at 10 deg", slip_on(10.0), 0.0, 0.1, 0.1),
    Statement("Fig 8: 12 deg is climbed", "climbs 12 deg", lambda F: degrees(F.max()), 12.0, math.inf, 0.5),
    Statement("Fig 8: 18 deg is not", "not 18 deg", lambda F: degrees(F.max()), -math.inf, 18.0, 0.5),
    Statement(
        "Fig 8: 'switches from 0 to 1' at 12 deg",
        "switches",
        lambda F: degrees(at(F, 0.9)) - degrees(at(F, 0.1)),
        -math.inf,
        2.0,
        0.5,
    ),
    Statement(
        "Fig 10: with less slip 'the vehicle velocity increased'",
        "less slip pulls more",
        lambda F: float(F[SLIPS <= 0.5].max()) - at(F, 1.0),
        0.02,
        math.inf,
        0.01,
    ),
)
