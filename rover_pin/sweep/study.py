"""A study: which scenario is driven, what is varied, how often; and its cases, each with its own seed."""

import dataclasses
import hashlib
import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.public import brief
from rover_pin.base.trust import Trust
from rover_pin.sweep.axis import Axis, Values, kind_of
from rover_pin.sweep.plan import MOST_CASES, Group, Plan


@dataclass(frozen=True)
class Case:
    """One run of a study. Its `key` says what is run, so its seed depends on neither order nor workers."""

    index: int
    key: str
    values: Mapping[str, Any]
    repeat: int = 0

    @cached_property
    def seed(self) -> int:
        """A seed in [0, 2^53), exact in any table, that comes from the key alone."""
        return int(np.random.SeedSequence(int(self.key, 16)).generate_state(1, np.uint64)[0] >> np.uint64(11))


@brief
@dataclass(frozen=True)
class Study:
    """What a batch of drives is made of; `read_study` reads one from TOML.

    Parameters
    ----------
    name : str
        Letters, digits, `-`, `_` and `.`; also the name of the folder of results.
    scenario : str
        What is driven.
    parameters : mapping
        Dotted setting of the scenario -> Range, LogRange or Values, in SI units.
    plan : Plan
        Grid, LatinHypercube or Sobol.
    paired : tuple of tuples of str
        Parameters that move together: lists of one length step by step, ranges at the same share of their way.
    settings : mapping
        Settings that every case shares.
    duration : float, optional
        Of each drive [s]; by default the scenario's.
    dt : float, optional
        Time step [s]; by default the scenario's.
    seed : int
        Root of the plan's and of all cases' seeds.
    repeats : int
        How often each point is run, each time with another seed.
    trust : Trust
        Which files of effects, that the model of a setting names, may run; no part of what the study is.

    Raises
    ------
    ParameterError
        What is not allowed, with the parameter's name.
    """

    name: str
    scenario: str
    parameters: Mapping[str, Axis]
    plan: Plan
    paired: tuple[tuple[str, ...], ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    duration: float | None = None
    dt: float | None = None
    seed: int = 0
    repeats: int = 1
    trust: Trust = Trust()

    def __post_init__(self) -> None:
        rows = (list, tuple)
        lists = isinstance(self.paired, rows) and all(isinstance(names, rows) for names in self.paired)
        if not lists or not all(isinstance(name, str) for names in self.paired for name in names):
            raise ParameterError(f"paired = {self.paired!r} is not a list of lists of parameters.")
        object.__setattr__(self, "paired", tuple(map(tuple, self.paired)))
        if not isinstance(self.scenario, str):
            raise ParameterError(f"scenario = {self.scenario!r} is not allowed: it is the name of one scenario.")
        if not re.fullmatch(r"[A-Za-z0-9][\w.-]*", str(self.name), re.ASCII):
            raise ParameterError(
                f"name = {self.name!r} is not allowed: it also names a folder; use letters, digits, '-', '_' and '.'."
            )
        self._check_numbers()
        self._check_names()

    def _check_numbers(self) -> None:
        for name, unit in (("duration", "s"), ("dt", "s")):
            value = getattr(self, name)
            if value is not None and (kind_of(value) != "number" or value <= 0.0):
                raise ParameterError(f"{name} = {value!r} is not allowed: it is a time above 0 {unit}.")
        for name, least in (("seed", 0), ("repeats", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ParameterError(f"{name} = {value!r} is not allowed: it is a whole number from {least} on.")

    def _check_names(self) -> None:
        if not self.parameters:
            raise ParameterError("the study varies nothing: give at least one parameter.")
        for name in self.settings:
            if name in self.parameters:
                raise ParameterError(f"'{name}' is both a setting and a parameter: remove one of them.")
            if kind_of(self.settings[name]) is None:
                raise ParameterError(f"the setting {name} = {self.settings[name]!r} is no number, text or true/false.")
        counts = Counter(name for names in self.paired for name in names)
        for name, times in counts.items():
            if name not in self.parameters:
                raise ParameterError(f"paired names '{name}': {closest(name, self.parameters)}")
            if times > 1:
                raise ParameterError(f"paired names '{name}' {times} times: a parameter moves with one group.")
        for names in self.paired:
            _check_group([self.parameters[name] for name in names], names)

    def groups(self) -> list[Group]:
        """Return the plan's directions: paired parameters first named, then in the order of `parameters`."""
        partners = {name: names for names in self.paired for name in names}
        ordered = dict.fromkeys(partners.get(name, (name,)) for name in self.parameters)
        return [{name: self.parameters[name] for name in names} for names in ordered]

    def cases(self) -> list[Case]:
        """Return all cases in the plan's order, the repeats of a point one after the other."""
        counts: Counter[str] = Counter()
        cases: list[Case] = []
        points = self.plan.choose(self.groups(), self.seed)
        if len(points) * self.repeats > MOST_CASES:
            raise ParameterError(
                f"repeats = {self.repeats} of {len(points)} points are more than {MOST_CASES} cases: give fewer."
            )
        for point in points:
            values = {name: point[name] for name in self.parameters}
            for _ in range(self.repeats):
                digest = canonical(values)
                cases.append(Case(len(cases), self._key(values, counts[digest]), values, counts[digest]))
                counts[digest] += 1
        return cases

    def describe(self) -> dict[str, Any]:
        """Return the study as plain data, for comparison and for the record."""
        plain = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "trust"}
        plain["plan"] = _plain(self.plan)
        plain["parameters"] = {name: _plain(axis) for name, axis in self.parameters.items()}
        plain["settings"] = dict(self.settings)
        return json.loads(json.dumps(plain))

    def _key(self, values: Mapping[str, Any], repeat: int) -> str:
        # Neither the plan nor the name: a point keeps its seed when others join it.
        what = [self.scenario, self.settings, self.duration, self.dt, str(self.seed), values, repeat]
        return hashlib.sha256(canonical(what).encode()).hexdigest()[:24]


def canonical(content: Any) -> str:
    """Return `content` as JSON in which equal things look equal: sorted names, 10 is 10.0."""
    return json.dumps(_floats(content), sort_keys=True, ensure_ascii=False, allow_nan=False)


def _floats(content: Any) -> Any:
    if isinstance(content, Mapping):
        return {name: _floats(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_floats(value) for value in content]
    return float(content) if kind_of(content) == "number" else content


def _plain(choice: Any) -> dict[str, Any]:
    return {"kind": type(choice).__name__, **dataclasses.asdict(choice)}


def _check_group(axes: list[Axis], names: tuple[str, ...]) -> None:
    lengths = {len(axis.values) if isinstance(axis, Values) else None for axis in axes}
    if len(names) < 2 or len(lengths) > 1:
        raise ParameterError(
            f"paired = {list(names)!r} cannot move together: give at least two parameters, either all ranges or all "
            "lists of one length."
        )
