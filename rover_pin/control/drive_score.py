"""What a drive costs: too little progress, slip, energy, and being stuck in the end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from rover_pin.contact import Scalar
from rover_pin.control.reduced import Outcome
from rover_pin.motion.model import CRUISE_SPEED, Model
from rover_pin.motion.trace import Trace
from rover_pin.quantity import Record, quantity

TAIL = 3.0
"""The end of a drive [s], whose mean speed tells whether the rover is stuck."""
STUCK_SPEED = 0.02 * CRUISE_SPEED
"""A rover that is slower than this over the tail is stuck [m/s]; at a wall some crawl at 2 mm/s and still get out."""
STUCK_WIDTH = 0.2 * STUCK_SPEED
"""Width of the smooth step that stands for it where derivatives are wanted [m/s]."""


@dataclass(frozen=True)
class Cost(Record):
    """J = progress (1 - x / (v_c T)) + slip mean(S^2) + energy E / (m g v_c T) + stuck [stuck], v_c = 0.05 m/s.

    Over an ensemble: (1 - worst) mean(J) + worst max(J). The energy is the electric one; S is the true slip.
    """

    progress: Scalar = quantity(1.0, "", "assumed: one for a drive that goes nowhere", 0.0, 1e3)
    slip: Scalar = quantity(0.3, "", "assumed", 0.0, 1e3)
    energy: Scalar = quantity(0.1, "", "assumed: cruise on the flat costs 0.03 then", 0.0, 1e3)
    stuck: Scalar = quantity(1.0, "", "assumed: as bad as no progress at all", 0.0, 1e3)
    worst: Scalar = quantity(0.0, "", "assumed: the mean counts", 0.0, 1.0)

    def total(self, progress: Scalar, slip: Scalar, energy: Scalar, stuck: Scalar) -> Scalar:
        """Return J of one drive."""
        return self.progress * (1.0 - progress) + self.slip * slip + self.energy * energy + self.stuck * stuck

    def over(self, costs: np.ndarray) -> np.ndarray:
        """Return the ensemble's cost from those of the drives, along the last axis."""
        return (1.0 - self.worst) * np.mean(costs, axis=-1) + self.worst * np.max(costs, axis=-1)


class Score(NamedTuple):
    """One drive, judged."""

    progress: float
    "distance along x over that of an undisturbed cruise [-]"
    slip: float
    "mean of S^2 over wheels and time [-]"
    energy: float
    "electric energy over weight times cruise distance [-]"
    stuck: float
    "1 where the rover ends up stuck or the drive ended early, else 0; in between only where smoothed"

    def cost(self, cost: Cost) -> float:
        """Return J."""
        return float(cost.total(*self))


def score_trace(trace: Trace, model: Model, duration: float) -> Score:
    """Return the score of a full drive that was to last `duration` [s]; one that ended early is stuck."""
    if len(trace.t) < 2:
        return Score(0.0, 1.0, 0.0, 1.0)
    x, energy = trace.need("body_x", "energy_electric")
    end = float(np.interp(trace.t[-1] - TAIL, trace.t, x))
    ended = trace.t[-1] < duration - 0.1
    slow = (x[-1] - end) / TAIL < STUCK_SPEED
    way = CRUISE_SPEED * duration
    weight = model.rover.mass * model.gravity
    slip = float(np.mean(trace.stack("slip") ** 2))
    return Score(float(x[-1] - x[0]) / way, slip, float(energy[-1]) / (weight * way), float(ended or slow))


def score_outcome(outcome: Outcome, model: Model, start: float, duration: float) -> Score:
    """Return the score of a reduced drive, floats or expressions; being stuck is a smooth step of the end speed."""
    way = CRUISE_SPEED * duration
    weight = model.rover.mass * model.gravity
    stuck = 0.5 * (1.0 - ca.tanh(0.5 * (outcome.speed_end - STUCK_SPEED) / STUCK_WIDTH))
    return Score((outcome.x_end - start) / way, outcome.slip, outcome.energy / (weight * way), stuck)
