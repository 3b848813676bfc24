"""Confidence level and limits of significance for the whole package, and the record of a profile of chi2 along one
parameter.
"""

from typing import NamedTuple

from scipy.special import ndtri

CONFIDENCE = 0.95
"""Minimum probability of a statement that counts as certain: an answer of the search for missing effects, the coverage
of an interval, the significance of a decrease of chi2. Below this probability, a report lists several possibilities.
The value is the custom of the field, and the package uses it everywhere."""
MAJORITY = 0.5
"""Limit of one half: a statement with a larger probability is more likely true than not, and a larger fraction is the
main part."""
CLEAR_SDS = 3.0
"""Minimum deviation in SDs of a difference that counts as more than chance. A normally distributed value deviates by
more than 3 SD once in 370 cases; the limit is the custom of the field."""
MAX_CHI_SQUARE = 3.0
"""Largest reduced chi2 of a model whose residual can count as noise. Above it, the search for missing effects also
starts from the declared parameters, and the stated probabilities do not follow from the evidence: they are averaged
over the folds and one further fold with the prior probabilities. A single fold that chooses other causes then also
suffices to change the answer.

Probabilities are computed as if the residual were noise. At a reduced chi2 of 3, two thirds of the squared residual are
not the declared noise, so that the probabilities given all data are too close to 0 and 1."""
NORMAL_95 = float(ndtri(0.5 + 0.5 * CONFIDENCE))
"""Half the width of the 95 % interval of a normal distribution, in SDs: 1.96. Its square, 3.84, is the rise of chi2 at
the ends of such an interval."""


class Profile(NamedTuple):
    """Profile of chi2 along one parameter: the rise of chi2 above its minimum at several values of this parameter [SI],
    while all other parameters are fitted again at each value.

    A rise is NaN if the fit at this value does not converge.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    rises: tuple[float, ...]
