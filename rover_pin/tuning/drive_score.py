"""The cost of a drive, which a tuning uses to compare gains: lack of progress, slip, energy, sinkage, and whether the
drive ends stuck or buries a wheel.
"""

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
from rover_pin.tuning.reduced_model.drive import ReducedOutcome

TAIL = 3.0
"""Length of the last part of a drive [s]. The mean speed in this part decides whether the drive counts as ending
stuck."""
STUCK_SPEED = 0.02 * CRUISE_SPEED
"""Minimum mean speed in the last part of a drive [m/s]. A slower rover counts as stuck. The limit is 1 mm/s, because at
a wall some rovers crawl at 2 mm/s and still get out."""
STUCK_WIDTH = 0.2 * STUCK_SPEED
"""Width [m/s] of the smooth step that decides in the reduced model whether a rover is stuck. The complete simulation
decides by the sharp limit `STUCK_SPEED`."""
BURIED_WIDTH = 0.01
"""Width of the smooth step that decides in the reduced model whether a wheel is buried, as a ratio h / r of sinkage to
wheel radius. The complete simulation decides by the sharp limit `Model.buried` for this ratio."""


@dataclass(frozen=True)
class Cost(Record):
    """The weights of the cost J of a drive. A tuning compares gains by this cost.

        J = progress (1 - x / (v_c T)) + slip mean(S^2) + energy E / (m g v_c T) + sinkage mean(h / r) + stuck

    x is the travelled distance along x, T the duration, v_c = 0.05 m/s the cruise speed, S the true slip, E the
    electric energy, m g the weight, and h / r the relative sinkage. Means are over wheels and time. `progress`, `slip`,
    `energy`, `sinkage` and `stuck` are the weights. The weight `stuck` is added if the drive ends stuck. If a wheel is
    buried (h = `Model.buried` r), the sum of all weights is added, so that a burial costs more than everything else.

    The cost of several drives is (1 - worst) mean(J) + worst max(J). When gains are chosen, the gains with fewer
    burials are always preferred.
    """

    progress: Scalar = quantity(1.0, "", "assumed: one for a drive that goes nowhere", 0.0, 1e3)
    slip: Scalar = quantity(0.3, "", "assumed", 0.0, 1e3)
    energy: Scalar = quantity(0.1, "", "assumed: cruise on the flat costs 0.03 then", 0.0, 1e3)
    sinkage: Scalar = quantity(0.5, "", "assumed: 9 mm deeper all the time cost 0.1; a wheel at rest 0.09", 0.0, 1e3)
    stuck: Scalar = quantity(1.0, "", "assumed: as bad as no progress at all", 0.0, 1e3)
    worst: Scalar = quantity(0.0, "", "assumed: the mean counts", 0.0, 1.0)

    def total(self, score: Score) -> Scalar:
        """Return the cost J of a drive from its score. If the fields of the score are arrays, the result is an array
        with the costs of several drives.
        """
        steady = self.slip * score.slip + self.energy * score.energy + self.sinkage * score.sinkage
        unburied = self.progress * (1.0 - score.progress) + steady + self.stuck * score.stuck
        return unburied + self.highest * score.buried

    @property
    def highest(self) -> Scalar:
        """The sum of all weights: the cost of a drive without progress and without burial, at full slip and sinkage,
        that ends stuck.
        """
        return self.progress + self.slip + self.energy + self.sinkage + self.stuck

    def over(self, costs: np.ndarray) -> np.ndarray:
        """Return the common cost of several drives from the costs of the single drives, which are along the last axis
        of `costs`.
        """
        return (1.0 - self.worst) * np.mean(costs, axis=-1) + self.worst * np.max(costs, axis=-1)

    def choice(self, scores: np.ndarray) -> np.ndarray:
        """Return the cost for the choice of gains, from the scores of several drives, an array (..., drives, fields of
        a score).

        Every burial adds the sum of all weights to the common cost of the drives, so that one burial outweighs all
        other costs.
        """
        buried = np.asarray(scores)[..., Score._fields.index("buried")]
        return self.mean(scores) + float(self.highest) * np.sum(buried, axis=-1)

    def mean(self, scores: np.ndarray) -> np.ndarray:
        """Return the common cost of several drives from their scores, an array (..., drives, fields of a score)."""
        return self.over(self.total(Score(*np.moveaxis(np.asarray(scores), -1, 0))))


