"""A free number with its coordinate, its bounds and what is known of it beforehand."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Record, quantities

MOST_EXPONENT = 700.0
"""Greatest exponent of which a float holds the exponential; beyond every bound."""
LEAST_OF_ORIGIN = 1e-6
"""Share of its origin at which a number on a logarithm stops that may fall to 0."""


@dataclass(frozen=True)
class Prior:
    """What is known of a number without these data: a normal distribution, in its unit (SI)."""

    mean: float
    sd: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.mean) and math.isfinite(self.sd) and self.sd > 0):
            raise ParameterError(
                f"Prior({self.mean:g}, {self.sd:g}) needs a finite mean and a positive sd; to hold a number exactly, "
                "set it."
            )


@dataclass(frozen=True)
class Parameter:
    """One free number: x = origin + scale u, or x = origin exp(scale u) where `log`.

    With a prior u is standard normal: `origin` is what is known of it beforehand and `scale` its standard deviation,
    `declared` with the data (a law's shape: as published) or assumed, as `source` says.
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
        """Return x at u."""
        x = self.origin * math.exp(min(self.scale * u, MOST_EXPONENT)) if self.log else self.origin + self.scale * u
        return min(max(x, self.low), self.high)

    def u(self, x: float) -> float:
        """Return u of x."""
        return math.log(x / self.origin) / self.scale if self.log else (x - self.origin) / self.scale

    @property
    def bounds(self) -> tuple[float, float]:
        """The bounds of u."""
        low = self.u(LEAST_OF_ORIGIN * self.origin if self.log and self.low <= 0 else self.low)
        return min(low, self.u(self.high)), max(low, self.u(self.high))

    def slope(self, u: float) -> float:
        """Return dx / du."""
        return self.scale * (self.value(u) if self.log else 1.0)

    @property
    def beforehand(self) -> str:
        """What is known of it beforehand, in words; empty without a prior."""
        if not self.prior:
            return ""
        if self.log and self.scale >= 1.0:
            return f"{self.origin:.3g} over or times {math.exp(self.scale):.3g}"
        return f"{self.origin:.3g} +- {self.scale:.1%}" if self.log else f"{self.origin:.3g} +- {self.scale:.2g}"


def parameter_of(
    name: str, record: Record, sd: float, log: bool = False, declared: str = "", source: str = ""
) -> Parameter:
    """Return the number `owner.quantity` around its value in its record; `sd` is relative where `log`.

    `declared` says where the data state it; without it is assumed, by `source` or that of the quantity.
    """
    quantity = name.rpartition(".")[2]
    value, spec = float(getattr(record, quantity)), quantities(record)[quantity]
    source = declared or f"assumed: {(source or spec.source).removeprefix('assumed: ')}"
    low, high = float(spec.low), float(spec.high)
    return Parameter(name, value, sd, low, high, log, declared=bool(declared), source=source)


def declared_in(title: str, name: str, table: Container[str], sds: Container[str]) -> str:
    """Return where a table of the data declares a number, and whether with an SD; empty where it does not."""
    return f"declared in [{title}]{'' if name in sds else ', its SD assumed'}" if name in table else ""


def bounds_of(parameters: Sequence[Parameter]) -> np.ndarray:
    """Return the bounds of each u (parameters, 2)."""
    return np.array([parameter.bounds for parameter in parameters]).reshape(-1, 2)


def prior_curvature(parameters: Sequence[Parameter]) -> np.ndarray:
    """Return the curvature that the priors give chi2 / 2; next to none where there is none."""
    return np.diag([1.0 if parameter.prior else 1e-9 for parameter in parameters])
