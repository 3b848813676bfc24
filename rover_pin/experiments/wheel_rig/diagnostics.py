"""What a model leaves of a rig set: constants against other measurements, channel residuals, and what they go with."""

from __future__ import annotations

from typing import Any, NamedTuple

from rover_pin.base.public import brief
from rover_pin.experiments.wheel_rig.channel_residual import RigChannelResidual
from rover_pin.experiments.wheel_rig.known_elsewhere import Flag
from rover_pin.experiments.wheel_rig.residual_tests import ResidualTest


@brief
class FitDiagnostics(NamedTuple):
    """What one model leaves."""

    flags: tuple[Flag, ...]
    residuals: tuple[RigChannelResidual, ...]
    tests: tuple[ResidualTest, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "flags": [flag.as_dict() for flag in self.flags],
            "residual_tests": [test._asdict() for test in self.tests],
            "remainder": [
                residual._asdict()
                | {"levels": [level._asdict() for level in residual.levels], "said": residual.sentence}
                for residual in self.residuals
            ],
        }


@brief
class RigExtra(NamedTuple):
    """What only a rig set has to say of the models before and after."""

    before: FitDiagnostics
    after: FitDiagnostics
    declared: tuple[str, ...] = ()
    "how what is declared of lugs and sand was used"

    def lines(self, added: bool) -> list[str]:
        """Return lines for a reader."""
        lines = [f"declared: {line}" for line in self.declared]
        lines += [f"before: {flag.sentence}" for flag in self.before.flags]
        lines += [f"after: {flag.sentence}" for flag in self.after.flags] if added else []
        return [*lines, *(f"left: {residual.sentence}" for residual in self.after.residuals)]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        sides = {"before": self.before.as_dict(), "after": self.after.as_dict()}
        return {**sides, "declared": list(self.declared)}
