"""Base classes of effects. An effect is a record of parameters with a few methods (hooks) that the simulator calls;
each hook does nothing by default.

There are four kinds of effects. An `Effect` acts at the contact of a wheel with the soil, a `MotorEffect` in a motor, a
`BodyEffect` on the rover's body, and a `SensorEffect` between the true motion and the log. Each class lists its
`neutral` values, at which the effect vanishes, and its `places`, which are the parameters that locate the effect and do
not scale it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Self

import numpy as np

from rover_pin.base.quantity import Record
from rover_pin.contact import Contact, Load, Scalar


class State(NamedTuple):
    """Description of one state variable of an effect, such as the depth of a hole; the simulator keeps one value for
    every wheel.

    An `odd` state changes sign when the direction of travel is mirrored.
    """

    name: str
    odd: bool = False


@dataclass(frozen=True)
class Effect(Record):
    """An effect at the contact of a wheel with the soil.

    A model calls the hooks of all its effects in turn. `amend` changes the contact that the later effects see. `load`
    returns the force and torque that this effect adds to the load of the effects before it. `rate` returns the time
    derivatives of the effect's own states. Formulas are written for scalars with `ca.` functions only, so that they
    work for floats and for CasADi expressions. `neutral` lists the parameter values at which the effect vanishes.

    Examples
    --------
    A resistance that is a share of the normal force:

    >>> @dataclass(frozen=True)
    ... class Drag(Effect):
    ...     share: float = 0.1
    ...     neutral = {"share": 0.0}
    ...     def load(self, contact, load, x):
    ...         return Load(f_t=-self.share * load.f_n)
    """

    title: ClassVar[str] = ""
    "short name for a reader"
    family: ClassVar[str] = ""
    "group of effects with a similar action. Data may identify the group sooner than the effect within it."
    meaning: ClassVar[str] = ""
    "explanation as a clause without a full stop, which can follow 'because'"
    before_slip: ClassVar[bool] = False
    "whether `amend` changes the speeds that the slip is computed from"
    states: ClassVar[tuple[State, ...]] = ()
    neutral: ClassVar[dict[str, float]] = {}
    places: ClassVar[tuple[str, ...]] = ()
    holds: ClassVar[tuple[str, ...]] = ()
    """names of effects whose law this effect contains already. A model with this effect does not try them as
    candidates."""
    unpaid: ClassVar[bool] = False
    """whether the effect changes the sinkage without the work of compaction that the deeper rut costs, in traction laws
    that leave compaction out"""

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact (slip, sinkage, soil) as the later effects shall see it.

        `contact` is the contact after all earlier effects, and `x` holds the values of this effect's states. By default
        the contact stays unchanged.
        """
        return contact

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the force and torque that this effect adds to the wheel's load.

        `load` is the summed load of all earlier effects, and `x` holds the values of this effect's states. By default
        nothing is added.
        """
        return Load()

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the time derivative of each state of this effect, in the order of `states`.

        `load` is the total load of all effects, and `x` holds the present values of the states.
        """
        return ()


class Drive(NamedTuple):
    """Input of one wheel's motor: its command, its supply and its constants. All fields are scalars: floats or CasADi
    expressions.
    """

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
    """index of the wheel that the motor drives, counted from 0"""
    bus_current: Scalar = 0.0
    """total current that all motors drew from the supply in the previous time step [A]"""

    @property
    def current(self) -> Scalar:
        """Current of the motor [A]: (delta V - K omega) / R, with the duty delta, the supply voltage V, the constant K,
        the wheel rate omega and the winding resistance R.
        """
        return (self.delta * self.supply - self.constant * self.omega) / self.resistance


@dataclass(frozen=True)
class MotorEffect(Record):
    """An effect between the duty ratio of a motor and the torque at its wheel.

    A model calls the hooks of all its motor effects in turn. `amend` changes the drive (duty, voltage, resistance) that
    the later effects see, `torque` adds to the torque, and `rate` returns the time derivatives of the effect's own
    states. `neutral` lists the parameter values at which the effect vanishes, and `places` the parameters that locate
    it.
    """

    title: ClassVar[str] = ""
    family: ClassVar[str] = "motor"
    meaning: ClassVar[str] = ""
    states: ClassVar[tuple[State, ...]] = ()
    neutral: ClassVar[dict[str, float]] = {}
    places: ClassVar[tuple[str, ...]] = ()

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the input of the motor (duty, voltage, resistance) as the later effects shall see it. `x` holds the
        values of this effect's states.
        """
        return drive

    def torque(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> Scalar:
        """Return the torque [N m] that this effect adds to the motor's torque at the wheel.

        `torque` is the torque of the motor and all earlier effects, and `x` holds the values of this effect's states.
        """
        return 0.0

    def rate(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the time derivative of each state of this effect, in the order of `states`.

        `torque` is the total torque of all effects [N m], and `x` holds the present values of the states.
        """
        return ()


