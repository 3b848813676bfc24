"""The description of a tuning: the gains to find, the drives, and the effort that the search may take."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Self

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.public import brief
from rover_pin.base.quantity import Quantity, quantities
from rover_pin.base.trust import Trust
from rover_pin.control.slip_control import Gains, HoleLaw
from rover_pin.tuning.drive_score import Cost

IDEAL, SENSED = ("true", "eq9"), ("onboard", "camera", "tracked")
"""Names of slip estimates. IDEAL are the true slip of Eq (1) and the paper's estimate by Eq (9), both without noise.
SENSED are estimates from sensors with noise."""
ON_BOARD = ("onboard", "camera")
"""Names of the slip estimates that convert torques into slips, so that they need a belief about the soil."""
ESTIMATES = (*IDEAL, *SENSED)
"""Names of all slip estimates."""
LOGARITHMIC = ("k_p", "k_i")
"""Gains that the search varies on a logarithmic scale, because good values may differ by orders of magnitude."""
HOLE_PREFIX = "hole."
"""Prefix of the names of the hole law's numbers in a study, for example `hole.deep`."""


class SlipLaw(NamedTuple):
    """The numbers of a slip control that a tuning may change: its gains, and the numbers of its hole law."""

    gains: Gains = Gains()
    hole: HoleLaw | None = None
    "hole law of the control, or None if the desired slip S_d is constant"

    def number(self, name: str) -> float:
        """Return the value of the number whose name is `name`, for example `k_p` or `hole.deep`."""
        record = self.hole if name.startswith(HOLE_PREFIX) else self.gains
        return float(getattr(record, name.removeprefix(HOLE_PREFIX)))

    def with_numbers(self, numbers: Mapping[str, float]) -> SlipLaw:
        """Return a copy of the law with some numbers replaced. `numbers` are the new values by their names."""
        gains = self.gains.replace(
            **{name: value for name, value in numbers.items() if not name.startswith(HOLE_PREFIX)}
        )
        of_hole = {
            name.removeprefix(HOLE_PREFIX): value for name, value in numbers.items() if name.startswith(HOLE_PREFIX)
        }
        return SlipLaw(gains, self.hole.replace(**of_hole) if self.hole else None)


class SeededDrive(NamedTuple):
    """A drive of a study together with a seed for the noise of its sensors."""

    case: DriveCase
    seed: int = 0
    "seed of the sensor noise; 0 if the control reads no sensors"


@dataclass(frozen=True)
class DriveCase:
    """A drive of a tuning study: a scenario with its settings."""

    name: str
    scenario: str
    "name of the scenario, for example `ditch`"
    settings: tuple[tuple[str, Any], ...] = ()
    "names and values of settings, for example `soil.k`"
    post_peak: float = 0.0
    """fraction of its shear strength that the soil loses past the peak [-]"""
    seal: str = ""
    """digest of the model file that the setting `model` names; it is a part of the key of a stored result, so that
    results for another model are not used again"""

    @property
    def model_file(self) -> str:
        """Path of the model file of the drive; an empty text if the drive has no model file."""
        return str(dict(self.settings).get("model", ""))


@dataclass(frozen=True)
class Effort:
    """The effort of a search for gains: numbers of points, generations and steps.

    The search is a differential evolution. It uses the reduced model for a drive if the slip of the reduced model
    agrees with the slip of the full rover (the complete simulation) on this drive; otherwise it uses the full rover. A
    descent (called polish) from some of the best points follows, always on the full rover.
    """

    population: int = 12
    "number of points in each generation of the differential evolution"
    generations: int = 8
    """number of generations of the differential evolution"""
    starts: int = 2
    """number of points that a polish (a descent) starts from"""
    steps: int = 20
    "number of evaluations of each polish"
    keep: int = 4
    """number of the best points of the search that the full rover drives before one of them is chosen"""

    def __post_init__(self) -> None:
        # Differential evolution needs a population of five.
        for name, low in (("population", 5), ("generations", 0), ("starts", 0), ("steps", 1), ("keep", 1)):
            _check_whole(f"effort.{name}", getattr(self, name), low)


