"""What a fit says of a model's numbers: estimates with intervals, and what each depends on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.public import brief
from rover_pin.estimation.numbers import Number, assumed_lines
from rover_pin.estimation.profile import MOST
from rover_pin.estimation.wording import format_value

MANY = 10
"""Numbers of one record up to which each is listed that is as it was known beforehand."""


@brief
class Estimate(NamedTuple):
    """A number with its interval, and where its variance comes from."""

    number: Number
    data_share: float
    "share of its variance that is the data's"
    prior_shares: Mapping[str, float]
    "share of it that what was known beforehand of each number leaves, its own included, the largest first"
    remedy: str = ""
    "what would tell it"

    @property
    def is_found(self) -> bool:
        """Whether at least half of its variance is the data's, and no bound ends its interval."""
        return self.data_share >= MOST and self.number.closed and not self.number.at_bound

    @property
    def is_as_known(self) -> bool:
        """Whether the data say less of it than what was known beforehand."""
        return self.prior_shares[self.number.name] >= MOST

    @property
    def depends_on(self) -> tuple[str, ...]:
        """The fewest numbers whose priors leave half of its variance; empty where the data leave it."""
        if self.data_share >= MOST:
            return ()
        sums = np.cumsum([*self.prior_shares.values()])
        return tuple(self.prior_shares)[: int(np.searchsorted(sums, MOST)) + 1]

    def line(self, others: Mapping[str, Estimate]) -> str:
        """Return the number, whether it is found, else on what of the others it depends and what would tell that."""
        if self.data_share >= MOST:
            return f"{self.number.text}{': found' if self.is_found else ''}"
        kinds = {name: "declared" if others[name].number.declared else "assumed" for name in self.depends_on}
        words = " and ".join(f"the {kinds[name]} {name} ({self.prior_shares[name]:.0%})" for name in self.depends_on)
        return f"{self.number.text}: its variance depends on {words}; {others[self.depends_on[0]].remedy}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        shares = {name: float(share) for name, share in self.prior_shares.items()}
        more = {"found": self.is_found, "data_share": self.data_share, "prior_shares": shares}
        return {**self.number.as_dict(), **more, "depends_on": list(self.depends_on)}


def variance_shares(covariance: np.ndarray) -> np.ndarray:
    """Return the share of each number's variance (numbers, numbers) that the prior of each leaves in it.

    With C = (J' W J + 1)^-1, the `covariance` of numbers whose priors have mean m and SD 1, u = C (J' W y + m): the
    error of a prior's mean moves u_i by C_ij of it, so that C_ij^2 / C_ii of the variance is its, and the rest of a row
    is the data's.
    """
    return np.asarray(covariance**2 / np.diag(covariance)[:, None])


class ChannelFit(NamedTuple):
    """How well one channel is met."""

    name: str
    unit: str
    points: int
    rmse: float

    @property
    def line(self) -> str:
        """How well it is met, in words."""
        return f"{self.name}: RMSE {format_value(self.rmse, self.unit)} over {self.points} points"


@brief
@dataclass(frozen=True, eq=False)
class Identification:
    """The base model fitted to data, with all that it assumes. `model` has the fitted numbers."""

    name: str
    model: Any = field(repr=False)
    estimates: tuple[Estimate, ...]
    misfit: float
    "reduced chi-square; 1 is the noise"
    channels: tuple[ChannelFit, ...]
    held: Mapping[str, float]
    "constants of wheel and soil that were not free [SI]"
    elsewhere: tuple[Any, ...] = ()
    "fitted constants of a rig against other measurements of them"
    correlation: np.ndarray = field(default_factory=lambda: np.eye(0), repr=False)
    "of the numbers, in their order"

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of a number, `k` for `soil.k`."""
        for estimate in self.estimates:
            if name in (estimate.number.name, estimate.number.name.rpartition(".")[2]):
                return estimate
        raise ParameterError(f"'{name}' was not free: {', '.join(row.number.name for row in self.estimates)} were.")

    @property
    def found(self) -> tuple[str, ...]:
        """Names of the numbers that the data tell."""
        return tuple(estimate.number.name for estimate in self.estimates if estimate.is_found)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, for JSON; SI units."""
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
        """Return all of it as text."""
        numbers = [estimate.number for estimate in self.estimates]
        by_name = {estimate.number.name: estimate for estimate in self.estimates}
        informed = [estimate for estimate in self.estimates if not estimate.is_as_known]
        lines = [self.name, *(f"  {estimate.line(by_name)}" for estimate in informed)]
        lines += [f"  {channel.line}" for channel in self.channels]
        lines += [f"  reduced chi-square {self.misfit:.3g}; 1 is the noise"]
        lines += [f"  measured elsewhere: {flag.sentence}" for flag in self.elsewhere]
        as_known = _list_numbers([estimate.number for estimate in self.estimates if estimate.is_as_known])
        lines += ["  the data say less of these than was known beforehand:"] if as_known else []
        lines += [f"    {text}" for text in as_known]
        lines += [f"  {line}" for line in assumed_lines(numbers)]
        held = ", ".join(f"{name} = {value:.4g}" for name, value in self.held.items())
        return "\n".join([*lines, f"  held [SI]: {held}"])


def _list_numbers(numbers: Sequence[Number]) -> list[str]:
    """Return numbers in words, those of a record that has many of them as their count."""
    owners = [number.name.rpartition(".")[0] for number in numbers]
    counts = {owner: owners.count(owner) for owner in owners}
    rows = [
        number.text if counts[owner] <= MANY else f"{owner}: {counts[owner]} numbers"
        for number, owner in zip(numbers, owners, strict=True)
    ]
    return list(dict.fromkeys(rows))
