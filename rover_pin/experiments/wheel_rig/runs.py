"""Runs of one wheel-rig data set as arrays, with the predictions of a model and their exact derivatives by the
parameters.

A fold is a group of runs that are held out together. It is either a slip level or a pressing trial, which presses the
wheel into the sand without rolling.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from rover_pin.estimation.experiment import Sensitivities
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import MAJORITY
from rover_pin.experiments.folded import stack
from rover_pin.experiments.wheel_rig.declared import own_name
from rover_pin.experiments.wheel_rig.model import RigModel, RigPredictor, conditions, predictor, uncarried_runs
from rover_pin.experiments.wheel_rig.steady_law import pressed_law
from rover_pin.measurements.channel import RIG_CHANNELS
from rover_pin.measurements.pressed import Trial
from rover_pin.measurements.rig_set import RigSet

PRESSED = "logarithm of pressing force"
"""Name of the channel of pressing trials. Each trial is held out on its own, because the sand is prepared anew for each
trial and may differ."""
FORCE_SD, DEPTH_SD = 0.05, 0.001
"""Relative SD of a pressing force, because sand yields in steps; and SD of the depth at this force [m], because the
surface is not perfectly level (both assumed)."""


@dataclass(frozen=True, eq=False)
class RigRuns:
    """Runs of one wheel-rig data set as arrays (folds, channels, samples), with the stated noise of each value.

    A fold is a group of runs that are held out together: the runs of one slip level, or one pressing trial, which
    presses the wheel into the sand without rolling. The slip levels come first, then the trials. The samples of a slip
    level are its runs, and the samples of a trial are its depths. Pressing trials have a channel of their own. Folds
    with fewer samples than the longest one are filled up with NaN.
    """

    data: RigSet

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the measured channels, and of the channel of pressing trials if there are trials."""
        names = tuple(channel.name for channel in self.data.channels)
        return (*names, PRESSED) if self.data.trials else names

    @property
    def folds(self) -> tuple[str, ...]:
        """Names of the groups of runs that are held out together: first the slip levels, then the pressing trials."""
        return (*self.data.level_names, *(f"pressed in: {trial.name}" for trial in self.data.trials))

    @cached_property
    def _place(self) -> np.ndarray:
        """Index of each run among the runs of its slip level (runs,)."""
        run_counts = np.zeros(len(self.data.level_names), dtype=int)
        place = np.zeros(self.data.level.size, dtype=int)
        for run, level in enumerate(self.data.level):
            place[run], run_counts[level] = run_counts[level], run_counts[level] + 1
        return place

    def table(self, rows: np.ndarray) -> np.ndarray:
        """Return values of the runs sorted by slip level, as a table (..., levels, channels, runs of a level).

        `rows` (..., channels, runs) holds the values in the order of the runs. Levels with fewer runs are filled up
        with NaN.
        """
        rows = np.asarray(rows)
        levels, longest = len(self.data.level_names), int(self._place.max()) + 1
        padded_table = np.full((*rows.shape[:-2], levels, rows.shape[-2], longest), np.nan)
        padded_table[..., self.data.level, :, self._place] = np.moveaxis(rows, -1, 0)
        return padded_table

    def _whole(self, rows: np.ndarray, pressed: np.ndarray) -> np.ndarray:
        """Join the values of the runs and of the pressing trials to one table (..., folds, channels, samples).

        `rows` (..., channels, runs) holds the values of the runs and `pressed` (..., trials, 1, samples) the values of
        the trials. Trials are folds after the slip levels, with a channel of their own. All other cells are NaN.
        """
        runs, count = self.table(rows), len(self.data.channels)
        return stack([(runs, range(count)), (pressed, [count])], count + 1, np.nan) if self.data.trials else runs

    def rows(self, table: np.ndarray) -> np.ndarray:
        """Return the values of a table (folds, channels, samples) as rows (channels, runs), in the order of the runs.

        Pressing trials are omitted.
        """
        return np.asarray(table[self.data.level, : len(self.data.channels), self._place]).T

    def in_sds(self, residual: np.ndarray) -> np.ndarray:
        """Return a residual divided by the stated SDs, as rows (channels, runs) in the order of the runs.

        `residual` has the shape (folds, channels, samples). Pressing trials are omitted.
        """
        return self.rows(residual) / np.array([channel.sd for channel in self.data.channels])

    @cached_property
    def observed(self) -> np.ndarray:
        """Measured values (folds, channels, samples); NaN in cells without a measurement."""
        measured = np.array([channel.measured for channel in self.data.channels])
        return self._whole(measured, log_forces(self.data.trials))

    @cached_property
    def sds(self) -> np.ndarray:
        """Stated SD of each value (folds, channels, samples); 1 in cells without a measurement."""
        sds = np.array([channel.sd for channel in self.data.channels])
        padded = self._whole(sds, log_force_sds(self.data.trials))
        return np.where(np.isfinite(padded), padded, 1.0)

    @property
    def rms_sd(self) -> np.ndarray:
        """RMS of the stated SDs of each channel (channels,)."""
        return np.array([float(np.sqrt(np.mean(channel.sd**2))) for channel in self.data.channels])

    @property
    def inputs(self) -> np.ndarray:
        """Inputs of the simple curves for the comparison with the model (levels, runs of a level, inputs).

        The inputs are the slip, and also the slip angle and the load if they vary.
        """
        rig = self.data
        rows = [rig.slip, *([rig.slip_angle] if rig.askew.any() else [])]
        rows += [rig.load] if rig.loads_vary else []
        return np.moveaxis(self.table(np.array(rows)), 1, 2)

    @property
    def varied(self) -> np.ndarray:
        """Inputs of each sample (folds, samples, inputs) on which a smooth deviation between model and data may depend.

        The inputs are the slip, the slip angle, and the logarithms of the load and of the faster of travel and rim
        speed. The speed is omitted if the data set states no speeds.
        """
        rig = self.data
        # Loads and speeds act by their ratios, so their logarithms are used.
        rows = [rig.slip, rig.slip_angle, np.log(rig.load)]
        rows += [] if self.data.speeds is None else [np.log(np.abs(self.data.speeds).max(axis=1))]
        table = self.table(np.array(rows))
        if self.data.trials:
            parts = [(part, range(len(rows))) for part in (table, places(self.data.trials, np.array(rows)))]
            table = stack(parts, len(rows), np.nan)
        return np.moveaxis(table, 1, 2)

    @cached_property
    def _conditions(self) -> np.ndarray:
        """Inputs of the runs for the compiled functions of steady runs (runs, 5), as `conditions` returns them."""
        rig = self.data
        return conditions(rig.load, rig.slip, self.data.speeds, rig.slip_angle)

    @cached_property
    def _predictors(self) -> dict[Any, RigPredictor]:
        """Compiled functions that were already made: (structure of the model, names of the free parameters) ->
        function.
        """
        return {}

    def sensitivities(self, model: RigModel, parameters: Sequence[Parameter], u: np.ndarray) -> Sensitivities:
        """Return the channels that a model predicts, and their exact derivatives by the parameters.

        The values of a run are NaN if no sinkage down to the axle carries its load.

        Parameters
        ----------
        model : RigModel
            The model. It gives the values of all parameters that are not in `parameters`.
        parameters : sequence of Parameter
            The parameters for the derivatives of the channels.
        u : array (parameters,)
            Values of the parameters in fit coordinates, that is, in units of the prior SD.
        """
        free, vector = tuple(map(own_name, (parameter.name for parameter in parameters))), model.vector()
        where = [model.names.index(name) for name in free]
        vector[where] = [parameter.value(x) for parameter, x in zip(parameters, u, strict=True)]
        # Compiling a law takes much longer than evaluating it, so each structure is compiled once.
        key = (model.structure, free)
        if key not in self._predictors:
            self._predictors[key] = predictor(model, free, self._conditions)
        values, jacobian, _ = self._predictors[key](vector)
        measured = [RIG_CHANNELS.index(type(channel)) for channel in self.data.channels]
        # The law gives derivatives by the values of the parameters, and the fit needs derivatives by u (chain rule).
        slopes = np.array([parameter.slope(x) for parameter, x in zip(parameters, u, strict=True)])
        derivatives = np.moveaxis(jacobian[measured] * slopes, -1, 0)
        pressed, by_pressed = pressed_in(model, free, vector, self.data.trials)
        by_pressed *= slopes.reshape(-1, 1, 1, 1)
        return Sensitivities(self._whole(values[measured], pressed), self._whole(derivatives, by_pressed))

    def unpredicted_part(self, model: RigModel) -> str:
        """Return a clause on the runs that the model cannot predict; an empty text if the model predicts every run.

        A run cannot be predicted if no sinkage down to the axle carries its load.
        """
        values = predictor(model, (), self._conditions)(model.vector()).values
        return uncarried_runs(values, self.data.load, self.data.slip)

    def turns(self) -> np.ndarray | None:
        """Return the position of each run in the order of measurement (folds, samples), so that a drift can be
        identified.

        The order of measurement is the order of the rows in points.csv. Pressing trials have the position 0. If most
        runs follow a run of their own slip level, the result is None, because a drift then cannot be distinguished from
        an offset of a level.
        """
        # If runs of one level follow each other, time and level change together.
        order = np.arange(self.data.level.size)
        if np.mean(np.diff(self.data.level) == 0) > MAJORITY:
            return None
        table = self._whole(order[None].astype(float), log_forces(self.data.trials))
        return np.nan_to_num(table[:, 0]).astype(int)


