"""Models drawn from what is believed: what the data leave open, as models that can be driven."""

from typing import Any

import numpy as np

from rover_pin.inference.beliefs import Beliefs, Hypothesis


def drawn_models(beliefs: Beliefs, count: int, seed: int = 0) -> list[Any]:
    """Return models of equal weight, drawn from the posterior of causes and numbers.

    Hypotheses come by their probability (systematic resampling), their numbers from u ~ N(mean, D R D) within bounds, R
    the posterior's correlations and D the SDs that intervals are made of. What is left without a cause is in none.
    """
    random = np.random.default_rng(seed)
    fitted = [(weight, row) for weight, row in zip(beliefs.weights, beliefs.hypotheses, strict=True) if row.is_fitted]
    edges = np.cumsum([weight for weight, _ in fitted])
    places = np.searchsorted(edges, edges[-1] * (np.arange(count) + random.random()) / count)
    return [_drawn(fitted[min(place, len(fitted) - 1)][1], random) for place in places]


def _drawn(hypothesis: Hypothesis, random: np.random.Generator) -> Any:
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
