"""One drive on several equally probable models: what the data that they come from leave open about it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.jobs.cluster import results
from rover_pin.base.public import brief
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.outcome.outcome import drive_outcome
from rover_pin.simulation.trace.trace import Trace

FAILED = ("stuck", "stalled", "slid back", "ended")
"""Outcomes of a drive that does not get on; one that ended has buried a wheel, or fell."""


@brief
@dataclass(frozen=True)
class Bands:
    """The same drive on n models, each a row (n, T); one that ended early stays as it was."""

    t: np.ndarray
    x: np.ndarray
    "of the base [m]"
    slip: np.ndarray
    "mean of the wheels [-]"
    sinkage: np.ndarray
    "of the deepest wheel [m]"
    stuck: tuple[bool, ...]
    "whether it does not get on in the end"
    buried: tuple[bool, ...]
    outcomes: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """Return shares of the models, and median, lowest and highest of what the drive comes to."""
        n = len(self.outcomes)
        return {
            "models": n,
            "stuck": f"{sum(self.stuck)} of {n}",
            "buried": f"{sum(self.buried)} of {n}",
            "end_x_m": _spread(self.x[:, -1]),
            "end_slip": _spread(self.slip[:, -1]),
            "deepest_mm": _spread(1e3 * self.sinkage.max(axis=1)),
            "outcomes": list(self.outcomes),
        }

    @property
    def panels(self) -> dict[str, np.ndarray]:
        """What is drawn, by label and unit."""
        return {"x [m]": self.x, "mean slip [-]": self.slip, "deepest wheel [mm]": 1e3 * self.sinkage}

    def table(self) -> Any:
        """Return a pandas DataFrame: a row a model and time."""
        import pandas as pd

        n, count = self.x.shape
        columns = {"model": np.repeat(np.arange(1, n + 1), count), "t_s": np.tile(self.t, n), "x_m": self.x.ravel()}
        return pd.DataFrame(columns | {"mean_slip": self.slip.ravel(), "deepest_m": self.sinkage.ravel()})


def drive_on_models(
    name: str, files: Sequence[str | Path], settings: dict[str, Any], workers: int | None = None
) -> Bands:
    """Return a ready-made drive on the model of each file; `settings` as of `scenario`, without `model`.

    Raises ParameterError, DataError: as of `scenario`.
    """
    jobs = [(name, str(file), settings) for file in files]
    scenario(name, **{**settings, "model": str(files[0])})  # what is refused is refused before any drive
    drives = list(results(_drive_scenario, jobs, workers or -1))
    t = max((drive[0] for drive in drives), key=len)
    x, slip, sinkage = (np.array([_hold_end(drive[at], len(t)) for drive in drives]) for at in (1, 2, 3))
    kinds, stops, sentences = zip(*(drive[4:] for drive in drives), strict=True)
    buried = tuple(stop.startswith("buried") for stop in stops)
    return Bands(t, x, slip, sinkage, tuple(kind in FAILED for kind in kinds), buried, sentences)


def _drive_scenario(name: str, file: str, settings: dict[str, Any]) -> tuple[Any, ...]:
    trace = scenario(name, **{**settings, "model": file}).drive(measure_error=False)
    outcome = drive_outcome(trace)
    kind, sentence = ("", "not known") if outcome is None else (outcome.kind, outcome.sentence)
    return (*_channels(trace), kind, str(trace.attrs.get("stop", "")), sentence)


def _channels(trace: Trace) -> tuple[np.ndarray, ...]:
    return trace.t, trace["body_x"], trace.stack("slip").mean(axis=1), trace.stack("sinkage").max(axis=1)


def _hold_end(values: np.ndarray, count: int) -> np.ndarray:
    return np.pad(values, (0, count - len(values)), mode="edge")


def _spread(values: np.ndarray) -> str:
    return f"{np.median(values):.3g} [{values.min():.3g}, {values.max():.3g}]"