class Body(NamedTuple):
    """State of the rover's body, as a body effect sees it. All fields are scalars or tuples of scalars; joints are in
    the order of the rover's velocity vector v.
    """

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
    "angles of the suspension joints [rad]"
    rates: tuple[Scalar, ...]
    "rates of the suspension joints [rad/s]"
    known_rates: tuple[Scalar, ...]
    """values of `rates` at the start of the time step. The implicit step solves for `rates` but takes these values as
    known: friction of the form -f(known rate) rate with f > 0 cannot oscillate."""
    twist: Scalar = 0.0
    "sum of the two rocker angles, which a rigid differential holds at 0 [rad]"
    twist_rate: Scalar = 0.0
    """time derivative of `twist` [rad/s]"""
    names: tuple[str, ...] = ()
    "channel names of the suspension joints: rocker_l, bogie_l, ..."


def joints_called(joint: str, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the suspension joints that the text `joint` selects from `names`.

    `joint` is the name of one joint (bogie_l), the common start of a pair (bogie for bogie_l and bogie_r), or empty for
    all joints.
    """
    return tuple(name for name in names if joint in ("", name) or name.startswith(f"{joint}_"))


class Push(NamedTuple):
    """Forces and torques of a body effect on the base and the suspension joints. The pushes of several effects add."""

    f_x: Scalar = 0.0
    "force on the base at its origin, in the world [N]"
    f_y: Scalar = 0.0
    f_z: Scalar = 0.0
    m_x: Scalar = 0.0
    "moment on the base, in the world [N m]"
    m_y: Scalar = 0.0
    m_z: Scalar = 0.0
    joints: tuple[Scalar, ...] = ()
    """torques on the suspension joints [N m], one for each joint; an empty tuple means no torque"""
    differential: Scalar = 0.0
    "torque of the differential on each rocker [N m]"


class Ballast(NamedTuple):
    """Mass that the base carries in addition to the mass in the rover's description. All fields are plain numbers, not
    CasADi expressions.
    """

    mass: float = 0.0
    "mass added at the rover's centre of mass [kg]"
    shift_x: float = 0.0
    """displacement of the rover's centre of mass by the load of the base, in the axes of the base [m]"""
    shift_z: float = 0.0


@dataclass(frozen=True)
class BodyEffect(Record):
    """An effect on the rover's body: an additional force or torque, a change of its mass, or a change of the ground.

    `push` is a formula of scalars, which the simulator solves implicitly in the speeds. A body effect has no states of
    its own. `ballast` (additional mass), `rise` (slope of the ground) and `bend` (height of the ground) are read once,
    before the drive.
    """

    title: ClassVar[str] = ""
    family: ClassVar[str] = "body"
    meaning: ClassVar[str] = ""
    only_resists: ClassVar[bool] = False
    """whether the effect only opposes motion, so that the place where a rover comes to rest does not depend on it"""
    in_pivots: ClassVar[bool] = False
    "whether the effect acts only in the pivots of the suspension, so that a rover without pivots cannot have it"
    neutral: ClassVar[dict[str, float]] = {}
    places: ClassVar[tuple[str, ...]] = ()

    @property
    def frees_differential(self) -> bool:
        """Whether this effect replaces the rigid differential by its torque `Push.differential`."""
        return False

    def begin_at(self, x: float, y: float) -> Self:
        """Return the effect for a drive that starts with the base at the position (x, y) in the world [m].

        An effect that depends on the distance from the start overrides this method; by default the effect stays
        unchanged.
        """
        return self

    def push(self, body: Body) -> Push:
        """Return the forces and torques of this effect on the base and the joints of the suspension."""
        return Push()

    def stored_energy(self, body: Body) -> Scalar:
        """Return the elastic energy that is stored in the effect [J]. The energy depends on the pose of the body, not
        on its speed.
        """
        return 0.0

    def ballast(self) -> Ballast:
        """Return the mass that this effect adds to the rover, and the displacement of the centre of mass."""
        return Ballast()

    def rise(self) -> tuple[float, float]:
        """Return the slope [rad] of ground that is declared level, towards +x and towards +y; a positive
        slope rises.
        """
        return 0.0, 0.0

    def bend(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return positions x [m] in increasing order, and the height of the true ground above the declared ground at
        each of them [m].

        The height is linear between the positions and constant beyond the first and the last one. Empty tuples mean
        that the ground is as declared.
        """
        return (), ()


@dataclass(frozen=True)
class SensorEffect(Record):
    """An error of a sensor, which changes the log but not the motion. It works on whole channels, which are arrays over
    time.
    """

    title: ClassVar[str] = ""
    family: ClassVar[str] = "sensor"
    meaning: ClassVar[str] = ""
    neutral: ClassVar[dict[str, float]] = {}
    places: ClassVar[tuple[str, ...]] = ()

    def undo(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the true channels that belong to the logged channels, without channels that the sensor logs correctly.

        `t` are the times [s], and `channels` maps names to logged values. A replay uses the true channels as its
        inputs.
        """
        return {}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the channels as the sensor logs them, for given true channels, without channels that the sensor logs
        correctly.

        `t` are the times [s], and `channels` maps names to true values.
        """
        return {}
