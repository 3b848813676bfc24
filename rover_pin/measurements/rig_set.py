"""A wheel-rig set: what a single wheel pulled, asked for and sank at given slips and loads, and what is known."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.public import brief
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.channel import RIG_CHANNELS, RigChannel, Sinkage
from rover_pin.measurements.checks import Finding, column, depths, positive, same_length, slips
from rover_pin.measurements.pressed import ASSUMED_UNCERTAINTY, Trial, exponent, stiffness
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.measurements.rig_file import ANGLE, BEKKER_UNITS
from rover_pin.parameters.bekker import bekker

SAME_SLIP = 0.15
"""Slips that span less tell nothing that depends on slip. Why: a pull rises over four times as much (assumed)."""
SAME_LOAD = 1.5
"""Loads within this ratio count as one. Why: they move the share of c in the strength by a third at most."""
SAME_LEVEL = 0.02
"""Slips within this of their neighbour are one level where the data name none."""
STRAIGHT = 0.01
"""Slip angle [rad] up to which a wheel runs straight. Why: cells' cross-talk is some 1 % of the load (assumed)."""
FRICTION = ("phi", "FlankPressure.phi_f", "Ploughing.phi_f")
"""Numbers that are the friction of the sand, which its angle of repose bounds from below."""


class Independent(NamedTuple):
    """A soil constant known from another measurement: its range [SI] at a given exponent."""

    name: str
    unit: str
    low: float
    high: float
    source: str
    tolerance: float = ASSUMED_UNCERTAINTY
    "share of both ends that is granted"


