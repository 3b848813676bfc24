"""A base class for experiments whose runs are functions of time. A derived class defines the equations of motion.

DATA is a folder with two files: bench.toml has a table for each part of the system in `parts`, and runs.csv holds the
measured runs. The columns of runs.csv are `run` and then `columns`: the time, the inputs, the measured channels, and
the SD of each channel. An input is constant from its row to the next row, or linear between rows (`linear_inputs`), and
a number can delay it (`delays`). Each run is held out once and begins with the states that `start` returns, to which
`free_start` adds a free value in each run. All numbers of parts and laws must have different names.

Equations of motion that are written with CasADi's functions are compiled (`is_symbolic`). The time of a prediction then
grows in proportion to the number of samples: 131,072 samples of two states take about 0.1 s.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, make_dataclass, replace
from functools import cached_property
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
from rover_pin.experiments.compiled_motion import CompiledMotion
from rover_pin.experiments.folded import read_folded

FILE, START = "bench.toml", "start"
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
    is_measured: bool = True
    """whether the runs were measured; a proposed run begins with the states of `start`, without a free value"""
    parts: ClassVar[Mapping[str, type[Record]]]
    laws: ClassVar[Sequence[Any]]
    uncertainty: ClassVar[Mapping[str, float]]
    """relative prior SD of each uncertain number, by its name, such as `arm.mass`"""
    columns: ClassVar[Sequence[str]]
    units: ClassVar[Mapping[str, str]]
    """unit of each measured channel, in the order of the columns in runs.csv"""
    states: ClassVar[int]
    stand_in = 1e6
    difference = 1e-3
    """The integration has fixed steps and no rounding that matters, so that a small step gives nearly the tangent. A
    step of the order of the prior SD would give the slope of a chord, which leads past the minimum of a bent law."""
    steps: ClassVar[int] = 2
    """number of integration steps (RK4) between two rows of runs.csv"""
    is_symbolic: ClassVar[bool] = False
    """whether `motion` uses only arithmetic and CasADi's functions, such as `ca.tanh`. It is then called once with
    symbols, and compiled; otherwise it is called with arrays in every integration step"""
    linear_inputs: ClassVar[Sequence[str]] = ()
    """columns of inputs that are linear between rows; every other input is constant from its row to the next row"""
    delays: ClassVar[Mapping[str, str]] = {}
    """column of an input -> name of the number that delays this input [s]; before the first row of a run, the input has
    its first value"""
    free_start: ClassVar[Mapping[int, float]] = {}
    """index of a state -> prior SD of its initial value, which is free in each run and is added to `start`"""

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

    def start(self, n: Any) -> Sequence[Any]:
        """Return the initial value of each state, which all runs have in common; by default 0.

        A value can be a number of a part, `n.level`. If this number is in `uncertainty`, the initial value is fitted.
        """
        return (0.0,) * self.states

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
        """Return the declared parts without any law. The search for missing effects may add laws to this model.

        If initial states are free in each run, they are the numbers of a further part called `start`.
        """
        if not self.free_start:
            return self.declared
        numbers = {
            f"state_{state}_run_{run}": (0.0, "", -self.stand_in, self.stand_in)
            for state in self.free_start
            for run in range(len(self.folds))
        }
        initial = record("Start", "the state at the begin of each run", **numbers)()
        return Parts({**self.declared.records, START: initial})

    def uncertain(self, model: Parts) -> tuple[Parameter, ...]:
        """Return the numbers that are uncertain even if no law is missing, with priors around their declared values."""
        free = [
            replace(self.parameter(model, f"{START}.state_{state}_run_{run}", sd), source="assumed: initial states")
            for state, sd in self.free_start.items()
            for run in range(len(self.folds))
        ]
        return (*(self.parameter(model, name, sd, True, FILE) for name, sd in self.uncertainty.items()), *free)

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
        proposed = {"time": self.time[which], "set_values": ahead, "observed": 0.0 * self.observed[which]}
        return replace(self, folds=labels, is_measured=False, **proposed)

    def predict(self, models: Sequence[Parts]) -> np.ndarray:
        """Return the channels that each model predicts (models, runs, channels, samples), integrated by RK4 with fixed
        steps.
        """
        # A model that diverges is a bad fit, not an error.
        with np.errstate(over="ignore", invalid="ignore"):
            predicted = self._compiled(models) if self.is_symbolic else self._by_arrays(models)
        return np.clip(np.nan_to_num(predicted, nan=self.stand_in), -self.stand_in, self.stand_in)

    def _compiled(self, models: Sequence[Parts]) -> np.ndarray:
        """Return the predictions (models, runs, channels, samples) of equations of motion that are written in
        CasADi.
        """
        predicted = np.zeros((len(models), *self.observed.shape))
        for at, model in enumerate(models):
            n = self._numbers([model])
            start = np.broadcast_to(self._initial([model], n)[:, 0], (self.states, len(self.folds)))
            p = np.array([float(getattr(n, name)) for name in self._motion.names])
            for run, time in enumerate(self.time):
                # Shorter runs are padded with NaN behind their last row.
                rows = int(np.isfinite(time).sum())
                inputs = self._inputs(run, rows, n) if self.delays else self._common_inputs[run]
                channels = self._motion.run(np.diff(time[:rows]), *inputs, p, start[:, run])
                predicted[at, run, :, :rows] = channels.T
        return predicted

    @cached_property
    def _motion(self) -> CompiledMotion:
        """Compiled equations of motion; initial states are no numbers of `motion`."""
        names = [name for name in vars(self._numbers([self.declared])) if not name.startswith("state_")]
        return CompiledMotion(self.motion, names, self.states, self.set_values.shape[1])

    @cached_property
    def _common_inputs(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Inputs of each run in the form of `_inputs`, for all models, if no number delays an input."""
        return [self._inputs(run, int(np.isfinite(time).sum()), None) for run, time in enumerate(self.time)]

    def _by_arrays(self, models: Sequence[Parts]) -> np.ndarray:
        """Return the predictions (models, runs, channels, samples) of equations of motion that are written as a Python
        function of arrays.
        """
        # All models and runs are integrated together. Steps between padded rows are 0, so the state of a shorter run
        # stays constant after its end.
        n, longest = self._numbers(models), self.time.shape[1]
        stages = np.zeros((longest - 1, self.steps, 3, self.set_values.shape[1], len(models), len(self.folds)))
        at_rows = np.zeros((self.set_values.shape[1], len(models), len(self.folds), longest))
        delayed = self.delays and len(models) > 1
        for at, model in enumerate(models if delayed else models[:1]):
            among = at if delayed else slice(None)
            for run, time in enumerate(self.time):
                rows = int(np.isfinite(time).sum())
                between, rows_of = self._inputs(run, rows, self._numbers([model]))
                stages[: rows - 1, ..., among, run] = between if delayed else between[..., None]
                at_rows[:, among, run, :rows] = rows_of.T if delayed else rows_of.T[:, None]
        steps = np.nan_to_num(np.diff(self.time)).T / self.steps
        state = np.zeros((self.states, len(models), len(self.folds))) + self._initial(models, n)
        states = [state]
        for step, of_row in zip(steps, stages, strict=True):
            for begin, middle, end in of_row:
                # RK4, the classical Runge-Kutta method, with the inputs at the begin, the middle and the end.
                first, half = self._rate(n, state, begin), step / 2
                second = self._rate(n, state + half * first, middle)
                third = self._rate(n, state + half * second, middle)
                last = self._rate(n, state + step * third, end)
                state = state + step / 6 * (first + 2 * (second + third) + last)
            states.append(state)
        # The channels of all samples follow from their states in one call.
        over_samples = np.moveaxis(np.array(states), 0, -1)
        by_sample = SimpleNamespace(**{key: np.asarray(number)[..., None] for key, number in vars(n).items()})
        channels = self.motion(by_sample, over_samples, *at_rows)[1]
        shape = (len(models), len(self.folds), longest)
        return np.stack([np.broadcast_to(channel, shape) for channel in channels], axis=2)

    def _initial(self, models: Sequence[Parts], n: Any) -> np.ndarray:
        """Return the states at the begin of each run (states, models, runs or 1)."""
        start = np.stack([np.broadcast_to(value, (len(models), 1)) for value in self.start(n)])
        if not self.free_start or not self.is_measured:
            return start
        initial = np.repeat(start, len(self.folds), axis=2).astype(float)
        for state in self.free_start:
            for run in range(len(self.folds)):
                initial[state, :, run] += np.ravel(getattr(n, f"state_{state}_run_{run}"))
        return initial

    def _inputs(self, run: int, rows: int, n: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return the inputs of one run for one model: at the begin, middle and end of each integration step (rows - 1,
        steps, 3, inputs), and at the rows (rows, inputs).

        An input that is constant between rows has one value in a step: its mean over the step. A delayed input then
        changes the prediction smoothly with its delay, although it jumps inside a step.
        """
        time = self.time[run, :rows]
        fractions = np.arange(self.steps)[:, None] / self.steps + np.array([0.0, 0.5, 1.0]) / self.steps
        at = time[:-1, None, None] + np.diff(time)[:, None, None] * fractions
        stages, at_rows = np.empty((*at.shape, len(self.set_values[run]))), np.empty((rows, len(self.set_values[run])))
        for index, values in enumerate(np.nan_to_num(self.set_values[run, :, :rows])):
            name = self.columns[1 + index]
            delay = float(np.ravel(getattr(n, self.delays[name]))[0]) if name in self.delays else 0.0
            if name in self.linear_inputs:
                stages[..., index] = np.interp(at - delay, time, values)
                at_rows[:, index] = np.interp(time - delay, time, values)
            elif not delay:
                stages[..., index], at_rows[:, index] = values[:-1, None, None], values
            else:
                # Mean of a step: difference of the integral of the input, which is linear between rows. Before the
                # first row the input has its first value.
                integral = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(time))])
                ends = at[..., [0, 2]] - delay
                area = np.interp(ends, time, integral) + values[0] * np.minimum(ends - time[0], 0.0)
                stages[..., index] = np.diff(area) / np.maximum(np.diff(ends), 1e-300)
                place = np.searchsorted(time, time - delay, side="right") - 1
                at_rows[:, index] = values[np.maximum(place, 0)]
        return stages, at_rows

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
