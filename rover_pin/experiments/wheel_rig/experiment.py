"""Wheel-rig sets in one sand as one experiment: levels of each set are its folds, its noise is its own."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rover_pin.base.public import brief
from rover_pin.contact import Soil
from rover_pin.estimation.experiment import Differentiable, Sensitivities
from rover_pin.estimation.noise import Noise, declared_noise
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.folded import stack
from rover_pin.experiments.soil_priors import SD
from rover_pin.experiments.wheel_rig.declared import SetNumbers
from rover_pin.experiments.wheel_rig.joint_model import OWN, JointModel, Part, of_one_sand
from rover_pin.experiments.wheel_rig.model import ASKEW, PAPER, RigModel
from rover_pin.experiments.wheel_rig.presets import LUGS, known_heights, known_trench
from rover_pin.experiments.wheel_rig.runs import PRESSED, RigRuns
from rover_pin.measurements.channel import RIG_CHANNELS, RigChannel
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_set import SAME_LOAD, RigSet

OTHER_WIDTH = 1.05
"""Widths that differ by this tell k_1 and k_2 apart: from here k_2 is free. Why: widths are stated to 1 %."""


@brief
@dataclass(frozen=True, eq=False)
class RigExperiment(Differentiable):
    """The runs of one set or several; folds are the levels of each, channels all that any of them measured.

    The model of one set is a `RigModel`, of several a `JointModel`, which names what is a set's own after the set.
    """

    sets: tuple[RigSet, ...]
    twice: tuple[Finding, ...] = ()
    "runs that stood in two sets"
    no_value = "no sinkage down to the axle carries the load"

    @cached_property
    def runs(self) -> dict[str, RigRuns]:
        """The runs of each set, by its name."""
        return {data.name: RigRuns(data) for data in self.sets}

    def in_set(self, set_name: str, separator: str, name: str) -> str:
        """Return the name of what is a set's own, after the set where there are several."""
        return f"{set_name}{separator}{name}" if len(self.sets) > 1 else name

    @property
    def name(self) -> str:  # type: ignore[override]
        """The sets' names."""
        return " + ".join(self.runs)

    @property
    def kinds(self) -> tuple[type[RigChannel], ...]:
        """The channels that any set has, in their order."""
        present = {type(channel) for data in self.sets for channel in data.channels}
        return tuple(kind for kind in RIG_CHANNELS if kind in present)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels."""
        return (*(kind.name for kind in self.kinds), *((PRESSED,) if any(data.trials for data in self.sets) else ()))

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return next((kind.unit for kind in self.kinds if kind.name == channel), "")

    @property
    def folds(self) -> tuple[str, ...]:
        """The name of every level and pressing, of several sets as `set: fold`."""
        return tuple(self.in_set(name, ": ", fold) for name, runs in self.runs.items() for fold in runs.folds)

    @property
    def campaigns(self) -> np.ndarray:
        """Which set each fold is of."""
        return np.array([at for at, runs in enumerate(self.runs.values()) for _ in runs.folds])

    def of_set(self, name: str) -> np.ndarray:
        """Return which folds are of a set (folds,)."""
        return self.campaigns == list(self.runs).index(name)

    def _whole(self, tables: Sequence[np.ndarray], empty: float) -> np.ndarray:
        """Return tables (..., levels, own channels, own samples) of every set as one, `empty` where a set has none."""
        rows = map(self._rows, self.runs.values())
        return stack(list(zip(tables, rows, strict=True)), len(self.channels), empty)

    def _rows(self, runs: RigRuns) -> list[int]:
        """Return which channels are those of a set."""
        return [self.channels.index(channel) for channel in runs.channels]

    @cached_property
    def observed(self) -> np.ndarray:
        """What was measured (folds, channels, samples); NaN where nothing was."""
        return self._whole([runs.observed for runs in self.runs.values()], np.nan)

    def in_sds(self, residual: np.ndarray) -> np.ndarray:
        """Return the residual (levels, channels, runs of a level) of one set as rows (channels, runs) in stated SDs."""
        (runs,) = self.runs.values()
        return runs.in_sds(residual[:, self._rows(runs)])

    def noise(self) -> Noise:
        """Return white noise of the SDs that each set states."""
        return declared_noise(self._whole([runs.sds for runs in self.runs.values()], 1.0), self.observed)

    @property
    def varied(self) -> np.ndarray:
        """What was set at each sample (folds, samples, inputs), speeds left out where a set has none."""
        tables = [np.moveaxis(runs.varied, 2, 1) for runs in self.runs.values()]
        count = min(table.shape[1] for table in tables)
        parts = [(table[:, :count], range(count)) for table in tables]
        return np.moveaxis(stack(parts, count, np.nan), 1, 2)

    def turns(self) -> np.ndarray | None:
        """Return at which turn each run of one set was made; None of several, or where it follows the level."""
        return None if len(self.sets) > 1 else next(iter(self.runs.values())).turns()

    def base_model(self, soil: Soil | None = None) -> RigModel | JointModel:
        """Return the model that the sets declare, in another soil where one is given.

        The sand of several is as any of them declares it; lugs dig from the start where every set tells what it has.
        """
        rigs = self.sets
        trench = known_trench(self.declared) if all("lug_height" in rig.beside for rig in rigs) else ()
        effects = (*(ASKEW if any(rig.askew.any() for rig in rigs) else PAPER), *trench)
        sand = soil or of_one_sand(rigs).soil()
        if len(rigs) == 1:
            return RigModel(rigs[0].wheel, sand, effects, rigs[0].errors)
        parts = {rig.name: Part(rig.wheel, rig.errors, rig.beside.get("lug_height")) for rig in rigs}
        return JointModel(sand, effects, parts)

    @property
    def declared(self) -> RigSet:
        """The wheel with the highest lugs, with all that any set declares of the sand."""
        rigs = sorted(self.sets, key=lambda rig: rig.beside.get("lug_height", 0.0))
        all_declare_lugs = all("lug_height" in rig.beside for rig in rigs)
        beside = {name: value for rig in rigs for name, value in rig.beside.items()}
        if not all_declare_lugs and beside.get("lug_height") == 0.0:
            del beside["lug_height"]
        return replace(rigs[-1], beside=beside)

    def records(self, model: RigModel | JointModel) -> Mapping[str, Any]:
        """Return soil, effects, and wheel and rig of each set, by name."""
        return model.records

    def replace_record(self, model: RigModel | JointModel, owner: str, record: Any) -> RigModel | JointModel:
        """Return the model with another record of this name."""
        return model.with_record(owner, record)

    def _numbers(self, model: RigModel | JointModel) -> dict[str, SetNumbers]:
        return {data.name: SetNumbers(data, model.of(data.name)) for data in self.sets}

    def uncertain(self, model: RigModel | JointModel) -> tuple[Parameter, ...]:
        """Return what is uncertain: of the sand once, as any set tells it, then of lugs, and of each wheel and rig.

        Lugs of declared height, where the model has them dig, fill their pockets to 1 +- 0.3.
        """
        of_sets = self._numbers(model)
        parameters: dict[str, Parameter] = {}
        for parameter in (parameter for numbers in of_sets.values() for parameter in numbers.of_sand()):
            if parameter.name not in parameters or (parameter.prior and not parameters[parameter.name].prior):
                parameters[parameter.name] = parameter
        for parameter in (*self._jointly_identified(model), *known_heights(self.declared, model.records)):
            parameters.setdefault(parameter.name, parameter)
        of_rigs = self._named_parameters({name: numbers.of_rig() for name, numbers in of_sets.items()})
        return (*parameters.values(), *of_rigs)

    def reading_errors(self, model: RigModel | JointModel) -> tuple[Parameter, ...]:
        """Return the offsets and scales of every set that its rig.toml does not state."""
        return tuple(self._named_parameters({name: of.reading_errors() for name, of in self._numbers(model).items()}))

    def _named_parameters(self, of_sets: Mapping[str, Iterable[Parameter]]) -> Iterator[Parameter]:
        """Yield each set's own parameters under the name that the model has for them."""
        for name, parameters in of_sets.items():
            yield from (replace(parameter, name=self.in_set(name, ".", parameter.name)) for parameter in parameters)

    def _jointly_identified(self, model: RigModel | JointModel) -> Iterator[Parameter]:
        """Yield what the sets tell together, though none alone: n and c by their loads, k_2 by their widths."""
        loads = np.concatenate([data.load for data in self.sets])
        widths = [float(data.wheel.b) for data in self.sets]
        if loads.max() >= SAME_LOAD * loads.min():
            yield self.parameter(model, "soil.n", SD["n"].undeclared)
            yield self.parameter(model, "soil.c", max(SD["c"].undeclared, float(model.soil.c)))
        if max(widths) >= OTHER_WIDTH * min(widths):
            yield self.parameter(model, "soil.k_2", float(model.soil.k_1) / min(widths))

    def sensitivities(
        self, model: RigModel | JointModel, parameters: Sequence[Parameter], u: np.ndarray
    ) -> Sensitivities:
        """Return the channels of every set and their exact slopes."""
        predicted, slopes = [], []
        for name, runs in self.runs.items():
            set_model, share = model.of(name), model.lug_share(name)
            names = [_local(parameter.name, name) for parameter in parameters]
            acting = [at for at, local in enumerate(names) if local and local.rpartition(".")[0] in set_model.records]
            acting_parameters = [_scale_parameter(replace(parameters[at], name=names[at]), share) for at in acting]
            of_set = runs.sensitivities(set_model, acting_parameters, np.asarray(u)[acting])
            table = np.zeros((len(parameters), *of_set.predicted.shape))
            table[acting] = of_set.slopes
            predicted.append(of_set.predicted)
            slopes.append(table)
        return Sensitivities(self._whole(predicted, 0.0), self._whole(slopes, 0.0))

    def predict(self, models: Sequence[RigModel | JointModel]) -> np.ndarray:
        """Return the channels of each model (models, folds, channels, samples)."""
        return np.array([self.sensitivities(model, (), np.zeros(0)).predicted for model in models])

    def unpredicted_part(self, model: RigModel | JointModel) -> str:
        """Return which run no sinkage carries, of the first set that has one; empty where all are carried."""
        reasons = ((name, runs.unpredicted_part(model.of(name))) for name, runs in self.runs.items())
        return next((self.in_set(name, ": ", why) for name, why in reasons if why), "")


def _local(name: str, set_name: str) -> str:
    """Return a parameter's name as a set's own model has it; empty where it is another set's."""
    for kind, _ in OWN:
        owner, separator, quantity = name.rpartition(f".{kind}.")
        if separator:
            return f"{kind}.{quantity}" if owner == set_name else ""
    return name


def _scale_parameter(parameter: Parameter, share: float) -> Parameter:
    """Return a parameter, of a height of lugs one whose value at u is this share of the given one's."""
    if share == 1.0 or parameter.name.rpartition(".")[2] not in LUGS:
        return parameter
    scale = parameter.scale if parameter.log else parameter.scale * share
    return replace(
        parameter, origin=parameter.origin * share, scale=scale, low=parameter.low * share, high=parameter.high * share
    )
