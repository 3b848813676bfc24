"""Points of the load-traction factor against the slip ratio, as in Fig 6: means with their standard deviation."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np
import pandas as pd

from rover_pin.contact import Soil, Wheel
from rover_pin.errors import DataError
from rover_pin.evidence.channel import Channel, Predictor, TractionFactor
from rover_pin.evidence.checks import column, positive, same_length, slips
from rover_pin.evidence.prediction import CompiledPrediction
from rover_pin.evidence.tables import read_table
from rover_pin.parameters import NEXUS6_WHEEL
from rover_pin.soil.angles import Angles, FixedAngles
from rover_pin.soil.traction import NetTraction, TractionForm, load_traction_factor

FORM, ANGLES = NetTraction(), FixedAngles()


@dataclass(frozen=True)
class FactorLaw:
    """F(S) of a form, at the soil's theta_1."""

    form: TractionForm
    angles: Angles

    def build(self, condition: Any, wheel: Wheel, soil: Soil, free: Any) -> tuple[Any, Any]:
        """Return F [1] at the slip ratio `condition` [1] and its Jacobian."""
        factor = load_traction_factor(condition[0], soil, wheel, self.form, self.angles)
        return factor, ca.jacobian(factor, free)


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

    tells: ClassVar[frozenset[str]] = frozenset({"k", "phi"})
    told_by: ClassVar[str] = "the traction factor F(S) alone"

    def __post_init__(self) -> None:
        where = "TractionPoints"
        object.__setattr__(self, "slip", column(self.slip, "slip", where))
        channel = TractionFactor(self.factor, self.sd)
        same_length(where, slip=self.slip, factor=channel.measured)
        slips(self.slip, "slip", where)
        object.__setattr__(self, "factor", channel.measured)
        object.__setattr__(self, "sd", channel.sd)

    @classmethod
    def from_scatter(cls, slip: Any, factor: Any, wheel: Wheel = NEXUS6_WHEEL, form: TractionForm = FORM) -> Self:
        """Return the means of scattered single measurements, one for every distinct slip ratio.

        The SD of a mean is the SD of the scatter, pooled over all slips, over the root of the number of repeats: the
        SD of a handful of repeats is itself too uncertain to weigh a fit.

        Raises
        ------
        DataError
            No slip ratio was repeated, so the scatter is unknown.
        """
        slip, factor = column(slip, "slip", "scatter"), column(factor, "factor", "scatter")
        same_length("scatter", slip=slip, factor=factor)
        levels, at, count = np.unique(slip, return_inverse=True, return_counts=True)
        means = np.bincount(at, factor) / count
        if len(slip) == len(levels):
            raise DataError(
                "scatter: no slip ratio is repeated, so the scatter is unknown; use TractionPoints with sd."
            )
        pooled = np.sqrt(np.sum((factor - means[at]) ** 2) / (len(slip) - len(levels)))
        return cls(levels, means, pooled / np.sqrt(count), wheel, form)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The traction factor."""
        return (TractionFactor(self.factor, self.sd),)

    @property
    def loads(self) -> np.ndarray:
        """Nothing: the angles are given, whatever the load."""
        return np.empty(0)

    def predictor(self, free: tuple[str, ...]) -> Predictor:
        """Return F and its Jacobian at the measured slips."""
        return CompiledPrediction(FactorLaw(self.form, self.angles), self.slip[:, None], self.wheel, free)


def read_traction_points(
    path: str | Path, wheel: Wheel = NEXUS6_WHEEL, form: TractionForm = FORM, angles: Angles = ANGLES
) -> TractionPoints:
    """Return the points of a CSV file: columns `slip, traction_factor, sd` and, where `sd` is the scatter, `count`.

    Raises
    ------
    DataError
        A missing file or column, or values out of range.
    """
    path = Path(path)
    table: pd.DataFrame = read_table(path, ("slip", "traction_factor", "sd"))
    sd = column(table["sd"], "sd", path.name)
    if "count" in table:
        count = column(table["count"], "count", path.name)
        positive(count, "count", "", path.name)
        sd = sd / np.sqrt(count)
    try:
        return TractionPoints(table["slip"], table["traction_factor"], sd, wheel, form, angles)
    except DataError as error:
        raise DataError(f"{path.name}: {error}") from error
