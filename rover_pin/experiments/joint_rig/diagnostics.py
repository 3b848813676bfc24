"""What one model of several sets leaves of each of them."""

from __future__ import annotations

from typing import Any, NamedTuple

from rover_pin.estimation.wording import format_value


class SetError(NamedTuple):
    """The RMSE of one channel of one set, each of its levels predicted by a fit to all other levels of all sets."""

    set: str
    channel: str
    unit: str
    before: float
    after: float
    noise: float
    curve: str
    "the curve through that set's own points that predicts its levels best"
    curve_error: float

    @property
    def sentence(self) -> str:
        """One sentence for a reader."""
        errors = f"{format_value(self.before, self.unit)} -> {format_value(self.after, self.unit)}"
        curve = f"a {self.curve} of that set alone {format_value(self.curve_error, self.unit)}"
        return f"{self.set}: held-out {self.channel} {errors} (noise {format_value(self.noise, self.unit)}; {curve})"


class JointExtra(NamedTuple):
    """What only a joint fit has to say."""

    sets: tuple[SetError, ...]
    declared: tuple[str, ...]

    def lines(self, added: bool) -> list[str]:
        """Return lines for a reader."""
        return [*(set_error.sentence for set_error in self.sets), *(f"declared: {line}" for line in self.declared)]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        sets = [set_error._asdict() for set_error in self.sets]
        return {"sets": sets, "declared": list(self.declared)}
