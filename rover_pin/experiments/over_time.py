"""A test bench whose runs are functions of time: a derived class says how its state moves and what is measured of it.

DATA is a folder with bench.toml, a table for each of `parts`, and runs.csv. Its columns are run, then `columns`: the
time, what is set, what is measured, and the SD of each of that. What is set holds from row to row; a run begins with
every state at 0, and is a fold. Numbers of parts and laws have names of their own.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, make_dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, Self

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.toml_file import read_toml, table_in
from rover_pin.base.quantity import Record, quantity, record_from
from rover_pin.discrepancy.candidate import Candidate, plain_candidate
from rover_pin.discrepancy.standalone import Parts, Standalone
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.folded import read_folded

FILE = "bench.toml"
SHARES = (0.25, 0.5, 0.75, 1.0)
"""Shares of what was set in a run at which it could be run again."""


def record(name: str, meaning: str, **numbers: tuple[float, str, float, float]) -> Any:
    """Return a class of numbers (default, unit, least, most); as a law it vanishes where its first number is 0."""
    fields = [
        (key, float, quantity(value, unit, "assumed", low, high)) for key, (value, unit, low, high) in numbers.items()
    ]
    space = {"__doc__": f"{meaning}.", "meaning": meaning, "neutral": {next(iter(numbers)): 0.0}}
    return make_dataclass(name, fields, bases=(Record,), namespace=space, frozen=True)


@dataclass(frozen=True, eq=False)
class OverTime(Standalone):
    """The runs: time (runs, samples), what was set and observed (runs, channels, samples), the SD of each channel."""

    declared: Parts
    folds: tuple[str, ...]
    time: np.ndarray
    set_values: np.ndarray
    observed: np.ndarray
    sd: np.ndarray
    parts: ClassVar[Mapping[str, type[Record]]]
    laws: ClassVar[Sequence[Any]]
    uncertainty: ClassVar[Mapping[str, float]]
    "relative SD of each uncertain number, `part.number`"
    columns: ClassVar[Sequence[str]]
    units: ClassVar[Mapping[str, str]]
    "of each channel, in the order of their columns"
    states: ClassVar[int]
    stand_in = 1e6
    steps: ClassVar[int] = 2
    "of RK4 from row to row"

    @abstractmethod
    def motion(self, n: Any, state: np.ndarray, *values: np.ndarray) -> tuple[Any, Any]:
        """Return d(state)/dt and the channels, each in order, by the numbers `n` of parts and laws, from what is set.

        All are arrays of any shape: every model and run at once.
        """

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return the experiment in a folder."""
        table, count = read_toml(path / FILE), len(cls.units)
        parts = {key: record_from(kind, table_in(table, key, FILE), FILE) for key, kind in cls.parts.items()}
        folds, rows = read_folded(path / "runs.csv", "run", tuple(cls.columns))
        if (np.diff(rows[:, 0]) <= 0.0).any():
            raise DataError(
                f"{path / 'runs.csv'}: {cls.columns[0]} does not grow from row to row of a run; sort its rows."
            )
        sd = np.sqrt(np.nanmean(rows[:, -count:] ** 2, axis=(0, 2)))
        return cls(Parts(parts), folds, rows[:, 0], rows[:, 1 : -2 * count], rows[:, -2 * count : -count], sd)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the measured channels."""
        return tuple(self.units)

    @property
    def varied(self) -> np.ndarray:
        """Time, and what is set."""
        return np.concatenate([self.time[..., None], np.swapaxes(self.set_values, 1, 2)], axis=2)

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return self.units[channel]

    def base_model(self) -> Parts:
        """Return the parts as declared, without any law."""
        return self.declared

    def uncertain(self, model: Parts) -> tuple[Parameter, ...]:
        """Return the uncertain numbers about what is declared."""
        return tuple(self.parameter(model, name, sd, True, FILE) for name, sd in self.uncertainty.items())

    def candidates(self, model: Parts, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return the laws of this bench."""
        return tuple(plain_candidate(law()) for law in self.laws)

    def next_runs(self) -> Self:
        """Return each run with what is set at SHARES of what it was: within what the bench has borne."""
        pairs = [(at, share) for at in range(len(self.folds)) for share in SHARES]
        which, shares = [at for at, _ in pairs], np.array([share for _, share in pairs])
        labels = tuple(f"a run as {self.folds[at]}, with {share:.0%} of what was set" for at, share in pairs)
        ahead = shares[:, None, None] * self.set_values[which]
        return replace(self, folds=labels, time=self.time[which], set_values=ahead, observed=0.0 * self.observed[which])

    def predict(self, models: Sequence[Parts]) -> np.ndarray:
        """Return what each model says (models, runs, channels, samples), all at once by fixed steps of RK4."""
        with np.errstate(over="ignore", invalid="ignore"):
            predicted = self._integrate_motion(models)
        return np.clip(np.nan_to_num(predicted, nan=self.stand_in), -self.stand_in, self.stand_in)

    def _integrate_motion(self, models: Sequence[Parts]) -> np.ndarray:
        n, values = self._numbers(models), np.moveaxis(np.nan_to_num(self.set_values), 2, 0)
        steps = np.nan_to_num(np.diff(self.time)).T / self.steps
        state = np.zeros((self.states, len(models), len(self.folds)))
        states = [state]
        for step, value in zip(steps, values, strict=False):
            for _ in range(self.steps):
                state = state + self._step(n, state, value.T, step)
            states.append(state)
        over_samples = np.moveaxis(np.array(states), 0, -1)
        by_sample = SimpleNamespace(**{key: np.asarray(number)[..., None] for key, number in vars(n).items()})
        set_values = np.moveaxis(np.nan_to_num(self.set_values), 1, 0)
        channels = self.motion(by_sample, over_samples, *set_values)[1]
        return np.stack(np.broadcast_arrays(*channels), axis=2)

    def _step(self, n: Any, state: np.ndarray, values: np.ndarray, step: np.ndarray) -> np.ndarray:
        first, half = self._rate(n, state, values), step / 2
        second = self._rate(n, state + half * first, values)
        third = self._rate(n, state + half * second, values)
        return step / 6 * (first + 2 * (second + third) + self._rate(n, state + step * third, values))

    def _rate(self, n: Any, state: np.ndarray, values: np.ndarray) -> np.ndarray:
        rate = np.empty_like(state)
        for row, change in enumerate(self.motion(n, state, *values)[0]):
            rate[row] = change
        return rate

    def _numbers(self, models: Sequence[Parts]) -> SimpleNamespace:
        """Return every number of parts and laws, (models, 1) where it differs; a law that is absent is neutral."""
        neutral = {law.__name__: law(**law.neutral) for law in self.laws}
        rows = [
            {key: number for part in (neutral | self.records(model)).values() for key, number in part.values().items()}
            for model in models
        ]
        columns = {key: [row[key] for row in rows] for key in rows[0]}
        return SimpleNamespace(
            **{key: np.array(values)[:, None] if len(set(values)) > 1 else values[0] for key, values in columns.items()}
        )
