"""A linear experiment whose slopes are differences, and effects as records: what the search of drive logs sees."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.question import Question
from rover_pin.discrepancy.search import Search, calibrate
from rover_pin.discrepancy.signature import signatures
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import declared_noise
from rover_pin.estimation.parameter import Parameter

SHAPE = 5, 2, 12
"""Folds, channels and samples."""


@dataclass(frozen=True)
class Effect:
    """An effect of one size, by its name."""

    name: str
    a: float = quantity(1.0, "N", "assumed", -100.0, 100.0, "a")
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}

    def replace(self, **values: float) -> Effect:
        """Return it with other values."""
        return replace(self, **values)


@dataclass(frozen=True)
class Base:
    """The base model's number."""

    b: float = quantity(0.0, "", "assumed", -1e3, 1e3, "b")

    def replace(self, **values: float) -> Base:
        """Return it with other values."""
        return replace(self, **values)


@dataclass(frozen=True)
class Model:
    """Records by the name of their owner."""

    records: tuple[tuple[str, Any], ...] = (("base", Base()),)

    def having(self, effect: Effect) -> Model:
        """Return the model with an effect."""
        return self.holding(effect.name.partition("@")[0], effect)

    def holding(self, owner: str, record: Any) -> Model:
        """Return the model with another record of this owner."""
        return Model(tuple({**dict(self.records), owner: record}.items()))


@dataclass(frozen=True, eq=False)
class Sums(Experiment):
    """What is measured is the sum of columns (folds, channels, samples), each times the number of its record."""

    observed: np.ndarray
    columns: dict[str, np.ndarray]
    sd: float | None = 1.0
    "of every value as declared; None: learnt"
    asked: list[int] = field(default_factory=list)
    is_timed = True

    @property
    def folds(self) -> tuple[str, ...]:
        return tuple(f"run-{at}" for at in range(len(self.observed)))

    @property
    def channels(self) -> tuple[str, ...]:
        return tuple(f"c{at}" for at in range(self.observed.shape[1]))

    @property
    def varied(self) -> np.ndarray:
        folds, _, samples = self.observed.shape
        return np.broadcast_to(np.linspace(0.0, 1.0, samples)[None, :, None], (folds, samples, 1))

    def noise(self):
        return None if self.sd is None else declared_noise(np.full(self.observed.shape[1], self.sd), self.observed)

    def records(self, model):
        return dict(model.records)

    def replace_record(self, model, owner, record):
        return model.holding(owner, record)

    def predict(self, models):
        self.asked.append(len(models))
        return np.array([self.sum_of(model) for model in models])

    def sum_of(self, model):
        """What one model predicts."""
        total = np.zeros(self.observed.shape)
        for _, record in model.records:
            total += (
                record.b * self.columns["base"] if isinstance(record, Base) else record.a * self.columns[record.name]
            )
        return total


NUMBER = Parameter("base.b", 0.0, 1.0, -1e3, 1e3, declared=True)


def candidate(name: str) -> Candidate:
    """An effect as a candidate; `kind@place` is sought along the way."""
    kind, _, place = name.partition("@")
    return Candidate(kind, Effect(name), (f"{kind}.a",), place=place, place_searched=bool(place))


def made(names, sizes=None, seed=0, size=8.0, shape=SHAPE, sd=1.0, b=0.7, of=Sums) -> Sums:
    """An experiment that shows effects of some sizes in white noise of SD 1; a default size moves rows by `size`."""
    draw = np.random.default_rng(seed)
    columns = {name: draw.normal(size=shape) for name in ("base", *names)}
    columns = {name: size * column / np.linalg.norm(column) for name, column in columns.items()}
    drawn_values = b * columns["base"] + sum(value * columns[name] for name, value in (sizes or {}).items())
    return of(drawn_values + draw.normal(size=shape), columns, sd)


def fitted(experiment: Sums, number: Parameter = NUMBER) -> Fit:
    """The base model fitted."""
    return calibrate(experiment, Model(), (number,))


def searched(experiment: Sums, names, number: Parameter = NUMBER) -> Search:
    """What was found of the candidates of these names."""
    base = fitted(experiment, number)
    search = Search(base)
    search.run(signatures(base, [candidate(name) for name in names]))
    return search


def question(experiment: Sums, names, number: Parameter = NUMBER) -> Question:
    """Which of the candidates of these names the base model lacks."""
    return Question(
        "test-bed", "sums", experiment, Model(), (number,), lambda base: [candidate(name) for name in names]
    )
