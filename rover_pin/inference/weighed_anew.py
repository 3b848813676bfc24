"""Hypotheses weighed without each fold, and what they then predict of it together."""

from typing import Any

import numpy as np
from scipy.special import softmax

from rover_pin.inference.beliefs import Beliefs, Hypothesis


def scores_without(beliefs: Beliefs) -> np.ndarray:
    """Return the logarithm of evidence times prior of each hypothesis (folds, hypotheses) without each fold."""
    density = np.array([hypothesis.fold_prediction.log_density for hypothesis in beliefs.hypotheses]).T
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
    rows = [hypothesis.fold_prediction.missed for hypothesis in beliefs.hypotheses if hypothesis.is_fitted]
    weights = softmax(scores_without(beliefs)[:, fitted], axis=1)
    averaged = np.einsum("fh,hfcs->fcs", weights, np.array(rows))
    return [float(np.sqrt(np.nanmean(averaged[:, at] ** 2))) for at in range(averaged.shape[1])]


def drawn_models(beliefs: Beliefs, count: int, seed: int = 0) -> list[Any]:
    """Return models of equal weight, drawn from the posterior of causes and numbers.

    Hypotheses come by their probability (systematic resampling), their numbers from u ~ N(mean, D R D) within bounds, R
    the posterior's correlations and D the SDs that intervals are made of. What is left without a cause is in none.
    """
    random = np.random.default_rng(seed)
    fitted = [(weight, row) for weight, row in zip(beliefs.weights, beliefs.hypotheses, strict=True) if row.is_fitted]
    edges = np.cumsum([weight for weight, _ in fitted])
    places = np.searchsorted(edges, edges[-1] * (np.arange(count) + random.random()) / count)
    return [_draw_model(fitted[min(place, len(fitted) - 1)][1], random) for place in places]


def _draw_model(hypothesis: Hypothesis, random: np.random.Generator) -> Any:
    names = [parameter.name for parameter in hypothesis.parameters]
    mean, sd = np.array([hypothesis.moments(name) for name in names]).reshape(-1, 2).T
    covariance = hypothesis.posterior.covariance[: len(names), : len(names)]
    scale = np.sqrt(np.diag(covariance))
    u = mean + sd / scale * random.multivariate_normal(np.zeros(len(names)), covariance, method="eigh")
    values = {
        parameter.name: parameter.value(float(np.clip(x, *parameter.bounds)))
        for parameter, x in zip(hypothesis.parameters, u, strict=True)
    }
    return hypothesis.experiment.with_values(hypothesis.model, values)
