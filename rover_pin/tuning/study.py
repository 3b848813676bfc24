"""What is to be tuned, on which drives, at what effort: declared in Python or in a TOML file."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.public import brief
from rover_pin.base.quantity import quantities, record_from, to_si
from rover_pin.base.trust import Trust
from rover_pin.control.slip_control import Gains
from rover_pin.tuning.drive_score import Cost

ESTIMATES = ("true", "eq9")
"""The slip of Eq (1) itself, or the paper's estimate, Eq (9)."""
LOGARITHMIC = ("k_p", "k_i")
"""Gains that are searched on a logarithmic scale."""


@dataclass(frozen=True)
class DriveCase:
    """A ready-made scenario with its settings; `post_peak` is the share of shear strength lost past the peak.

    `seal` is the digest of what the setting `model` names (`sealed`): by it an evaluation is remembered.
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
    rover, else on this; from the `starts` best of it, gradient polish with `steps` evaluations each; the `keep` best of
    all are driven by the full rover.
    """

    population: int = 12
    generations: int = 8
    starts: int = 2
    steps: int = 8
    keep: int = 4

    def __post_init__(self) -> None:
        for name, low in (("population", 5), ("generations", 0), ("starts", 0), ("steps", 1), ("keep", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < low:
                raise ParameterError(f"effort.{name} = {value!r} is not allowed: give a whole number from {low} on.")


@brief
@dataclass(frozen=True)
class TuningStudy:
    """Gains to find: `free` names them with their bounds; the others keep their values in `before`.

    Raises
    ------
    ParameterError
        No training scenario, nothing free, an unknown gain or estimate, bounds that leave nothing between them.
    """

    name: str
    training: tuple[DriveCase, ...]
    held_out: tuple[DriveCase, ...] = ()
    free: Mapping[str, tuple[float, float]] = field(default_factory=lambda: {"k_p": (0.01, 10.0), "k_i": (0.01, 10.0)})
    before: Gains = field(default_factory=Gains)
    estimate: str = "true"
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
        if not self.free:
            raise ParameterError(
                f"Tuning '{self.name}' has no free gains: name some of {', '.join(quantities(Gains))}."
            )
        names = [case.name for case in (*self.training, *self.held_out)]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ParameterError(f"Tuning '{self.name}' has two drives named '{twice[0]}': give each its own name.")
        for name, bounds in self.free.items():
            _check_bounds(self.name, name, bounds)

    def gains(self, unit: Iterable[float]) -> Gains:
        """Return the gains at a point of the unit cube, one coordinate a free gain."""
        return self.before.replace(**{n: placed(n, b, u) for (n, b), u in zip(self.free.items(), unit, strict=True)})

    @property
    def model_files(self) -> tuple[str, ...]:
        """The paths of the model files that its drives name."""
        return tuple(sorted({case.model_file for case in (*self.training, *self.held_out)} - {""}))

    def on_model(self, file: str | Path) -> Self:
        """Return the study with every drive, training and held out, on the model of a file.

        What a drive's own settings may still change is what `scenario` lets them change beside `model`; the resistance
        is the model's, so that a `cruise_slip` of theirs is left out.

        Raises
        ------
        ParameterError
            A drive that names a model file itself.
        """
        for case in (*self.training, *self.held_out):
            if case.model_file:
                raise ParameterError(
                    f"Tuning '{self.name}': {case.name} names the model file {case.model_file} itself: leave it out "
                    f"there, or tune without {file}."
                )

        def with_model(case: DriveCase) -> DriveCase:
            settings = (setting for setting in case.settings if setting[0] != "cruise_slip")
            return dataclasses.replace(case, settings=(*settings, ("model", str(file))))

        training, held_out = (tuple(with_model(case) for case in cases) for cases in (self.training, self.held_out))
        return dataclasses.replace(self, training=training, held_out=held_out)

    def trusting(self, trust: Trust) -> Self:
        """Return the study with this trust in the files of effects that its drives' models name."""

        def with_trust(case: DriveCase) -> DriveCase:
            return dataclasses.replace(case, settings=(*case.settings, ("trust", trust))) if case.model_file else case

        training, held_out = (tuple(with_trust(case) for case in cases) for cases in (self.training, self.held_out))
        return dataclasses.replace(self, training=training, held_out=held_out)


def placed(name: str, bounds: tuple[float, float], u: float) -> float:
    """Return the gain at the share `u` of the way between its bounds, logarithmic for the k's."""
    low, high = bounds
    if name in LOGARITHMIC:
        return min(max(math.exp(math.log(low) + float(u) * math.log(high / low)), low), high)
    return low + float(u) * (high - low)


def _check_bounds(study: str, name: str, bounds: tuple[float, float]) -> None:
    gain_fields = quantities(Gains)
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


def read_tuning(path: str | Path, trust: Trust = Trust()) -> TuningStudy:
    """Return the study in a TOML file, as in::

        name = "ditch"
        estimate = "true"              # the true slip, or "eq9"
        seed = 0
        [free]                         # gains to find, with their bounds
        k_p = [0.01, 10.0]
        S_d = [0.05, 0.9]
        [before]                       # the other gains, and where the free ones come from
        delta_max = 0.55
        [cost]
        slip = 0.3
        [effort]
        population = 12
        [[training]]
        scenario = "ditch"
        post_peak = 0.3
        soil.k = 0.01
        terrain.wall_angle_deg = 35
        [[held_out]]
        scenario = "incline"

    Raises
    ------
    DataError
        A file that is missing or not TOML, or names another outside its folder that `trust` does not allow.
    ParameterError
        An unknown key or name, with the close ones; anything that TuningStudy refuses.
    """
    table = read_toml(path)
    trust.refuse_elsewhere(table, Path(path))
    try:
        return _study(table, Path(path).stem)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from error


def _study(table: dict[str, Any], stem: str) -> TuningStudy:
    keys = [entry.name for entry in dataclasses.fields(TuningStudy)]
    for key in table:
        if key not in keys:
            raise ParameterError(f"the study has no key '{key}': {closest(key, keys)}")
    fields = {key: value for key, value in table.items() if key in ("estimate", "seed")}
    name = _name("the study", "name", table.get("name", stem))
    if "free" in table:
        fields["free"] = {name: _pair(name, bounds) for name, bounds in table_in(table, "free", stem).items()}
    effort = table_in(table, "effort", stem)
    efforts = [entry.name for entry in dataclasses.fields(Effort)]
    for key in effort:
        if key not in efforts:
            raise ParameterError(f"[effort] has no key '{key}': {closest(key, efforts)}")
    return TuningStudy(
        name,
        **fields,
        training=_cases("training", table.get("training", [])),
        held_out=_cases("held_out", table.get("held_out", [])),
        before=record_from(Gains, table.get("before", {}), "[before]"),
        cost=record_from(Cost, table.get("cost", {}), "[cost]"),
        effort=Effort(**effort),
    )


def _pair(name: str, bounds: Any) -> Any:
    """Return bounds as two numbers; what is none is left for `TuningStudy` to refuse."""
    if not isinstance(bounds, list):
        return bounds
    return tuple(to_si(bound, "", "", f"the bounds of {name}") for bound in bounds)


def _cases(where: str, entries: Any) -> tuple[DriveCase, ...]:
    if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
        raise ParameterError(f"'{where}' must be a list of drives: write each under its own [[{where}]].")
    return tuple(_case(f"{where} {i + 1}", dict(entry)) for i, entry in enumerate(entries))


def _case(where: str, entry: dict[str, Any]) -> DriveCase:
    if "scenario" not in entry:
        raise ParameterError(f'{where} names no scenario: add scenario = "ditch", say.')
    scenario, name = (_name(where, key, entry.pop(key, where)) for key in ("scenario", "name"))
    post_peak = to_si(entry.pop("post_peak", 0.0), "", "", f"{where}: post_peak")
    return DriveCase(name, scenario, tuple(sorted(_flat(entry))), post_peak)


def _name(where: str, key: str, value: Any) -> str:
    if not isinstance(value, str):
        raise ParameterError(f"{where}: {key} = {value!r} is not allowed: it is one name, in quotes.")
    return value


def _flat(entry: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return dotted name -> value: in TOML `soil.k = 1` is a table in a table."""
    flat: list[tuple[str, Any]] = []
    for name, value in entry.items():
        # a list, as of effects to add, must be fit for a key
        plain = tuple(value) if isinstance(value, list) else value
        flat += _flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else [(f"{prefix}{name}", plain)]
    return flat
