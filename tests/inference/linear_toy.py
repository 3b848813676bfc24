"""A linear experiment small enough to write all its matrices down, as the tests of evidence and beliefs need it."""

import math
from itertools import product

import numpy as np

from rover_pin.estimation.experiment import Differentiable, Sensitivities
from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.cause import Cause
from rover_pin.inference.samples import samples_of

MEMORY = 0.15
"""Memory of drift over the length of the campaign, as the equation of the errors has it."""


class Toy(Differentiable):
    """What is measured is the sum of columns (folds, channels, samples), each times its number, which a model is."""

    def __init__(self, observed, sd, columns, inputs, order=None):
        self.observed, self.sd, self.columns, self.inputs, self.order = observed, sd, columns, inputs, order
        self.folds, self.channels = (tuple(map(str, range(many))) for many in np.shape(observed)[:2])

    @property
    def varied(self):
        return self.inputs

    def turns(self):
        return self.order

    def samples(self):
        return samples_of(self, self.sd, self.inputs)

    def predict(self, models):
        none = np.zeros(np.shape(self.observed))
        return np.array([sum((self.columns[name] * x for name, x in (model or {}).items()), none) for model in models])

    def records(self, model):
        return {}

    def replace_record(self, model, owner, record):
        return model

    def with_values(self, model, values):
        return {**(model or {}), **values}

    def value(self, model, name):
        return 0.0

    def sensitivities(self, model, parameters, u):
        rows = [self.columns[parameter.name] for parameter in parameters]
        predicted = sum(
            (row * parameter.value(x) for row, parameter, x in zip(rows, parameters, u, strict=True)), 0.0 * self.sd
        )
        slopes = [row * parameter.slope(x) for row, parameter, x in zip(rows, parameters, u, strict=True)]
        return Sensitivities(predicted, np.array(slopes).reshape(-1, *np.shape(self.observed)))


def number(name, scale=1.0, reach=1e3):
    """A number around 0."""
    return Parameter(name, 0.0, scale, -reach, reach)


def cause(name, scale=1.0):
    """A cause of one size."""
    return Cause(name, lambda model: model, (number(name, scale),), frozenset({name}))


def places(observed):
    """(fold, channel, sample) of all that is compared, channel after channel."""
    folds, channels, many = observed.shape
    every = product(range(channels), range(folds), range(many))
    return [(fold, channel, at) for channel, fold, at in every if np.isfinite(observed[fold, channel, at])]


def dense(toy, scales, added=()):
    """The covariance of all errors as the equation of error_model.py has it; a scale that is not there is 0.

    `scales`: by (letter, channel), channel -1 for all; `added`: tables of what laws add.
    """
    rows = places(toy.observed)
    channel_rows = [[row for row in rows if row[1] == channel] for channel in range(len(toy.channels))]
    n = [math.sqrt(sum(toy.sd[row] ** 2 for row in block) / len(block)) for block in channel_rows]
    spread = [max(float(np.std([toy.observed[row] for row in block])), n[at]) for at, block in enumerate(channel_rows)]
    inputs = np.array([toy.inputs[fold, at] for fold, _, at in rows])
    reach = np.ptp(inputs, axis=0)
    x = inputs[:, reach > 0] / reach[reach > 0]
    order = None if toy.order is None else [float(toy.order[fold, at]) for fold, _, at in rows]
    length = scales.get(("l", -1), 1.0)
    total = np.zeros((len(rows), len(rows)))
    for (i, first), (j, second) in product(enumerate(rows), repeat=2):
        c = first[1]
        if second[1] != c:
            continue
        square = {letter: scales.get((letter, c), 0.0) ** 2 for letter in "stda"}
        smooth = math.exp(-sum((x[i] - x[j]) ** 2) / (2 * length**2))
        total[i, j] += square["s"] * toy.sd[first] ** 2 * (i == j)
        total[i, j] += square["t"] * n[c] ** 2 * (first[0] == second[0])
        if order is not None:
            total[i, j] += square["d"] * n[c] ** 2 * math.exp(-abs(order[i] - order[j]) / (MEMORY * np.ptp(order)))
        total[i, j] += square["a"] * spread[c] ** 2 * smooth
        total[i, j] += scales.get(("e", -1), 0.0) ** 2 * sum(g[first] * g[second] for g in added) * smooth
    return total


def scales_of(errors, eta):
    """The scales of an error model by letter and channel."""
    return dict(zip(errors.scales, np.exp(eta), strict=True))


def random_toy(seed, timed, channels=2, folds=4, longest=4, numbers=2):
    """A toy whose folds are unequally long and have holes, its numbers `b0`, `b1` and so on."""
    draw = np.random.default_rng(seed)
    shape = (folds, channels, longest)
    inputs = np.dstack([draw.uniform(2.0, 5.0, (folds, longest)), np.full((folds, longest), 3.0)])
    inputs = np.dstack([inputs, draw.uniform(-40.0, 90.0, (folds, longest))])
    columns = {f"b{at}": draw.normal(size=shape) * draw.uniform(0.5, 3.0) for at in range(numbers)}
    sd = draw.uniform(0.3, 0.8, shape)
    observed = sum(columns.values()) * draw.normal() + draw.normal(size=shape) * sd
    ends = draw.integers(1, longest + 1, folds)
    ends[draw.integers(folds)] = longest
    for fold, end in enumerate(ends):
        observed[fold, :, end:] = np.nan
    holes = draw.random(shape) < 0.15
    holes[:, :, 0] = False
    observed[holes] = np.nan
    order = draw.permutation(folds * longest).reshape(folds, longest) if timed else None
    return Toy(observed, sd, columns, inputs, order)
