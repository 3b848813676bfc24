"""Fitted constants against what other measurements say of them: an effect that a fit has absorbed shows here."""

from __future__ import annotations

from typing import NamedTuple

from rover_pin.contact import Soil
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.wording import Against, against, interval, shown
from rover_pin.experiments.wheel_rig.data import Independent, RigSet


class Flag(NamedTuple):
    """A fitted constant against an independent measurement of it [SI]."""

    name: str
    unit: str
    fitted: tuple[float, float, float]
    "value, and the ends of its 95 % interval"
    independent: Independent
    says: Against

    @property
    def agrees(self) -> bool:
        """Whether the two meet, and the interval says anything at all."""
        return self.says is Against.AGREES

    @property
    def said(self) -> str:
        """One sentence for a reader."""
        known = shown(self.independent.low, self.unit)
        if self.independent.high > self.independent.low:
            known += f" to {shown(self.independent.high, self.unit)}"
        fitted = interval(*self.fitted, self.unit)
        return f"{self.name} = {fitted} {self.says.value} {known} ({self.independent.source})"

    def as_dict(self) -> dict:
        """Return plain values."""
        known = {"independent": [self.independent.low, self.independent.high], "source": self.independent.source}
        return self._asdict() | known | {"agrees": self.agrees, "says": self.says.value}


def flags(data: RigSet, soil: Soil, b: float, fitted: tuple[Number, ...]) -> tuple[Flag, ...]:
    """Return every fitted constant that is known from elsewhere, and whether the two agree.

    They agree where the 95 % interval meets the independent range, which is granted 10 % on both sides if it is a
    measurement of the constant and no bound; an interval that covers nearly all that is allowed says nothing.
    """
    own = {one.name.removeprefix("soil."): one for one in fitted}
    rows = {name: (one.value, one.low, one.high) for name, one in own.items()}
    covered = {name: one.covered for name, one in own.items()}
    if "k_1" in rows:
        rows["K_eff"] = tuple((value + soil.k_2 * b) / b**soil.n for value in rows["k_1"])
        covered["K_eff"] = covered["k_1"]
    found = []
    for known in data.independent(float(soil.n)):
        if known.name in rows:
            granted = known.low * (1 - known.unsure), known.high * (1 + known.unsure)
            says = against(rows[known.name][1:], granted, covered[known.name])
            found.append(Flag(known.name, known.unit, rows[known.name], known, says))
    return tuple(found)
