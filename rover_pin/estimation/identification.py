"""The result of an identification: estimates of a model's parameters with intervals, and the fractions of the variance
of each estimate that come from the noise of the data and from the priors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.public import brief
from rover_pin.estimation.numbers import Number, assumed_lines
from rover_pin.estimation.profile import MAJORITY
from rover_pin.estimation.wording import format_value

MAX_LISTED_NUMBERS = 10
"""Maximum number of parameters of one part of the model (such as a motor) that a report lists one by one, if the data
do not improve them. If a part has more such parameters, the report states only their number, because a table or a motor
would fill the page with values that are known already."""


@brief
class Estimate(NamedTuple):
    """A fitted parameter with its interval, and the fractions of its variance that come from the noise and from each
    prior.
    """

    number: Number
    data_share: float
    """fraction of the estimate's variance that comes from the noise of the data"""
    prior_shares: Mapping[str, float]
    """name of each parameter -> fraction of the estimate's variance that comes from the prior of this parameter. The
    prior of the estimated parameter itself is included, and the largest fraction comes first"""
    remedy: str = ""
    """measurement that would improve the estimate, in words"""

    @property
    def is_found(self) -> bool:
        """Whether the data determine the parameter: at least half of its variance comes from the noise of the data, its
        interval is limited by the data at both ends, and its value does not lie at a bound.
        """
        return self.data_share >= MAJORITY and self.number.closed and not self.number.at_bound

    @property
    def is_as_known(self) -> bool:
        """Whether at least half of the variance comes from the parameter's own prior: the data then add little to the
        prior knowledge.
        """
        return self.prior_shares[self.number.name] >= MAJORITY

    @property
    def depends_on(self) -> tuple[str, ...]:
        """Names of the parameters on whose priors the estimate mainly depends.

        These are as few parameters as possible whose priors together cause at least half of the estimate's variance.
        The result is empty if the noise of the data causes at least half of the variance.
        """
        if self.data_share >= MAJORITY:
            return ()
        sums = np.cumsum([*self.prior_shares.values()])
        return tuple(self.prior_shares)[: int(np.searchsorted(sums, MAJORITY)) + 1]

    def line(self, others: Mapping[str, Estimate]) -> str:
        """Return the estimate as one line of a report: value and interval, followed by "found", or by the names of the
        parameters on whose priors the estimate depends and the measurement that would improve it.

        `others` maps the name of each parameter of the identification to its estimate.
        """
        if self.data_share >= MAJORITY:
            return f"{self.number.text}{': found' if self.is_found else ''}"
        # The remedy is that of the parameter with the largest fraction, because measuring it helps most.
        kinds = {name: "declared" if others[name].number.declared else "assumed" for name in self.depends_on}
        words = " and ".join(f"the {kinds[name]} {name} ({self.prior_shares[name]:.0%})" for name in self.depends_on)
        return f"{self.number.text}: its variance depends on {words}; {others[self.depends_on[0]].remedy}"

    def as_dict(self) -> dict[str, Any]:
        """Return the estimate as plain values for JSON."""
        shares = {name: float(share) for name, share in self.prior_shares.items()}
        more = {"found": self.is_found, "data_share": self.data_share, "prior_shares": shares}
        return {**self.number.as_dict(), **more, "depends_on": list(self.depends_on)}


def variance_shares(covariance: np.ndarray) -> np.ndarray:
    """Return the fraction of each parameter's variance (row) that comes from the prior of each parameter (column).

    `covariance` C (parameters, parameters) is the covariance of the parameters u in units of their prior SDs: C = (J' W
    J + 1)^-1, with the derivatives J of the whitened residuals and their weights W. An error e of the prior mean of
    parameter j moves u_i by C_ij e, so that the fraction of prior j in the variance of parameter i is C_ij^2 / C_ii.
    The fraction of the data is 1 minus the sum of the row.
    """
    return np.asarray(covariance**2 / np.diag(covariance)[:, None])


