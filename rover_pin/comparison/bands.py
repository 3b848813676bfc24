"""Drive a scenario on several equally probable models. The spread of the results is the uncertainty of the drive."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.jobs.cluster import results
from rover_pin.base.public import brief
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.engines import COMPILED
from rover_pin.simulation.outcome.outcome import drive_outcome

FAILED = ("stuck", "stalled", "slid back", "ended")
"""The outcomes of a drive that count as stuck. The outcome "ended" means that a wheel was buried or the rover fell
over."""


@brief
@dataclass(frozen=True)
class Bands:
    """Results of driving one scenario on n models, at T common times.

    If a drive ended early, its last state is repeated until the end of the longest drive.
    """

    t: np.ndarray
    "time [s] (T,)"
    x: np.ndarray
    """position of the rover's base along x [m] (n, T)"""
    slip: np.ndarray
    """slip, as the mean over the wheels [-] (n, T)"""
    sinkage: np.ndarray
    """sinkage of the wheel that is deepest in the soil [m] (n, T)"""
    stuck: tuple[bool, ...]
    """for each model, whether the outcome of its drive is one of FAILED (n)"""
    buried: tuple[bool, ...]
    """for each model, whether a buried wheel ended its drive (n)"""
    outcomes: tuple[str, ...]
    """for each model, the outcome of its drive as a sentence (n)"""

    def summary(self) -> dict[str, Any]:
        """Return the number of models on which the rover is stuck or buried, and the median and range of the final
        values.
        """
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
        """The channels that the figure draws: a dict from label with unit to values (n, T)."""
        return {"x [m]": self.x, "mean slip [-]": self.slip, "deepest wheel [mm]": 1e3 * self.sinkage}

    def table(self) -> Any:
        """Return all drives as a pandas DataFrame with one row for each model and time."""
        import pandas as pd

        n, count = self.x.shape
        columns = {"model": np.repeat(np.arange(1, n + 1), count), "t_s": np.tile(self.t, n), "x_m": self.x.ravel()}
        return pd.DataFrame(columns | {"mean_slip": self.slip.ravel(), "deepest_m": self.sinkage.ravel()})


def drive_on_models(
    name: str, files: Sequence[str | Path], settings: dict[str, Any], workers: int | None = None, engine: str = COMPILED
) -> Bands:
    """Drive the scenario `name` on the model in each file, and return the results of all drives at common times.

    Parameters
    ----------
    name : str
        Name of a ready-made scenario, such as "flat".
    files : sequence of paths
        Model files, for example the files in the folder `posterior` of a close-loop run.
    settings : dict
        Settings of `scenario` except `model`.
    workers : int, optional
        Number of processes; by default one for each core.
    engine : str
        The engine that computes the steps (see `simulate`).

    Raises
    ------
    ParameterError, DataError
        If `scenario` refuses a setting or a file.
    """
    # Building one scenario first refuses wrong settings at once, before any process starts.
    scenario(name, **{**settings, "model": str(files[0])})
    jobs = [(name, str(file), settings, engine) for file in files]
    drives = list(results(_drive_scenario, jobs, workers or -1))
    # All drives are recorded at the same interval, so the longest list of times contains all others.
    t = max((times for times, *_ in drives), key=len)
    # A drive that ended early is extended by its last row, so that all drives have the length of the longest.
    x, slip, sinkage = (
        np.array([np.pad(drive[channel], (0, len(t) - len(drive[channel])), mode="edge") for drive in drives])
        for channel in (1, 2, 3)
    )
    kinds, stops, sentences = zip(*(drive[4:] for drive in drives), strict=True)
    buried = tuple(stop.startswith("buried") for stop in stops)
    return Bands(t, x, slip, sinkage, tuple(kind in FAILED for kind in kinds), buried, sentences)


def _drive_scenario(name: str, file: str, settings: dict[str, Any], engine: str) -> tuple[Any, ...]:
    """Drive the scenario `name` on the model in `file` with an engine, and return the results that `Bands` needs.

    The result is a tuple of times [s] (T,), x [m] (T,), slip as the mean over the wheels (T,), largest sinkage [m]
    (T,), kind of outcome, reason of an early end, and outcome as a sentence.
    """
    trace = scenario(name, **{**settings, "model": file}).drive(measure_error=False, engine=engine)
    # A trace without the channels from which an outcome follows gives None. Such a drive does not count as stuck.
    outcome = drive_outcome(trace)
    kind, sentence = ("", "not known") if outcome is None else (outcome.kind, outcome.sentence)
    slip, sinkage = trace.stack("slip").mean(axis=1), trace.stack("sinkage").max(axis=1)
    return (trace.t, trace["body_x"], slip, sinkage, kind, str(trace.attrs.get("stop", "")), sentence)


def _spread(values: np.ndarray) -> str:
    """Return the median of some values and, in brackets, their smallest and largest value, as text."""
    return f"{np.median(values):.3g} [{values.min():.3g}, {values.max():.3g}]"
