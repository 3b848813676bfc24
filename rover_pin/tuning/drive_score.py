"""What a drive costs: too little progress, slip, energy, digging in, and being stuck in the end; none may be buried."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.simulation.model.cruise import CRUISE_SPEED
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.trace.trace import Trace
from rover_pin.tuning.reduced_model.drive import Outcome

TAIL = 3.0
"""The end of a drive [s], whose mean speed tells whether the rover is stuck."""
STUCK_SPEED = 0.02 * CRUISE_SPEED
"""A rover that is slower than this over the tail is stuck [m/s]; at a wall some crawl at 2 mm/s and still get out."""
STUCK_WIDTH = 0.2 * STUCK_SPEED
"""Width of the smooth step that stands for it in the reduced model [m/s]."""
BURIED_WIDTH = 0.01
"""Width of that for a buried wheel, h / r above `Model.buried`."""


@dataclass(frozen=True)
class Cost(Record):
    """J = progress (1 - x / (v_c T)) + slip mean(S^2) + energy E / (m g v_c T) + sinkage mean(h / r) + stuck.

    v_c = 0.05 m/s; S is the true slip, E the electric energy, means are over wheels and time; the weight of stuck
    counts where that came about. A buried wheel (it sank by `Model.buried` r) is a constraint, no weight: such a drive
    costs as much more as all else together, and of an ensemble the fewest burials come first, then
    (1 - worst) mean(J) + worst max(J).
    """

    progress: Scalar = quantity(1.0, "", "assumed: one for a drive that goes nowhere", 0.0, 1e3)
    slip: Scalar = quantity(0.3, "", "assumed", 0.0, 1e3)
    energy: Scalar = quantity(0.1, "", "assumed: cruise on the flat costs 0.03 then", 0.0, 1e3)
    sinkage: Scalar = quantity(0.5, "", "assumed: 9 mm deeper all the time cost 0.1; a wheel at rest 0.09", 0.0, 1e3)
    stuck: Scalar = quantity(1.0, "", "assumed: as bad as no progress at all", 0.0, 1e3)
    worst: Scalar = quantity(0.0, "", "assumed: the mean counts", 0.0, 1.0)

    def total(self, score: Score) -> Scalar:
        """Return J of one drive, or of each of several."""
        steady = self.slip * score.slip + self.energy * score.energy + self.sinkage * score.sinkage
        unburied = self.progress * (1.0 - score.progress) + steady + self.stuck * score.stuck
        return unburied + self.highest * score.buried

    @property
    def highest(self) -> Scalar:
        """What a drive costs that makes no progress, slips, digs and gets stuck: all weights together."""
        return self.progress + self.slip + self.energy + self.sinkage + self.stuck

    def over(self, costs: np.ndarray) -> np.ndarray:
        """Return the ensemble's cost from those of the drives, along the last axis."""
        return (1.0 - self.worst) * np.mean(costs, axis=-1) + self.worst * np.max(costs, axis=-1)

    def choice(self, scores: np.ndarray) -> np.ndarray:
        """Return what gains are chosen by, from scores (..., drives, parts): one burial outweighs any other cost."""
        buried = np.asarray(scores)[..., Score._fields.index("buried")]
        return self.mean(scores) + float(self.highest) * np.sum(buried, axis=-1)

    def mean(self, scores: np.ndarray) -> np.ndarray:
        """Return the ensemble's cost from scores (..., drives, parts)."""
        return self.over(self.total(Score(*np.moveaxis(np.asarray(scores), -1, 0))))


class Score(NamedTuple):
    """One drive, judged."""

    progress: Scalar
    "distance along x over that of an undisturbed cruise [-]"
    slip: Scalar
    "mean of S^2 over wheels and time [-]"
    energy: Scalar
    "electric energy over weight times cruise distance [-]"
    stuck: Scalar
    "1 where the rover ends up stuck or the drive ended early, else 0; in between only in the reduced model"
    sinkage: Scalar
    "mean of h / r over wheels and time [-]"
    buried: Scalar
    "1 where a wheel sank by `Model.buried` radii, else 0; in between only in the reduced model"

    def cost(self, cost: Cost) -> float:
        """Return J."""
        return float(cost.total(self))


def score_trace(trace: Trace, model: Model, duration: float) -> Score:
    """Return the score of a full drive that was to last `duration` [s]; one that ended early is stuck."""
    if len(trace.t) < 2:
        return Score(progress=0.0, slip=1.0, energy=0.0, stuck=1.0, sinkage=float(model.buried), buried=0.0)
    x, energy = trace.need("body_x", "energy_electric")
    end = float(np.interp(trace.t[-1] - TAIL, trace.t, x))
    stopped_early = trace.t[-1] < duration - 0.1
    slow = (x[-1] - end) / TAIL < STUCK_SPEED
    way = CRUISE_SPEED * duration
    weight = model.rover.mass * model.gravity
    slip = float(np.mean(trace.stack("slip") ** 2))
    sunk = np.mean(trace.stack("sinkage"), axis=1) / float(model.rover.wheel.r)
    # what a drive that ended early would have gone on with
    missing_share = max(duration - trace.t[-1], 0.0) / duration
    sinkage = (1.0 - missing_share) * float(np.mean(sunk)) + missing_share * float(sunk[-1])
    buried = str(trace.attrs.get("stop", "")).startswith("buried")
    spent = float(energy[-1]) / (weight * way)
    return Score(float(x[-1] - x[0]) / way, slip, spent, float(stopped_early or slow), sinkage, float(buried))


def score_outcome(outcome: Outcome, model: Model, start: float, duration: float) -> Score:
    """Return the score of a reduced drive; being stuck or buried is a smooth step at the end."""
    way = CRUISE_SPEED * duration
    weight = model.rover.mass * model.gravity
    stuck = 1.0 - _step((outcome.speed_end - STUCK_SPEED) / STUCK_WIDTH)
    buried = _step((outcome.deepest - model.buried) / BURIED_WIDTH)
    # a full drive ends when a wheel is buried, and counts as stuck
    stuck = 1.0 - (1.0 - stuck) * (1.0 - buried)
    spent = outcome.energy / (weight * way)
    return Score((outcome.x_end - start) / way, outcome.slip, spent, stuck, outcome.sinkage, buried)


def _step(x: Scalar) -> float:
    """Return 0 far below 0 and 1 far above."""
    return 0.5 * (1.0 + math.tanh(0.5 * x))
