"""A cause of the residual: an effect that the model lacks or an error of the measurement, with the priors of its
parameters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.estimation.parameter import Parameter

SIZE_SD = 2.0
"""Prior SD of a cause's size during the fit, in multiples of the cause's default size.

The prior of a size beyond this SD raises chi2 by more than 1. The value is assumed, and wider than the true prior of a
size (`priors.py`), so that the prior does not move the fit; the evidence is corrected for the true prior afterwards."""


@dataclass(frozen=True, eq=False)
class Cause:
    """A possible cause of the residual: a function that adds it to a model, and its free parameters with priors.

    `amplitudes` are the names of the parameters that are sizes: if all sizes are zero (or neutral), the cause does not
    act. The other parameters only change the shape of its contribution.
    """

    name: str
    on: Callable[[Any], Any]
    """function that takes a model and returns the model with this cause added"""
    parameters: tuple[Parameter, ...]
    amplitudes: frozenset[str]
    family: str = ""
    """name that similar causes share, so that the probability that one of them acts can be stated; empty for a cause by
    itself"""
    owner: str = ""
    "name of the effect in the model; empty if the cause is not an effect"

    def absent(self, parameters: Sequence[Parameter], u: np.ndarray) -> np.ndarray:
        """Return the parameters u (parameters,) with this cause switched off, to predict the data without this cause.

        `parameters` are all free parameters of the model, and `u` (parameters,) their values in units of their prior
        SD. The sizes of this cause are set to u = 0. A size that is fitted on a logarithm cannot be zero; it is set to
        its upper bound, at which an effect with a threshold does not act.
        """
        # Shape parameters keep their values; without a size they have no influence.
        neutral = [parameter.bounds[1] if parameter.log else 0.0 for parameter in parameters]
        return np.where([parameter.name in self.amplitudes for parameter in parameters], neutral, u)


def reading_error(name: str, parameter: Parameter) -> Cause:
    """Return an error of the measurement (an offset, a scale, a delay) as a cause of the residual.

    The model already contains the error with the value 0. The cause therefore adds nothing to the model; it only makes
    `parameter` a free parameter.
    """
    return Cause(name, lambda model: model, (parameter,), frozenset({name}), "rig")
