"""Measured channels of a wheel rig, the traction factor, and the systematic errors of a rig's readings.

Each measured value has its standard deviation.
"""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Load, Scalar
from rover_pin.measurements.checks import column, positive, same_length


@dataclass(frozen=True, eq=False)
class Channel:
    """Measured values of one quantity with the standard deviation of each value.

    Parameters
    ----------
    measured : array (points,)
        Values in the channel's SI unit. NaN marks a missing cell if `may_miss` allows it.
    sd : float or array (points,)
        Standard deviation of each value in the unit of the values. A single number holds for all values.

    Raises
    ------
    DataError
        The column is empty, holds text or infinite values, both lengths differ, or an SD is not positive.

    Examples
    --------
    >>> DrawbarPull([1.0, 2.5], 0.3).sd.tolist()
    [0.3, 0.3]
    """

    measured: Any = field(repr=False)
    sd: Any = field(repr=False)

    name: ClassVar[str] = ""
    unit: ClassVar[str] = ""
    may_miss: ClassVar[bool] = False
    """whether cells of the column may be empty, because the channel was not measured in every run"""

    def __post_init__(self) -> None:
        where = type(self).__name__
        measured = column(self.measured, self.name, where, gaps=self.may_miss)
        sd = column(np.atleast_1d(self.sd), "sd", where, gaps=self.may_miss)
        # A single SD holds for all points.
        if sd.size == 1:
            sd = np.full(measured.size, sd[0])
        same_length(where, measured=measured, sd=sd)
        # A missing value needs no SD, but arrays of weights must stay finite: such a cell gets the mean SD.
        sd = column(np.where(np.isnan(measured), np.mean(sd[np.isfinite(sd)]), sd), "sd", where)
        positive(sd, "sd", self.unit, where)
        object.__setattr__(self, "measured", measured)
        object.__setattr__(self, "sd", sd)

    @property
    def has_value(self) -> np.ndarray:
        """Mask of the points at which the channel was measured (points,): False for an empty cell."""
        return np.isfinite(self.measured)


class TractionFactor(Channel):
    """The load-traction factor F [-]: the traction force, Eq (7) of the paper, divided by the load on the wheel."""

    name: ClassVar[str] = "traction factor"


class RigChannel(Channel):
    """Base class of the measured quantities of a wheel rig. `column` is the name of the quantity's column in the table
    of points.
    """

    column: ClassVar[str] = ""
    may_miss: ClassVar[bool] = True
    is_sideways: ClassVar[bool] = False
    """whether the channel is compared with predictions only in runs with a slip angle"""


class DrawbarPull(RigChannel):
    """Drawbar pull f_t [N], the net force of the soil on the wheel along its heading (Eq (7) of the paper), positive
    forwards.
    """

    name: ClassVar[str] = "drawbar pull"
    unit: ClassVar[str] = "N"
    column: ClassVar[str] = "drawbar_pull_N"


class Torque(RigChannel):
    """Torque of the wheel about its axle [N m], positive if it drives the wheel forwards."""

    name: ClassVar[str] = "torque"
    unit: ClassVar[str] = "N m"
    column: ClassVar[str] = "torque_Nm"


class Sinkage(RigChannel):
    """Sinkage h [m] of the wheel below the undisturbed surface, positive downwards (Eq (5) of the paper relates it to
    the entry angle).
    """

    name: ClassVar[str] = "sinkage"
    unit: ClassVar[str] = "m"
    column: ClassVar[str] = "sinkage_m"


class SideForce(RigChannel):
    """Force along the axle on a wheel with a slip angle [N], positive if the soil resists the sideways motion."""

    name: ClassVar[str] = "side force"
    unit: ClassVar[str] = "N"
    column: ClassVar[str] = "lateral_N"
    is_sideways: ClassVar[bool] = True


class VerticalMoment(RigChannel):
    """Moment of the soil on a wheel with a slip angle about the vertical axis through the wheel's centre [N m].

    The moment is positive if it turns the wheel to its left. A wheel with a positive slip angle moves to its right, so
    a positive moment increases the slip angle. The aligning moment of a tyre on a road has the opposite sign.
    """

    name: ClassVar[str] = "moment about the vertical"
    unit: ClassVar[str] = "N m"
    column: ClassVar[str] = "moment_z_Nm"
    is_sideways: ClassVar[bool] = True


class MotorTorque(RigChannel):
    """Torque of the wheel about its axle [N m] as computed from the current of its motor, positive if it drives the
    wheel forwards.

    Its scale (torque constant and efficiency of the gear) and its zero (no-load current) are uncertain. They are
    independent of the errors of a torque cell, so that a rig may state both torques of a run.
    """

    name: ClassVar[str] = "torque by motor current"
    unit: ClassVar[str] = "N m"
    column: ClassVar[str] = "motor_torque_Nm"


def sd_column(column: str) -> str:
    """Return the name of the column that holds the SD of a channel: drawbar_pull_sd_N for the column drawbar_pull_N."""
    return "_sd_".join(column.rsplit("_", 1))


