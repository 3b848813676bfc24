"""Whether residuals hang together with what was set or when it was measured: correlations with permutation p-values."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.stats import permutation_test

from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.measurements.wheel_rig import SAME_LOAD

DRAWS = 1999
"""Permutations of a test: the least p-value is 1 / 2000."""

SIGNIFICANCE_LEVEL = 0.01
"""p-value from which a correlation is pointed at; with a dozen tests one in eight tables shows one by chance."""

SLIP_SQUARED, ORDER, NEIGHBOURS, NEXT_RUN = "slip^2", "run order", "neighbour in slip", "next run"


class ResidualTest(NamedTuple):
    """The correlation of one channel's residual with one quantity, and how often chance gives as much."""

    channel: str
    against: str
    correlation: float
    p: float

    @property
    def is_significant(self) -> bool:
        """Whether chance hardly gives this."""
        return self.p < SIGNIFICANCE_LEVEL


def residual_tests(data: RigSet, residual: np.ndarray, seed: int) -> tuple[ResidualTest, ...]:
    """Return the tests of residuals [channels, runs] in SDs.

    Correlation with slip, with slip^2 (what slip does not carry of it), with load where loads vary, and with the order
    of the rows; and of each residual with that of the run next to it in slip, and with that of the next run: whiteness.
    The p-values are two-sided, by permuting the residuals.
    """
    load = np.asarray(data.rig.load)
    varies = bool(load.max() >= SAME_LOAD * load.min())
    return tuple(
        ResidualTest(channel.name, name, *_tested(row[channel.has_value], statistic, seed))
        for channel, row in zip(data.rig.channels, residual, strict=True)
        for name, statistic in _statistics(data, channel.has_value, varies).items()
    )


Statistic = Callable[..., np.ndarray]


def _statistics(data: RigSet, is_measured: np.ndarray, varies: bool) -> dict[str, Statistic]:
    """Return what the residuals of these runs are tested with."""
    slip, load = np.asarray(data.rig.slip)[is_measured], np.asarray(data.rig.load)[is_measured]
    against = {"slip": slip, SLIP_SQUARED: _curvature(slip), ORDER: np.arange(slip.size, dtype=float)}
    if varies:
        against["load"] = load
    statistics = {name: _with(values) for name, values in against.items()}
    order = {NEIGHBOURS: np.argsort(slip, kind="stable"), NEXT_RUN: np.arange(slip.size)}
    return statistics | {name: _with_next(run_order) for name, run_order in order.items()}


def _tested(row: np.ndarray, statistic: Statistic, seed: int) -> tuple[float, float]:
    centred = row - row.mean()
    if not np.ptp(row) > 0:
        return 0.0, 1.0
    test_result = permutation_test(
        (centred,), statistic, permutation_type="pairings", n_resamples=DRAWS, vectorized=True, random_state=seed
    )
    return float(test_result.statistic), float(test_result.pvalue)


def _with(values: np.ndarray) -> Statistic:
    scaled = values - values.mean()
    scaled = scaled / max(np.linalg.norm(scaled), 1e-300)

    def correlation(row: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.asarray(row @ scaled / np.linalg.norm(row, axis=axis))

    return correlation


def _with_next(order: np.ndarray) -> Statistic:
    def correlation(row: np.ndarray, axis: int = -1) -> np.ndarray:
        sorted_row = row[..., order]
        products = sorted_row[..., 1:] * sorted_row[..., :-1]
        return np.asarray(products.sum(axis=axis) / np.sum(row**2, axis=axis))

    return correlation


def _curvature(slip: np.ndarray) -> np.ndarray:
    """Return slip^2 without its share that is linear in slip."""
    design = np.column_stack([np.ones_like(slip), slip])
    return np.asarray(slip**2 - design @ np.linalg.lstsq(design, slip**2, rcond=None)[0])
