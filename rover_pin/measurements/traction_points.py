"""Points of the load-traction factor against the slip ratio, as in Fig 6: means with their standard deviation."""

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


@dataclass(frozen=True, eq=False)
class TractionPoints:
    """Mean traction factors at several slip ratios.

    Parameters
    ----------
    slip : array [points]
        Slip ratios, Eq (1) [-].
    factor : array [points]
        Mean load-traction factor at each [-].
    sd : float or array [points]
        Standard deviation of each **mean** [-]: the error bar of Fig 6 divided by the root of the number of repeats.
    form : TractionForm
        Which ratio was measured.
    angles : Angles
        How the arc follows from the soil; the paper holds theta_1 and theta_2.
    slip_sd : float or array [points]
        Standard deviation of each slip ratio [-]; 0 where it was set exactly. Residuals are then shorter by what the
        slip's doubt explains (`TractionFactors`).
    shared : float or array [points]
        By how much all factors may be wrong together, one standard deviation [-]: a wrong load or torque constant. Its
        signs say which way each goes with the others.
    slip_shared : float or array [points]
        The same of all slip ratios: a wrong radius.
    load : array [points], optional
        W [N] of each point, where `angles` follow the sinkage: its arc carries W, as far as k_1, k_2 and n have it.
        Without it the arc is that of the soil's theta_1.
    declared : mapping
        name -> value (SI) of soil constants that come with the data.
    doubts : mapping
        name -> SD (SI) that is declared with one of them.

    Raises
    ------
    DataError
        Columns that are empty, of different lengths, not finite or out of range.
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
        """W [N] where the arc follows from it; nothing where the angles are given, whatever the load."""
        return np.asarray(self.load) if isinstance(self.angles, SinkageAngles) else np.empty(0)


def errors(values: Any, count: int, name: str, where: str) -> np.ndarray:
    """Return standard deviations, one a point; a single one holds for all."""
    sd = column(np.atleast_1d(values), name, where)
    sd = np.full(count, sd[0]) if sd.size == 1 else sd
    same_length(where, slip=np.empty(count), **{name: sd})
    return sd


def read_traction_points(path: str | Path) -> TractionPoints:
    """Return the points of a CSV file: columns `slip, traction_factor, sd`; `slip_sd`; `count` where `sd` is scatter.

    Raises DataError: a missing file or column, or values out of range.
    """
    path = Path(path)
    table: pd.DataFrame = measured_points(path, ("slip", "traction_factor", "sd"))
    sd = column(table["sd"], "sd", path.name)
    if "count" in table:
        count = column(table["count"], "count", path.name)
        positive(count, "count", "", path.name)
        sd = sd / np.sqrt(count)
    slip_sd = table.get("slip_sd", 0.0)
    try:
        return TractionPoints(table["slip"], table["traction_factor"], sd, slip_sd=slip_sd)
    except DataError as error:
        raise DataError(f"{path.name}: {error}") from error
