"""Runs driven freely from their start, not drawn to the log: how far they diverge; what a drive verdict has besides."""

from typing import Any, NamedTuple

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import PATH
from rover_pin.experiments.drive_log.ground.run_variability import GroundVariability
from rover_pin.experiments.unlisted.residual import DriveResidual
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import Commands


class FreeRun(NamedTuple):
    """One run driven freely from its start, without being drawn to the log: how far off the place was."""

    run: str
    distance: float
    "driven in the log [m]"
    before: float
    "RMS of the distance from the logged place, base model [m]"
    after: float
    "the same with what was added [m]"


def free_runs(experiment: DriveExperiment, before: Model, after: Model) -> tuple[FreeRun, ...]:
    """Return how far the free simulations of all runs diverge from the log, before and after; of odometry nothing."""
    if PATH not in experiment.channels:
        return ()
    strayed = [
        [
            _rms_distance(run.commands, replay.channels)
            for run, replay in zip(experiment.runs, experiment.free.replays(model), strict=True)
        ]
        for model in (before, after)
    ]
    return tuple(
        FreeRun(run.name, _distance(run.commands), was, now)
        for run, was, now in zip(experiment.runs, strayed[0], strayed[1], strict=True)
    )


def _rms_distance(run: Commands, channels: dict[str, np.ndarray]) -> float:
    if "body_x" not in channels:
        return float("nan")
    off = np.hypot(channels["body_x"] - run.place[:, 0], channels["body_y"] - run.place[:, 1])
    return float(np.sqrt(np.nanmean(off**2)))


def _distance(run: Commands) -> float:
    steps = run.place[:: max(1, round(1.0 / run.period)), :2]
    return float(np.nansum(np.hypot(*np.diff(steps, axis=0).T)))


class DriveExtra(NamedTuple):
    """Runs driven freely, what the last model leaves, and what the drives say of their ground."""

    free: tuple[FreeRun, ...] = ()
    residual: DriveResidual | None = None
    ground: GroundVariability | None = None

    def lines(self, added: bool) -> list[str]:
        """Return lines for a reader."""
        lines = []
        if self.free:
            was, now = distances_of(self.free)
            after = "" if was == now else f" -> {1e3 * now:.1f} mm"
            way = f"RMS distance from the logged place {1e3 * was:.1f} mm{after}"
            lines.append(f"free run: {way} over {len(self.free)} runs")
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


def distances_of(free: tuple[FreeRun, ...]) -> tuple[float, float]:
    """Return the RMS distance of all free runs from the logged place, before and after [m]."""
    rows = np.array([(free_run.before, free_run.after) for free_run in free])
    was, now = (float(np.sqrt(np.nanmean(side**2))) if np.isfinite(side).any() else float("nan") for side in rows.T)
    return was, now
