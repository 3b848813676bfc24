"""What only a drive log has to say besides: free simulations, its ground, how an unlisted effect would act."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.free_runs import FreeRun
from rover_pin.experiments.drive_log.ground.raked import Raked
from rover_pin.experiments.unlisted.remainder import Remainder


class DriveExtra(NamedTuple):
    """Runs driven freely, what the last model leaves, and what the drives say of their ground."""

    free: tuple[FreeRun, ...] = ()
    remainder: Remainder | None = None
    ground: Raked | None = None

    def lines(self, added: bool) -> list[str]:
        """Return lines for a reader."""
        said = [f"free run: {line}" for line in free_lines(self.free)]
        said += self.ground.lines if self.ground else []
        return [*said, f"left: {self.remainder.said}"] if self.remainder else said

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "free_runs": [one._asdict() for one in self.free],
            "remainder": self.remainder.said if self.remainder else "",
            "ground": self.ground.as_dict() if self.ground else None,
        }


def extra_of(verdict: Verdict) -> DriveExtra:
    """Return what a drive log's verdict has besides; nothing where the log did not suffice."""
    return verdict.extra if isinstance(verdict.extra, DriveExtra) else DriveExtra()


def free_lines(free: tuple[FreeRun, ...]) -> list[str]:
    """Return one line: how far free simulations stray from the log."""
    if not free:
        return []
    was, now = (
        float(np.sqrt(np.nanmean([row**2 for row in rows]))) for rows in zip(*[one[2:] for one in free], strict=True)
    )
    after = "" if was == now else f" -> {1e3 * now:.1f} mm"
    return [f"RMS distance from the logged place {1e3 * was:.1f} mm{after} over {len(free)} runs"]
