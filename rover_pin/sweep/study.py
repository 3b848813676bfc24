"""Description of a batch study (scenario, varied parameters, repeats), and the cases of the study, each with its
seed.
"""

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
from rover_pin.scenarios.drive_file import with_drive_file
from rover_pin.sweep.plan import MAX_CASES, Axis, Group, Plan, Values, kind_of


@dataclass(frozen=True)
class Case:
    """One run of a study: a combination of parameter values, and a seed for random numbers.

    The `key` is a digest of everything that determines the run. The seed follows from the key, so that it depends
    neither on the order of the cases nor on the number of workers.
    """

    index: int
    key: str
    values: Mapping[str, Any]
    repeat: int = 0

    @cached_property
    def seed(self) -> int:
        """Seed of this run, computed from the key. It is below 2^53, so that a table of floats holds it exactly."""
        return int(np.random.SeedSequence(int(self.key, 16)).generate_state(1, np.uint64)[0] >> np.uint64(11))


@brief
@dataclass(frozen=True)
class Study:
    """Description of a batch study: a scenario that is driven with many combinations of parameter values. `read_study`
    reads a study from a TOML file.

    Parameters
    ----------
    name : str
        Letters, digits, `-`, `_` and `.`; also the default name of the results folder.
    scenario : str
        Name of the scenario that is driven, or the path of a drive file (.toml). The study then takes the scenario and
        the settings of this file; the study's own settings, parameters, duration and step replace the values of the
        file.
    parameters : mapping
        Name of a setting of the scenario, such as `soil.k` -> the values that it takes: Range, LogRange or Values, in
        SI units.
    plan : Plan
        Rule that chooses the combinations of values: Grid, LatinHypercube or Sobol.
    paired : tuple of tuples of str
        Groups of parameters that change together. In each case, lists of a group (which must have equal length) take
        their values with a common index, and ranges take the values at a common fraction of their width.
    settings : mapping
        Name of a setting of the scenario -> its value, common to all cases.
    duration : float, optional
        Duration of each drive [s]; by default the duration of the scenario.
    dt : float, optional
        Time step [s]; by default the time step of the scenario.
    seed : int
        Seed that determines the plan and the seeds of all cases.
    repeats : int
        Number of runs of each combination of values, each with another seed.
    trust : Trust
        Files of effects whose code may run if a setting names a model file. It does not count as part of the study.

    Raises
    ------
    ParameterError
        If an argument is not allowed; the message names the parameter.
    DataError
        If the drive file cannot be read.

    Examples
    --------
    >>> from rover_pin.sweep import Grid, Study, Values
    >>> study = Study("supply", "flat", {"motor.supply": Values([7.2, 8.0])}, Grid(), repeats=3)
    >>> len(study.cases())
    6
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
        # The checks follow the fields: form of the pairs, scenario, name, times and counts, and then all names.
        # Each entry of `paired` lists parameters that change together, row by row.
        rows = (list, tuple)
        lists = isinstance(self.paired, rows) and all(isinstance(names, rows) for names in self.paired)
        if not lists or not all(isinstance(name, str) for names in self.paired for name in names):
            raise ParameterError(
                f"paired = {self.paired!r} is not a list of lists of parameter names: write for example "
                'paired = [["soil.c", "soil.phi"]].'
            )
        object.__setattr__(self, "paired", tuple(map(tuple, self.paired)))
        if not isinstance(self.scenario, str):
            raise ParameterError(f"scenario = {self.scenario!r} is not allowed: give the name of one scenario.")
        if not re.fullmatch(r"[A-Za-z0-9][\w.-]*", str(self.name), re.ASCII):
            raise ParameterError(
                f"name = {self.name!r} is not allowed, because the folder of the results gets this name: "
                "use letters, digits, '-', '_' and '.'."
            )
        # Times in seconds, and whole numbers with their minimum.
        for name, unit in (("duration", "s"), ("dt", "s")):
            value = getattr(self, name)
            if value is not None and (kind_of(value) != "number" or value <= 0.0):
                raise ParameterError(f"{name} = {value!r} is not allowed: give a time of more than 0 {unit}.")
        for name, minimum in (("seed", 0), ("repeats", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < minimum:
                raise ParameterError(f"{name} = {value!r} is not allowed: give a whole number of at least {minimum}.")
        # At least one parameter varies, and a name occurs only once among settings, parameters and pairs.
        if not self.parameters:
            raise ParameterError("the study varies no parameter: give at least one in `parameters`.")
        # A name is either varied or fixed.
        for name in self.settings:
            if name in self.parameters:
                raise ParameterError(f"'{name}' is both a setting and a parameter: remove one of them.")
            if kind_of(self.settings[name]) is None:
                raise ParameterError(
                    f"the setting {name} = {self.settings[name]!r} is not allowed: give a number, a text or true/false."
                )
        counts = Counter(name for names in self.paired for name in names)
        for name, times in counts.items():
            if name not in self.parameters:
                raise ParameterError(
                    f"paired names '{name}', which is not among the parameters: {closest(name, self.parameters)}"
                )
            if times > 1:
                raise ParameterError(
                    f"paired names '{name}' {times} times, but a parameter can be in one group only: name it once."
                )
        # Parameters that change together need equal numbers of values, or must all be ranges.
        for names in self.paired:
            axes = [self.parameters[name] for name in names]
            lengths = {len(axis.values) if isinstance(axis, Values) else None for axis in axes}
            if len(names) < 2 or len(lengths) > 1:
                raise ParameterError(
                    f"paired = {list(names)!r} cannot change together: give at least two parameters, either all "
                    "ranges or all lists of one length."
                )
        # A drive file is replaced by its scenario and its settings, so that the results folder states the whole drive.
        own_times = {name: getattr(self, name) for name in ("duration", "dt") if getattr(self, name) is not None}
        own = {**own_times, **self.parameters}
        scenario, settings = with_drive_file(self.scenario, {**self.settings, **own}, self.trust)
        object.__setattr__(self, "scenario", scenario)
        object.__setattr__(self, "settings", {name: value for name, value in settings.items() if name not in own})

    def groups(self) -> list[Group]:
        """Return the dimensions of the plan, in the order of `parameters`.

        Each dimension is a group of parameters that change together: paired parameters, or a single parameter.
        """
        # The groups are in the order of their first parameters.
        partners = {name: names for names in self.paired for name in names}
        ordered = dict.fromkeys(partners.get(name, (name,)) for name in self.parameters)
        return [{name: self.parameters[name] for name in names} for names in ordered]

    def cases(self) -> list[Case]:
        """Return all cases in the order of the plan. The repeats of one combination of values follow each other.

        Raises ParameterError if there are more than MAX_CASES cases.
        """
        counts: Counter[str] = Counter()
        cases: list[Case] = []
        points = self.plan.choose(self.groups(), self.seed)
        if len(points) * self.repeats > MAX_CASES:
            raise ParameterError(
                f"repeats = {self.repeats} for each of {len(points)} points gives more than {MAX_CASES} cases, "
                "the maximum: give fewer repeats or fewer points."
            )
        for point in points:
            values = {name: point[name] for name in self.parameters}
            # A random plan can choose one point of lists twice. The second choice counts as a repeat, so that no two
            # cases have the same key and seed.
            digest = canonical(values)
            for _ in range(self.repeats):
                # The key is a digest of the scenario, all settings, the values and the number of the repeat. The plan
                # and the name of the study are not part of it, so that a point keeps its seed in a larger plan.
                repeat = counts[digest]
                content = [self.scenario, self.settings, self.duration, self.dt, str(self.seed), values, repeat]
                key = hashlib.sha256(canonical(content).encode()).hexdigest()[:24]
                cases.append(Case(len(cases), key, values, repeat))
                counts[digest] += 1
        return cases

    def describe(self) -> dict[str, Any]:
        """Return the study as plain data (dicts, lists, numbers and texts). It is stored in the results folder, and
        compared with the study of a later run.
        """
        plain = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name != "trust"}
        plain["plan"] = _plain(self.plan)
        plain["parameters"] = {name: _plain(axis) for name, axis in self.parameters.items()}
        plain["settings"] = dict(self.settings)
        return json.loads(json.dumps(plain))


def canonical(content: Any) -> str:
    """Return `content` as JSON text. Equal content gives equal text: names are sorted, and the number 10 is written as
    10.0.
    """
    return json.dumps(_floats(content), sort_keys=True, ensure_ascii=False, allow_nan=False)


def _floats(content: Any) -> Any:
    """Return `content` with all numbers in nested tables and lists as floats."""
    if isinstance(content, Mapping):
        return {name: _floats(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_floats(value) for value in content]
    return float(content) if kind_of(content) == "number" else content


def _plain(choice: Any) -> dict[str, Any]:
    """Return a plan or an axis as plain data, with the name of its class as `kind`."""
    return {"kind": type(choice).__name__, **dataclasses.asdict(choice)}
