"""What an effect is: a record of parameters and at most three hooks, with do-nothing defaults.

There are four kinds, by where they act: at a wheel's contact, in a motor, on the body, in a sensor. Each names its
`neutral` values, at which it vanishes, and its `places`: the quantities that say where it is, not how large.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Self

import numpy as np

from rover_pin.base.quantity import Record
from rover_pin.contact import Contact, Load, Scalar


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

    title: ClassVar[str] = ""
    "a reader's name of it"
    family: ClassVar[str] = ""
    "what effects like it do, where data may tell that sooner than which of them acts"
    meaning: ClassVar[str] = ""
    "what it means, a clause without a full stop that can follow 'because'"
    before_slip: ClassVar[bool] = False
    "whether it amends the speeds from which the slip is taken"
    states: ClassVar[tuple[State, ...]] = ()
    neutral: ClassVar[dict[str, float]] = {}
    places: ClassVar[tuple[str, ...]] = ()
    holds: ClassVar[tuple[str, ...]] = ()
    "effects whose law it holds already: beside it they are no candidates"
    unpaid: ClassVar[bool] = False
    "whether it changes the sinkage without what compaction then costs, where the traction law leaves that out"

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

    title: ClassVar[str] = ""
    family: ClassVar[str] = "motor"
    meaning: ClassVar[str] = ""
    states: ClassVar[tuple[State, ...]] = ()
    neutral: ClassVar[dict[str, float]] = {}
    places: ClassVar[tuple[str, ...]] = ()

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the drive as the later effects shall see it."""
        return drive

    def torque(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> Scalar:
        """Return what this effect adds to the motor torque at the wheel [N m]."""
        return 0.0

    def rate(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return d(states)/dt, given the drive and the whole torque."""
        return ()


class Body(NamedTuple):
    """What an effect on the body sees; scalars, floats or expressions. Joints are in the order of the rover's v."""

    x: Scalar
    "world position of the base's origin [m]"
    y: Scalar
    z: Scalar
    roll: Scalar
    "attitude of the base, world z-y-x [rad]"
    pitch: Scalar
    yaw: Scalar
    v_x: Scalar
    "world velocity of the base's origin [m/s]"
    v_y: Scalar
    v_z: Scalar
    w_x: Scalar
    "angular velocity of the base in the world [rad/s]"
    w_y: Scalar
    w_z: Scalar
    angles: tuple[Scalar, ...]
    "of the suspension's joints [rad]"
    rates: tuple[Scalar, ...]
    "of the suspension's joints [rad/s]"
    known_rates: tuple[Scalar, ...]
    "the same numbers, which the implicit step takes as they are: write friction as -f(known) rate, and it never swings"
    twist: Scalar = 0.0
    "sum of the two rockers' angles, which a rigid differential holds at 0 [rad]"
    twist_rate: Scalar = 0.0
    "its rate [rad/s]"
    names: tuple[str, ...] = ()
    "of the suspension's joints, as their channels: rocker_l, bogie_l, ..."


def joints_called(joint: str, names: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that `joint` means: the one of this name, those of a pair (bogie: bogie_l, bogie_r), or all."""
    return tuple(name for name in names if joint in ("", name) or name.startswith(f"{joint}_"))


class Push(NamedTuple):
    """What a body effect pushes with; pushes add."""

    f_x: Scalar = 0.0
    "force on the base at its origin, in the world [N]"
    f_y: Scalar = 0.0
    f_z: Scalar = 0.0
    m_x: Scalar = 0.0
    "moment on the base, in the world [N m]"
    m_y: Scalar = 0.0
    m_z: Scalar = 0.0
    joints: tuple[Scalar, ...] = ()
    "torques on the suspension's joints, one each, or none at all [N m]"
    differential: Scalar = 0.0
    "torque of the differential on either rocker [N m]"


class Ballast(NamedTuple):
    """What the base weighs besides: numbers, not expressions."""

    mass: float = 0.0
    "added at the rover's centre of mass [kg]"
    shift_x: float = 0.0
    "of the rover's centre of mass, by what the base carries, in the base's axes [m]"
    shift_z: float = 0.0


@dataclass(frozen=True)
class BodyEffect(Record):
    """An effect on the rover's body: what pushes it besides wheels and motors, its weight, where down and ground are.

    `push` is a formula of scalars, taken fully implicitly in the speeds; it has no own states. `ballast`, `rise` and
    `bend` are read once, before the drive.
    """

    title: ClassVar[str] = ""
    family: ClassVar[str] = "body"
    meaning: ClassVar[str] = ""
    only_resists: ClassVar[bool] = False
    "whether it acts against motion alone, so that where a rover stands at rest does not depend on it"
    in_pivots: ClassVar[bool] = False
    "whether it acts in the suspension's pivots alone, so that a rover without any cannot have it"
    neutral: ClassVar[dict[str, float]] = {}
    places: ClassVar[tuple[str, ...]] = ()

    @property
    def frees_differential(self) -> bool:
        """Whether the differential is this effect's `Push.differential` instead of rigid."""
        return False

    def begin_at(self, x: float, y: float) -> Self:
        """Return the effect as a drive meets it that begins with the base at x, y [m] of the world."""
        return self

    def push(self, body: Body) -> Push:
        """Return what this effect pushes with."""
        return Push()

    def stored_energy(self, body: Body) -> Scalar:
        """Return the energy that it holds and gives back [J], a function of where the body is, not of its speed."""
        return 0.0

    def ballast(self) -> Ballast:
        """Return what the base carries besides."""
        return Ballast()

    def rise(self) -> tuple[float, float]:
        """Return by what angle what is taken for level rises towards +x and towards +y [rad]."""
        return 0.0, 0.0

    def bend(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return x, increasing, and by how much the ground there is higher than declared, straight in between [m].

        Beyond both ends it goes on as high as there; without any x the ground is as declared.
        """
        return (), ()


@dataclass(frozen=True)
class SensorEffect(Record):
    """An effect between what happens and what is logged; it works on whole channels, arrays over time."""

    title: ClassVar[str] = ""
    family: ClassVar[str] = "sensor"
    meaning: ClassVar[str] = ""
    neutral: ClassVar[dict[str, float]] = {}
    places: ClassVar[tuple[str, ...]] = ()

    def undo(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return what is true where the sensor reads these channels, the inputs of a replay; else nothing."""
        return {}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the channels that the sensor reports otherwise than they are."""
        return {}
