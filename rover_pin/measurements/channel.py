"""Measured channels with their noise, and what a wheel's forces predict of each."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from rover_pin.contact import Scalar, Wheel
from rover_pin.measurements.checks import column, positive, same_length
from rover_pin.soil.sinkage import sinkage
from rover_pin.soil.traction import WheelForces


@dataclass(frozen=True, eq=False)
class Channel:
    """Measured values and the standard deviation of each; a single `sd` holds for all."""

    measured: Any = field(repr=False)
    sd: Any = field(repr=False)

    name: ClassVar[str] = ""
    unit: ClassVar[str] = ""
    may_miss: ClassVar[bool] = False
    "whether NaN is a cell that was not measured"

    def __post_init__(self) -> None:
        where = type(self).__name__
        measured = column(self.measured, self.name, where, gaps=self.may_miss)
        sd = column(np.atleast_1d(self.sd), "sd", where, gaps=self.may_miss)
        if sd.size == 1:
            sd = np.full(measured.size, sd[0])
        same_length(where, measured=measured, sd=sd)
        sd = column(np.where(np.isnan(measured), np.mean(sd[np.isfinite(sd)]), sd), "sd", where)
        positive(sd, "sd", self.unit, where)
        object.__setattr__(self, "measured", measured)
        object.__setattr__(self, "sd", sd)

    @property
    def has_value(self) -> np.ndarray:
        """Which points have a value [points]."""
        return np.isfinite(self.measured)


@dataclass(frozen=True, eq=False)
class TractionFactor(Channel):
    """The load-traction factor [-]."""

    name: ClassVar[str] = "traction factor"


@dataclass(frozen=True, eq=False)
class RigChannel(Channel):
    """A channel of a wheel rig, computed from the wheel forces at the entry angle that carries the load."""

    column: ClassVar[str] = ""
    may_miss: ClassVar[bool] = True
    is_sideways: ClassVar[bool] = False
    "whether it is looked at only where a run has a slip angle"

    @staticmethod
    def predicted(forces: WheelForces, theta_1: Scalar, wheel: Wheel) -> Scalar:
        """Return the model's value of this channel."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class DrawbarPull(RigChannel):
    """f_t of Eq (7) [N]."""

    name: ClassVar[str] = "drawbar pull"
    unit: ClassVar[str] = "N"
    column: ClassVar[str] = "drawbar_pull_N"

    @staticmethod
    def predicted(forces: WheelForces, theta_1: Scalar, wheel: Wheel) -> Scalar:
        """Return f_t [N]."""
        return forces.f_t


@dataclass(frozen=True, eq=False)
class Torque(RigChannel):
    """The wheel's torque [N m]."""

    name: ClassVar[str] = "torque"
    unit: ClassVar[str] = "N m"
    column: ClassVar[str] = "torque_Nm"

    @staticmethod
    def predicted(forces: WheelForces, theta_1: Scalar, wheel: Wheel) -> Scalar:
        """Return the torque [N m]."""
        return forces.torque


@dataclass(frozen=True, eq=False)
class Sinkage(RigChannel):
    """h of Eq (5) [m]."""

    name: ClassVar[str] = "sinkage"
    unit: ClassVar[str] = "m"
    column: ClassVar[str] = "sinkage_m"

    @staticmethod
    def predicted(forces: WheelForces, theta_1: Scalar, wheel: Wheel) -> Scalar:
        """Return h [m]."""
        return sinkage(theta_1, wheel)


@dataclass(frozen=True, eq=False)
class SidewaysChannel(RigChannel):
    """What a wheel at a slip angle shows besides; Eqs (2)-(7) run straight, a `RigModel` does not."""

    is_sideways: ClassVar[bool] = True

    @staticmethod
    def predicted(forces: WheelForces, theta_1: Scalar, wheel: Wheel) -> Scalar:
        """Return 0."""
        return 0.0


@dataclass(frozen=True, eq=False)
class SideForce(SidewaysChannel):
    """The force along the axle of a wheel that travels at a slip angle, positive where the soil resists [N]."""

    name: ClassVar[str] = "side force"
    unit: ClassVar[str] = "N"
    column: ClassVar[str] = "lateral_N"


@dataclass(frozen=True, eq=False)
class VerticalMoment(SidewaysChannel):
    """What the soil turns a wheel at a slip angle with, about the vertical through its centre [N m].

    Positive where it turns the wheel to its left. At a positive slip angle, where the wheel goes to its right, that is
    further askew; the aligning moment of a tyre on a road has the other sign.
    """

    name: ClassVar[str] = "moment about the vertical"
    unit: ClassVar[str] = "N m"
    column: ClassVar[str] = "moment_z_Nm"


RIG_CHANNELS: tuple[type[RigChannel], ...] = (DrawbarPull, Torque, Sinkage, SideForce, VerticalMoment)
"""The channels of a rig, in the order in which they are read and predicted."""
