"""What a model leaves of a rig set: constants against other measurements, channel residuals, and what they go with."""

from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.numbers import Number
from rover_pin.experiments.wheel_rig.channel_residual import RigChannelResidual, channel_residuals
from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.experiments.wheel_rig.known_elsewhere import Flag, flags
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.residual_tests import ResidualTest, residual_tests


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


def diagnose(
    data: RigSet, model: RigModel, numbers: tuple[Number, ...], residual: np.ndarray, seed: int
) -> FitDiagnostics:
    """Return what a model leaves of a set (channels, runs) [SD], and its constants against other measurements."""
    reference_flags = flags(data, model.soil, float(model.wheel.b), numbers)
    return FitDiagnostics(reference_flags, channel_residuals(data, residual), residual_tests(data, residual, seed))


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
