"""The error of a drive that its step size causes. It is estimated from a repetition of the drive with another step
size.
"""

from __future__ import annotations

import contextlib
import copy
import math
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.stepping.timing import Timing

NORMAL = RECORD.index("normal")
"""Index of the column of the normal force in the array `record` of a row."""
MARGIN = 2.0
"""Safety factor on the estimated error, which assumes convergence of first order. It allows for drives that do not
converge regularly."""
LOADS = 100.0
"""Tolerance of the relative error of the wheels' loads, divided by the tolerance of x and y [1/m]: 1 % of the loads is
allowed if 0.1 mm is allowed."""


class StepChange(NamedTuple):
    """Difference between a drive and its repetition with another step. The error of the drive that its step size causes
    is estimated from this difference.
    """

    distance: float
    "largest distance between the two drives in x and y [m]"
    load: float
    """largest difference between the mean loads of a wheel in both drives, divided by the mean of all wheels' loads
    [-]"""
    stop: str
    """reason why the repetition ended, if it differs from the reason why the drive ended; otherwise empty"""
    ratio: float
    """step of the repetition divided by the step of the drive"""
    lessens: bool = True
    """whether the estimated error decreased when the step was last halved"""

    @property
    def errors(self) -> dict[str, float]:
        """The estimated errors of the drive, as name of an attribute of the trace -> error: MARGIN |change| / |ratio -
        1|.

        `change` is the difference between the two drives, and `ratio` the step of the repetition divided by the step of
        the drive. With MARGIN = 1 this is Richardson's extrapolation for a first-order method. A change to half the
        step is thus multiplied by 4, a change to twice the step by 2.
        """
        share = MARGIN / abs(self.ratio - 1.0)
        return {"step_error_m": share * self.distance, "step_error_load": share * self.load}

    def excess(self, tolerance: float) -> float:
        """Return the error of the drive divided by its tolerance [-]; above 1, the error is too large. It is the larger
        of the two ratios for the position and for the loads.

        `tolerance` [m] is the tolerance of the position; the tolerance of the loads is LOADS times this number. The
        result is infinite if the repetition of the drive ended for another reason than the drive.
        """
        place_error, load_error = self.errors.values()
        return math.inf if self.stop else max(place_error / tolerance, load_error / (LOADS * tolerance))

    def or_worse(self, change: StepChange) -> StepChange:
        """Return the larger of two step changes, this step change and `change`, after scaling `change` to the step
        ratio of this step change. Position and loads are compared separately.
        """
        scale = abs(self.ratio - 1.0) / abs(change.ratio - 1.0)
        distance, load = max(self.distance, scale * change.distance), max(self.load, scale * change.load)
        return self._replace(distance=distance, load=load, stop=self.stop or change.stop)

    def half_step_change(self) -> StepChange:
        """Return the part of the change that is expected to remain after the step is halved: a quarter, as for a
        second-order method.

        A smaller error of the drive with halved steps is not believed, because it may have occurred by chance, for
        example because both drives passed an obstacle on one side.
        """
        return self._replace(distance=0.25 * self.distance, load=0.25 * self.load, stop="")

    def warning(self, tolerance: float) -> str:
        """Return a warning if the error of the drive exceeds its tolerance [m], or an empty string."""
        if self.excess(tolerance) <= 1.0:
            return ""
        place_error, load_error = self.errors.values()
        stop_text = f" (with another step, the drive ends differently: {self.stop})" if self.stop else ""
        advice = "give a smaller dt"
        if not self.lessens:
            advice = "halving the step does not reduce this error, so that no step is safe"
        return (
            f"the step's error exceeds the tolerance: it is up to {1e3 * place_error:.2g} mm in x and y "
            f"({1e3 * tolerance:g} mm allowed) and {100 * load_error:.2g} % of the loads "
            f"({100 * LOADS * tolerance:g} % allowed){stop_text}: {advice}."
        )


def step_change(first: tuple[np.ndarray, str], second: tuple[np.ndarray, str], ratio: float) -> StepChange:
    """Return the difference between a drive and its repetition with another step.

    Parameters
    ----------
    first, second : tuples (rows, stop)
        The drive and its repetition: the rows (`row_type`) of each, and the reason of its end.
    ratio : float
        Step of the repetition divided by the step of the drive.
    """
    (rows, stop), (other_rows, other_stop) = first, second
    # A drive may end before its repetition; only rows that both have are compared.
    n, places = min(len(rows), len(other_rows)), rows["q"][:, :2]
    distances = np.linalg.norm(places[:n] - other_rows["q"][:n, :2], axis=1)
    loads, other_loads = (drive["record"][:n, :, NORMAL].sum(axis=0) for drive in (rows, other_rows))
    change, mean = float(np.max(np.abs(other_loads - loads), initial=0.0)), float(np.mean(loads))
    load = change / mean if mean > np.finfo(float).eps * change else 0.0  # a rover in the air has no loads
    # Only the kind of a failure is compared, not its time.
    kinds = [text.split(" ")[0].rstrip(":") for text in (stop, other_stop)]
    new_stop = other_stop if kinds[0] != kinds[1] else ""
    return StepChange(float(np.max(distances, initial=0.0)), load, new_stop, ratio)


def complete_steps(lengths: np.ndarray, dt: float, duration: float) -> np.ndarray:
    """Return the lengths of a drive's steps [s] for its whole `duration` [s]. If the drive ended earlier, steps of the
    length `dt` [s] are added for the missing time.
    """
    return np.append(lengths, np.full(max(0, round((duration - float(lengths.sum())) / dt)), dt))


def repeating(controller: Controller, rows: np.ndarray, timing: Timing) -> Controller | None:
    """Return a controller that repeats the commands of a drive of `controller`; None if these commands are not known.

    A controller of the package is copied and reset; it is recognised by the method `native` of its innermost
    controller. A user-supplied controller may remember its readings or write them to a file, so that it is not called
    again. Instead, the commands in the rows of the drive are repeated, if each control period has a row.

    Parameters
    ----------
    controller : Controller
        The controller of the drive.
    rows : array (`row_type`)
        The rows of the drive.
    timing : Timing
        Control period and time between rows of the drive.
    """
    if hasattr(innermost(controller), "native"):
        with contextlib.suppress(TypeError, ValueError):  # a slip estimate that cannot be copied
            again = copy.deepcopy(controller)
            if hasattr(again, "reset"):
                again.reset()
            return again
    ratio = timing.control / timing.sample
    return controller_of_rows(rows, timing.sample) if len(rows) and abs(ratio - round(ratio)) < 1e-6 else None


def innermost(controller: Controller) -> Controller:
    """Return the controller that computes the commands, if `controller` is wrapped around it: without the outer
    controllers that only limit the commands, stop the rover, or add noise to the readings.
    """
    while hasattr(controller, "controller"):
        controller = controller.controller
    return controller


def controller_of_rows(rows: np.ndarray, sample: float) -> Controller:
    """Return a controller that gives the commands (duties and steering angles) that the rows of a drive contain. The
    rows are `sample` [s] apart.
    """
    begin = float(rows["t"][0]) - sample

    def controller(reading: Reading) -> Command:
        row = rows[min(round((reading.t - begin) / sample), len(rows) - 1)]
        return Command(row["duty"], row["servo"])

    return controller
