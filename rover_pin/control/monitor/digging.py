"""How fast the ground digs: hypotheses, each with its own holes, weighed by the forces along the way."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.monitor.ahead import Pull

RATES = np.array([0.0, 0.05, 0.1, 0.15, 0.2])
"""c_d of each hypothesis: none, and up to four times what `DiggingMemory` assumes."""
PRIOR = np.array([0.5, 0.125, 0.125, 0.125, 0.125])
"""Their probabilities beforehand (assumed: half of all ground does not dig)."""
BALANCE_SD = 0.03
"""Error of the balance of forces over the weight (assumed: strength of the soil, level)."""
CORRELATED, MEMORY = 0.5, 25.0
"""Balances nearer than this err alike; times longer ago than this count no more [s] (both assumed)."""
STRAY = 0.05
"""Likelihood, over its peak, that any balance keeps: an obstacle may push at any time."""


class Contacts(NamedTuple):
    """What the belief says of the wheels at a sample (wheels,), means of its particles."""

    rim: np.ndarray
    slope: np.ndarray
    level: np.ndarray
    load: np.ndarray
    travel: np.ndarray
    "forward speed of the ground under the wheel [m/s]"
    slip: np.ndarray

    @property
    def shares(self) -> np.ndarray:
        """Share of each wheel in the load."""
        load = np.maximum(self.load, 0.0)
        return load / max(float(load.sum()), 1e-9)


@lru_cache(maxsize=16)
def deepening(count: int) -> ca.Function:
    """Return the function c_d, v, rim, r, D -> dD/dt of `HoleLaw`, columns of `count` rows."""
    c_d, v, rim, r, D = (ca.MX.sym(name, count) for name in ("c_d", "v", "rim", "r", "D"))
    return ca.Function("deepening", [c_d, v, rim, r, D], [HoleLaw(c_d=c_d, r=r).deepening(v, rim, D)])


class Digging:
    """Weights of `RATES`, and the holes that each digs."""

    def __init__(self, pull: Pull, radii: np.ndarray):
        self.pull, self.radii = pull, radii
        self.reset()

    def reset(self) -> None:
        """Begin on fresh ground."""
        self.holes = np.zeros((len(self.radii), len(RATES)))
        self.evidence = np.zeros(len(RATES))

    @property
    def weights(self) -> np.ndarray:
        """Probability of each rate."""
        weights = PRIOR * np.exp(self.evidence - self.evidence.max())
        return np.asarray(weights / weights.sum())

    def update(self, at: Contacts, unknown: float, period: float, settled: bool) -> None:
        """Dig on, and weigh by the balance; `unknown` is the SD of what uneven ground adds to it [-]."""
        rows = (np.repeat(column, len(RATES)) for column in (at.travel, at.rim, self.radii))
        rates = deepening(self.holes.size)(np.tile(RATES, len(self.radii)), *rows, self.holes.ravel())
        self.holes = np.maximum(self.holes + period * np.asarray(rates).reshape(self.holes.shape), 0.0)
        if settled:
            slips = np.repeat(at.slip[:, None], len(RATES), axis=1)
            net = self.pull.less_resistance(slips, self.holes, at.shares, at.slope)
            density = np.exp(-0.5 * net**2 / (BALANCE_SD**2 + unknown**2)) + STRAY
            self.evidence = (1.0 - period / MEMORY) * self.evidence + np.log(density) * period / CORRELATED
