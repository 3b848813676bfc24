"""A wheel-rig data set: measured pull, torque and sinkage of one wheel at given slips and loads.

The data set also holds everything that is known about the wheel, the soil and the rig from other measurements.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.public import brief
from rover_pin.base.quantity import quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.measurements.channel import RIG_CHANNELS, RigChannel, RigErrors, Sinkage
from rover_pin.measurements.checks import Finding, column, depths, positive, same_length, slips
from rover_pin.measurements.pressed import ASSUMED_UNCERTAINTY, Trial, exponent, stiffness
from rover_pin.measurements.rig_file import ANGLE, BEKKER_UNITS
from rover_pin.parameters.bekker import bekker
from rover_pin.parameters.gravity import EARTH

SAME_SLIP = 0.15
"""Smallest range of slips of a data set that shows how the channels depend on slip. A pull rises over four times this
range (assumed)."""
SAME_LOAD = 1.5
"""Largest ratio of two loads that still count as one load: they change the contribution of the cohesion c to the
strength by at most a third."""
SAME_LEVEL = 0.02
"""Largest distance between neighbouring slips (sorted by size) of one slip level, if the data do not name the levels.
Rigs repeat a slip to within about 0.01 (assumed), and the levels of a test are usually 0.1 apart."""
STRAIGHT = 0.01
"""Largest slip angle [rad] at which a wheel counts as running straight. At this angle the side force is about as small
as the cross-talk of load cells, which is 1 % of the load (assumed)."""
FRICTION = ("phi", "FlankPressure.phi_f", "Ploughing.phi_f")
"""Names of the parameters that are friction angles of the sand. None of them can be smaller than the sand's angle of
repose."""


class Independent(NamedTuple):
    """A soil or lug constant that is known from a measurement other than the runs: its name, and its range
    in SI units.
    """

    name: str
    unit: str
    low: float
    high: float
    source: str
    tolerance: float = ASSUMED_UNCERTAINTY
    "relative tolerance of both ends of the range"


@brief
@dataclass(frozen=True, eq=False)
class RigSet:
    """Steady runs of one wheel at given slip ratios and loads, with everything that is known about wheel, soil and rig.

    Parameters
    ----------
    wheel : Wheel
        Radius and width of the wheel [m].
    slip : array (points,)
        Slip ratio, Eq (1) of the paper [-].
    load : float or array (points,)
        Vertical load [N].
    channels : tuple of RigChannel
        Measured channels with the SD of one run: `DrawbarPull`, `Torque`, `Sinkage`, `SideForce`, `VerticalMoment`,
        `MotorTorque`.
    name : str
        Name of the data set, for messages.
    wheel_range : mapping
        Name -> (low, high) [SI] of the wheel sizes and soil constants that state a range.
    declared : mapping
        Name -> value [SI] of soil constants from a separate measurement.
    levels : array (points,), optional
        Label of the slip level that each run repeats. Without labels, close slips form a level.
    doubts : mapping
        Name -> SD [SI] that is declared with a constant of `declared`.
    slip_angle : float or array (points,)
        Angle between the wheel's plane and its travel [rad], positive if the wheel moves to its right.
    errors, error_sd : RigErrors and mapping
        Declared errors of the rig's readings, and `rig.name` or `wheel.name` -> SD of the uncertain errors and sizes.
    trials : tuple of Trial
        Pressing trials: the wheel pressed into the soil without turning.
    beside : mapping
        Name -> value [SI] of declared numbers of lugs and sand (`rig_file.BESIDE`): lug sizes, density, angle of
        repose.
    runs : tuple of str
        Names of the runs.
    speeds : array (points, 2), optional
        Travel speed along the wheel's plane, and rim speed [m/s].
    source, points_file, unread : str, str and tuple of Finding
        Who measured the data set, the file of its runs, and findings from reading this file.
    gravity : float
        Gravity at the test [m/s^2]; the weight of soil follows from gravity and a declared density.
    gravity_is_assumed : bool
        Whether the gravity was not declared, so that it is the Earth's.

    Raises
    ------
    DataError
        Columns that are empty, of different lengths, not finite or out of range; a load that is not positive.

    Examples
    --------
    >>> from rover_pin.measurements.channel import DrawbarPull
    >>> RigSet(Wheel(0.06, 0.05), [0.1, 0.4], 50.0, (DrawbarPull([2.0, 9.0], 0.3),)).level_names
    ('S = 0.10', 'S = 0.40')
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
    gravity: float = EARTH
    gravity_is_assumed: bool = True

    def __post_init__(self) -> None:
        # One load holds for all runs.
        slip = column(self.slip, "slip", self.name)
        load = column(np.atleast_1d(self.load), "load", self.name)
        load = np.full(slip.size, load[0]) if load.size == 1 else load
        if not self.channels:
            raise DataError(
                f"{self.name}: no channel was measured: give one of {', '.join(c.column for c in RIG_CHANNELS)}."
            )
        same_length(self.name, slip=slip, load=load, **{c.column: c.measured for c in self.channels})
        slips(slip, "slip", self.name)
        positive(load, "load", "N", self.name)
        for channel in self.channels:
            if isinstance(channel, Sinkage):
                depths(channel.measured, self.wheel.r, channel.column, self.name)
        # Scalars become arrays, so that later code needs no distinction.
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
        """The names of the slip levels, sorted by the mean slip of each level."""
        # Levels are sorted by slip, not by name, so that tables and figures go from small to large slip.
        names = np.unique(self.levels)
        order = np.argsort([self.slip[self.levels == name].mean() for name in names])
        return tuple(map(str, names[order]))

    @cached_property
    def level(self) -> np.ndarray:
        """Index of the slip level of each run (points,), as a position in `level_names`."""
        place = {name: at for at, name in enumerate(self.level_names)}
        return np.array([place[str(name)] for name in self.levels])

    @property
    def loads_vary(self) -> bool:
        """Whether the loads of the runs differ enough to show how the channels depend on the load."""
        return bool(np.max(self.load) >= SAME_LOAD * np.min(self.load))

    @property
    def askew(self) -> np.ndarray:
        """Mask of the runs with a slip angle (points,)."""
        return np.asarray(np.abs(self.slip_angle) > STRAIGHT)

    @property
    def rolled(self) -> Self:
        """The data set without its pressing trials, so that only the runs with a rolling wheel remain."""
        return replace(self, trials=())

    def place(self, column_name: str) -> str:
        """Return the text that names a column of this data set in a finding: the name of the points file, and the
        column's name.
        """
        return f"{self.points_file}: {column_name}" if self.points_file else column_name

    def rows(self, keep: Any) -> Self:
        """Return the data set with some of its runs only. `keep` selects them by a mask, indices or a slice, as in a
        NumPy array.

        A channel that has no measured value in these runs is omitted.
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
        """Return the declared soil; constants that the data set does not declare come from Table 1 of the paper.

        Pressing trials determine k_1 + k_2 b (b: width of the wheel), and n unless n is declared. Without trials,
        Bekker's k_c and k_phi are converted for the width b. A single width determines only the sum k_1 + k_2 b; this
        sum is stored in k_1, with k_2 = 0.
        """
        b = self.wheel.b
        # Constants that are not declared keep the values of Table 1.
        soil = Soil().replace(**{name: value for name, value in self.declared.items() if name in quantities(Soil)})
        if self.trials:
            n = self._pressed_n  # cached, because its fit takes long
            return soil.replace(n=n, k_1=stiffness(self.trials, self.wheel, n) * b**n, k_2=0.0)
        # Bekker's constants are used only if both are declared.
        k_1, k_2 = soil.k_1, soil.k_2
        if BEKKER_UNITS.keys() <= self.declared.keys():
            k_1, k_2 = bekker(self.declared["k_c"], self.declared["k_phi"], soil.n, b)
        return soil.replace(k_1=k_1 + k_2 * float(b), k_2=0.0)

    @cached_property
    def _pressed_n(self) -> float:
        """Sinkage exponent n in the computation of k_1 from the pressing trials: the declared n, or else the n that
        fits the trials best.
        """
        return self.declared["n"] if "n" in self.declared else exponent(self.trials, self.wheel)

    def independent(self, n: float) -> tuple[Independent, ...]:
        """Return the constants of soil and lugs that are known from measurements other than the runs, to compare fitted
        values with them.

        A single width b of the wheel determines only K_eff = (k_1 + k_2 b) / b^n. The units of K_eff depend on n, so
        that declared moduli are returned only if `n` equals the exponent of their declaration.

        Parameters
        ----------
        n : float
            Sinkage exponent of the model that is compared.
        """
        # k_1 and k_2 are compared through K_eff below, because one width determines only their sum.
        constants = [
            Independent(name, quantities(Soil)[name].unit, value, value, "stated with the data")
            for name, value in self.declared.items()
            if name in quantities(Soil) and name not in ("n", "k_1", "k_2")
        ]
        if {"k_1", *BEKKER_UNITS} & self.declared.keys() and not self.trials and n == float(self.soil().n):
            K = float(self.soil().k_1) / float(self.wheel.b) ** n
            constants.append(Independent("K_eff", "Pa/m^n", K, K, "stated with the data"))
        # The lug height is a parameter of two effects, whose values must agree with it.
        lugs = self.beside.get("lug_height", 0.0)
        if lugs > 0.0:
            names = ("LugExcavation.h_l", "Grousers.h_s")
            constants += [Independent(name, "m", lugs, lugs, "lug_height of [wheel]") for name in names]
        if "angle_of_repose" in self.beside:
            least, most = self.beside["angle_of_repose"], quantities(Soil)["phi"].high
            # A heap slides when its slope reaches the friction angle, so the angle of repose is a lower bound.
            source = "angle_of_repose: a heap of dry sand is no steeper than its friction angle; a smooth rim may slide"
            constants += [Independent(name, "rad", least, most, source, 0.0) for name in FRICTION]
        return tuple(constants)


def classes(values: np.ndarray, apart: float) -> np.ndarray:
    """Group values that are close together, and return the number of the group of each value (points,).

    Two values belong to one group if they are neighbours in sorted order and differ by at most `apart`.

    >>> classes(np.array([0.1, 0.4, 0.11]), 0.02).tolist()
    [0, 1, 0]
    """
    order = np.argsort(values)
    value_class = np.empty(values.size, dtype=int)
    value_class[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > apart)])
    return value_class


def _labels(slip: np.ndarray) -> np.ndarray:
    """Return a label for the slip level of each run (points,), such as "S = 0.10": the mean slip of all runs with
    nearly equal slip.
    """
    level = classes(slip, SAME_LEVEL)
    return np.array([f"S = {slip[level == i].mean():.2f}" for i in level])
