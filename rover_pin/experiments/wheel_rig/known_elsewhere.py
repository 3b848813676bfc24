"""Fitted constants against what other measurements say of them: an effect that a fit has absorbed shows here."""

from typing import NamedTuple

from rover_pin.contact import Soil
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.wording import Against, against, format_value, interval
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
    def sentence(self) -> str:
        """One sentence for a reader."""
        range_text = format_value(self.independent.low, self.unit)
        if self.independent.high > self.independent.low:
            range_text += f" to {format_value(self.independent.high, self.unit)}"
        fitted = interval(*self.fitted, self.unit)
        return f"{self.name} = {fitted} {self.says.value} {range_text} ({self.independent.source})"

    def as_dict(self) -> dict:
        """Return plain values."""
        reference = {"independent": [self.independent.low, self.independent.high], "source": self.independent.source}
        return self._asdict() | reference | {"agrees": self.agrees, "says": self.says.value}


def flags(data: RigSet, soil: Soil, b: float, fitted: tuple[Number, ...]) -> tuple[Flag, ...]:
    """Return every fitted constant that is known from elsewhere, and whether the two agree.

    They agree where the 95 % interval meets the independent range, which is granted 10 % on both sides if it is a
    measurement of the constant and no bound; an interval that covers nearly all that is allowed says nothing.
    """
    numbers_by_name = {number.name.removeprefix("soil."): number for number in fitted}
    rows = {name: (number.value, number.low, number.high) for name, number in numbers_by_name.items()}
    covered = {name: number.covered for name, number in numbers_by_name.items()}
    if "k_1" in rows:
        rows["K_eff"] = tuple((value + soil.k_2 * b) / b**soil.n for value in rows["k_1"])
        covered["K_eff"] = covered["k_1"]
    raised_flags = []
    for reference in data.independent(float(soil.n)):
        if reference.name in rows:
            granted = reference.low * (1 - reference.tolerance), reference.high * (1 + reference.tolerance)
            says = against(rows[reference.name][1:], granted, covered[reference.name])
            raised_flags.append(Flag(reference.name, reference.unit, rows[reference.name], reference, says))
    return tuple(raised_flags)
