"""Profile likelihood: how far chi2 rises where one number moves and the others do their best to keep the fit."""

from typing import NamedTuple

CLEAR = 3.0
"""SDs from which something is clear of chance, which goes so far once in 370 times."""
NORMAL_95 = 1.959964
"""Half a 95 % interval of a normal law, in SDs; its square is by how much chi2 rises at the interval's ends."""


class Profile(NamedTuple):
    """The rise of chi2 above its least, at values of one parameter [SI]; NaN where a refit did not settle."""

    name: str
    unit: str
    values: tuple[float, ...]
    rises: tuple[float, ...]
