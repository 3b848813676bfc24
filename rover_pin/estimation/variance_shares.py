"""What an estimate depends on: how much of its variance what was known beforehand of each number leaves in it."""

import numpy as np


def variance_shares(covariance: np.ndarray) -> np.ndarray:
    """Return the share of each number's variance (numbers, numbers) that the prior of each leaves in it.

    With C = (J' W J + 1)^-1 of numbers whose priors have mean m and SD 1, u = C (J' W y + m): the error of a prior's
    mean moves u_i by C_ij of it, so that C_ij^2 / C_ii of the variance is its, and the rest of a row is the data's.

    Parameters
    ----------
    covariance : array (numbers, numbers)
        C, of numbers in units of what is known of them beforehand.
    """
    return np.asarray(covariance**2 / np.diag(covariance)[:, None])
