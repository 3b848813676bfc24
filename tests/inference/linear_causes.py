"""Linear toys with causes, drawn from the prior that the package states, or with amplitudes that a test sets."""

import numpy as np

from rover_pin.inference.cause import SIZE_SD
from rover_pin.inference.error_model import PRIORS, ErrorModel
from rover_pin.inference.explore import Explorer
from rover_pin.inference.hypothesis import Fitter
from rover_pin.inference.priors import COUNT_PRIORS, DISCREPANCY_PRIORS, SIZE_LOG_SD, SIZE_MEDIAN
from tests.inference import linear_toy as toys

NOISE = 0.5
"""Declared SD of every value."""


def design(seed, causes, folds=5, each=3, channels=1, size=20.0):
    """A toy without data: a slope and smooth, curved causes whose default amplitudes move their channels by some SDs.

    `size`: greatest norm [SD] of what a default size moves, the least a tenth of it; None: all alike at 10.
    """
    draw = np.random.default_rng(seed)
    shape = (folds, channels, each)
    inputs = np.dstack([np.repeat(np.linspace(0.0, 1.0, folds)[:, None], each, 1), draw.random((folds, each))])
    x = np.moveaxis(inputs, 2, 0)[:, :, None] * np.ones(shape)
    columns = {"base": 2.0 * np.ones(shape)}
    for name in causes:
        column = sum(
            np.cos(draw.uniform(2.0, 14.0) * x[at] + draw.uniform(0, 7, (1, channels, 1))) for at in range(len(x))
        )
        norm = 10.0 if size is None else size * 10.0 ** draw.uniform(-1.0, 0.0)
        columns[name] = column * norm * NOISE / np.linalg.norm(column)
    return toys.Toy(np.zeros(shape), np.full(shape, NOISE), columns, inputs)


def explorer(toy, names):
    """An explorer of causes by name."""
    return Explorer(
        Fitter(toy, toy.samples(), None, (toys.number("base"),)), [toys.cause(name, scale=SIZE_SD) for name in names]
    )


def size(draw):
    """A size over its default, as it is thought of beforehand."""
    return draw.choice([-1.0, 1.0]) * SIZE_MEDIAN * np.exp(SIZE_LOG_SD * draw.normal())


def spread(at, weights):
    """Which of some alternatives has the place `at`, modulo 1, each as wide as its weight."""
    edges = np.cumsum(weights) / np.sum(weights)
    return int(np.searchsorted(edges, (0.5 + at) % 1.0))


def from_the_prior(seed, names, **options):
    """A toy with data drawn from the prior, and the names of the causes that act.

    Counts of causes and kinds of discrepancy are spread evenly over successive seeds, so that few show their shares.
    """
    draw = np.random.default_rng(seed)
    toy = design(seed + 10**6, names, **options)
    true = [
        names[at] for at in draw.permutation(len(names))[: spread(seed * 0.6180340, COUNT_PRIORS[: len(names) + 1])]
    ]
    kinds = DISCREPANCY_PRIORS[bool(true)]
    kind = list(kinds)[spread(seed * 0.7548777, list(kinds.values()))]
    parts = [size(draw) * toy.columns[name] for name in true]
    smooth = draw.normal() * toy.columns["base"] + sum(parts)
    toy.observed = smooth + NOISE * draw.normal(size=smooth.shape)  # for the spread of what is measured
    letters = ErrorModel(toy.samples(), kind, [0.0] * len(parts)).scales
    scales = {key: PRIORS[key[0]].median * np.exp(PRIORS[key[0]].sd * draw.normal()) for key in letters}
    covariance = toys.dense(toy, scales, parts)
    errors = draw.multivariate_normal(np.zeros(len(covariance)), covariance, method="cholesky")
    toy.observed = smooth + toy.samples().table_of(errors)
    return toy, true
