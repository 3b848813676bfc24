"""A drive log's model with its uncertain numbers fitted: from where the loop looks for what is missing."""

from __future__ import annotations

from collections.abc import Callable

from rover_pin.cluster import Workers
from rover_pin.discrepancy.search import calibrated
from rover_pin.estimation.fit import Fit
from rover_pin.experiments.drive_log.experiment import experiment_of
from rover_pin.experiments.drive_log.features import logged_runs
from rover_pin.experiments.drive_log.model import nuisances
from rover_pin.experiments.drive_log.raw_currents import raw_current_numbers, with_raw_currents
from rover_pin.experiments.drive_log.resume import Memory
from rover_pin.motion.drive_log import DriveLog
from rover_pin.motion.model import Model


def calibrated_on(
    log: DriveLog, model: Model, jobs: Workers, progress: Callable[[str], None], memory: Memory = Memory()
) -> Fit:
    """Return the model fitted to a log, every run replayed from where the rover stood at its start."""
    model = with_raw_currents(log, model)
    progress("setting the rover down at every start")
    experiment = experiment_of(logged_runs(log, model.rover), model, jobs, memory)
    progress("calibrating the base model")
    return calibrated(experiment, model, (*nuisances(log, model), *raw_current_numbers(log, model)))
