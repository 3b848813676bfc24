"""The slip of every wheel from what the rover feels on board: currents, wheel rates, attitude, suspension angles."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.control.torque_factor import torque_factors
from rover_pin.rover.driven_loads import configuration, footing, loads_on, turning, wheel_mounts
from rover_pin.rover.rover import Rover
from rover_pin.simulation.command import Reading
from rover_pin.simulation.failure import suspension_of
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.timing import CONTROL_PERIOD

SPEEDS = np.linspace(-0.4, 1.1, 151)
"""Speeds that are weighed against each other, in units of the rim speed at full duty without load."""
SLIPS = np.linspace(-1.0, 1.0, 201)
LEAST_LOAD, LEAST_RIM = 0.5, 1e-3
"""N and m/s below which a wheel tells nothing."""
REST = 0.005
"""Speed below which nothing counts as moving [m/s]: `AlgebraicSlip.v_0`."""
FACTORS = 2.0
"""Range of T / (r W) over which a wheel that meets something else may read anything."""
LEAST_ROWS = 6
"""Readings from which rates of angles are estimated."""
SETTLING = 0.0012
"""Rise of a wheel against the others that noise, sinking and settling make of a rover that stands [m/s]."""


@dataclass(frozen=True)
class Trust(Record):
    """How far the estimator trusts what it knows (all assumed, set on drives that no study reports)."""

    window: Scalar = quantity(0.8, "s", "assumed: rates of angles from potentiometers of 3 mrad", 0.1, 10.0)
    strength: Scalar = quantity(0.05, "", "assumed: relative error of the soil's law and of loads", 1e-3, 1.0)
    factor: Scalar = quantity(0.015, "", "assumed: error of T / (r W) from the current", 1e-4, 1.0)
    stray: Scalar = quantity(0.1, "", "assumed: chance that a wheel meets a wall or a stone", 1e-9, 1.0)
    correlated: Scalar = quantity(0.5, "s", "assumed: readings nearer than this err alike", 1e-3, 10.0)
    wander: Scalar = quantity(0.02, "m/s", "assumed: change of speed within a second", 1e-4, 1.0)
    surprise: Scalar = quantity(0.02, "", "assumed: chance of any speed at all, per second", 0.0, 1.0)
    quiet: Scalar = quantity(0.2, "", "assumed: chance that a rover moves on bent ground and does not fold", 0.0, 1.0)


class _Felt(NamedTuple):
    """What was read at a control instant, and where it puts the wheels."""

    current: np.ndarray
    rate: np.ndarray
    tilt: np.ndarray
    "roll and pitch [rad]"
    links: np.ndarray
    mounts: np.ndarray
    "rotations of the wheels' frames"
    centres: np.ndarray
    "forward places and heights of the wheel centres against the base, levelled [m]"


class _Rates(NamedTuple):
    """How the wheels move, from the readings of the window."""

    rim: np.ndarray
    "rim speeds over the ground [m/s]"
    ahead: np.ndarray
    "forward speeds of the centres against the base [m/s]"
    rise: np.ndarray | None
    "upward ones; None before they are known"


@dataclass
class OnboardSlip:
    """S_hat from one common speed u of the rover, weighed on a grid by what every wheel's torque says of its slip.

    Kinematics: the centre of wheel i travels v_i = (u + d_i) / cos alpha_i along ground of slope alpha_i, with d_i the
    forward speed of the centre against the base, from the rates of attitude and suspension angles. Rim speeds r omega_i
    count the turning of the mounts. So u alone gives all slips by Eq (1); differences between wheels need no soil.
    Where no rim moves the rover stands, to within REST: a rover that slides with all its wheels held is not seen.
    Torque: T_i = K i_i over the load W_i of `driven_loads` is F(S_i) of the known soil, to within its trust. The belief
    p(u) diffuses by `wander`, is mixed with a little of everything, and multiplied by these likelihoods; S_hat is its
    mean. A wheel at a wall or a stone may read anything (`stray`): then the others tell. Nothing is inverted, so that
    an F that levels off or falls again only leaves u less certain.
    Bends: the slopes alpha_i are those between neighbours. Where they differ by B (mean of |tan alpha_i - median|), the
    ground bends within a wheelbase, loads and F err by a share B more, and a rover that travels folds: its wheels rise
    against each other at a speed of order u B, one that stands at `SETTLING`. So a posture that is bent and stays says
    u = 0, which neither torques nor wheel rates can where the slip is common to all and F has fallen past its peak.

    What cannot be seen: a slip that all wheels share is invisible to kinematics; torques show it where the soil's F(S)
    is known and rises. Where F is flat (k much below r, S beyond 0.3 to 0.5) S_hat leans on its memory; where the soil
    is weaker than believed it reads high, where stronger low. Sinkage and lateral slip are left out.

    Source: none; a histogram filter (Thrun, Burgard and Fox, Probabilistic Robotics, chapter 8). Differs from the
    paper: it has Eq (9)'s table.
    """

    rover: Rover
    places: np.ndarray
    "of the suspension angles in q"
    constant: float
    "torque per current at the wheel [N m/A]"
    fastest: float
    "rim speed at full duty without load [m/s]"
    factors: np.ndarray
    "F at SLIPS"
    trust: Trust = field(default_factory=Trust)
    period: float = CONTROL_PERIOD

    def __post_init__(self) -> None:
        self.r = np.array([float(mount.wheel.r) for mount in self.rover.wheels])
        self.speeds = self.fastest * SPEEDS
        step = self.speeds[1] - self.speeds[0]
        half = len(SPEEDS) // 2
        reach = np.arange(-half, half + 1) * step
        kernel = np.exp(-0.5 * (reach / (float(self.trust.wander) * math.sqrt(self.period))) ** 2)
        self.kernel = kernel / kernel.sum()
        self.reset()

    @classmethod
    def of(cls, model: Model, trust: Trust | None = None) -> OnboardSlip:
        """Return the estimator for a model's rover, motor, gravity and contact law: first soil and contact effects."""
        rover, motor = model.built, model.motor
        fastest = float(rover.wheel.r) * float(motor.no_load_rate)
        places = suspension_of(model).places
        return cls(rover, places, float(motor.constant), fastest, torque_factors(model, SLIPS), trust or Trust())

    def reset(self) -> None:
        """Forget the past: any speed may be."""
        self.belief = np.full(len(SPEEDS), 1.0 / len(SPEEDS))
        self.sd = np.full(len(self.rover.wheels), 1.0)
        "SD of the last estimate"
        self.past: deque[_Felt] = deque(maxlen=max(2, round(float(self.trust.window) / self.period)))

    def slip(self, reading: Reading) -> np.ndarray:
        """Return S_hat, one value a wheel [-]; to be called once a control period."""
        self.past.append(self._felt(reading))
        q = self._posture(
            *(np.mean([getattr(sample, name) for sample in self.past], axis=0) for name in ("tilt", "links"))
        )
        foot, jacobians = footing(self.rover, q)
        torque = self.constant * np.mean([sample.current for sample in self.past], axis=0)
        load = loads_on(self.rover, q, torque, foot, jacobians)
        rates, level = self._rates(foot.left), np.hypot(foot.forward[:, 0], foot.forward[:, 1])
        slips = slip_ratios(rates.rim, (self.speeds[:, None] + rates.ahead) / level)
        tells = (load > LEAST_LOAD) & (np.abs(rates.rim) > LEAST_RIM)
        bend = _apart(foot.forward[:, 2] / level)
        self._learn(slips[:, tells], (torque / (self.r * np.maximum(load, LEAST_LOAD)))[tells], bend)
        if rates.rise is not None:
            self._weigh(np.log(self._folding(_apart(rates.rise), bend)))
        if np.all(np.abs(rates.rim) < REST):
            self._weigh(-0.5 * (self.speeds / REST) ** 2)
        mean = self.belief @ slips
        self.sd = np.sqrt(np.maximum(self.belief @ slips**2 - mean**2, 0.0))
        return np.asarray(mean)

    def _felt(self, reading: Reading) -> _Felt:
        tilt = np.array(reading.attitude[:2])
        mounts, centres = wheel_mounts(self.rover, self._posture(tilt, reading.suspension))
        return _Felt(reading.current, reading.wheel_rate, tilt, np.array(reading.suspension), mounts, centres[:, ::2])

    def _posture(self, tilt: np.ndarray, links: np.ndarray) -> np.ndarray:
        """Return q heading along x; steering is not read."""
        q = configuration(self.rover, (float(tilt[0]), float(tilt[1]), 0.0), {})
        q[self.places] = links
        return q

    def _rates(self, axles: np.ndarray) -> _Rates:
        rate = np.mean([sample.rate for sample in self.past], axis=0)
        if len(self.past) < LEAST_ROWS:
            return _Rates(self.r * rate, np.zeros(len(rate)), None)
        t = self.period * (np.arange(len(self.past)) - 0.5 * (len(self.past) - 1))
        to_rate = t / (t @ t)
        swing = to_rate @ turning([sample.mounts for sample in self.past], axles)
        ahead, rise = np.einsum("t,tnk->kn", to_rate, np.array([sample.centres for sample in self.past]))
        return _Rates(self.r * (rate + swing), ahead, rise)

    def _learn(self, slips: np.ndarray, factors: np.ndarray, bend: float = 0.0) -> None:
        """Move the belief on by a period, and weigh it by the factors T / (r W) of the wheels that tell something."""
        trust, spread = self.trust, np.convolve(self.belief, self.kernel, mode="same")
        anything = float(trust.surprise) * self.period
        self.belief = (1.0 - anything) * spread / spread.sum() + anything / len(spread)
        expected = np.interp(slips, SLIPS, self.factors)
        variance = float(trust.factor) ** 2 + (float(trust.strength) ** 2 + bend**2) * expected**2
        likelihood = np.exp(-0.5 * (factors - expected) ** 2 / variance) / np.sqrt(2.0 * np.pi * variance)
        p_outlier = float(trust.stray)
        self._weigh(np.sum(np.log((1.0 - p_outlier) * likelihood + p_outlier / FACTORS), axis=1))

    def _folding(self, rise: float, bend: float) -> np.ndarray:
        """Return the density of wheels rising so fast against each other at each speed, on ground that bends so."""
        moving, quiet = np.hypot(SETTLING, self.speeds * bend), float(self.trust.quiet)
        return (1.0 - quiet) * np.exp(-rise / moving) / moving + quiet * np.exp(-rise / SETTLING) / SETTLING

    def _weigh(self, log_p: np.ndarray) -> None:
        """Multiply the belief by a likelihood, given as its logarithm, of readings that err alike for a while."""
        belief = self.belief * np.exp(self.period / float(self.trust.correlated) * (log_p - log_p.max()))
        self.belief = belief / belief.sum()


def _apart(values: np.ndarray) -> float:
    """Return the mean distance of the wheels' values from their median."""
    return float(np.mean(np.abs(values - np.median(values))))


@dataclass
class SureSlip:
    """What an on-board estimate is sure of: S_hat less its SD, not below 0; what a control may act on.

    Where torques fit two slips, as past the peak, or none, as at a wall, the mean of both would take the duty from a
    wheel that grips. Source: none. Differs from the paper: it feeds back one number.
    """

    estimate: OnboardSlip

    def reset(self) -> None:
        """Forget the past."""
        self.estimate.reset()

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the slip that is surely exceeded, one value a wheel [-]; a braking slip as estimated."""
        S_hat = self.estimate.slip(reading)
        return np.maximum(S_hat - self.estimate.sd, np.minimum(S_hat, 0.0))


def slip_ratios(rim: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return Eq (1) within [-1, 1] for the rim speeds of the wheels (n,) at travel speeds (grid, n); 0 at rest."""
    sense = np.where(rim < 0.0, -1.0, 1.0)
    greatest = np.maximum(np.maximum(np.abs(rim), np.abs(v)), REST)
    return np.clip(sense * (rim - v) / greatest, -1.0, 1.0)
