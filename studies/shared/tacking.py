"""Beyond the paper: cross obstacles at an angle, one wheel after another, with on-board sensors only.

In all soil laws of the package, thrust only grows or only falls with slip. Changing the duty therefore cannot help a
rover with both front wheels at a wall, where all wheels already pull as hard as the soil allows. Turned by about 35
degrees, the rover lifts one wheel at a time while five push, and the wall is less steep along its path. On-board
sensors show when to turn: uneven ground folds the bogies, a smooth slope does not.
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import casadi as ca
import numpy as np

from rover_pin.base.quantity import Record, quantities, quantity
from rover_pin.contact import Scalar
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.control.motion.servo import LawControl
from rover_pin.control.open_loop import Turn
from rover_pin.control.torque_check import NoLimit, TorqueLimit
from rover_pin.rover.rover import Rover
from rover_pin.simulation.state import suspension_places

FRESH = (1.0, -1.0)
"""Initial memory of the control: the next obstacle is crossed on the left side, and the ground is even."""


@dataclass(frozen=True)
class Tacking(Record):
    """Parameters of tacking: kappa = gain (psi_d - psi) within 1 / radius, psi_d = +-heading on uneven ground, else 0.

    The ground counts as uneven from the time at which a suspension angle exceeds `alert` until `calm` after it last
    did. On uneven ground, and where the nose points up by more than `alert`, the duty is `delta_climb`. Source: none;
    found with the package's own optimisation (studies/beyond_the_paper.py).
    """

    heading: Scalar = quantity(math.radians(34.0), "rad", "tuned", 0.0, math.radians(80.0), "psi")
    radius: Scalar = quantity(0.58, "m", "tuned", 0.4, 100.0, "R")
    gain: Scalar = quantity(4.0, "1/m", "assumed: full lock at 30 deg off", 0.0, 100.0)
    alert: Scalar = quantity(math.radians(7.9), "rad", "tuned: bogies fold by 10 deg and more in a ditch", 0.0, 1.0)
    calm: Scalar = quantity(6.0, "s", "assumed: a rover's length at 0.05 m/s", 0.0, 1e3)
    delta: Scalar = quantity(0.55, "", "paper, section 5", 0.0, 1.0, "delta")
    delta_climb: Scalar = quantity(0.55, "", "the duty without control", 0.0, 1.0)


@lru_cache(maxsize=16)
def _law(steering: tuple[bool, ...], links: int) -> ca.Function:
    """Return the law of a rover with these steering wheels. Its numbers are `Tacking`'s and the wheel positions."""
    n = len(steering)
    t, read, memory = ca.SX.sym("t"), ca.SX.sym("read", 3 + 2 * n + links), ca.SX.sym("memory", 2)
    values, places = ca.SX.sym("values", len(quantities(Tacking))), ca.SX.sym("places", 2 * n)
    law = Tacking(**dict(zip(quantities(Tacking), ca.vertsplit(values), strict=True)))
    # Memory: the side of the next turn, and the time until which the ground counts as uneven.
    folded = ca.mmax(ca.fabs(read[3 + 2 * n :])) > law.alert if links else ca.SX(0.0)
    # The side changes once an obstacle is over, so that the rover keeps its course on average.
    over = ca.logic_and(memory[1] > 0.0, memory[1] < t)
    side = ca.if_else(ca.logic_and(over, ca.logic_not(folded)), -memory[0], memory[0])
    until = ca.if_else(folded, t + law.calm, ca.if_else(over, FRESH[1], memory[1]))
    uneven = t <= until
    target_yaw = ca.if_else(uneven, side * law.heading, 0.0)
    bend = ca.fmin(ca.fmax(law.gain * (target_yaw - read[2]), -1.0 / law.radius), 1.0 / law.radius)
    delta = ca.if_else(ca.logic_or(uneven, -read[1] > law.alert), law.delta_climb, law.delta)
    # All wheels roll about the turning centre; the fastest gets the full duty.
    pairs = [(places[2 * at], places[2 * at + 1]) for at in range(n)]
    speeds, angles = rolling(pairs, steering, BodyMotion(1.0, bend))
    fastest = ca.mmax(ca.fabs(ca.vertcat(*speeds)))
    out = [delta / fastest * ca.vertcat(*speeds), ca.vertcat(*angles), ca.vertcat(side, until)]
    inputs = [t, read, ca.SX(0, 1), memory, ca.vertcat(values, places)]
    return ca.Function("tacking", inputs, out)


@dataclass
class TackingControl(LawControl):
    """A controller that reads yaw, pitch and suspension angles only, and commands the duty and the steering.

    Successive obstacles are crossed on alternating sides, so that the rover keeps its course on average. Source: none.
    Differs from the paper: the controller knows no slip, and it steers.

    Raises
    ------
    ParameterError
        If its tightest turn needs a wheel to steer beyond 75 deg.
    """

    rover: Rover
    tacking: Tacking = field(default_factory=Tacking)
    limit: TorqueLimit | NoLimit = field(default_factory=NoLimit)
    memory: np.ndarray = field(default_factory=lambda: np.array(FRESH))
    """Side on which the next obstacle is crossed, and time until which the ground is uneven [s]."""
    fresh = np.array(FRESH)

    def __post_init__(self) -> None:
        widest = float(np.max(np.abs(turning_places(self.rover)[:, 1])))
        for radius in {float(self.tacking.radius), max(float(self.tacking.radius), widest)}:
            Turn.of(self.rover, radius), Turn.of(self.rover, -radius)

    @property
    def law(self) -> ca.Function:
        """Return the law as one CasADi function."""
        return _law(steers(self.rover), len(suspension_places(self.rover)))

    @property
    def numbers(self) -> np.ndarray:
        """Return the numbers of `Tacking`, and x, y of each wheel from the line of the turning centres."""
        return np.concatenate([list(self.tacking.values().values()), turning_places(self.rover).ravel()])