class Score(NamedTuple):
    """The score of one drive: the quantities that `Cost` computes its cost from."""

    progress: Scalar
    """travelled distance along x divided by the distance of an undisturbed cruise [-]"""
    slip: Scalar
    """mean of the squared slip S^2 over wheels and time [-]"""
    energy: Scalar
    "electric energy divided by weight times cruise distance [-]"
    stuck: Scalar
    """1 if the rover ends stuck or the drive ended early, 0 otherwise; values between 0 and 1 occur in the reduced
    model only"""
    sinkage: Scalar
    """mean of sinkage divided by wheel radius over wheels and time [-]"""
    buried: Scalar
    """1 if a wheel sank by `Model.buried` times its radius, 0 otherwise; values between 0 and 1 occur in the reduced
    model only"""

    def cost(self, cost: Cost) -> float:
        """Return the cost J of the drive with the weights in `cost`."""
        return float(cost.total(self))


def score_trace(trace: Trace, model: Model, duration: float) -> Score:
    """Return the score of a simulated drive of the full rover (the complete simulation) from its trace.

    `duration` is the planned duration [s]. A drive that ended earlier counts as stuck.
    """
    # A drive that ended at once has no progress and counts as stuck; nothing can be averaged over it.
    if len(trace.t) < 2:
        return Score(progress=0.0, slip=1.0, energy=0.0, stuck=1.0, sinkage=float(model.buried), buried=0.0)
    x, energy = trace.need("body_x", "energy_electric")
    before_tail = float(np.interp(trace.t[-1] - TAIL, trace.t, x))
    # A drive may end early because of a failure, or end slowly at a wall; both count as stuck.
    stopped_early = trace.t[-1] < duration - 0.1
    slow = (x[-1] - before_tail) / TAIL < STUCK_SPEED
    cruise_distance = CRUISE_SPEED * duration
    weight = model.rover.mass * model.gravity
    slip = float(np.mean(trace.stack("slip") ** 2))
    sunk = np.mean(trace.stack("sinkage"), axis=1) / float(model.rover.wheel.r)
    # A drive that ended early is scored as if it had stood still with its last sinkage for the remaining time.
    missing_share = max(duration - trace.t[-1], 0.0) / duration
    sinkage = (1.0 - missing_share) * float(np.mean(sunk)) + missing_share * float(sunk[-1])
    buried = str(trace.attrs.get("stop", "")).startswith("buried")
    # The energy is compared with the weight times the distance of a cruise, so that rovers of any size have similar
    # scores.
    spent = float(energy[-1]) / (weight * cruise_distance)
    return Score(
        float(x[-1] - x[0]) / cruise_distance, slip, spent, float(stopped_early or slow), sinkage, float(buried)
    )


def score_outcome(outcome: ReducedOutcome, model: Model, start: float, duration: float) -> Score:
    """Return the score of a drive of the reduced model, with smooth steps instead of the sharp limits for stuck and
    buried.

    `start` is the x of the base at the start [m], and `duration` the duration of the drive [s].
    """
    cruise_distance = CRUISE_SPEED * duration
    weight = model.rover.mass * model.gravity
    stuck = 1.0 - _step((outcome.speed_end - STUCK_SPEED) / STUCK_WIDTH)
    buried = _step((outcome.deepest - model.buried) / BURIED_WIDTH)
    # A drive of the full rover ends when a wheel is buried, and then counts as stuck as well.
    stuck = 1.0 - (1.0 - stuck) * (1.0 - buried)
    spent = outcome.energy / (weight * cruise_distance)
    return Score((outcome.x_end - start) / cruise_distance, outcome.slip, spent, stuck, outcome.sinkage, buried)


def _step(x: Scalar) -> float:
    """Return a smooth step from 0 to 1 at x: 0 far below x = 0, 0.5 at x = 0, and 1 far above x = 0."""
    return 0.5 * (1.0 + math.tanh(0.5 * x))
