"""Points of the load-traction factor at several slip ratios, as in Fig 6 of the paper: means with their SDs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.table import measured_points
from rover_pin.contact import Wheel
from rover_pin.measurements.channel import TractionFactor
from rover_pin.measurements.checks import column, not_negative, positive, same_length, slips
from rover_pin.parameters import NEXUS6_WHEEL
from rover_pin.soil.angles import Angles, FixedAngles, SinkageAngles
from rover_pin.soil.wheel_forces import NetTraction, TractionForm

FORM, ANGLES = NetTraction(), FixedAngles()
"""Default of the traction ratio that was measured (net traction), and default rule for the contact angles (fixed
angles)."""


@dataclass(frozen=True, eq=False)
class TractionPoints:
    """Mean load-traction factors (traction divided by load) at several slip ratios, with the errors of both.

    Parameters
    ----------
    slip : array (points,)
        Slip ratios of Eq (1), (r omega - v) / max(r omega, v) [-].
    factor : array (points,)
        Mean load-traction factor at each slip [-].
    sd : float or array (points,)
        Standard deviation of each **mean** [-]: the error bar of Fig 6 divided by the root of the number of repeats.
    wheel : Wheel
        Radius and width of the wheel [m]; by default the size of Nexus 6's wheels.
    form : TractionForm
        The traction ratio that was measured: net or gross.
    angles : Angles
        Rule for the contact angles; the paper holds theta_1 and theta_2 constant.
    slip_sd : float or array (points,)
        Standard deviation of each slip ratio [-]; 0 if the slip was set exactly. Through the slope of the curve, it
        enters the weights of the residuals (`TractionFactors`).
    shared : float or array (points,)
        Standard deviation of an error that all factors share [-], for example of a wrong load or torque constant. The
        signs of the entries state whether each factor moves with the others or against them.
    slip_shared : float or array (points,)
        Standard deviation of an error that all slip ratios share [-], for example of a wrong radius.
    load : array (points,), optional
        Wheel load W [N] of each point, for `angles` that follow the sinkage: the contact arc then carries W, by k_1,
        k_2 and n. Without a load, the arc is given by the soil's theta_1.
    declared : mapping
        Name -> value (SI) of soil constants that come with the data.
    doubts : mapping
        Name -> SD (SI) that is declared with a constant of `declared`.

    Raises
    ------
    DataError
        Columns that are empty, of different lengths, not finite or out of range.

    Examples
    --------
    >>> TractionPoints([0.1, 0.5], [0.05, 0.2], 0.03).sd.tolist()
    [0.03, 0.03]
    """

    slip: Any = field(repr=False)
    factor: Any = field(repr=False)
    sd: Any = field(repr=False)
    wheel: Wheel = NEXUS6_WHEEL
    form: TractionForm = FORM
    angles: Angles = ANGLES
    slip_sd: Any = field(default=0.0, repr=False)
    shared: Any = field(default=0.0, repr=False)
    slip_shared: Any = field(default=0.0, repr=False)
    load: Any = field(default=(), repr=False)
    declared: Mapping[str, float] = field(default_factory=dict)
    doubts: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = "TractionPoints"
        object.__setattr__(self, "slip", column(self.slip, "slip", where))
        channel = TractionFactor(self.factor, self.sd)
        same_length(where, slip=self.slip, factor=channel.measured)
        slips(self.slip, "slip", where)
        for name in ("slip_sd", "shared", "slip_shared"):
            object.__setattr__(self, name, errors(getattr(self, name), len(self.slip), name, where))
        not_negative(self.slip_sd, "slip_sd", "", where)
        object.__setattr__(self, "factor", channel.measured)
        object.__setattr__(self, "sd", channel.sd)
        if len(self.load):
            object.__setattr__(self, "load", column(self.load, "load", where))
            same_length(where, slip=self.slip, load=self.load)
            positive(self.load, "load", "N", where)

    @property
    def loads(self) -> np.ndarray:
        """Wheel load W [N] of each point if the contact angles follow from the load; otherwise an empty array."""
        return np.asarray(self.load) if isinstance(self.angles, SinkageAngles) else np.empty(0)


def errors(values: Any, count: int, name: str, where: str) -> np.ndarray:
    """Return the standard deviations of the points as an array (count,); `values` holds one number for each point, or
    one number for all points.

    `name` and `where` name the values and their source in error messages.
    """
    sd = column(np.atleast_1d(values), name, where)
    # A single number holds for all points.
    sd = np.full(count, sd[0]) if sd.size == 1 else sd
    same_length(where, slip=np.empty(count), **{name: sd})
    return sd


def read_traction_points(path: str | Path) -> TractionPoints:
    """Read the traction points of a CSV file.

    The columns of the file are `slip`, `traction_factor`, `sd`, and optionally `slip_sd` and `count`. If the file has a
    column `count` (number of repeats), `sd` is the scatter of single values and is divided by the root of the count.

    Raises DataError if the file or a column is missing, or if a value is out of range.
    """
    path = Path(path)
    table: pd.DataFrame = measured_points(path, ("slip", "traction_factor", "sd"))
    sd = column(table["sd"], "sd", path.name)
    # The error bar of a mean is the scatter of single values divided by the root of their number.
    if "count" in table:
        count = column(table["count"], "count", path.name)
        positive(count, "count", "", path.name)
        sd = sd / np.sqrt(count)
    slip_sd = table.get("slip_sd", 0.0)
    try:
        return TractionPoints(table["slip"], table["traction_factor"], sd, slip_sd=slip_sd)
    except DataError as error:
        raise DataError(f"{path.name}: {error}") from error
