"""A wheel-rig set as an experiment: levels of slip are its folds, its channels have exact sensitivities."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rover_pin.base.public import brief
from rover_pin.contact import Soil
from rover_pin.estimation.experiment import Experiment, Sensitivities
from rover_pin.estimation.noise import Noise, declared_noise
from rover_pin.estimation.parameter import Parameter, declared_in
from rover_pin.experiments.folded import stacked
from rover_pin.experiments.soil_priors import DECADES, LEAST, MAX_EXIT_RATIO, WIDE
from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.experiments.wheel_rig.model import ASKEW, PAPER, RigModel, RigPredictor, conditions, predictor, uncarried
from rover_pin.experiments.wheel_rig.presets import known_heights, known_trench
from rover_pin.experiments.wheel_rig.pressings import (
    PRESSED,
    PRESSING,
    PRESSING_SD,
    log_force_sds,
    log_forces,
    places,
    pressed_in,
)
from rover_pin.measurements.channel import (
    RIG_CHANNELS,
    DrawbarPull,
    RigChannel,
    SideForce,
    Sinkage,
    Torque,
    VerticalMoment,
)
from rover_pin.measurements.wheel_rig import SAME_LOAD

ROWS: tuple[type[RigChannel], ...] = RIG_CHANNELS
"""The channels in the order in which a rig model predicts them."""
MIXED = 0.5
"""Share of runs after one of their own level from which drift cannot be distinguished from what levels share."""
TARE, SCALE = 0.1, 0.05
"""SD of an offset that nobody states, as a share of the channel's largest value, and of a scale: cells are sure to 1 %,
a torque by a motor's current to 10 % (assumed)."""
OFFSET_AND_SCALE = {
    DrawbarPull: ("pull_tare", "force_scale"),
    Torque: ("torque_tare", "torque_scale"),
    Sinkage: ("sinkage_zero", "sinkage_scale"),
    SideForce: ("side_tare", "side_scale"),
    VerticalMoment: ("moment_tare", "moment_scale"),
}
"""The offset and the scale of each channel that a rig may have."""


