"""Every fold as the others say it by a hypothesis, its model linear about the whole fit."""

import math
from typing import NamedTuple

import numpy as np

from rover_pin.inference.evidence import Linear


class FoldPrediction(NamedTuple):
    """What the others say of each fold: ln of its density (folds,), and how far it is missed (folds, ...)."""

    log_density: np.ndarray
    missed: np.ndarray


def predict_folds(covariance: np.ndarray, linear: Linear, fold: np.ndarray) -> FoldPrediction:
    """Return every fold as the others predict it, given the covariance C of the errors; `missed` is a row (n,).

    With Q = (C + J J')^-1 a fold b of r_0 is of N(r_b - Q_bb^-1 (Q r)_b, Q_bb^-1) by the others.
    Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), section 5.4.2.
    """
    precision = np.linalg.inv(covariance + linear.slopes @ linear.slopes.T)
    pull = precision @ linear.target
    density, missed = np.zeros(int(fold.max()) + 1), np.zeros(len(fold))
    for at in range(len(density)):
        members = np.flatnonzero(fold == at)
        if not members.size:
            continue
        block = precision[np.ix_(members, members)]
        missed[members] = np.linalg.solve(block, pull[members])
        density[at] = 0.5 * (
            np.linalg.slogdet(block)[1] - float(missed[members] @ pull[members]) - len(members) * math.log(2 * math.pi)
        )
    return FoldPrediction(density, missed)
