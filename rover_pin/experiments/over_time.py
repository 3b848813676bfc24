"""A base class for experiments whose runs are functions of time. A derived class defines the equations of motion.

DATA is a folder with two files: bench.toml has a table for each part of the system in `parts`, and runs.csv holds the
measured runs. The columns of runs.csv are `run` and then `columns`: the time, the inputs, the measured channels, and
the SD of each channel. An input is constant from its row to the next row. Each run is held out once and begins with all
states at 0. All numbers of parts and laws must have different names.
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
from rover_pin.discrepancy.experiment import FileExperiment, Parts
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.folded import read_folded

FILE = "bench.toml"
SHARES = (0.25, 0.5, 0.75, 1.0)
"""Factors on the inputs of a measured run. The products are proposals for the next runs."""


def record(name: str, meaning: str, **numbers: tuple[float, str, float, float]) -> Any:
    """Return a class with the numbers of one part of the system (such as an arm) or of one law (such as friction).

    The search for missing effects fits these numbers and states them with their units.

    Parameters
    ----------
    name, meaning : str
        Name of the class, and the meaning of the part or law in words.
    numbers : tuple
        Name of each number -> its default, unit, minimum and maximum. A law has no effect if its first number is 0.

    Examples
    --------
    >>> record("Viscous", "grease resists", b=(0.05, "N m s", 0.0, 5.0))().b
    0.05
    """
    # Each number becomes a field with unit and bounds, so that the loop can fit it like a number of an effect file.
    fields = [
        (key, float, quantity(value, unit, "assumed", low, high)) for key, (value, unit, low, high) in numbers.items()
    ]
    space = {"__doc__": f"{meaning}.", "meaning": meaning, "neutral": {next(iter(numbers)): 0.0}}
    return make_dataclass(name, fields, bases=(Record,), namespace=space, frozen=True)


@dataclass(frozen=True, eq=False)
class OverTime(FileExperiment):
    """An experiment whose runs are functions of time. Derive a class from it that defines the equations of motion.

    `time` holds the time of each sample (runs, samples), `set_values` the inputs (runs, inputs, samples), `observed`
    the measured channels (runs, channels, samples), and `sd` the SD of each channel (channels,).
    """

    declared: Parts
    folds: tuple[str, ...]
    time: np.ndarray
    set_values: np.ndarray
    observed: np.ndarray
    sd: np.ndarray
    parts: ClassVar[Mapping[str, type[Record]]]
    laws: ClassVar[Sequence[Any]]
    uncertainty: ClassVar[Mapping[str, float]]
    """relative prior SD of each uncertain number, by its name, such as `arm.mass`"""
    columns: ClassVar[Sequence[str]]
    units: ClassVar[Mapping[str, str]]
    """unit of each measured channel, in the order of the columns in runs.csv"""
    states: ClassVar[int]
    stand_in = 1e6
    steps: ClassVar[int] = 2
    """number of integration steps (RK4) between two rows of runs.csv"""

    @abstractmethod
    def motion(self, n: Any, state: np.ndarray, *values: np.ndarray) -> tuple[Any, Any]:
        """Return the time derivatives of all states and the values of all channels. Each derived class defines this
        method.

        The derivatives have the order of the states, and the channels have the order of `units`. All values are arrays
        of one shape, because all models and runs are integrated at once.

        Parameters
        ----------
        n : namespace
            The numbers of all parts and laws by their names, for example `n.mass`.
        state : array [states, ...]
            The states.
        values : array
            The inputs, in the order of their columns.
        """

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the experiment from a folder with bench.toml and runs.csv.

        Raises DataError: a file or column is missing, a value is not allowed, or the time does not increase within a
        run.
        """
        # Columns of runs.csv in their order: time, inputs, measured channels, and the SD of each channel.
        table, count = read_toml(path / FILE), len(cls.units)
        parts = {key: record_from(kind, table_in(table, key, FILE), FILE) for key, kind in cls.parts.items()}
        folds, rows = read_folded(path / "runs.csv", "run", tuple(cls.columns))
        if (np.diff(rows[:, 0]) <= 0.0).any():
            raise DataError(
                f"{path / 'runs.csv'}: {cls.columns[0]} must increase from row to row within each run; sort the rows "
                "of each run by time."
            )
        sd = np.sqrt(np.nanmean(rows[:, -count:] ** 2, axis=(0, 2)))
        return cls(Parts(parts), folds, rows[:, 0], rows[:, 1 : -2 * count], rows[:, -2 * count : -count], sd)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the measured channels."""
        return tuple(self.units)

    @property
    def varied(self) -> np.ndarray:
        """Inputs of each sample (runs, samples, 1 + inputs): the time, and the inputs that were set."""
        return np.concatenate([self.time[..., None], np.swapaxes(self.set_values, 1, 2)], axis=2)

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return self.units[channel]

    def base_model(self) -> Parts:
        """Return the declared parts without any law. The search for missing effects may add laws to this model."""
        return self.declared

    def uncertain(self, model: Parts) -> tuple[Parameter, ...]:
        """Return the numbers that are uncertain even if no law is missing, with priors around their declared values."""
        return tuple(self.parameter(model, name, sd, True, FILE) for name, sd in self.uncertainty.items())

    def candidates(self, model: Parts, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return the laws of this experiment as candidates for a missing effect of the model."""
        return tuple(plain_candidate(law()) for law in self.laws)

    def next_runs(self) -> Self:
        """Return runs that could be measured next: each measured run with its inputs multiplied by each of the factors
        SHARES.

        No factor exceeds 1, so that the inputs stay within the inputs of the measured runs.
        """
        # The proposed runs have no measured values, so zeros take their place.
        pairs = [(at, share) for at in range(len(self.folds)) for share in SHARES]
        which, shares = [at for at, _ in pairs], np.array([share for _, share in pairs])
        labels = tuple(f"a run as {self.folds[at]}, with {share:.0%} of its inputs" for at, share in pairs)
        ahead = shares[:, None, None] * self.set_values[which]
        return replace(self, folds=labels, time=self.time[which], set_values=ahead, observed=0.0 * self.observed[which])

    def predict(self, models: Sequence[Parts]) -> np.ndarray:
        """Return the channels that each model predicts (models, runs, channels, samples), integrated by RK4 with fixed
        steps.
        """
        # A model that diverges is a bad fit, not an error.
        with np.errstate(over="ignore", invalid="ignore"):
            # All models and runs are integrated together. Steps between padded rows are 0, so the state of a shorter
            # run stays constant after its end.
            n, values = self._numbers(models), np.moveaxis(np.nan_to_num(self.set_values), 2, 0)
            steps = np.nan_to_num(np.diff(self.time)).T / self.steps
            state = np.zeros((self.states, len(models), len(self.folds)))
            states = [state]
            for step, value in zip(steps, values, strict=False):
                for _ in range(self.steps):
                    state = state + self._step(n, state, value.T, step)
                states.append(state)
            # The channels of all samples follow from their states in one call.
            over_samples = np.moveaxis(np.array(states), 0, -1)
            by_sample = SimpleNamespace(**{key: np.asarray(number)[..., None] for key, number in vars(n).items()})
            set_values = np.moveaxis(np.nan_to_num(self.set_values), 1, 0)
            channels = self.motion(by_sample, over_samples, *set_values)[1]
            predicted = np.stack(np.broadcast_arrays(*channels), axis=2)
        return np.clip(np.nan_to_num(predicted, nan=self.stand_in), -self.stand_in, self.stand_in)

    def _step(self, n: Any, state: np.ndarray, values: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the change of the states over one step of RK4 (the classical Runge-Kutta method)."""
        # The inputs are constant between two rows, so all four slopes use the same inputs.
        first, half = self._rate(n, state, values), step / 2
        second = self._rate(n, state + half * first, values)
        third = self._rate(n, state + half * second, values)
        return step / 6 * (first + 2 * (second + third) + self._rate(n, state + step * third, values))

    def _rate(self, n: Any, state: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the time derivatives of all states as one array of the shape of `state`."""
        rate = np.empty_like(state)
        for row, change in enumerate(self.motion(n, state, *values)[0]):
            rate[row] = change
        return rate

    def _numbers(self, models: Sequence[Parts]) -> SimpleNamespace:
        """Return an object whose attributes are the numbers of all parts and laws, for use in the equations of motion.

        A number is an array (models, 1) if the models differ in it, and otherwise a single number. If a model does not
        have a law, the numbers of this law have their neutral values, at which the law has no effect.
        """
        # Numbers in which all models agree stay scalars, which keeps the arrays of the integration small.
        neutral = {law.__name__: law(**law.neutral) for law in self.laws}
        rows = [
            {key: number for part in (neutral | self.records(model)).values() for key, number in part.values().items()}
            for model in models
        ]
        columns = {key: [row[key] for row in rows] for key in rows[0]}
        return SimpleNamespace(
            **{key: np.array(values)[:, None] if len(set(values)) > 1 else values[0] for key, values in columns.items()}
        )
