"""What only a drive log has to say besides: free simulations, its ground, how an unlisted effect would act."""

from typing import Any, NamedTuple

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.free_runs import FreeRun
from rover_pin.experiments.drive_log.ground.run_variability import GroundVariability
from rover_pin.experiments.unlisted.residual import DriveResidual


class DriveExtra(NamedTuple):
    """Runs driven freely, what the last model leaves, and what the drives say of their ground."""

    free: tuple[FreeRun, ...] = ()
    residual: DriveResidual | None = None
    ground: GroundVariability | None = None

    def lines(self, added: bool) -> list[str]:
        """Return lines for a reader."""
        lines = [f"free run: {line}" for line in free_lines(self.free)]
        lines += self.ground.lines if self.ground else []
        return [*lines, f"left: {self.residual.description}"] if self.residual else lines

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "free_runs": [run._asdict() for run in self.free],
            "remainder": self.residual.description if self.residual else "",
            "ground": self.ground.as_dict() if self.ground else None,
        }


def extra_of(verdict: Verdict) -> DriveExtra:
    """Return what a drive log's verdict has besides; nothing where the log did not suffice."""
    return verdict.extra if isinstance(verdict.extra, DriveExtra) else DriveExtra()


def free_lines(free: tuple[FreeRun, ...]) -> list[str]:
    """Return one line: how far free simulations diverge from the log."""
    if not free:
        return []
    was, now = (
        float(np.sqrt(np.nanmean([row**2 for row in rows]))) for rows in zip(*[run[2:] for run in free], strict=True)
    )
    after = "" if was == now else f" -> {1e3 * now:.1f} mm"
    return [f"RMS distance from the logged place {1e3 * was:.1f} mm{after} over {len(free)} runs"]
