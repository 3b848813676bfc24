"""Hypotheses weighed without each fold, and what they then predict of it together."""

import numpy as np
from scipy.special import softmax

from rover_pin.inference.beliefs import Beliefs


def scores_without(beliefs: Beliefs) -> np.ndarray:
    """Return the logarithm of evidence times prior of each hypothesis (folds, hypotheses) without each fold."""
    density = np.array([beliefs.left_out(hypothesis).log_density for hypothesis in beliefs.hypotheses]).T
    return np.asarray(beliefs.scores - density)


def weights_without(beliefs: Beliefs) -> np.ndarray:
    """Return the probability of each hypothesis (folds, hypotheses) by the data without each fold."""
    return np.asarray(softmax(scores_without(beliefs), axis=1))


def chosen_without(beliefs: Beliefs) -> list[frozenset[str]]:
    """Return the most probable set of causes without each fold (folds,)."""
    names = [beliefs.totals(lambda hypothesis: {frozenset(hypothesis.names)}, row) for row in weights_without(beliefs)]
    return [next(iter(totals)) for totals in names]


def errors_without(beliefs: Beliefs) -> list[float]:
    """Return the RMSE of each channel, every fold predicted by all that was fitted, as the other folds weigh that."""
    fitted = np.array([hypothesis.is_fitted for hypothesis in beliefs.hypotheses])
    rows = [beliefs.left_out(hypothesis).missed for hypothesis in beliefs.hypotheses if hypothesis.is_fitted]
    weights = softmax(scores_without(beliefs)[:, fitted], axis=1)
    averaged = np.einsum("fh,hfcs->fcs", weights, np.array(rows))
    return [float(np.sqrt(np.nanmean(averaged[:, at] ** 2))) for at in range(averaged.shape[1])]
