"""Estimate of the slip of every wheel from measurements on board: motor currents, wheel rates, attitude, suspension
angles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import casadi as ca
import numpy as np

from rover_pin.control.sensing.belief import LENGTHS, Belief, BeliefLibrary, compile_belief
from rover_pin.control.sensing.ground import ground_law
from rover_pin.control.sensing.laws import ReadingTrust, belief_laws
from rover_pin.control.sensing.odometry import VisualOdometry
from rover_pin.control.sensing.soil_belief import ControllerBelief, SoilHypotheses
from rover_pin.control.slip_control import HoleLaw
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.rover.forward_dynamics import constraint_rows
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Reading
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.compiled_body import KeyedModel
from rover_pin.simulation.native.control import OnboardLaw
from rover_pin.simulation.state import suspension_places
from rover_pin.simulation.stepping.timing import CONTROL_PERIOD

SLIPS = np.linspace(-1.0, 1.0, LENGTHS["N_FACTORS"])
"""Slip ratios at which the torque factor F, the torque divided by wheel radius and load, is tabulated [-]."""
STRIDE = 0.25
"""Time between two postures (roll, pitch and suspension angles) of the rover that the filter compares [s]."""
MIN_PACE = 0.002
"""Minimum rim speed [m/s]. The filter expresses the rover's speed as a multiple of the rim speed, and a slower rim
counts as having this minimum speed."""
STANDING_ROLL, STANDING_CHANGE = 0.56, 0.0012
"""On bent ground, a rover counts as not moving if within 4 s its rims turn by more than the first number times the
wheel radius, while its posture (roll, pitch and suspension angles) changes by less than the second number [m]."""
WALL_TIME = 0.31
"""Time constant of the low-pass filter that decides whether a wheel is at a wall [s]. A wheel is at a wall if its
torque stays above the largest torque of the soil for about this time."""
BACKWARDS_DUTY = -0.02
"""If the duties of all wheels are below this value [-], the rover counts as driving backwards. Torques then carry no
information about the slip."""


@dataclass
class OnboardSlip:
    """A particle filter that estimates, from on-board sensors, the slip and the hole depth of each wheel and the
    probability that the rover does not move.

    The sensors are motor currents, wheel rates, roll, pitch and suspension angles, and visual odometry if the rover has
    a camera. A particle consists of a mode (moving or stalled), the forward speed u of the base, and for each wheel i
    the slip s_i and the depth D_i of the hole. The particles change from sample to sample:

        moving: u / (r omega) performs a random walk;  stalled: u / (r omega) is 0 to within 0.03
        v_i = (u + d_i) / cos a_i,  s_i follows from v_i by `RelaxedSlip`,  D_i follows by `HoleLaw`

    r omega is the rim speed, and v_i the travel speed of wheel i. The mode changes at constant rates. d_i is the
    forward speed of the wheel's centre relative to the base, and a_i the slope of the ground; both follow from the
    posture (roll, pitch and suspension angles) and its rates by `ground_law`. C code weighs the particles by the
    probability densities of the readings, which `laws.py` defines:

    - The torque factor T_i / (r W_i), with the torque T_i from the current and the load W_i from the static balance, is
      F(s_i) of the soil.
    - On bent ground, the wheels rise relative to each other at about u times the bend. The bend is the mean deviation
      of the slopes under the wheels from their median.
    - Within 2 s, the posture changes by about the distance times the bend, or hardly at all if the rover does not move.
    - If the rims turn by half a radius on bent ground within 4 s and the posture does not change, the rover does not
    move.
    - `odometry`, if the rover has visual odometry, measures u with a delay.

    - The thrust of all wheels, minus the slope, is the motion resistance R plus the resistance of the holes. This
      balance is used if the soil is uncertain.

    If the belief is uncertain, the particles are in blocks, and each block assumes another soil of `SoilHypotheses`.
    The readings decide between the soils during the drive, and the estimates are means over all soils.

    A wheel whose torque exceeds the largest torque of the soil is at a wall. Torques then count less, and stalling is
    likely. The filter has three limits. It cannot recognise a slip that all wheels have in common where F(S) is flat,
    unless the posture shows the slip. It does not measure the slope directly under a wheel. If the soil is taken for
    certain and is stronger than assumed, the estimated slip S_hat is too high; if the soil is weaker, S_hat is too low,
    and torques then outweigh `odometry`.

    Source: none; a particle filter (Gordon, Salmond and Smith 1993). Differs from the paper: the paper estimates the
    slip by Eq (9) from a table of speeds.

    Examples
    --------
    >>> from rover_pin import scenario, simulate
    >>> from rover_pin.control.slip_control import Gains, SlipControl
    >>> model = scenario("flat").model
    >>> estimate = OnboardSlip.of(model)
    >>> trace = simulate(model, SlipControl(Gains(), estimate), 1.0)
    >>> 0.0 <= estimate.p_stands <= 1.0
    True
    """

    rover: Rover
    places: np.ndarray
    """indices of the suspension angles in the configuration vector q"""
    constant: float
    """torque at the wheel per current of its motor [N m/A]"""
    soils: SoilHypotheses
    """the soils that the filter considers, and the motion resistance"""
    holes: HoleLaw
    "law of the hole that a slipping wheel digs"
    trust: ReadingTrust = field(default_factory=ReadingTrust)
    """errors of readings and rates of events that the filter assumes"""
    relaxed: RelaxedSlip = field(default_factory=RelaxedSlip)
    """law that lets the slip of a wheel follow its speeds with a delay"""
    odometry: VisualOdometry | None = None
    """visual odometry, or None if the rover has no camera"""
    period: float = CONTROL_PERIOD
    "time between two samples [s]"
    believed: ControllerBelief | None = None
    """the belief that the estimate was made from"""

    def __post_init__(self) -> None:
        trust, radii = self.trust.values(), self.rover.radii
        # The constants of the filter, by the names of their fields in the struct of `belief.py`.
        names = "strength correlated wander surprise stalls wall_stalls frees".split()
        self.belief = Belief(
            _compile_belief(_KeyedRover.of(self.rover, self.places), self.holes, self.relaxed, self.trust, self.period),
            len(radii),
            len(self.places),
            self.odometry.lag if self.odometry else 0,
            **{name: float(trust[name]) for name in names},
            wall_error=float(self.trust.wall),
            rise_correlated=float(self.trust.folds),
            odometry_sd=float(self.odometry.camera.sd) if self.odometry else 1.0,
            period=self.period,
            stride=round(STRIDE / self.period),
            torque_per_current=self.constant,
            radius=radii.copy(),
            factors=np.ascontiguousarray(self.soils.factors, dtype=float),
            greatest=self.soils.factors.max(axis=1),
            softness=np.ascontiguousarray(self.soils.softness, dtype=float),
            memory=float(trust["memory"]),
            resistance=self.soils.resistance,
            resistance_sd=float(self.soils.sd.resistance),
            torque_sd=float(self.soils.sd.torque),
            hole_length=float(self.holes.length),
            balance_correlated=float(trust["balance_correlated"]),
            floor=MIN_PACE,
            min_roll=STANDING_ROLL * float(radii.max()),
            settled=STANDING_CHANGE,
            wall_gain=-math.expm1(-self.period / WALL_TIME),
        )
        # The filter starts as at the beginning of a drive, where any speed is possible.
        self.reset()

    @classmethod
    def of(
        cls,
        believed: ControllerBelief | Model,
        trust: ReadingTrust | None = None,
        odometry: VisualOdometry | None = None,
    ) -> OnboardSlip:
        """Return the slip estimate of a controller that holds a belief about rover, motor, gravity, first soil and
        contact effects. A model instead of a belief is taken for certain.

        `trust` has the errors of readings and the rates of events that the filter assumes; `odometry` is the visual
        odometry of the rover, or None.
        """
        belief = believed if isinstance(believed, ControllerBelief) else ControllerBelief.of_plant(believed)
        model = belief.model
        # The masses that the model's effects add change the wheel loads, so the built rover is used.
        rover = model.built
        return cls(
            rover,
            suspension_places(model.rover),
            float(model.motor.constant),
            SoilHypotheses.of(model, belief.sd, SLIPS),
            HoleLaw(r=float(rover.wheel.r)),
            trust or ReadingTrust(),
            model.slip if isinstance(model.slip, RelaxedSlip) else RelaxedSlip(),
            odometry,
            believed=belief,
        )

    def reset(self) -> None:
        """Reset the filter and the visual odometry to the start of a drive, when all speeds are possible."""
        self.belief.forget()
        if self.odometry:
            self.odometry.reset()

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the estimated slip S_hat of each wheel (wheels,) [-]. Call this method once in each control period."""
        sample, links, wheels = self.belief.sample, len(self.places), len(self.rover.wheels)
        sample[:2], sample[2 : 2 + links] = reading.attitude[:2], reading.suspension
        sample[2 + links : 2 + links + wheels], sample[2 + links + wheels :] = reading.wheel_rate, reading.current
        # NaN means that no speed was measured; the filter then uses the other readings only.
        late = self.odometry.speed(reading) if self.odometry else math.nan
        self.belief.sense(bool(max(reading.duty) < BACKWARDS_DUTY), late)
        return self.belief.estimates[:, 0].copy()

    def native_law(self, hole: HoleLaw | None) -> OnboardLaw | None:
        """Return the estimate in the form for the compiled simulation loop, which does not call Python.

        The result is None if there is visual odometry, or for a class that a user has derived from this class.
        """
        if self.odometry or type(self) is not OnboardSlip:
            return None
        # The compiled loop calls the C function of the filter by its address and reads the estimates from the arrays.
        belief, radius = self.belief, float(hole.r) if hole else 0.0
        return OnboardLaw(*belief.addresses, belief.sample, belief.estimates, belief.p_stands, BACKWARDS_DUTY, radius)

    @property
    def expressions(self) -> list[ca.Function]:
        """The CasADi functions of the filter: first `ground_law`, then the laws of `belief_laws`."""
        laws = belief_laws(self.holes, self.relaxed, self.trust, self.period)
        return [ground_law(self.rover, self.places), *laws]

    @property
    def sd(self) -> np.ndarray:
        """Standard deviation of the latest S_hat of each wheel (wheels,) [-]."""
        return self.belief.estimates[:, 1].copy()

    @property
    def hole(self) -> np.ndarray:
        """Depth of the hole of each wheel (wheels,) [m]: the mean of the estimate plus one standard deviation, which is
        on the safe side.
        """
        return self.belief.estimates[:, 2] + self.belief.estimates[:, 3]

    @property
    def p_stands(self) -> float:
        """Probability that the rover does not move while its wheels turn."""
        return float(self.belief.struct.stuck)

    @property
    def speed(self) -> float:
        """Estimated forward speed of the base [m/s]."""
        return float(self.belief.struct.speed)


