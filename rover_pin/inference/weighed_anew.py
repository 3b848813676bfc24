"""Hypotheses weighed without each fold, and what they then predict of it together."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from rover_pin.inference.beliefs import Beliefs


def weights_without(beliefs: Beliefs) -> np.ndarray:
    """Return the probability of each hypothesis (folds, hypotheses) by the data without each fold."""
    density = np.array([beliefs.left_out(hypothesis).log_density for hypothesis in beliefs.hypotheses]).T
    scores = beliefs.scores - density
    return np.asarray(np.exp(scores - logsumexp(scores, axis=1, keepdims=True)))


def chosen_without(beliefs: Beliefs) -> list[frozenset[str]]:
    """Return the most probable set of causes without each fold (folds,)."""
    names = [beliefs.totals(lambda hypothesis: {frozenset(hypothesis.names)}, row) for row in weights_without(beliefs)]
    return [next(iter(totals)) for totals in names]


def errors_without(beliefs: Beliefs) -> list[float]:
    """Return the RMSE of each channel, every fold predicted by all hypotheses as the other folds weigh them."""
    samples = beliefs.hypotheses[0].errors.samples
    missed = np.array([beliefs.left_out(hypothesis).missed for hypothesis in beliefs.hypotheses])
    weights = weights_without(beliefs)[samples.fold].T
    averaged = np.sum(weights * missed, axis=0)
    return [float(np.sqrt(np.mean(averaged[samples.channel == at] ** 2))) for at in np.unique(samples.channel)]
