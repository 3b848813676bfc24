"""Points of the load-traction factor against the slip ratio, as in Fig 6: means with their standard deviation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.table import measured_points
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.channel import Channel, Predictor, TractionFactor
from rover_pin.measurements.checks import column, not_negative, positive, same_length, slips
from rover_pin.measurements.known import UNDECLARED_SD, Known, range_of
from rover_pin.measurements.prediction import CompiledPrediction
from rover_pin.parameters import NEXUS6_WHEEL
from rover_pin.soil.angles import Angles, FixedAngles, SinkageAngles
from rover_pin.soil.sinkage import fitted_entry_angle
from rover_pin.soil.traction import NetTraction, TractionForm, load_traction_factor

FORM, ANGLES = NetTraction(), FixedAngles()


@dataclass(frozen=True)
class FactorLaw:
    """F(S) of a form, at the soil's theta_1, held against a factor measured at an uncertain slip.

    With S known to a and F_m to b, the least of (S_t - S)^2 / a^2 + (F(S_t) - F_m)^2 / b^2 over the true slip S_t is,
    to first order in S_t - S, that of the effective variance s^2,

        (F(S) - F_m)^2 / s^2,    s^2 = b^2 + F'(S)^2 a^2,

    reached at S_t = S - a^2 F' (F - F_m) / s^2. Minimised over the soil this is the functional errors-in-variables fit,
    consistent where F is straight over a; each S_t is spent on its own point, so that a point counts once.

    Source: Deming, Statistical Adjustment of Data (1943); York et al., American Journal of Physics 72 (2004) 367.
    """

    form: TractionForm
    angles: Angles
    loaded: bool = False
    "whether theta_1 balances f_n against the point's load; else it is the soil's"

    def build(self, condition: Any, wheel: Wheel, soil: Soil, free: Any) -> tuple[Any, Any]:
        """Return (F - F_m) / s, 1 / s, F' / s [3] and their Jacobian for `condition`: S, its SD a, F_m, its SD b, W."""
        S, a, measured, b, load = (condition[i] for i in range(5))
        slip = ca.SX.sym("S")
        if self.loaded:
            soil = soil.replace(theta_1=fitted_entry_angle(load, slip, wheel, soil))
        law = load_traction_factor(slip, soil, wheel, self.form, self.angles)
        factor, slope = (ca.substitute(expression, slip, S) for expression in (law, ca.jacobian(law, slip)))
        weight = 1.0 / ca.sqrt(b * b + (slope * a) ** 2)
        rows = ca.vertcat((factor - measured) * weight, weight, slope * weight)
        return rows, ca.jacobian(rows, free)


class UncertainSlip:
    """The `Predictor` of points with errors in both axes, and with errors that all of them share.

    Rows r = (F - F_m) / s with an error e that all share have the covariance I + u u^T, u = e / s for one of the
    factors, F' e / s for one of the slips. They are made independent by its root, one error after the other, and
    handed out as F_m + b w: a fit that divides by b minimises w^2.
    """

    def __init__(self, points: TractionPoints, free: tuple[str, ...]):
        loaded = bool(points.loads.size)
        load = points.loads if loaded else np.zeros(len(points.slip))
        conditions = np.column_stack([points.slip, points.slip_sd, points.factor, points.sd, load])
        self.rows = CompiledPrediction(FactorLaw(points.form, points.angles, loaded), conditions, points.wheel, free)
        self.measured, self.sd = points.factor, points.sd
        self.shared = np.array([points.shared, points.slip_shared])

    def __call__(self, fields: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the predictions [m] and their Jacobian [m, p]."""
        rows, slopes = self.rows(fields)
        rows, slopes = rows.reshape(3, -1), slopes.reshape(3, len(self.measured), -1)
        factor, slip = ((e * rows[at], e[:, None] * slopes[at]) for at, e in enumerate(self.shared, 1))
        w, dw = parted(parted(factor, slip), parted(factor, (rows[0], slopes[0])))
        return self.measured + self.sd * w, self.sd[:, None] * dw


Rows = tuple[np.ndarray, np.ndarray]
"""Values [m] and their Jacobian [m, p]."""


def parted(shared: Rows, rows: Rows) -> Rows:
    """Return (I + u u^T)^(-1/2) x = x - c (u x) u, with c = (1 - 1 / sqrt(1 + u^2)) / u^2, and its Jacobian."""
    (u, du), (x, dx) = shared, rows
    size, along = float(u @ u), float(u @ x)
    if size == 0.0:
        return rows
    root = 1.0 / math.sqrt(1.0 + size)
    c = (1.0 - root) / size
    dc = 2.0 * (0.5 * root**3 - c) / size * (u @ du)
    return x - c * along * u, dx - np.outer(u, along * dc + c * (x @ du + u @ dx)) - c * along * du


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
        slip's doubt explains (`FactorLaw`).
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
    sized : str
        How a k_1 of `declared` was chosen that nobody declared.

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
    declared: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    doubts: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    sized: str = ""

    tells: ClassVar[frozenset[str]] = frozenset({"k", "phi"})
    data_kind: ClassVar[str] = "the traction factor F(S) alone"

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
        """W [N] where the arc follows from it; nothing where the angles are given, whatever the load."""
        return np.asarray(self.load) if isinstance(self.angles, SinkageAngles) else np.empty(0)

    @property
    def known_ranges(self) -> Mapping[str, Known]:
        """A k_1 that was sized, within a factor exp(1.96 UNDECLARED_SD)."""
        if not self.sized:
            return {}
        low, high = range_of(self.declared["k_1"], UNDECLARED_SD, relative=True)
        return {"k_1": Known(self.sized, low, high, "assumed, as nobody measured it")}

    def declared_soil(self, soil: Soil) -> Soil:
        """Return `soil` with what the data declare of it."""
        return soil.replace(**self.declared)

    def predictor(self, free: tuple[str, ...]) -> Predictor:
        """Return F and its Jacobian at the measured slips."""
        return UncertainSlip(self, free)


def errors(values: Any, count: int, name: str, where: str) -> np.ndarray:
    """Return standard deviations, one a point; a single one holds for all."""
    sd = column(np.atleast_1d(values), name, where)
    sd = np.full(count, sd[0]) if sd.size == 1 else sd
    same_length(where, slip=np.empty(count), **{name: sd})
    return sd


def read_traction_points(
    path: str | Path, wheel: Wheel = NEXUS6_WHEEL, form: TractionForm = FORM, angles: Angles = ANGLES
) -> TractionPoints:
    """Return the points of a CSV file: columns `slip, traction_factor, sd`; `slip_sd`; `count` where `sd` is scatter.

    Raises
    ------
    DataError
        A missing file or column, or values out of range.
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
        return TractionPoints(table["slip"], table["traction_factor"], sd, wheel, form, angles, slip_sd)
    except DataError as error:
        raise DataError(f"{path.name}: {error}") from error
