"""Folds left out: fits to the others, what is compared, and what has no prediction."""

import numpy as np

from rover_pin.discrepancy.cross_validation import fall_of


def test_folds_that_only_one_model_predicts_are_not_compared():
    """What the second loses keeps both from being compared; what only the first loses counts for neither."""
    without, found, lost = np.array([9.0, 7.0, 5.0]), np.array([3.0, 6.0, 1.0]), np.array([np.nan, 0.0, 0.0])
    assert fall_of(without, found) == 11.0
    assert fall_of(without + lost, found) == fall_of(without + lost, found + lost) == 5.0
    assert np.isnan(fall_of(without, found + lost))