RIG_CHANNELS: tuple[type[RigChannel], ...] = (DrawbarPull, Torque, Sinkage, SideForce, VerticalMoment, MotorTorque)
"""The classes of the channels that a rig can measure, in the common order of tables and predictions."""


@dataclass(frozen=True)
class RigErrors(Record):
    """Errors of a rig: the relation between the forces on the wheel and the readings of the sensors.

    The forces on the wheel are the pull f_t, the side force f_y, the torque T and the moment M about the vertical axis;
    h is the sinkage and W the stated load. The wheel carries the load W' = s_W W, and the rig reads:

    * pull s_f f_t + f_0 + x W' and side force s_f s_y f_y + f_y0, because one load cell of scale s_f measures both;
    * torque s_T T + T_0, where T_0 is the zero error with the friction of bearing and seals;
    * sinkage s_h h + h_0, where h_0 is a wrong zero, or a radius measured over instead of under the lugs;
    * moment s_M (M - x_0 f_y) + M_0, where x_0 is the distance of the cell's vertical axis ahead of the wheel's centre;
    * torque by motor current s_I T + T_I0, where T_I0 is the torque of the no-load current.

    A wheel that is pressed into the soil without turning meets s_p times the force of the law for rolling, and a plate
    s_b times this force (`experiments.wheel_rig.runs`). An error that `rig.toml` states with an `sd` is a nuisance
    parameter of every fit, with this prior. An error without `sd` is corrected exactly.

    All errors are neutral by default. Source: the usual errors of single-wheel rigs. For example, a zero error of the
    torque looks like a rolling resistance.
    """

    torque_tare: Scalar = quantity(0.0, "N m", "none unless [rig] states it", -1e4, 1e4, "T_0")
    pull_tare: Scalar = quantity(0.0, "N", "none unless [rig] states it", -1e5, 1e5, "f_0")
    side_tare: Scalar = quantity(0.0, "N", "none unless [rig] states it", -1e5, 1e5, "f_y0")
    sinkage_zero: Scalar = quantity(0.0, "m", "none unless [rig] states it", -1.0, 1.0, "h_0")
    crosstalk: Scalar = quantity(0.0, "", "share of the load that the pull's cell shows: none", -0.5, 0.5, "x")
    load_scale: Scalar = quantity(1.0, "", "load over that stated: 1", 0.5, 2.0, "s_W")
    force_scale: Scalar = quantity(1.0, "", "reading over force: 1", 0.5, 2.0, "s_f")
    moment_tare: Scalar = quantity(0.0, "N m", "none unless [rig] states it", -1e4, 1e4, "M_0")
    moment_arm: Scalar = quantity(0.0, "m", "taken about the wheel's centre unless [rig] states it", -5.0, 5.0, "x_0")
    torque_scale: Scalar = quantity(1.0, "", "reading over torque: 1", 0.5, 2.0, "s_T")
    sinkage_scale: Scalar = quantity(1.0, "", "reading over sinkage: 1", 0.5, 2.0, "s_h")
    side_scale: Scalar = quantity(1.0, "", "additional scale of the side force after s_f: 1", 0.5, 2.0, "s_y")
    moment_scale: Scalar = quantity(1.0, "", "reading over moment: 1", 0.5, 2.0, "s_M")
    motor_torque_tare: Scalar = quantity(0.0, "N m", "none unless [rig] states it", -1e4, 1e4, "T_I0")
    motor_torque_scale: Scalar = quantity(1.0, "", "reading over torque: 1", 0.2, 5.0, "s_I")
    pressing_scale: Scalar = quantity(1.0, "", "force of pressing in over that of the law: 1", 0.2, 5.0, "s_p")
    plate_scale: Scalar = quantity(1.0, "", "force of pressing a plate in over that of the law: 1", 0.2, 5.0, "s_b")

    def read(self, forces: Load, h: Scalar, load: Scalar) -> tuple[Scalar, ...]:
        """Return the readings of the rig for the forces on its wheel.

        Parameters
        ----------
        forces : Load
            Forces and moments of the soil on the wheel [N, N m].
        h : scalar
            Sinkage [m].
        load : scalar
            Load W' on the wheel [N].

        Returns
        -------
        tuple
            Pull [N], torque [N m], sinkage [m], side force [N], moment [N m] and torque by motor current [N m].
        """
        # One load cell measures pull and side force, so that both share its scale; the load of the wheel appears in the
        # pull by cross-talk.
        return (
            self.force_scale * forces.f_t + self.pull_tare + self.crosstalk * load,
            self.torque_scale * forces.torque + self.torque_tare,
            self.sinkage_scale * h + self.sinkage_zero,
            self.force_scale * self.side_scale * forces.f_y + self.side_tare,
            self.moment_scale * (forces.moment_z - self.moment_arm * forces.f_y) + self.moment_tare,
            self.motor_torque_scale * forces.torque + self.motor_torque_tare,
        )