@dataclass(frozen=True)
class _KeyedRover:
    """A rover and the indices of its suspension angles, as the key of a cache. Two keys are equal if their `content` is
    equal.
    """

    content: tuple[object, ...]
    rover: Rover = field(compare=False)
    places: np.ndarray = field(compare=False)

    @classmethod
    def of(cls, rover: Rover, places: np.ndarray) -> _KeyedRover:
        """Return the cache key of a rover. Its content is everything on which the result of `ground_law` depends."""
        # Arrays are compared by their bytes, because a key must be hashable.
        sides = tuple((mount.joint, mount.side) for mount in rover.wheels)
        arrays = rover.radii, rover.model.gravity.linear, constraint_rows(rover), places
        numbers = tuple(np.asarray(array).tobytes() for array in arrays)
        return cls((KeyedModel.of(rover.model).content, sides, *numbers), rover, places)


@lru_cache(maxsize=16)
def _compile_belief(
    key: _KeyedRover, holes: HoleLaw, relaxed: RelaxedSlip, trust: ReadingTrust, period: float
) -> BeliefLibrary:
    """Return the compiled particle filter for a rover. Rovers with equal keys and equal laws share one library."""
    return compile_belief(ground_law(key.rover, key.places), belief_laws(holes, relaxed, trust, period))
