"""Propose to read the sensors of a wheel rig while the wheel is unloaded: such a reading shows the zero error of a
sensor alone.

The loop (the search for missing effects) compares these readings with the runs of `next_runs` by the information that
they are expected to give.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.noise import declared_noise
from rover_pin.experiments.wheel_rig.declared import OFFSET_AND_SCALE
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.joint_model import JointModel
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.inference.next_measurement import NextMeasurement, Offer
from rover_pin.measurements.channel import RigChannel, Sinkage
from rover_pin.measurements.rig_set import RigSet


class ZeroReading(NextMeasurement):
    """The proposal to read a sensor while the wheel is unloaded, because its zero error explains the data."""

    @property
    def sentence(self) -> str:
        """The proposal as a sentence: the zero error, the reading that shows it alone, and where to declare it."""
        return (
            f"a zero error, {self.channel}, explains the data: {self.what}, and declare this reading in [rig] of "
            "rig.toml, before more runs are made"
        )


def reading_of(kind: type[RigChannel]) -> str:
    """Return the description of the reading that shows the zero error of a channel alone."""
    # A wheel that touches level sand has sunk by 0; every other reading needs a wheel that touches nothing.
    touches = "just touches level sand" if kind is Sinkage else "hangs free and turns"
    return f"read the {kind.name} while the wheel {touches}"


def zero_readings(named: Iterable[str]) -> tuple[ZeroReading, ...]:
    """Return the readings of the unloaded wheel that check the zero errors among the named causes of a verdict.

    A name such as "rig.torque_tare" is the zero error of a channel; in a joint fit, it begins with the name of the data
    set.
    """
    kinds = {f"rig.{offset}": kind for kind, (offset, _) in OFFSET_AND_SCALE.items()}
    found = ((name, kinds[f"rig.{end}"]) for name in named if f"rig.{(end := name.rpartition('rig.')[2])}" in kinds)
    return tuple(ZeroReading((name,), reading_of(kind), name, 0.0, 0.0) for name, kind in found)


@dataclass(frozen=True, eq=False)
class UnloadedReadings(Experiment):
    """Readings of the sensors of rigs while the wheel is unloaded, as an experiment without measured values.

    A fold is the reading of one channel of one data set, with the noise of one run. The forces on the unloaded wheel
    are zero, so that the model predicts the zero error of the channel.
    """

    rigs: RigExperiment

    @property
    def readings(self) -> tuple[tuple[RigSet, RigChannel], ...]:
        """The data set and the channel of each reading (folds,)."""
        return tuple((data, channel) for data in self.rigs.sets for channel in data.channels)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the readings, one for each kind of channel."""
        return tuple(dict.fromkeys(f"the unloaded {channel.name}" for _, channel in self.readings))

    @property
    def folds(self) -> tuple[str, ...]:
        """Descriptions of the readings."""
        return tuple(self.rigs.in_set(data.name, ": ", reading_of(type(channel))) for data, channel in self.readings)

    def _table(self, values: Sequence[float]) -> np.ndarray:
        """Return the values of the readings as a table (folds, channels, 1); NaN in the cells of other channels."""
        table = np.full((len(self.readings), len(self.channels), 1), np.nan)
        for fold, (_, channel) in enumerate(self.readings):
            table[fold, self.channels.index(f"the unloaded {channel.name}"), 0] = values[fold]
        return table

    @property
    def observed(self) -> np.ndarray:
        """Stand-ins (folds, channels, 1) for the readings, which are not measured yet: 0, and NaN in other cells."""
        return self._table([0.0] * len(self.readings))

    @property
    def sds(self) -> np.ndarray:
        """SD of each reading (folds, channels, 1): the RMS noise of one run; 1 in other cells."""
        return np.nan_to_num(
            self._table([float(np.sqrt(np.mean(channel.sd**2))) for _, channel in self.readings]), nan=1.0
        )

    @property
    def varied(self) -> np.ndarray:
        """Inputs of the readings (folds, 1, inputs): the inputs of the first run, because a wheel without load has no
        inputs of its own.
        """
        first = self.rigs.varied[0, 0]
        return np.tile(first, (len(self.readings), 1, 1))

    def predict(self, models: Sequence[RigModel | JointModel]) -> np.ndarray:
        """Return the predicted readings (models, folds, channels, 1): the zero error of each channel, and 0 in the
        cells of other channels.
        """
        tables = []
        for model in models:
            errors = ((model.of(data.name).errors, type(channel)) for data, channel in self.readings)
            zeros = [float(getattr(of_set, OFFSET_AND_SCALE[kind][0])) for of_set, kind in errors]
            tables.append(np.nan_to_num(self._table(zeros)))
        return np.array(tables)

    def records(self, model: RigModel | JointModel) -> Mapping[str, Any]:
        """Return the parts of a model that have numbers to fit, as for the runs of the rigs."""
        return self.rigs.records(model)

    def replace_record(self, model: RigModel | JointModel, owner: str, record: Any) -> RigModel | JointModel:
        """Return the model with `record` in place of the part called `owner`."""
        return self.rigs.replace_record(model, owner, record)


def unloaded_readings(experiment: RigExperiment) -> Offer:
    """Return the readings of the unloaded sensors of all data sets as possible next measurements."""
    readings = UnloadedReadings(experiment)
    return Offer(readings, declared_noise(readings.sds, readings.observed))