@brief
@dataclass(frozen=True, eq=False)
class RigSet:
    """Steady runs of one wheel at given slip ratios and loads.

    Parameters
    ----------
    slip : array [points]
        Slip ratio, Eq (1) [-].
    load : float or array [points]
        Vertical load [N].
    channels : tuple of RigChannel
        What was measured: `DrawbarPull`, `Torque`, `Sinkage`, `SideForce`, `VerticalMoment`, with the SD of one run.
    wheel_range : mapping
        name -> (low, high) of sizes of the wheel, or constants of the soil, that are known only so well.
    declared : mapping
        name -> value (SI) of soil constants that come with the data from another measurement.
    levels : array [points], optional
        Label of the level that each run repeats; slips that are close where it is not given.
    doubts : mapping
        name -> SD (SI) that is declared with a constant of `declared`.
    slip_angle : float or array [points]
        Angle between heading and travel, positive to the wheel's right [rad].
    errors, error_sd : RigErrors and mapping
        What the rig adds to its readings, and `rig.name` or `wheel.name` -> SD of what is not sure.
    trials : tuple of Trial
        The same wheel pressed into the same soil without turning.
    beside : mapping
        name -> value (SI) of `rig_file.BESIDE` that is declared: lugs, density, angle of repose.
    runs : tuple of str
        The names of the runs.
    speeds : array [points, 2], optional
        Of travel along the wheel's plane and of the rim [m/s].
    source, points_file, unread : str, str and tuple of Finding
        Who measured it, what the runs were read from, and what a reader should know of that.

    Raises
    ------
    DataError
        Columns that are empty, of different lengths, not finite or out of range; a load that is not positive.
    """

    wheel: Wheel
    slip: Any = field(repr=False)
    load: Any = field(repr=False)
    channels: tuple[RigChannel, ...] = field(repr=False)
    name: str = "wheel rig"
    wheel_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    declared: Mapping[str, float] = field(default_factory=dict)
    levels: Any = field(default=None, repr=False)
    doubts: Mapping[str, float] = field(default_factory=dict)
    slip_angle: Any = field(default=0.0, repr=False)
    errors: RigErrors = field(default_factory=RigErrors)
    error_sd: Mapping[str, float] = field(default_factory=dict)
    trials: tuple[Trial, ...] = ()
    beside: Mapping[str, float] = field(default_factory=dict)
    runs: tuple[str, ...] = field(default=(), repr=False)
    speeds: np.ndarray | None = field(default=None, repr=False)
    source: str = ""
    points_file: str = ""
    unread: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        slip = column(self.slip, "slip", self.name)
        load = column(np.atleast_1d(self.load), "load", self.name)
        load = np.full(slip.size, load[0]) if load.size == 1 else load
        if not self.channels:
            raise DataError(
                f"{self.name}: no channel was measured; give one of {', '.join(c.column for c in RIG_CHANNELS)}."
            )
        same_length(self.name, slip=slip, load=load, **{c.column: c.measured for c in self.channels})
        slips(slip, "slip", self.name)
        positive(load, "load", "N", self.name)
        for channel in self.channels:
            if isinstance(channel, Sinkage):
                depths(channel.measured, self.wheel.r, channel.column, self.name)
        angle = np.broadcast_to(np.asarray(self.slip_angle, dtype=float), slip.shape)
        normal = {
            "slip": slip,
            "load": load,
            "slip_angle": column(angle, ANGLE, self.name),
            "levels": _labels(slip) if self.levels is None else np.array(list(map(str, self.levels))),
            "runs": self.runs or tuple(f"run {i + 1}" for i in range(slip.size)),
        }
        for name, value in normal.items():
            object.__setattr__(self, name, value)

    @cached_property
    def level_names(self) -> tuple[str, ...]:
        """The names of the levels, by their mean slips."""
        names = np.unique(self.levels)
        order = np.argsort([self.slip[self.levels == name].mean() for name in names])
        return tuple(map(str, names[order]))

    @cached_property
    def level(self) -> np.ndarray:
        """Which of `level_names` each run is of [points]."""
        place = {name: at for at, name in enumerate(self.level_names)}
        return np.array([place[str(name)] for name in self.levels])

    @property
    def loads_vary(self) -> bool:
        """Whether the loads differ enough to tell what depends on them."""
        return bool(np.max(self.load) >= SAME_LOAD * np.min(self.load))

    @property
    def askew(self) -> np.ndarray:
        """Which runs have a slip angle [points]."""
        return np.asarray(np.abs(self.slip_angle) > STRAIGHT)

    @property
    def rolled(self) -> Self:
        """The set without its pressings."""
        return replace(self, trials=())

    def place(self, column_name: str) -> str:
        """Return where a column stands, as a finding says it."""
        return f"{self.points_file}: {column_name}" if self.points_file else column_name

    def rows(self, keep: Any) -> Self:
        """Return the set with these runs only, chosen as NumPy chooses: a mask, indices or a slice.

        A channel of which none of these runs has a value is left out.
        """
        return replace(
            self,
            slip=self.slip[keep],
            load=self.load[keep],
            slip_angle=self.slip_angle[keep],
            levels=self.levels[keep],
            runs=tuple(np.array(self.runs)[keep]),
            speeds=None if self.speeds is None else self.speeds[keep],
            channels=tuple(
                type(channel)(channel.measured[keep], channel.sd[keep])
                for channel in self.channels
                if channel.has_value[keep].any()
            ),
        )

    def soil(self) -> Soil:
        """Return the soil as declared: what the data state, the rest as Table 1 has it.

        Where the wheel was pressed in, that tells k_1 + k_2 b, and n unless it is declared; Bekker's constants are
        converted for this wheel's width. One width tells k_1 + k_2 b only, so all of it is put into k_1.
        """
        b = self.wheel.b
        soil = Soil().replace(**{name: value for name, value in self.declared.items() if name in quantities(Soil)})
        if self.trials:
            n = self._pressed_n
            return soil.replace(n=n, k_1=stiffness(self.trials, self.wheel, n) * b**n, k_2=0.0)
        k_1, k_2 = soil.k_1, soil.k_2
        if BEKKER_UNITS.keys() <= self.declared.keys():
            k_1, k_2 = bekker(self.declared["k_c"], self.declared["k_phi"], soil.n, b)
        return soil.replace(k_1=k_1 + k_2 * float(b), k_2=0.0)

    @cached_property
    def _pressed_n(self) -> float:
        """The exponent at which the trials tell k_1: as declared, else the one that meets them best."""
        return self.declared["n"] if "n" in self.declared else exponent(self.trials, self.wheel)

    def independent(self, n: float) -> tuple[Independent, ...]:
        """Return what other measurements say of the soil, at the exponent n, and of the wheel's lugs.

        One width tells K_eff = (k_1 + k_2 b) / b^n; constants that are stated do at the n that goes with them.
        """
        constants = [
            Independent(name, quantities(Soil)[name].unit, value, value, "stated with the data")
            for name, value in self.declared.items()
            if name in quantities(Soil) and name not in ("n", "k_1", "k_2")
        ]
        if {"k_1", *BEKKER_UNITS} & self.declared.keys() and not self.trials and n == float(self.soil().n):
            K = float(self.soil().k_1) / float(self.wheel.b) ** n
            constants.append(Independent("K_eff", "Pa/m^n", K, K, "stated with the data"))
        lugs = self.beside.get("lug_height", 0.0)
        if lugs > 0.0:
            names = ("LugExcavation.h_l", "Grousers.h_s")
            constants += [Independent(name, "m", lugs, lugs, "lug_height of [wheel]") for name in names]
        if "angle_of_repose" in self.beside:
            least, most = self.beside["angle_of_repose"], quantities(Soil)["phi"].high
            source = "angle_of_repose: dry sand stands no steeper than its own friction; a smooth rim may slide on it"
            constants += [Independent(name, "rad", least, most, source, 0.0) for name in FRICTION]
        return tuple(constants)


def classes(values: np.ndarray, apart: float) -> np.ndarray:
    """Return which class each value is of: neighbours by no more than `apart` from one another are of one."""
    order = np.argsort(values)
    value_class = np.empty(values.size, dtype=int)
    value_class[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > apart)])
    return value_class


def _labels(slip: np.ndarray) -> np.ndarray:
    """Return the level of each slip as a label: the mean of those that lie side by side."""
    level = classes(slip, SAME_LEVEL)
    return np.array([f"S = {slip[level == i].mean():.2f}" for i in level])
