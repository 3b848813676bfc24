"""Profile likelihood: how far chi2 rises where one number moves and the others do their best to keep the fit."""

from typing import NamedTuple

from scipy.special import ndtri

SURE = 0.95
"""Probability from which there is no doubt: of answers, of intervals, and that chance does not give the best of many.
Why: the custom of the field; it is the only level of significance."""
MOST = 0.5
"""What is more likely than not, and the larger part of a whole. Why: the words' meaning."""
CLEAR = 3.0
"""SDs from which something is clear of chance, which goes so far once in 370 times. Why: the custom of the field."""
NORMAL_95 = float(ndtri(0.5 + 0.5 * SURE))
"""Half a 95 % interval of a normal law, in SDs; its square is by how much chi2 rises at the interval's ends."""


class Profile(NamedTuple):
    """The rise of chi2 above its least, at values of one parameter [SI]; NaN where a refit did not settle."""

    name: str
    unit: str
    values: tuple[float, ...]
    rises: tuple[float, ...]
