"""What the Jacobian of a fit tells: covariance, correlations, singular values, what others reproduce."""

from __future__ import annotations

import numpy as np

from rover_pin.estimation.descent import LeastSquares
from rover_pin.estimation.problem import Problem


def own_share(jacobian: np.ndarray, index: int) -> float:
    """Return how much of a column, relative to its length, the others cannot reproduce."""
    column, others = jacobian[:, index], np.delete(jacobian, index, axis=1)
    length = np.linalg.norm(column)
    if others.shape[1] == 0 or length == 0:
        return float(length > 0)
    others = others / np.maximum(np.linalg.norm(others, axis=0), 1e-300)
    residual = column - others @ np.linalg.lstsq(others, column, rcond=None)[0]
    return float(np.linalg.norm(residual) / length)


def covariance(problem: LeastSquares, u: np.ndarray) -> np.ndarray:
    """Return (J^T J)^-1 at u; a direction without information gets a huge variance.

    Parameters on a bound do not widen the others: those move only one way, and the fit wants the other.
    """
    jacobian = problem.evaluate(u)[1]
    inside = (u > problem.space.low) & (u < problem.space.high)
    matrix = np.diag(np.diag(_inverse_square(jacobian)))
    matrix[np.ix_(inside, inside)] = _inverse_square(jacobian[:, inside])
    return matrix


def _inverse_square(jacobian: np.ndarray) -> np.ndarray:
    rows, count = jacobian.shape
    padded = np.vstack([jacobian, np.zeros((max(count - rows, 0), count))])
    _, values, directions = np.linalg.svd(padded, full_matrices=False)
    return (directions.T / np.maximum(values, 1e-9) ** 2) @ directions


def correlation(covariance: np.ndarray) -> np.ndarray:
    """Return the correlation matrix of a covariance."""
    sd = np.sqrt(np.diag(covariance))
    return covariance / np.outer(sd, sd)


def singular_values(problem: Problem, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return singular values of the data's weighted Jacobian, per spread of the starts, and their directions (rows)."""
    spread = np.array([axis.coordinate.spread for axis in problem.space.axes])
    jacobian = problem.data_jacobian(u) * spread
    _, values, directions = np.linalg.svd(jacobian, full_matrices=True)
    return np.pad(values, (0, len(spread) - len(values))), directions
