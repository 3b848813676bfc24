"""P(stuck) and P(buried) within seconds and their most likely cause, from what the rover feels on board."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rover_pin.control.monitor.ahead import DRAWS, AheadLaw, Pull, Ways, go_on
from rover_pin.control.monitor.digging import RATES, Contacts, Digging
from rover_pin.control.monitor.faults import Faults
from rover_pin.control.sensing.belief import UNDER
from rover_pin.control.sensing.laws import LEAST_LEVEL
from rover_pin.control.sensing.onboard_slip import CREEP, SLIPS, OnboardSlip
from rover_pin.control.torque_factor import pull_factors, standing_sinkage
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.simulation.command import Reading
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.outcome.outcome import GRIP

CAUSES = ("grip lost", "digging", "wall", "motor", "sensor")
CANNOT_TELL = "cannot tell"
EVERY, SETTLED = 2, 10
"""Samples from one look ahead to the next, and from the start until the belief has felt anything."""
STEEPENING = 0.01
"""SD of the rate at which the ground ahead takes more or less force, over the weight [1/s]: chosen on the drives of
`studies/monitor.py` for the seed 291001, so that P is as often right as it says."""
ALARM, SMOOTHED = 0.75, 0.3
"""P(stuck), smoothed over these seconds, from which an alarm is raised: that of less than five false ones an hour for
the seeds 291001 and 291002. Below half of it an alarm ends."""
WORTH = 0.2
"""P(stuck) from which a cause is looked for, and P of the cause from which it is named, over that."""
NAMED = 0.5


class Forecast(NamedTuple):
    """What the monitor says at a sample, of the next `HORIZON` seconds under the present command."""

    t: float
    "time of the sample [s]"
    p_stuck: float
    "probability that the rover then stands while its rims turn: S above 0.9 [-]"
    p_buried: float
    "probability that a wheel has sunk by `Model.buried` radii by then [-]"
    alarm: bool
    "whether the smoothed P(stuck) has reached `ALARM`, and has not fallen to half of it since"
    cause: str
    "most likely cause: one of `CAUSES`, 'cannot tell', or '' where P(stuck) is below `WORTH` and nothing is at fault"
    causes: tuple[float, ...]
    "probability of each of `CAUSES` [-]; the first three sum to P(stuck) where that is `WORTH` or more"


@dataclass
class Monitor:
    """The monitor of a rover: `step` is called once a control period.

    The on-board belief's particles are drawn with a rate of digging each, and go on for `HORIZON` under the present rim
    speeds by the balance of forces (`AheadLaw`): P(stuck) is the share of them that come to stand. What pushes back now
    beyond slope and hole is an obstacle, passed within a radius of way. The causes are what would let go: P without an
    obstacle is less by that of a wall, P without holes besides by that of digging; what remains is grip lost.

    Source: none. What it cannot see: an obstacle that no wheel touches yet. It knows the model's soil as `OnboardSlip`
    does, and is as wrong where that is wrong. Backwards, torques tell nothing, and P(stuck) is that the rover stands.
    For the first half second, in which the belief has felt nothing, P is 0.
    """

    estimate: OnboardSlip
    law: AheadLaw
    pull: Pull
    sinkage: float
    "of a wheel that stands on fresh ground [m]"
    buried: float
    "sinkage over radius from which a wheel counts as buried"
    faults: Faults
    digging: Digging = field(init=False)

    def __post_init__(self) -> None:
        self.digging = Digging(self.pull, np.array(self.law.radii))
        self.table = self.pull.table
        self.reset()

    @classmethod
    def of(cls, model: Model) -> Monitor:
        """Return the monitor of a model's rover, motor, gravity and contact law."""
        relaxed = model.slip if isinstance(model.slip, RelaxedSlip) else RelaxedSlip()
        law = AheadLaw(tuple(model.built.radii.tolist()), relaxed, float(model.built.gravity))
        pull, buried = Pull(pull_factors(model, SLIPS)), float(model.buried)
        return cls(OnboardSlip.of(model), law, pull, standing_sinkage(model), buried, Faults(model.motor))

    def reset(self) -> None:
        """Forget the past."""
        self.estimate.reset()
        self.digging.reset()
        self.faults.reset()
        self.random = np.random.default_rng(0)
        self.samples, self.smoothed, self.alarm = 0, 0.0, False
        self.last = Forecast(0.0, 0.0, 0.0, False, "", (0.0,) * len(CAUSES))

    def step(self, reading: Reading) -> Forecast:
        """Return what is ahead; a reading that is not finite changes nothing but the cause, the truth is not read."""
        self.faults.step(reading)
        if not self.faults.readable:
            causes = (*self.last.causes[:3], 0.0, 1.0)
            self.last = self.last._replace(t=reading.t, cause=CAUSES[-1], causes=causes)
            return self.last
        self.estimate.slip(reading)
        at, belief = self._contacts(), self.estimate.belief.struct
        uneven = float(np.hypot(belief.bend, belief.wall))
        self.digging.update(at, uneven, self.estimate.period, self.samples >= SETTLED)
        p_stuck, p_buried, causes = self.last.p_stuck, self.last.p_buried, self.last.causes[:3]
        if self.samples >= SETTLED and self.samples % EVERY == 0:
            p_stuck, p_buried, causes = self._ahead(at)
        self.samples += 1
        self.smoothed += self.estimate.period / SMOOTHED * (p_stuck - self.smoothed)
        self.alarm = self.smoothed > (0.5 * ALARM if self.alarm else ALARM)
        every = (*causes, self.faults.motor, self.faults.sensor)
        self.last = Forecast(reading.t, p_stuck, p_buried, self.alarm, _named(p_stuck, every), every)
        return self.last

    def _contacts(self) -> Contacts:
        belief = self.estimate.belief
        under = belief.keep["under"].reshape(len(UNDER), -1)
        slope, level, load, ahead = under[:4]
        travel = (belief.struct.speed + ahead) / np.maximum(level, LEAST_LEVEL)
        return Contacts(belief.keep["rim"].copy(), slope, level, np.maximum(load, 0.0), travel, belief.told[:, 0])

    def _ahead(self, at: Contacts) -> tuple[float, float, tuple[float, ...]]:
        pace = float(np.median(at.rim))
        if pace < CREEP or not at.load.any():
            return self.estimate.p_stands if pace < -CREEP else 0.0, 0.0, (0.0, 0.0, 0.0)
        state, draws = self._drawn(at, pace)
        ground = np.concatenate([at.rim, at.slope, at.level, at.load, [pace]])

        def stuck(**without: float) -> tuple[np.ndarray, Ways]:
            ways = go_on(self.law, self.table, *_without(state, draws, **without), ground)
            return ways.share < GRIP, ways

        stands, ways = stuck()
        p_stuck = float(np.mean(stands))
        p_buried = float(np.mean(self.sinkage / np.array(self.law.radii).min() + ways.depth > self.buried))
        if p_stuck < WORTH:
            return p_stuck, p_buried, (0.0, 0.0, 0.0)
        free, firm = (float(np.mean(stands & stuck(**gone)[0])) for gone in ({"wall": 0.0}, {"wall": 0.0, "hole": 0.0}))
        firm = min(firm, free)
        return p_stuck, p_buried, (firm, free - firm, p_stuck - free)

    def _drawn(self, at: Contacts, pace: float) -> tuple[np.ndarray, np.ndarray]:
        """Return states and draws for `AheadLaw`, a column each: particles and rates of digging by their weights."""
        belief, n = self.estimate.belief, len(self.law.radii)
        levels = (np.arange(DRAWS) + self.random.random()) / DRAWS
        particle, rate = (
            np.minimum(np.searchsorted(np.cumsum(weights), drawn * weights.sum()), len(weights) - 1)
            for weights, drawn in (
                (belief.keep["weight"], levels),
                (self.digging.weights, self.random.permutation(levels)),
            )
        )
        slips, holes = belief.keep["slip"].reshape(n, -1)[:, particle], self.digging.holes[:, rate]
        stalled = (belief.keep["stalled"][particle] > 0.0) | bool(belief.struct.no_progress)
        u = np.clip(belief.keep["travel"][particle], 0.0, pace)
        excess = self.pull.less_resistance(slips, holes, at.shares, at.slope)
        steepening = STEEPENING * self.random.standard_normal(DRAWS)
        still = np.zeros((2, DRAWS))
        return np.vstack([u, still, slips, holes]), np.vstack([RATES[rate], excess, steepening, stalled])


def _without(
    state: np.ndarray, draws: np.ndarray, wall: float = 1.0, hole: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return states and draws with shares of what holds the rover: what an obstacle takes, and holes."""
    n = (len(state) - 3) // 2
    holes = np.repeat([1.0, hole], [3 + n, n])[:, None]
    c_d, excess, steepening, stalled = draws
    return state * holes, np.vstack([hole * c_d, wall * excess, steepening, wall * stalled])


def _named(p_stuck: float, causes: tuple[float, ...]) -> str:
    """Return the most likely cause; a fault makes what else is said doubtful."""
    faults = max(causes[3:])
    if faults > NAMED:
        return CAUSES[3 + causes[3:].index(faults)]
    if p_stuck < WORTH:
        return ""
    most = max(causes[:3])
    return CAUSES[causes.index(most)] if most > NAMED * p_stuck else CANNOT_TELL
