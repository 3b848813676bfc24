"""What is to be tuned, on which drives, at what effort."""

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
from rover_pin.control.hole_law import HoleLaw
from rover_pin.control.slip_control import Gains
from rover_pin.tuning.drive_score import Cost

IDEAL, SENSED = ("true", "eq9"), ("onboard", "camera", "tracked")
"""The slip of Eq (1) itself, or the paper's estimate, Eq (9); and what sensors with noise of their own say of it."""
ESTIMATES = (*IDEAL, *SENSED)
LOGARITHMIC = ("k_p", "k_i")
"""Gains that are searched on a logarithmic scale."""
HOLE = "hole."
"""Before the name of a hole law's number."""


class SlipLaw(NamedTuple):
    """The numbers of a slip control: its gains, and those of its hole law, if S_d is no constant."""

    gains: Gains = Gains()
    hole: HoleLaw | None = None

    def number(self, name: str) -> float:
        """Return the number of this name, as `k_p` or `hole.deep`."""
        record = self.hole if name.startswith(HOLE) else self.gains
        return float(getattr(record, name.removeprefix(HOLE)))

    def with_numbers(self, numbers: Mapping[str, float]) -> SlipLaw:
        """Return the law with other numbers, by such names."""
        gains = self.gains.replace(**{name: value for name, value in numbers.items() if not name.startswith(HOLE)})
        of_hole = {name.removeprefix(HOLE): value for name, value in numbers.items() if name.startswith(HOLE)}
        return SlipLaw(gains, self.hole.replace(**of_hole) if self.hole else None)


class Run(NamedTuple):
    """A drive with a seed of its sensors' noise; 0 where none are read."""

    case: DriveCase
    seed: int = 0


@dataclass(frozen=True)
class DriveCase:
    """A ready-made scenario with its settings; `post_peak` is the share of shear strength lost past the peak.

    `seal` is the digest of what the setting `model` names (`seal`): by it an evaluation is remembered.
    """

    name: str
    scenario: str
    settings: tuple[tuple[str, Any], ...] = ()
    post_peak: float = 0.0
    seal: str = ""

    @property
    def model_file(self) -> str:
        """The path of the model file that it drives, empty where there is none."""
        return str(dict(self.settings).get("model", ""))


@dataclass(frozen=True)
class Effort:
    """How much is tried.

    `population` and `generations` of differential evolution, on the reduced model where its slip is that of the full
    rover, else on this; a polish on the full rover begins at its `starts` best, with `steps` evaluations each; its
    `keep` best are driven by the full rover too.
    """

    population: int = 12
    generations: int = 8
    starts: int = 2
    steps: int = 20
    keep: int = 4

    def __post_init__(self) -> None:
        for name, low in (("population", 5), ("generations", 0), ("starts", 0), ("steps", 1), ("keep", 1)):
            _check_whole(f"effort.{name}", getattr(self, name), low)