@brief
@dataclass(frozen=True, eq=False)
class RigExperiment(Experiment):
    """The runs of a rig set as arrays (levels, channels, runs of a level); noise as stated with each value.

    Pressings are folds behind the levels, in a channel of their own.
    """

    data: RigSet
    is_exact = True
    no_value = "no sinkage down to the axle carries the load"

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the set."""
        return self.data.rig.name

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the measured channels."""
        names = tuple(channel.name for channel in self.data.rig.channels)
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
        runs, count = self.table(rows), len(self.data.rig.channels)
        return stacked([(runs, range(count)), (pressed, [count])], count + 1, np.nan) if self.data.trials else runs

    def rows(self, table: np.ndarray) -> np.ndarray:
        """Return a table (folds, channels, samples) as rows (channels of runs, runs) in the order of the set."""
        return np.asarray(table[self.data.level, : len(self.data.rig.channels), self._place]).T

    def in_sds(self, residual: np.ndarray) -> np.ndarray:
        """Return a residual (levels, channels, runs of a level) as rows (channels, runs), each in its stated SD."""
        return self.rows(residual) / np.array([channel.sd for channel in self.data.rig.channels])

    @cached_property
    def observed(self) -> np.ndarray:
        """What was measured; NaN behind a level's end."""
        measured = np.array([channel.measured for channel in self.data.rig.channels])
        return self._whole(measured, log_forces(self.data.trials))

    def noise(self) -> Noise:
        """Return white noise of the stated SDs."""
        sds = np.array([channel.sd for channel in self.data.rig.channels])
        sd = self._whole(sds, log_force_sds(self.data.trials))
        return declared_noise(np.where(np.isfinite(sd), sd, 1.0), self.observed)

    @property
    def sd(self) -> np.ndarray:
        """RMS of the stated SDs of every channel (channels,)."""
        return np.array([float(np.sqrt(np.mean(channel.sd**2))) for channel in self.data.rig.channels])

    @property
    def inputs(self) -> np.ndarray:
        """What was set (levels, runs of a level, inputs): slip, and slip angle and load where they differ."""
        rig = self.data.rig
        rows = [rig.slip, *([rig.slip_angle] if rig.askew.any() else [])]
        rows += [rig.load] if np.max(rig.load) >= SAME_LOAD * np.min(rig.load) else []
        return np.moveaxis(self.table(np.array(rows)), 1, 2)

    @property
    def varied(self) -> np.ndarray:
        """What was set (levels, runs of a level, inputs): slip, slip angle, logarithms of load and travel speed."""
        rig = self.data.rig
        rows = [rig.slip, rig.slip_angle, np.log(rig.load)]
        rows += [] if self.data.speeds is None else [np.log(np.abs(self.data.speeds).max(axis=1))]
        table = self.table(np.array(rows))
        if self.data.trials:
            parts = [(part, range(len(rows))) for part in (table, places(self.data.trials, np.array(rows)))]
            table = stacked(parts, len(rows), np.nan)
        return np.moveaxis(table, 1, 2)

    def reading_errors(self, model: RigModel) -> tuple[Parameter, ...]:
        """Return what rig.toml does not state: a tare or zero and a scale of each channel, and one of the load."""
        sds = {"rig.load_scale": SCALE}
        for channel in self.data.rig.channels:
            offset, scale = OFFSET_AND_SCALE[type(channel)]
            sds |= {f"rig.{offset}": TARE * float(np.nanmax(np.abs(channel.measured))), f"rig.{scale}": SCALE}
        stated_errors = self.data.rig.error_sd
        return tuple(self.parameter(model, name, sd) for name, sd in sds.items() if name not in stated_errors)

    @cached_property
    def _conditions(self) -> np.ndarray:
        rig = self.data.rig
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
        measured = [ROWS.index(type(channel)) for channel in self.data.rig.channels]
        slopes = np.array([parameter.slope(x) for parameter, x in zip(parameters, u, strict=True)])
        derivatives = np.moveaxis(jacobian[measured] * slopes, -1, 0)
        pressed, by_pressed = pressed_in(model, free, vector, self.data.trials)
        by_pressed *= slopes.reshape(-1, 1, 1, 1)
        return Sensitivities(self._whole(values[measured], pressed), self._whole(derivatives, by_pressed))

    def unpredicted(self, model: RigModel) -> str:
        """Return which run no sinkage carries with this model; empty where all are carried."""
        values = predictor(model, (), self._conditions)(model.vector()).values
        return uncarried(values, self.data.rig.loads, np.asarray(self.data.rig.slip))

    def turns(self) -> np.ndarray | None:
        """Return the rows' order as that of measurement, 0 of a pressing; None where runs follow others of a level."""
        order = np.arange(self.data.level.size)
        if np.mean(np.diff(self.data.level) == 0) > MIXED:
            return None
        table = self._whole(order[None].astype(float), log_forces(self.data.trials))
        return np.nan_to_num(table[:, 0]).astype(int)

    def predict(self, models: Sequence[RigModel]) -> np.ndarray:
        """Return the channels of each model (models, levels, channels, runs of a level)."""
        return np.array([self.sensitivities(model, (), np.zeros(0)).predicted for model in models])

    def records(self, model: RigModel) -> Mapping[str, Any]:
        """Return wheel, soil and effects of a model, by name."""
        return model.records

    def replaced(self, model: RigModel, owner: str, record: Any) -> RigModel:
        """Return the model with another record of this name."""
        return model.with_record(owner, record)

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return next((rig_channel.unit for rig_channel in self.data.rig.channels if rig_channel.name == channel), "")

    def uncertain(self, model: RigModel) -> tuple[Parameter, ...]:
        """Return which soil constants are uncertain, and what is assumed of those that these channels tell in part.

        k and phi where a force was measured, k_1 where the sinkage was, with no prior; the exit ratio with SD 0.1; n
        with SD 0.3 where loads differ, or the wheel was pressed in; c with 300 Pa or its own size where loads differ.
        What rig.toml states with an SD has that prior around the stated value, and is uncertain whatever was measured.
        Lugs of declared height, where the model has them dig, fill their pockets to 1 +- 0.3.
        """
        declared_parameters = {parameter.name: parameter for parameter in self._stated(model)}
        soil_parameters = [declared_parameters.pop(parameter.name, parameter) for parameter in self._of_the_soil(model)]
        lugs = known_heights(self.data.rig, self, model)
        return (*soil_parameters, *declared_parameters.values(), *lugs, *self._of_the_rig(model))

    def _stated(self, model: RigModel) -> Iterator[Parameter]:
        """Yield the soil constants that [soil] states with an SD, around what it states."""
        declared = self.data.soil()
        for name, sd in self.data.rig.doubts.items():
            value, log = float(getattr(declared, name)), name in ("k", "k_1")
            relative = log and value > 0
            parameter = self.parameter(
                model, f"soil.{name}", sd / value if relative else sd, relative, self._declared(name)
            )
            yield dataclasses.replace(
                parameter, origin=value, high=MAX_EXIT_RATIO if name == "exit_ratio" else parameter.high
            )

    def _of_the_soil(self, model: RigModel) -> tuple[Parameter, ...]:
        """Return the uncertain soil constants, as if nothing were stated of them."""
        kinds, load = {type(channel) for channel in self.data.rig.channels}, self.data.rig.load
        parameters: list[Parameter] = []
        if kinds & {DrawbarPull, Torque}:
            spec = self.quantity(model, "soil.phi")
            parameters += [
                self._loose(model, "soil.k", DECADES, log=True),
                self._loose(model, "soil.phi", WIDE * (spec.high - spec.low)),
            ]
        if Sinkage in kinds:
            k_1 = self.value(model, "soil.k_1")
            parameters += [self._loose(model, "soil.k_1", DECADES if k_1 > 0 else abs(k_1) or 1e5, log=k_1 > 0)]
        exit_ratio = self.parameter(model, "soil.exit_ratio", 0.1, declared=self._declared("exit_ratio"))
        parameters += [dataclasses.replace(exit_ratio, low=0.0, high=MAX_EXIT_RATIO)]
        varied = np.max(load) >= SAME_LOAD * np.min(load)
        sds = {"n": 0.3} if varied or self.data.trials else {}
        sds |= {"c": max(300.0, self.value(model, "soil.c"))} if varied else {}
        parameters += [
            self.parameter(model, f"soil.{name}", sd, declared=self._declared(name)) for name, sd in sds.items()
        ]
        return tuple(parameters)

    def _declared(self, name: str) -> str:
        """Return where a soil constant is declared, and with what SD; empty where it is not."""
        return declared_in("soil", name, self.data.rig.declared, self.data.rig.doubts)

    def _of_the_rig(self, model: RigModel) -> Iterator[Parameter]:
        """Yield what rig.toml states with an SD, of rig and wheel, and how much stiffer sand is where pressed in."""
        if self.data.trials and PRESSING not in self.data.rig.error_sd:
            yield self.parameter(model, PRESSING, PRESSING_SD, log=True)
        for name, sd in self.data.rig.error_sd.items():
            parameter = self.parameter(model, name, sd, declared="declared in rig.toml")
            low, high = self.data.rig.wheel_range.get(own_name(name), (parameter.low, parameter.high))
            yield dataclasses.replace(parameter, low=low, high=high)

    def _loose(self, model: RigModel, name: str, scale: float, log: bool = False) -> Parameter:
        """Return a number without a prior; `scale` is how far apart its starts are."""
        parameter = self.parameter(model, name, scale, log)
        return dataclasses.replace(
            parameter, prior=False, low=max(parameter.low, LEAST * parameter.origin) if log else parameter.low
        )


def as_declared(data: RigSet, soil: Soil | None = None) -> RigModel:
    """Return the model that a set declares, its lugs digging; in another soil where one is given."""
    effects = (*(ASKEW if data.rig.askew.any() else PAPER), *known_trench(data.rig))
    return RigModel(data.rig.wheel, data.soil() if soil is None else soil, effects, data.rig.errors)


def own_name(name: str) -> str:
    """Return a parameter's name as a rig model's vector has it: soil and wheel are not said."""
    return name.removeprefix("soil.").removeprefix("wheel.")
