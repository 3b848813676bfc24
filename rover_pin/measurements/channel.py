"""Measured channels with their noise."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from rover_pin.measurements.checks import column, positive, same_length


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


class TractionFactor(Channel):
    """The load-traction factor [-]."""

    name: ClassVar[str] = "traction factor"


class RigChannel(Channel):
    """A channel of a wheel rig."""

    column: ClassVar[str] = ""
    may_miss: ClassVar[bool] = True
    is_sideways: ClassVar[bool] = False
    "whether it is looked at only where a run has a slip angle"


class DrawbarPull(RigChannel):
    """f_t of Eq (7) [N]."""

    name: ClassVar[str] = "drawbar pull"
    unit: ClassVar[str] = "N"
    column: ClassVar[str] = "drawbar_pull_N"


class Torque(RigChannel):
    """The wheel's torque [N m]."""

    name: ClassVar[str] = "torque"
    unit: ClassVar[str] = "N m"
    column: ClassVar[str] = "torque_Nm"


class Sinkage(RigChannel):
    """h of Eq (5) [m]."""

    name: ClassVar[str] = "sinkage"
    unit: ClassVar[str] = "m"
    column: ClassVar[str] = "sinkage_m"


class SideForce(RigChannel):
    """The force along the axle of a wheel that travels at a slip angle, positive where the soil resists [N]."""

    name: ClassVar[str] = "side force"
    unit: ClassVar[str] = "N"
    column: ClassVar[str] = "lateral_N"
    is_sideways: ClassVar[bool] = True


class VerticalMoment(RigChannel):
    """What the soil turns a wheel at a slip angle with, about the vertical through its centre [N m].

    Positive where it turns the wheel to its left. At a positive slip angle, where the wheel goes to its right, that is
    further askew; the aligning moment of a tyre on a road has the other sign.
    """

    name: ClassVar[str] = "moment about the vertical"
    unit: ClassVar[str] = "N m"
    column: ClassVar[str] = "moment_z_Nm"
    is_sideways: ClassVar[bool] = True


RIG_CHANNELS: tuple[type[RigChannel], ...] = (DrawbarPull, Torque, Sinkage, SideForce, VerticalMoment)
"""The channels of a rig, in the order in which they are read and predicted."""