class ChannelFit(NamedTuple):
    """Quality of a fit in one channel: RMSE of the residual in the channel's unit, and number of compared points."""

    name: str
    unit: str
    points: int
    rmse: float

    @property
    def line(self) -> str:
        """The channel in one line: RMSE and number of points."""
        return f"{self.name}: RMSE {format_value(self.rmse, self.unit)} over {self.points} points"


@brief
@dataclass(frozen=True, eq=False)
class Identification:
    """Result of an identification: the model fitted to data, with the estimates of its parameters and all assumptions.

    Example: `result["k"].number.value` is the fitted k [m], and `print(result.report())` shows the whole result.
    """

    name: str
    model: Any = field(repr=False)
    """the model with its fitted parameters"""
    estimates: tuple[Estimate, ...]
    misfit: float
    """reduced chi-square; 1 means that the residual is noise"""
    channels: tuple[ChannelFit, ...]
    held: Mapping[str, float]
    """name -> value [SI] of each constant of the wheel or the soil that was held at its declared value and not
    fitted"""
    elsewhere: tuple[Any, ...] = ()
    """comparisons of fitted constants with independent measurements of these constants"""
    correlation: np.ndarray = field(default_factory=lambda: np.eye(0), repr=False)
    """correlation matrix of the estimates (parameters, parameters), in the order of `estimates`"""

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of a parameter by its full name (`soil.k`) or by its quantity alone (`k`).

        Raises ParameterError if the parameter was not fitted.
        """
        for estimate in self.estimates:
            if name in (estimate.number.name, estimate.number.name.rpartition(".")[2]):
                return estimate
        fitted = ", ".join(row.number.name for row in self.estimates)
        raise ParameterError(f"'{name}' was not fitted. The fitted parameters are {fitted}.")

    @property
    def found(self) -> tuple[str, ...]:
        """Names of the parameters that the data determine."""
        return tuple(estimate.number.name for estimate in self.estimates if estimate.is_found)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain values for JSON, in SI units."""
        return {
            "name": self.name,
            "parameters": {estimate.number.name: estimate.as_dict() for estimate in self.estimates},
            "correlation": self.correlation.tolist(),
            "misfit": self.misfit,
            "channels": [channel._asdict() for channel in self.channels],
            "held": dict(self.held),
            "elsewhere": [flag.as_dict() for flag in self.elsewhere],
        }

    def report(self) -> str:
        """Return the whole result as text."""
        numbers = [estimate.number for estimate in self.estimates]
        by_name = {estimate.number.name: estimate for estimate in self.estimates}
        # First the parameters about which the data say something, then the quality of the fit, then the other
        # parameters.
        informed = [estimate for estimate in self.estimates if not estimate.is_as_known]
        lines = [self.name, *(f"  {estimate.line(by_name)}" for estimate in informed)]
        lines += [f"  {channel.line}" for channel in self.channels]
        lines += [f"  reduced chi-square {self.misfit:.3g}; 1 is the noise"]
        lines += [f"  measured elsewhere: {flag.sentence}" for flag in self.elsewhere]
        # A record with many parameters that the data do not improve is only counted.
        known = [estimate.number for estimate in self.estimates if estimate.is_as_known]
        owners = [number.name.rpartition(".")[0] for number in known]
        as_known = dict.fromkeys(
            number.text if owners.count(owner) <= MAX_LISTED_NUMBERS else f"{owner}: {owners.count(owner)} numbers"
            for number, owner in zip(known, owners, strict=True)
        )
        lines += ["  the data say less of these than was known beforehand:"] if as_known else []
        lines += [f"    {text}" for text in as_known]
        lines += [f"  {line}" for line in assumed_lines(numbers)]
        held = ", ".join(f"{name} = {value:.4g}" for name, value in self.held.items())
        return "\n".join([*lines, f"  held [SI]: {held}"])