@brief
@dataclass(frozen=True)
class TuningStudy:
    """Numbers to find: `free` names them with their bounds; the others keep their values in `before` and `hole`.

    With a `hole` law S_d falls with each wheel's hole, and its numbers may be free too, as `hole.deep`. An estimate of
    SENSED is driven with the noise, steps and delays of its sensors, each drive with other `noise_seeds` seeds.

    Raises ParameterError: no training scenario, nothing free, an unknown gain or estimate, bounds that leave nothing
    between them.
    """

    name: str
    training: tuple[DriveCase, ...]
    held_out: tuple[DriveCase, ...] = ()
    free: Mapping[str, tuple[float, float]] = field(default_factory=lambda: {"k_p": (0.01, 10.0), "k_i": (0.01, 10.0)})
    before: Gains = field(default_factory=Gains)
    hole: HoleLaw | None = None
    estimate: str = "true"
    noise_seeds: int = 1
    cost: Cost = field(default_factory=Cost)
    effort: Effort = field(default_factory=Effort)
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.training:
            raise ParameterError(f"Tuning '{self.name}' has no training scenarios: give one or more.")
        if self.estimate not in ESTIMATES:
            raise ParameterError(
                f"Tuning '{self.name}': estimate = {self.estimate!r}: {closest(self.estimate, ESTIMATES)}"
            )
        _check_whole(f"Tuning '{self.name}': noise_seeds", self.noise_seeds, 1)
        if not self.free:
            raise ParameterError(f"Tuning '{self.name}' has no free gains: name some of {', '.join(self._numbers)}.")
        names = [case.name for case in (*self.training, *self.held_out)]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ParameterError(f"Tuning '{self.name}' has two drives named '{twice[0]}': give each its own name.")
        for name, bounds in self.free.items():
            _check_bounds(self.name, name, bounds, self._numbers)

    @property
    def _numbers(self) -> dict[str, Quantity]:
        """What may be free, by name; a hole law's r is the rover's."""
        of_hole = {f"{HOLE}{name}": spec for name, spec in quantities(HoleLaw).items() if name != "r"}
        return {**quantities(Gains), **(of_hole if self.hole else {})}

    @property
    def law_before(self) -> SlipLaw:
        """The numbers before the tuning."""
        return SlipLaw(self.before, self.hole)

    def law(self, unit: Iterable[float]) -> SlipLaw:
        """Return the numbers at a point of the unit cube, one coordinate a free one."""
        return self.law_before.with_numbers(
            {name: value_at(name, bounds, u) for (name, bounds), u in zip(self.free.items(), unit, strict=True)}
        )

    @property
    def has_reduced_model(self) -> bool:
        """Whether the reduced model knows this control: a constant S_d, and a slip without noise."""
        return self.hole is None and self.estimate in IDEAL

    @property
    def compared(self) -> tuple[str, ...]:
        """The estimates that a report compares: those without noise; where sensors are read, the slip and these."""
        return IDEAL if self.estimate in IDEAL else ("true", self.estimate)

    @property
    def seeds(self) -> int:
        """How many seeds of noise every drive has."""
        return self.noise_seeds if self.estimate in SENSED else 1

    @property
    def training_runs(self) -> tuple[Run, ...]:
        """Every training drive with each of its seeds."""
        return self._runs(self.training, 0)

    @property
    def held_out_runs(self) -> tuple[Run, ...]:
        """Every drive that is held out with each of its seeds, none of them one of the training."""
        return self._runs(self.held_out, len(self.training_runs))

    def _runs(self, cases: Iterable[DriveCase], first: int) -> tuple[Run, ...]:
        repeated = [case for case in cases for _ in range(self.seeds)]
        if self.estimate not in SENSED:
            return tuple(map(Run, repeated))
        return tuple(Run(case, first + number) for number, case in enumerate(repeated, 1))

    @property
    def model_files(self) -> tuple[str, ...]:
        """The paths of the model files that its drives name."""
        return tuple(sorted({case.model_file for case in (*self.training, *self.held_out)} - {""}))

    def on_model(self, *files: str | Path) -> Self:
        """Return the study on the models of files: training drives take them in turn, held-out ones are driven on each.

        What a drive's own settings may still change is what `scenario` lets them change beside `model`; the resistance
        is the model's, so that a `cruise_slip` of theirs is left out.

        Raises ParameterError: a drive that names a model file itself.
        """
        for case in (*self.training, *self.held_out):
            if case.model_file:
                raise ParameterError(
                    f"Tuning '{self.name}': {case.name} names the model file {case.model_file} itself: leave it out "
                    f"there, or tune without {files[0]}."
                )

        def with_model(case: DriveCase, file: str | Path) -> DriveCase:
            settings = (setting for setting in case.settings if setting[0] != "cruise_slip")
            name = f"{case.name}, model {Path(file).stem}" if len(files) > 1 else case.name
            return dataclasses.replace(case, name=name, settings=(*settings, ("model", str(file))))

        training = tuple(map(with_model, self.training, itertools.cycle(files)))
        held_out = tuple(with_model(case, file) for case in self.held_out for file in files)
        return dataclasses.replace(self, training=training, held_out=held_out)

    def trusting(self, trust: Trust) -> Self:
        """Return the study with this trust in the files of effects that its drives' models name."""

        def with_trust(case: DriveCase) -> DriveCase:
            return dataclasses.replace(case, settings=(*case.settings, ("trust", trust))) if case.model_file else case

        training, held_out = (tuple(with_trust(case) for case in cases) for cases in (self.training, self.held_out))
        return dataclasses.replace(self, training=training, held_out=held_out)


def value_at(name: str, bounds: tuple[float, float], u: float) -> float:
    """Return the gain at the share `u` of the way between its bounds, logarithmic for the k's."""
    low, high = bounds
    if name in LOGARITHMIC:
        return min(max(math.exp(math.log(low) + float(u) * math.log(high / low)), low), high)
    return low + float(u) * (high - low)


def _check_whole(name: str, value: Any, low: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < low:
        raise ParameterError(f"{name} = {value!r} is not allowed: give a whole number from {low} on.")


def _check_bounds(study: str, name: str, bounds: tuple[float, float], gain_fields: Mapping[str, Quantity]) -> None:
    if name not in gain_fields:
        raise ParameterError(f"Tuning '{study}': there is no gain '{name}': {closest(name, gain_fields)}")
    try:
        low, high = map(float, bounds)
    except (TypeError, ValueError):
        raise ParameterError(f"Tuning '{study}': {name} needs its bounds as two numbers, [low, high].") from None
    if not low < high:
        raise ParameterError(
            f"Tuning '{study}': the bounds of {name} leave nothing between low = {low:g} and high = {high:g}: "
            "swap or widen them."
        )
    floor = 1e-12 if name in LOGARITHMIC else gain_fields[name].low
    if not (floor <= low and high <= gain_fields[name].high):
        raise ParameterError(
            f"Tuning '{study}': the bounds of {name} must lie in [{floor:g}, {gain_fields[name].high:g}], but are "
            f"[{low:g}, {high:g}]{' (it is searched on a logarithmic scale)' if name in LOGARITHMIC else ''}."
        )
