"""A free parameter of a fit: its coordinate u (its deviation from the prior mean in prior SDs), its bounds and its
prior.
"""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Record, quantities

MAX_EXPONENT = 700.0
"""Largest exponent that is passed to the exponential function. A larger exponent would overflow a float (above 709); at
this limit, the result is beyond every bound anyway."""
MIN_SHARE_OF_ORIGIN = 1e-6
"""Smallest value of a parameter that is fitted on a logarithm and has the lower bound 0, as a fraction of its origin
(prior mean). The logarithm of 0 is infinite, and a parameter at 1e-6 of its usual value has no effect."""


@dataclass(frozen=True)
class Prior:
    """Knowledge of a parameter before the data are used: a normal distribution with mean and SD in the parameter's unit
    (SI).

    Raises ParameterError if the mean is not finite, or if the SD is not a finite positive number.

    Examples
    --------
    >>> Prior(0.5, 0.1).sd
    0.1
    """

    mean: float
    sd: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.mean) and math.isfinite(self.sd) and self.sd > 0):
            raise ParameterError(
                f"Prior({self.mean:g}, {self.sd:g}) needs a finite mean and a finite, positive sd; to hold a "
                "parameter at an exact value, give it no prior and set this value in the model."
            )


@dataclass(frozen=True)
class Parameter:
    """A free parameter x of a fit, described by the coordinate u: x = origin + scale u, or x = origin exp(scale u) if
    `log` is True.

    If `prior` is True, u has a standard normal distribution: `origin` is the mean of the prior and `scale` its SD.
    `declared` is True if the prior came with the data (for the shape of a law: if it was published), and False if it is
    assumed; `source` states its origin. `low` and `high` are bounds of x.

    Examples
    --------
    >>> number = Parameter("soil.k", 0.01, 0.5, 1e-4, 0.5, log=True)
    >>> round(number.value(1.0), 5)
    0.01649
    """

    name: str
    origin: float
    scale: float
    low: float
    high: float
    log: bool = False
    prior: bool = True
    declared: bool = False
    source: str = ""

    def value(self, u: float) -> float:
        """Return the parameter's value x [SI] at the coordinate u; a value beyond a bound is moved onto the bound."""
        x = self.origin * math.exp(min(self.scale * u, MAX_EXPONENT)) if self.log else self.origin + self.scale * u
        return min(max(x, self.low), self.high)

    def u(self, x: float) -> float:
        """Return the coordinate u that belongs to a value x [SI] of the parameter."""
        return math.log(x / self.origin) / self.scale if self.log else (x - self.origin) / self.scale

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the coordinate u."""
        low = self.u(MIN_SHARE_OF_ORIGIN * self.origin if self.log and self.low <= 0 else self.low)
        return min(low, self.u(self.high)), max(low, self.u(self.high))

    def slope(self, u: float) -> float:
        """Return the derivative dx / du of the parameter's value x by its coordinate u, at u."""
        return self.scale * (self.value(u) if self.log else 1.0)

    @property
    def beforehand(self) -> str:
        """The prior as text, such as "0.01 +- 50.0%"; empty for a parameter without a prior."""
        if not self.prior:
            return ""
        if self.log and self.scale >= 1.0:
            return f"{self.origin:.3g} over or times {math.exp(self.scale):.3g}"
        return f"{self.origin:.3g} +- {self.scale:.1%}" if self.log else f"{self.origin:.3g} +- {self.scale:.2g}"


def parameter_of(
    name: str, record: Record, sd: float, log: bool = False, declared: str = "", source: str = ""
) -> Parameter:
    """Return the parameter `owner.quantity` of a fit, with its present value in a record as the mean of its prior.

    Parameters
    ----------
    name : str
        Name of the parameter.
    record : Record
        Part of the model that has the quantity, with its value, unit, bounds and source.
    sd : float
        SD of the prior: in the unit of the quantity, or relative if `log` is True.
    log : bool
        Whether the logarithm of the parameter is fitted, for a parameter that may change by factors.
    declared : str
        Place where the data declare the value. If the text is empty, the value counts as assumed.
    source : str
        Source of an assumed value; by default the source that the quantity states.
    """
    # An assumed value says so in its source, and names its origin only once.
    quantity = name.rpartition(".")[2]
    value, spec = float(getattr(record, quantity)), quantities(record)[quantity]
    source = declared or f"assumed: {(source or spec.source).removeprefix('assumed: ')}"
    low, high = float(spec.low), float(spec.high)
    return Parameter(name, value, sd, low, high, log, declared=bool(declared), source=source)


def declared_in(title: str, name: str, table: Container[str], sds: Container[str]) -> str:
    """Return the place in the data that declares a parameter, such as "declared in [wheel]".

    `title` is the name of the table in the data file. `table` and `sds` hold the names of its declared values and
    declared SDs. If the value is declared but its SD is not, the text adds that the SD is assumed. The text is empty if
    the data do not declare the parameter.
    """
    return f"declared in [{title}]{'' if name in sds else ', its SD assumed'}" if name in table else ""


def bounds_of(parameters: Sequence[Parameter]) -> np.ndarray:
    """Return the lower and the upper bound of the coordinate u of each parameter (parameters, 2)."""
    return np.array([parameter.bounds for parameter in parameters]).reshape(-1, 2)


def prior_curvature(parameters: Sequence[Parameter]) -> np.ndarray:
    """Return the contribution of the priors to the second derivatives of chi2 / 2, a diagonal matrix (parameters,
    parameters).

    The diagonal is 1 for a parameter with a prior, and nearly 0 for a parameter without one. The small value keeps the
    normal matrix invertible.
    """
    return np.diag([1.0 if parameter.prior else 1e-9 for parameter in parameters])


def posterior_covariance(columns: np.ndarray, inflation: float = 1.0) -> np.ndarray:
    """Return the posterior covariance (parameters, parameters) of parameters with independent priors N(0, 1).

    It is (I + A A' / c)^-1 with the whitened derivatives A of the residuals by the parameters, and the inflation c of
    the noise.

    Parameters
    ----------
    columns : array (parameters, n)
        The derivatives A; a NaN counts as 0.
    inflation : float
        Factor c on the variance of the noise.
    """
    filled = np.nan_to_num(columns)
    return np.asarray(np.linalg.inv(np.eye(len(filled)) + filled @ filled.T / inflation))
