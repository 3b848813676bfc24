"""What a model leaves of a rig set: constants against other measurements, remainders, and what residuals go with."""

from __future__ import annotations

from typing import Any, NamedTuple

from rover_pin.experiments.wheel_rig.beds import ByChance
from rover_pin.experiments.wheel_rig.known_elsewhere import Flag
from rover_pin.experiments.wheel_rig.remainder import Remainder
from rover_pin.experiments.wheel_rig.residual_tests import ResidualTest
from rover_pin.public import brief


@brief
class Left(NamedTuple):
    """What one model leaves."""

    flags: tuple[Flag, ...]
    remainders: tuple[Remainder, ...]
    tests: tuple[ResidualTest, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "flags": [one.as_dict() for one in self.flags],
            "residual_tests": [one._asdict() for one in self.tests],
            "remainder": [
                one._asdict() | {"levels": [level._asdict() for level in one.levels], "said": one.said}
                for one in self.remainders
            ],
        }


@brief
class RigExtra(NamedTuple):
    """What only a rig set has to say of the models before and after."""

    before: Left
    after: Left
    declared: tuple[str, ...] = ()
    "how what is declared of lugs and sand was used"
    chance: ByChance = ByChance()

    def lines(self, added: bool) -> list[str]:
        """Return lines for a reader."""
        said = [f"declared: {line}" for line in self.declared]
        said += [f"before: {flag.said}" for flag in self.before.flags]
        said += [f"after: {flag.said}" for flag in self.after.flags] if added else []
        return [*said, *(f"left: {one.said}" for one in self.after.remainders)]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        sides = {"before": self.before.as_dict(), "after": self.after.as_dict()}
        return {**sides, "declared": list(self.declared), "by_chance": self.chance.as_dict()}
