"""The runs of a wheel-rig set as arrays: levels of slip and pressings are its folds, its channels have exact slopes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from rover_pin.estimation.experiment import Sensitivities
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import MOST
from rover_pin.experiments.folded import stack
from rover_pin.experiments.wheel_rig.declared import own_name
from rover_pin.experiments.wheel_rig.model import RigModel, RigPredictor, conditions, predictor, uncarried_runs
from rover_pin.experiments.wheel_rig.steady_law import pressed_law
from rover_pin.measurements.channel import RIG_CHANNELS
from rover_pin.measurements.pressed import Trial
from rover_pin.measurements.rig_set import RigSet

PRESSED = "logarithm of pressing force"
"""The channel; each trial is a fold of it, as sand is prepared anew and may be stiffer by chance."""
GIVES_WAY, LEVEL = 0.05, 0.001
"""SD of a force over it, as sand gives way in steps, and SD of the depth, as it is level [m] (assumed)."""


@dataclass(frozen=True, eq=False)
class RigRuns:
    """The runs of a rig set as arrays (levels, channels, runs of a level); noise as stated with each value.

    Pressings are folds behind the levels, in a channel of their own.
    """

    data: RigSet

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the measured channels."""
        names = tuple(channel.name for channel in self.data.channels)
        return (*names, PRESSED) if self.data.trials else names

    @property
    def folds(self) -> tuple[str, ...]:
        """Names of the levels, and of pressings."""
        return (*self.data.level_names, *(f"pressed in: {trial.name}" for trial in self.data.trials))

    @cached_property
    def _place(self) -> np.ndarray:
        """Which run of its level each run is."""
        run_counts = np.zeros(len(self.data.level_names), dtype=int)
        place = np.zeros(self.data.level.size, dtype=int)
        for at, level in enumerate(self.data.level):
            place[at], run_counts[level] = run_counts[level], run_counts[level] + 1
        return place

    def table(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (..., channels, runs) as (..., levels, channels, runs of a level), NaN behind a level's end."""
        rows = np.asarray(rows)
        levels, longest = len(self.data.level_names), int(self._place.max()) + 1
        padded_table = np.full((*rows.shape[:-2], levels, rows.shape[-2], longest), np.nan)
        padded_table[..., self.data.level, :, self._place] = np.moveaxis(rows, -1, 0)
        return padded_table

    def _whole(self, rows: np.ndarray, pressed: np.ndarray) -> np.ndarray:
        """Return the table of rows (..., channels, runs), and below it that of the pressings (..., trials, 1, samples).

        NaN is where one of them has nothing.
        """
        runs, count = self.table(rows), len(self.data.channels)
        return stack([(runs, range(count)), (pressed, [count])], count + 1, np.nan) if self.data.trials else runs

    def rows(self, table: np.ndarray) -> np.ndarray:
        """Return a table (folds, channels, samples) as rows (channels of runs, runs) in the order of the set."""
        return np.asarray(table[self.data.level, : len(self.data.channels), self._place]).T

    def in_sds(self, residual: np.ndarray) -> np.ndarray:
        """Return a residual (levels, channels, runs of a level) as rows (channels, runs), each in its stated SD."""
        return self.rows(residual) / np.array([channel.sd for channel in self.data.channels])

    @cached_property
    def observed(self) -> np.ndarray:
        """What was measured; NaN behind a level's end."""
        measured = np.array([channel.measured for channel in self.data.channels])
        return self._whole(measured, log_forces(self.data.trials))

    @cached_property
    def sds(self) -> np.ndarray:
        """The stated SD of each value; 1 behind a level's end."""
        sds = np.array([channel.sd for channel in self.data.channels])
        padded = self._whole(sds, log_force_sds(self.data.trials))
        return np.where(np.isfinite(padded), padded, 1.0)

    @property
    def rms_sd(self) -> np.ndarray:
        """RMS of the stated SDs of every channel (channels,)."""
        return np.array([float(np.sqrt(np.mean(channel.sd**2))) for channel in self.data.channels])

    @property
    def inputs(self) -> np.ndarray:
        """What was set (levels, runs of a level, inputs): slip, and slip angle and load where they differ."""
        rig = self.data
        rows = [rig.slip, *([rig.slip_angle] if rig.askew.any() else [])]
        rows += [rig.load] if rig.loads_vary else []
        return np.moveaxis(self.table(np.array(rows)), 1, 2)

    @property
    def varied(self) -> np.ndarray:
        """What was set (levels, runs of a level, inputs): slip, slip angle, logarithms of load and travel speed."""
        rig = self.data
        rows = [rig.slip, rig.slip_angle, np.log(rig.load)]
        rows += [] if self.data.speeds is None else [np.log(np.abs(self.data.speeds).max(axis=1))]
        table = self.table(np.array(rows))
        if self.data.trials:
            parts = [(part, range(len(rows))) for part in (table, places(self.data.trials, np.array(rows)))]
            table = stack(parts, len(rows), np.nan)
        return np.moveaxis(table, 1, 2)

    @cached_property
    def _conditions(self) -> np.ndarray:
        rig = self.data
        return conditions(rig.load, rig.slip, self.data.speeds, rig.slip_angle)

    @cached_property
    def _predictors(self) -> dict[Any, RigPredictor]:
        return {}

    def sensitivities(self, model: RigModel, parameters: Sequence[Parameter], u: np.ndarray) -> Sensitivities:
        """Return the channels and their exact slopes; NaN where no sinkage carries the load."""
        free, vector = tuple(map(own_name, (parameter.name for parameter in parameters))), model.vector()
        where = [model.names.index(name) for name in free]
        vector[where] = [parameter.value(x) for parameter, x in zip(parameters, u, strict=True)]
        key = (model.structure, free)
        if key not in self._predictors:
            self._predictors[key] = predictor(model, free, self._conditions)
        values, jacobian, _ = self._predictors[key](vector)
        measured = [RIG_CHANNELS.index(type(channel)) for channel in self.data.channels]
        slopes = np.array([parameter.slope(x) for parameter, x in zip(parameters, u, strict=True)])
        derivatives = np.moveaxis(jacobian[measured] * slopes, -1, 0)
        pressed, by_pressed = pressed_in(model, free, vector, self.data.trials)
        by_pressed *= slopes.reshape(-1, 1, 1, 1)
        return Sensitivities(self._whole(values[measured], pressed), self._whole(derivatives, by_pressed))

    def unpredicted_part(self, model: RigModel) -> str:
        """Return which run no sinkage carries with this model; empty where all are carried."""
        values = predictor(model, (), self._conditions)(model.vector()).values
        return uncarried_runs(values, self.data.load, self.data.slip)

    def turns(self) -> np.ndarray | None:
        """Return the rows' order as that of measurement, 0 of a pressing; None where runs follow others of a level."""
        order = np.arange(self.data.level.size)
        if np.mean(np.diff(self.data.level) == 0) > MOST:  # drift cannot be distinguished from what levels share
            return None
        table = self._whole(order[None].astype(float), log_forces(self.data.trials))
        return np.nan_to_num(table[:, 0]).astype(int)


def log_forces(trials: Sequence[Trial]) -> np.ndarray:
    """Return ln of the forces (trials, 1, samples)."""
    return np.log([[trial.force] for trial in trials])


def log_force_sds(trials: Sequence[Trial]) -> np.ndarray:
    """Return the SD of ln of each force (trials, 1, samples): its own, and the depth's by the trial's slope."""
    slopes = np.array([[np.gradient(np.log(trial.force), trial.sinkage)] for trial in trials])
    return np.hypot(GIVES_WAY, LEVEL * slopes)


def places(trials: Sequence[Trial], inputs: np.ndarray) -> np.ndarray:
    """Return where each sample stands (trials, inputs, samples): its depth over its range where slip is over its own.

    `inputs` [inputs, runs] are those of runs, slip first: a press has none of the others.
    """
    depth = np.array([trial.sinkage for trial in trials])
    share = (depth - depth.min()) / np.ptp(depth)
    table = np.tile(inputs.min(axis=1)[:, None], (len(depth), 1, depth.shape[1]))
    table[:, 0] += share * np.ptp(inputs[0])
    return table


def pressed_in(
    model: RigModel, free: Sequence[str], vector: np.ndarray, trials: Sequence[Trial]
) -> tuple[np.ndarray, np.ndarray]:
    """Return ln of the forces (trials, 1, samples) at these values of all parameters, and slopes (free, ...)."""
    if not trials:
        return np.zeros((0, 1, 0)), np.zeros((len(free), 0, 1, 0))
    depth = np.array([trial.sinkage for trial in trials])
    law = pressed_law(model.structure, tuple(free), depth.size)
    rows = law(ca.DM(depth.reshape(1, -1)), ca.DM(vector)).full().reshape(-1, len(trials), 1, depth.shape[1])
    return rows[0], rows[1:]
