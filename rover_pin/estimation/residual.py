"""The sign of every residual of the package, said once."""

from __future__ import annotations

import numpy as np


def residual(measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Return measured - predicted: above 0 where the model gives too little.

    Whatever is fitted, tested for correlations, tabled, drawn or described as left has this sign.
    """
    return np.asarray(measured - predicted)
