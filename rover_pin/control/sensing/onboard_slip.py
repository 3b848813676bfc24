"""The slip of every wheel from what the rover feels on board: currents, wheel rates, attitude, suspension angles."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import casadi as ca
import numpy as np

from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.sensing.belief import LENGTHS, Belief, Compiled, compile_belief
from rover_pin.control.sensing.ground import ground_law
from rover_pin.control.sensing.laws import ReadingTrust, fold_law, still_law, torque_law, wheel_law
from rover_pin.control.sensing.odometry import VisualOdometry
from rover_pin.control.torque_factor import torque_factors
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.rover.constraints import constraint_rows
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Reading
from rover_pin.simulation.compiled.suspension import suspension_places
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.compiled_body import KeyedModel
from rover_pin.simulation.native.control import OnboardLaw
from rover_pin.simulation.timing import CONTROL_PERIOD

SLIPS = np.linspace(-1.0, 1.0, LENGTHS["N_FACTORS"])
STRIDE, CREEP = 0.25, 0.002
"""Time between postures that are compared [s]; rim speed [m/s] below which a median counts as this."""
LEAST_ROLL, SETTLED = 0.56, 0.0012
"""Way of the rims, over r, and change of posture [m], by which a rover is known to make no way on bent ground."""
WALL_TIME = 0.31
"""Time constant [s] in which a torque above all that the soil can ask for speaks of a wall."""
BACKWARDS = -0.02
"""Duty below which, on all wheels, the rover drives backwards: then torques tell nothing."""


@dataclass
class OnboardSlip:
    """S_hat, the depth of each wheel's hole, and P(the rover stands), from rates, currents, attitude and link angles.

    A particle is a mode (moving or stalled), the forward speed u of the base, and slip s_i and hole D_i of each wheel.

        moving: u / (r omega) wanders;  stalled: it is 0 to within 0.03;  between both by chances a second
        v_i = (u + d_i) / cos a_i,  s_i follows v_i by `RelaxedSlip`,  D_i by `HoleLaw`

    d_i is the forward speed of the centre against the base, a_i the ground's slope, both from the posture and its rates
    (`ground_law`). Particles are weighed by what is read, all of it in C (`laws.py` says each density):

    - T_i / (r W_i), from the current over the load of static balance, is F(s_i) of the known soil;
    - wheels on ground that bends rise against each other at a speed of order u times the bend;
    - over 2 s the posture changes by about the way times the bend, or hardly, where the rover stands;
    - rims that roll by half a radius on bent ground within 4 s while the posture stays: it stands;
    - `odometry`, where there is one, tells u of a while ago.

    A wheel whose torque exceeds all that the soil can ask for stands at a wall: then torques tell less, and stalling is
    likely. What cannot be seen: a slip that all wheels share where F(S) is flat, until the posture tells; the slope
    right under a wheel. Where the soil is stronger than believed S_hat reads high, where weaker low; torques outweigh
    `odometry` then. (The soil's strength as one more state put that right, and cost more where the soil is known.)

    Source: none; a particle filter (Gordon, Salmond and Smith 1993). Differs from the paper: it has Eq (9)'s table.
    """

    rover: Rover
    places: np.ndarray
    "of the suspension angles in q"
    constant: float
    "torque per current at the wheel [N m/A]"
    factors: np.ndarray
    "F at SLIPS"
    holes: HoleLaw
    trust: ReadingTrust = field(default_factory=ReadingTrust)
    relaxed: RelaxedSlip = field(default_factory=RelaxedSlip)
    odometry: VisualOdometry | None = None
    period: float = CONTROL_PERIOD

    def __post_init__(self) -> None:
        trust, radii = self.trust.values(), self.rover.radii
        names = "strength correlated wander surprise stalls wall_stalls frees".split()
        self.belief = Belief(
            _compile_belief(_Content.of(self.rover, self.places), self.holes, self.relaxed, self.trust, self.period),
            len(radii),
            len(self.places),
            self.odometry.lag if self.odometry else 0,
            **{name: float(trust[name]) for name in names},
            wall_share=float(self.trust.wall),
            fold_correlated=float(self.trust.folds),
            odometry_sd=float(self.odometry.camera.sd) if self.odometry else 1.0,
            period=self.period,
            stride=round(STRIDE / self.period),
            torque_per_current=self.constant,
            radius=radii.copy(),
            factors=np.ascontiguousarray(self.factors, dtype=float),
            most_factor=float(np.max(self.factors)),
            floor=CREEP,
            least_roll=LEAST_ROLL * float(radii.max()),
            settled=SETTLED,
            wall_gain=-math.expm1(-self.period / WALL_TIME),
        )
        self.reset()

    @classmethod
    def of(cls, model: Model, trust: ReadingTrust | None = None, odometry: VisualOdometry | None = None) -> OnboardSlip:
        """Return the estimator for a model's rover, motor, gravity and contact law: first soil and contact effects."""
        rover = model.built
        return cls(
            rover,
            suspension_places(model.rover),
            float(model.motor.constant),
            torque_factors(model, SLIPS),
            HoleLaw(r=float(rover.wheel.r)),
            trust or ReadingTrust(),
            model.slip if isinstance(model.slip, RelaxedSlip) else RelaxedSlip(),
            odometry,
        )

    def reset(self) -> None:
        """Forget the past: any speed may be."""
        self.belief.forget()
        if self.odometry:
            self.odometry.reset()

    def slip(self, reading: Reading) -> np.ndarray:
        """Return S_hat, one value a wheel [-]; to be called once a control period."""
        sample, links, wheels = self.belief.sample, len(self.places), len(self.rover.wheels)
        sample[:2], sample[2 : 2 + links] = reading.attitude[:2], reading.suspension
        sample[2 + links : 2 + links + wheels], sample[2 + links + wheels :] = reading.wheel_rate, reading.current
        late = self.odometry.speed(reading) if self.odometry else math.nan
        self.belief.sense(bool(max(reading.duty) < BACKWARDS), late)
        return self.belief.told[:, 0].copy()

    def native_law(self, hole: HoleLaw | None) -> OnboardLaw | None:
        """Return the same for the compiled loop; None with `odometry`, and for a class of another name."""
        if self.odometry or type(self) is not OnboardSlip:
            return None
        belief, radius = self.belief, float(hole.r) if hole else 0.0
        return OnboardLaw(*belief.addresses, belief.sample, belief.told, belief.p_stands, BACKWARDS, radius)

    @property
    def expressions(self) -> list[ca.Function]:
        """The ground under the wheels, and the belief's laws."""
        laws = belief_laws(self.holes, self.relaxed, self.trust, self.period)
        return [ground_law(self.rover, self.places), *laws]

    @property
    def sd(self) -> np.ndarray:
        """SD of the last estimate."""
        return self.belief.told[:, 1].copy()

    @property
    def hole(self) -> np.ndarray:
        """Depth of each wheel's hole [m], to be on the safe side: mean and SD."""
        return self.belief.told[:, 2] + self.belief.told[:, 3]

    @property
    def p_stands(self) -> float:
        """Probability that the rover stands while its wheels turn."""
        return float(self.belief.struct.stuck)

    @property
    def speed(self) -> float:
        """Forward speed of the base [m/s]."""
        return float(self.belief.struct.speed)


@dataclass(frozen=True)
class _Content:
    """A rover with the places of its suspension angles, the same as another of equal content."""

    content: tuple[object, ...]
    rover: Rover = field(compare=False)
    places: np.ndarray = field(compare=False)

    @classmethod
    def of(cls, rover: Rover, places: np.ndarray) -> _Content:
        """Return the rover with all that `ground_law` reads of it."""
        sides = tuple((mount.joint, mount.side) for mount in rover.wheels)
        arrays = rover.radii, rover.model.gravity.linear, constraint_rows(rover), places
        numbers = tuple(np.asarray(array).tobytes() for array in arrays)
        return cls((KeyedModel.of(rover.model).content, sides, *numbers), rover, places)


@lru_cache(maxsize=16)
def _compile_belief(at: _Content, holes: HoleLaw, relaxed: RelaxedSlip, trust: ReadingTrust, period: float) -> Compiled:
    return compile_belief(ground_law(at.rover, at.places), belief_laws(holes, relaxed, trust, period))


def belief_laws(holes: HoleLaw, relaxed: RelaxedSlip, trust: ReadingTrust, period: float) -> list[ca.Function]:
    """Return the laws of `laws.py` by which particles move on and are weighed."""
    return [wheel_law(holes, relaxed, period), *(law(trust) for law in (torque_law, fold_law, still_law))]