def log_forces(trials: Sequence[Trial]) -> np.ndarray:
    """Return the logarithms of the pressing forces [N] of the trials (trials, 1, samples)."""
    return np.log([[trial.force] for trial in trials])


def log_force_sds(trials: Sequence[Trial]) -> np.ndarray:
    """Return the SDs of the logarithms of the pressing forces of the trials (trials, 1, samples).

    Each SD combines the relative error of the force with the error of the depth, converted to an error of the force.
    """
    # An error of the depth acts like an error of the force on a steep curve.
    slopes = np.array([[np.gradient(np.log(trial.force), trial.sinkage)] for trial in trials])
    return np.hypot(FORCE_SD, DEPTH_SD * slopes)


def places(trials: Sequence[Trial], inputs: np.ndarray) -> np.ndarray:
    """Return the inputs of pressing trials on which a smooth deviation between model and data may depend.

    The result has the shape (trials, inputs, samples). A pressed wheel has no slip. The depth, scaled to the range of
    the slips, takes its place. All other inputs are at their minimum.

    Parameters
    ----------
    trials : sequence of Trial
        The pressing trials.
    inputs : array (inputs, runs)
        The inputs of the runs, slip first.
    """
    depth = np.array([trial.sinkage for trial in trials])
    share = (depth - depth.min()) / np.ptp(depth)
    table = np.tile(inputs.min(axis=1)[:, None], (len(depth), 1, depth.shape[1]))
    table[:, 0] += share * np.ptp(inputs[0])
    return table


def pressed_in(
    model: RigModel, free: Sequence[str], vector: np.ndarray, trials: Sequence[Trial]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the predicted logarithms of the forces in pressing trials, and their derivatives by the parameters `free`.

    The logarithms have the shape (trials, 1, samples) and the derivatives (free, trials, 1, samples). `vector` holds
    the values of all parameters of the model, in the order of `RigModel.names`.
    """
    # Arrays without trials, so that callers need no special case.
    if not trials:
        return np.zeros((0, 1, 0)), np.zeros((len(free), 0, 1, 0))
    depth = np.array([trial.sinkage for trial in trials])
    plates = np.array([(0.0, 1.0, 1.0) if trial.plate is None else (1.0, *trial.plate) for trial in trials])
    indenters = np.vstack([depth.reshape(1, -1), np.repeat(plates, depth.shape[1], axis=0).T])
    law = pressed_law(model.structure, tuple(free), depth.size)
    rows = law(ca.DM(indenters), ca.DM(vector)).full().reshape(-1, len(trials), 1, depth.shape[1])
    return rows[0], rows[1:]
