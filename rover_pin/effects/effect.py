"""What an effect is: a record of parameters and at most three hooks, with do-nothing defaults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.quantity import Record


class State(NamedTuple):
    """An own state of an effect, one per wheel; `odd` ones change sign when the direction of travel is mirrored."""

    name: str
    odd: bool = False


@dataclass(frozen=True)
class Effect(Record):
    """An effect at the wheel-soil contact. Formulas are scalar and use `ca.` functions only.

    The hooks are called in this order, for every effect of a model in turn: `amend` changes what the next effects see
    of the contact, `load` returns what is added to the load so far, `rate` returns the time derivatives of the own
    states. `neutral` names the parameter values at which the effect vanishes.
    """

    states: ClassVar[tuple[State, ...]] = ()
    neutral: ClassVar[dict[str, float]] = {}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact as the later effects shall see it."""
        return contact

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what this effect adds to the `load` of the effects before it."""
        return Load()

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return d(states)/dt, given the contact and the whole load."""
        return ()


class Drive(NamedTuple):
    """What one wheel's motor knows; scalars, floats or expressions."""

    delta: Scalar
    "PWM duty ratio, -1..1 [-]"
    omega: Scalar
    "rate of the wheel joint [rad/s]"
    supply: Scalar
    "supply voltage [V]"
    resistance: Scalar
    "winding resistance [ohm]"
    constant: Scalar
    "torque constant times gear ratio, k_t N = k_e N [N m/A = V s/rad]"
    wheel: Scalar = 0.0
    "which wheel of the rover, counted from 0"
    bus_current: Scalar = 0.0
    "what all motors together draw from the supply, one step ago [A]"

    @property
    def current(self) -> Scalar:
        """Current of the motor, (delta V - K omega) / R [A]."""
        return (self.delta * self.supply - self.constant * self.omega) / self.resistance


@dataclass(frozen=True)
class MotorEffect(Record):
    """An effect between duty and wheel torque, with the same three hooks as `Effect`."""

    states: ClassVar[tuple[State, ...]] = ()
    neutral: ClassVar[dict[str, float]] = {}

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the drive as the later effects shall see it."""
        return drive

    def torque(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> Scalar:
        """Return what this effect adds to the motor torque at the wheel [N m]."""
        return 0.0

    def rate(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return d(states)/dt, given the drive and the whole torque."""
        return ()


@dataclass(frozen=True)
class SensorEffect(Record):
    """An effect between what happens and what is logged; it works on whole channels, arrays over time."""

    neutral: ClassVar[dict[str, float]] = {}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the channels that the sensor reports otherwise than they are."""
        return {}
