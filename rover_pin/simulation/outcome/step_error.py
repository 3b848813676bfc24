"""What the step makes of a drive: once more at another, under its controller or the commands that it gave."""

from __future__ import annotations

import contextlib
import copy
import math
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.timing import Timing

NORMAL = RECORD.index("normal")
MARGIN = 2.0
"""What is said over the error of first order: of 942 random drives 3 are further off, 3.0 times less in the median."""
LOADS = 100.0
"""Tolerance of the loads, as a share of them, over that of the place [1/m]: 1 % where that is 0.1 mm."""


class StepChange(NamedTuple):
    """What another step makes of a drive."""

    distance: float
    "greatest distance between the two in x and y [m]"
    load: float
    "greatest change of the mean of a wheel's load, over the mean of all [-]"
    stop: str
    "why the drive at the other step stopped, where that is for another reason; else nothing"
    ratio: float
    "of the other step to the drive's own"
    lessens: bool = True
    "whether a smaller step lessened the error, the last time that it was tried"

    @property
    def errors(self) -> dict[str, float]:
        """The drive's own errors: MARGIN |change| / |ratio - 1|, Richardson's extrapolation where MARGIN were 1."""
        share = MARGIN / abs(self.ratio - 1.0)
        return {"step_error_m": share * self.distance, "step_error_load": share * self.load}

    def excess(self, tolerance: float) -> float:
        """Return the errors over their tolerance [m] and LOADS times that, whichever is the greater."""
        off, load = self.errors.values()
        return math.inf if self.stop else max(off / tolerance, load / (LOADS * tolerance))

    def or_worse(self, change: StepChange) -> StepChange:
        """Return the greater of two changes, the second as it were at this one's ratio."""
        scale = abs(self.ratio - 1.0) / abs(change.ratio - 1.0)
        distance, load = max(self.distance, scale * change.distance), max(self.load, scale * change.load)
        return self._replace(distance=distance, load=load, stop=self.stop or change.stop)

    def half_step_change(self) -> StepChange:
        """Return what is left of a change when the step is halved: a quarter, as the step is of second order at best.

        Errors that fell by more did so by chance: two drives that pass the same side of what divides them.
        """
        return self._replace(distance=0.25 * self.distance, load=0.25 * self.load, stop="")

    def warning(self, tolerance: float) -> str:
        """Return the sentence that a drive owes which does not keep its tolerance [m], or nothing."""
        if self.excess(tolerance) <= 1.0:
            return ""
        off, load = self.errors.values()
        stop_text = f" (another step ends it: {self.stop})" if self.stop else ""
        advice = "give a smaller dt" if self.lessens else "half the step does not lessen it, so that none is sure"
        return (
            f"the step's error is over the tolerance: up to {1e3 * off:.2g} mm in x and y, {1e3 * tolerance:g} mm "
            f"allowed, and {100 * load:.2g} % of the loads, {100 * LOADS * tolerance:g} % allowed{stop_text}: {advice}."
        )


def step_change(first: tuple[np.ndarray, str], second: tuple[np.ndarray, str], ratio: float) -> StepChange:
    """Return what another step of a ratio made of a drive, from the rows (`row_type`) of both and why they stopped."""
    (rows, stop), (at_other, stop_at_other) = first, second
    n, places = min(len(rows), len(at_other)), rows["q"][:, :2]
    off = np.linalg.norm(places[:n] - at_other["q"][:n, :2], axis=1)
    loads, loads_at_other = (drive["record"][:n, :, NORMAL].sum(axis=0) for drive in (rows, at_other))
    change, mean = float(np.max(np.abs(loads_at_other - loads), initial=0.0)), float(np.mean(loads))
    load = change / mean if mean > np.finfo(float).eps * change else 0.0  # a rover that never stands has no loads
    new_stop = stop_at_other if _kind(stop_at_other) != _kind(stop) else ""
    return StepChange(float(np.max(off, initial=0.0)), load, new_stop, ratio)


def complete_steps(lengths: np.ndarray, dt: float, duration: float) -> np.ndarray:
    """Return the steps [s] of a drive, and undivided ones for what is left where it ended early."""
    return np.append(lengths, np.full(max(0, round((duration - float(lengths.sum())) / dt)), dt))


def _kind(stop: str) -> str:
    return stop.split(" ")[0].rstrip(":")


def repeating(controller: Controller, rows: np.ndarray, timing: Timing) -> Controller | None:
    """Return what drives once more as a controller did; None where the rows do not hold all of its commands.

    A controller of the package itself, from its start, as `native` of the innermost tells; of one of your own, which
    may remember or write down what it is asked, the commands it gave, if they lie in the rows.
    """
    if hasattr(innermost(controller), "native"):
        with contextlib.suppress(TypeError, ValueError):  # an estimate that cannot be copied
            again = copy.deepcopy(controller)
            if hasattr(again, "reset"):
                again.reset()
            return again
    ratio = timing.control / timing.sample
    return controller_of_rows(rows, timing.sample) if len(rows) and abs(ratio - round(ratio)) < 1e-6 else None


def innermost(controller: Controller) -> Controller:
    """Return the controller within those that only limit it, stop it, or read sensors for it."""
    while hasattr(controller, "controller"):
        controller = controller.controller
    return controller


def controller_of_rows(rows: np.ndarray, sample: float) -> Controller:
    """Return the controller that gives the commands under which these rows were driven."""
    begin = float(rows["t"][0]) - sample

    def controller(reading: Reading) -> Command:
        row = rows[min(round((reading.t - begin) / sample), len(rows) - 1)]
        return Command(row["duty"], row["servo"])

    return controller