@brief
@dataclass(frozen=True)
class TuningStudy:
    """The description of a tuning, for `tune_gains`.

    Parameters
    ----------
    name : str
        Name of the study.
    training : tuple of DriveCase
        Drives for the choice of the gains.
    held_out : tuple of DriveCase
        Drives that test the chosen gains; the choice does not use them.
    free : mapping
        Name of a number to find -> its bounds (low, high). Numbers of the hole law may also be free, under names such
        as `hole.deep`.
    before : Gains
        Gains before the tuning. Numbers that are not free keep these values.
    hole : HoleLaw, optional
        Hole law, which decreases the desired slip S_d of a wheel with the depth of its hole. Without a hole law, S_d is
        constant.
    estimate : str
        Slip estimate of the control, one of ESTIMATES. An estimate of SENSED reads sensors with noise, resolution and
        delay.
    noise_seeds : int
        Number of noise seeds, if the slip estimate reads sensors. Each drive is repeated with each seed.
    believes : str
        What the on-board slip estimate knows about the soil, a word or a path of the setting `control.believes`. If
        empty, the default of this setting applies, so that the estimate knows nothing about the sand.
    cost : Cost
        Weights of the cost of a drive.
    effort : Effort
        Effort of the search.
    seed : int
        Seed of the search.

    Raises
    ------
    ParameterError
        There is no training drive or no free number, two drives have one name, a gain or an estimate is unknown, or
        bounds are out of order or out of range.

    Examples
    --------
    >>> study = TuningStudy("ditch", (DriveCase("ditch", "ditch"),), free={"k_p": (0.1, 10.0)})
    >>> round(study.law([0.5]).number("k_p"), 6)
    1.0
    """

    name: str
    training: tuple[DriveCase, ...]
    held_out: tuple[DriveCase, ...] = ()
    free: Mapping[str, tuple[float, float]] = field(default_factory=lambda: {"k_p": (0.01, 10.0), "k_i": (0.01, 10.0)})
    before: Gains = field(default_factory=Gains)
    hole: HoleLaw | None = None
    estimate: str = "true"
    noise_seeds: int = 1
    believes: str = ""
    cost: Cost = field(default_factory=Cost)
    effort: Effort = field(default_factory=Effort)
    seed: int = 0

    def __post_init__(self) -> None:
        # The checks follow the order of a user's mistakes: missing drives, unknown words, missing or repeated names,
        # bounds.
        if not self.training:
            raise ParameterError(f"Tuning '{self.name}' has no training drives: give one or more drives in `training`.")
        if self.estimate not in ESTIMATES:
            raise ParameterError(
                f"Tuning '{self.name}': estimate = {self.estimate!r} is no slip estimate: "
                f"{closest(self.estimate, ESTIMATES)}"
            )
        _check_whole(f"Tuning '{self.name}': noise_seeds", self.noise_seeds, 1)
        if not self.free:
            raise ParameterError(
                f"Tuning '{self.name}' has no free gains, so that there is nothing to tune: give bounds for at least "
                f"one of {', '.join(self._numbers)}."
            )
        # The name of a drive is its key in the results.
        names = [case.name for case in (*self.training, *self.held_out)]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ParameterError(
                f"Tuning '{self.name}' has several drives with the name '{twice[0]}': give each drive its own name."
            )
        for name, bounds in self.free.items():
            if name not in self._numbers:
                raise ParameterError(
                    f"Tuning '{self.name}': there is no gain with the name '{name}': {closest(name, self._numbers)}"
                )
            try:
                low, high = map(float, bounds)
            except (TypeError, ValueError):
                raise ParameterError(
                    f"Tuning '{self.name}': the bounds of {name} are {bounds!r}. Give two numbers, [low, high]."
                ) from None
            if not low < high:
                raise ParameterError(
                    f"Tuning '{self.name}': the bounds of {name} are out of order: low = {low:g} must be below high = "
                    f"{high:g}. Swap or widen the bounds."
                )
            # A logarithmic scale needs a lower bound above 0.
            lowest, highest = 1e-12 if name in LOGARITHMIC else self._numbers[name].low, self._numbers[name].high
            if not (lowest <= low and high <= highest):
                scale = f" ({name} is searched on a logarithmic scale)" if name in LOGARITHMIC else ""
                raise ParameterError(
                    f"Tuning '{self.name}': the bounds of {name} must lie in [{lowest:g}, {highest:g}], but are "
                    f"[{low:g}, {high:g}]{scale}."
                )

    @property
    def _numbers(self) -> dict[str, Quantity]:
        """The numbers of the slip control that may be free, with their units and bounds, by their names. The wheel
        radius in a hole law is not among them, because it is the radius of the rover's wheels.
        """
        of_hole = {f"{HOLE_PREFIX}{name}": spec for name, spec in quantities(HoleLaw).items() if name != "r"}
        return {**quantities(Gains), **(of_hole if self.hole else {})}

    @property
    def law_before(self) -> SlipLaw:
        """The numbers of the slip control before the tuning."""
        return SlipLaw(self.before, self.hole)

    def law(self, unit: Iterable[float]) -> SlipLaw:
        """Return the numbers of the slip control at a point of the unit cube. The search varies the free numbers within
        this cube.

        The point has a coordinate from 0 to 1 for each free number: 0 is the lower bound of the number, and 1 its upper
        bound (`value_at`).
        """
        return self.law_before.with_numbers(
            {name: value_at(name, bounds, u) for (name, bounds), u in zip(self.free.items(), unit, strict=True)}
        )

    @property
    def has_reduced_model(self) -> bool:
        """Whether the reduced model contains the control of the study: the desired slip must be constant, and the slip
        estimate without noise.
        """
        return self.hole is None and self.estimate in IDEAL

    @property
    def compared(self) -> tuple[str, ...]:
        """Names of the slip estimates that a report compares: the two of IDEAL, or the true slip and the study's
        estimate from sensors.
        """
        return IDEAL if self.estimate in IDEAL else ("true", self.estimate)

    @property
    def seeds(self) -> int:
        """Number of noise seeds for the repetitions of every drive; 1 if the slip estimate reads no sensors."""
        return self.noise_seeds if self.estimate in SENSED else 1

    @property
    def training_runs(self) -> tuple[SeededDrive, ...]:
        """Every training drive, once for each of its noise seeds."""
        return self._runs(self.training, 0)

    @property
    def held_out_runs(self) -> tuple[SeededDrive, ...]:
        """Every held-out drive, once for each of its noise seeds, which differ from the seeds of the training
        drives.
        """
        return self._runs(self.held_out, len(self.training_runs))

    def _runs(self, cases: Iterable[DriveCase], first: int) -> tuple[SeededDrive, ...]:
        """Return every drive of `cases` once for each of its noise seeds, which are numbered from `first` + 1."""
        repeated = [case for case in cases for _ in range(self.seeds)]
        if self.estimate not in SENSED:
            return tuple(map(SeededDrive, repeated))
        return tuple(SeededDrive(case, first + number) for number, case in enumerate(repeated, 1))

    @property
    def model_files(self) -> tuple[str, ...]:
        """Paths of the model files that the drives name; each path occurs once."""
        return tuple(sorted({case.model_file for case in (*self.training, *self.held_out)} - {""}))

    def on_model(self, *files: str | Path) -> Self:
        """Return a copy of the study whose drives use the models in these files, for example models from measured data.

        The training drives use the models in turn, so that their number does not change. Every held-out drive is
        repeated with each model. A setting `cruise_slip` of a drive is removed, because it determines the motion
        resistance, which the model already contains.

        Raises ParameterError: a drive names a model file itself.
        """
        for case in (*self.training, *self.held_out):
            if case.model_file:
                raise ParameterError(
                    f"Tuning '{self.name}': the drive {case.name} already has the model file {case.model_file}, so "
                    f"that it cannot be driven on the model {files[0]}. Remove the model from the drive, or tune "
                    f"without {files[0]}."
                )

        # With several models, the name of a drive gets the name of its model, because names must be unique.
        def with_model(case: DriveCase, file: str | Path) -> DriveCase:
            settings = (setting for setting in case.settings if setting[0] != "cruise_slip")
            name = f"{case.name}, model {Path(file).stem}" if len(files) > 1 else case.name
            return dataclasses.replace(case, name=name, settings=(*settings, ("model", str(file))))

        training = tuple(map(with_model, self.training, itertools.cycle(files)))
        held_out = tuple(with_model(case, file) for case in self.held_out for file in files)
        return dataclasses.replace(self, training=training, held_out=held_out)

    def trusting(self, trust: Trust) -> Self:
        """Return a copy of the study with the user's decision `trust`, which files of code the models and the settings
        of the drives may name.
        """

        def with_trust(case: DriveCase) -> DriveCase:
            # Without consent, only a model file needs the decision: the keys of other drives stay as they are.
            needs_trust = case.model_file or trust != Trust()
            return dataclasses.replace(case, settings=(*case.settings, ("trust", trust))) if needs_trust else case

        training, held_out = (tuple(with_trust(case) for case in cases) for cases in (self.training, self.held_out))
        return dataclasses.replace(self, training=training, held_out=held_out)


def value_at(name: str, bounds: tuple[float, float], u: float) -> float:
    """Return the value of a free number at a fraction `u` of its range: the lower bound for u = 0, the upper bound for
    u = 1.

    The scale is logarithmic for k_p and k_i, and linear for other numbers.
    """
    low, high = bounds
    if name in LOGARITHMIC:
        return min(max(math.exp(math.log(low) + float(u) * math.log(high / low)), low), high)
    return low + float(u) * (high - low)


def _check_whole(name: str, value: Any, low: int) -> None:
    """Raise ParameterError if a value is no whole number or is below `low`. `name` is the value's name in the error."""
    if isinstance(value, bool) or not isinstance(value, int) or value < low:
        raise ParameterError(f"{name} = {value!r} is not allowed: give a whole number, {low} or more.")
