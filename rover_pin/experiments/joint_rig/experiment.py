"""Several rig sets in one sand as one experiment: levels of each set are its folds, its noise is its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.effects.effect import Effect
from rover_pin.estimation.experiment import Experiment, Sensitivities
from rover_pin.estimation.noise import Noise, declared_noise
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.folded import stacked
from rover_pin.experiments.joint_rig.model import OWN, JointModel, Part
from rover_pin.experiments.joint_rig.one_sand import of_one_sand
from rover_pin.experiments.wheel_rig.candidates import candidates
from rover_pin.experiments.wheel_rig.checks import FEWEST_LEVELS
from rover_pin.experiments.wheel_rig.data import RigSet, as_rig_set
from rover_pin.experiments.wheel_rig.experiment import ROWS, RigExperiment
from rover_pin.experiments.wheel_rig.model import ASKEW, PAPER, RigModel
from rover_pin.experiments.wheel_rig.presets import LUGS, TRENCH, known_heights, known_trench
from rover_pin.experiments.wheel_rig.pressings import PRESSED
from rover_pin.measurements.finding import Finding
from rover_pin.measurements.wheel_rig import SAME_LOAD, WheelRig

OTHER_WIDTH = 1.05
"""Widths that differ by this tell k_1 and k_2 apart: from here k_2 is free."""


@dataclass(frozen=True, eq=False)
class JointRig(Experiment):
    """The runs of several sets; folds are the levels of each, channels all that any of them measured."""

    sets: Mapping[str, RigSet]
    twice: tuple[Finding, ...] = ()
    is_exact = True
    no_value = RigExperiment.no_value

    @cached_property
    def _each(self) -> dict[str, RigExperiment]:
        return {name: RigExperiment(data) for name, data in self.sets.items()}

    @property
    def name(self) -> str:  # type: ignore[override]
        """The sets' names."""
        return " + ".join(self.sets)

    @property
    def kinds(self) -> tuple[Any, ...]:
        """The channels that any set has, in their order."""
        present = {type(channel) for data in self.sets.values() for channel in data.rig.channels}
        return tuple(kind for kind in ROWS if kind in present)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels."""
        pressed = any(data.trials for data in self.sets.values())
        return (*(kind.name for kind in self.kinds), *((PRESSED,) if pressed else ()))

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return next((kind.unit for kind in self.kinds if kind.name == channel), "")

    @property
    def folds(self) -> tuple[str, ...]:
        """`set: fold` of every level and pressing of every set."""
        return tuple(f"{name}: {fold}" for name, experiment in self._each.items() for fold in experiment.folds)

    def of_set(self, name: str) -> np.ndarray:
        """Return which folds are of a set (folds,)."""
        return np.array([set_name == name for set_name, of in self._each.items() for _ in of.folds])

    def _whole(self, tables: Mapping[str, np.ndarray], empty: float) -> np.ndarray:
        """Return tables (..., levels, own channels, own samples) of every set as one, `empty` where a set has none."""
        rows = {name: [self.channels.index(channel) for channel in self._each[name].channels] for name in tables}
        return stacked([(table, rows[name]) for name, table in tables.items()], len(self.channels), empty)

    @property
    def campaigns(self) -> np.ndarray:
        """Which set each fold is of."""
        return np.array([at for at, experiment in enumerate(self._each.values()) for _ in experiment.folds])

    @property
    def varied(self) -> np.ndarray:
        """What was set at each sample (folds, samples, inputs), speeds left out where a set has none."""
        tables = [np.moveaxis(experiment.varied, 2, 1) for experiment in self._each.values()]
        count, samples = min(table.shape[1] for table in tables), max(table.shape[2] for table in tables)
        padded = [np.full((len(table), count, samples), np.nan) for table in tables]
        for wide, table in zip(padded, tables, strict=True):
            wide[..., : table.shape[2]] = table[:, :count]
        return np.moveaxis(np.concatenate(padded), 1, 2)

    def reading_errors(self, model: JointModel) -> tuple[Parameter, ...]:
        """Return the offsets and scales of every set that its rig.toml does not state."""
        return tuple(
            dataclasses.replace(parameter, name=f"{name}.{parameter.name}")
            for name, experiment in self._each.items()
            for parameter in experiment.reading_errors(model.of(name))
        )

    @cached_property
    def observed(self) -> np.ndarray:
        """What was measured (folds, channels, samples); NaN where nothing was."""
        return self._whole({name: experiment.observed for name, experiment in self._each.items()}, np.nan)

    def noise(self) -> Noise:
        """Return white noise of the SDs that each set states."""
        sd = self._whole({name: experiment.noise().sd for name, experiment in self._each.items()}, 1.0)
        return declared_noise(sd, self.observed)

    def base_model(self) -> JointModel:
        """Return the soil as any set declares it, n and k_1 as the first set with pressing trials has them.

        Lugs dig from the start where every set tells what it has.
        """
        sets = self.sets.values()
        sand = as_rig_set(of_one_sand([data.rig for data in sets]))
        askew = any(data.rig.askew.any() for data in sets)
        parts = {
            name: Part(data.rig.wheel, data.rig.errors, data.rig.beside.get("lug_height"))
            for name, data in self.sets.items()
        }
        lugs_declared = all("lug_height" in data.rig.beside for data in sets)
        trench = known_trench(self.declared) if lugs_declared else ()
        return JointModel(sand.soil(), (*(ASKEW if askew else PAPER), *trench), parts)

    def records(self, model: Any) -> dict[str, Any]:
        """Return the soil, the effects, and `set.wheel` and `set.rig` of each."""
        set_records = {
            f"{name}.{kind}": getattr(part, field) for name, part in model.parts.items() for kind, field in OWN
        }
        return {"soil": model.soil, **{type(effect).__name__: effect for effect in model.effects}, **set_records}

    def replaced(self, model: Any, owner: str, record: Any) -> Any:
        """Return the model with another record of this name."""
        if owner == "soil":
            return dataclasses.replace(model, soil=record)
        name, _, kind = owner.rpartition(".")
        if name in model.parts:
            part = dataclasses.replace(model.parts[name], **{dict(OWN)[kind]: record})
            return dataclasses.replace(model, parts={**model.parts, name: part})
        effects = tuple(record if type(effect).__name__ == owner else effect for effect in model.effects)
        return dataclasses.replace(model, effects=effects)

    def uncertain(self, model: JointModel) -> tuple[Parameter, ...]:
        """Return what is uncertain of any set: the soil once, wheels and errors of the rig by the name of their set."""
        parameters: dict[str, Parameter] = {}
        for name, experiment in self._each.items():
            for parameter in experiment.uncertain(model.of(name)):
                if parameter.name == TRENCH:
                    continue
                full = parameter.name if parameter.name.startswith("soil.") else f"{name}.{parameter.name}"
                if full not in parameters or (parameter.prior and not parameters[full].prior):
                    parameters[full] = dataclasses.replace(parameter, name=full)
        for parameter in self._jointly_identified(model):
            parameters.setdefault(parameter.name, parameter)
        parameters |= {parameter.name: parameter for parameter in known_heights(self.declared, self, model)}
        return tuple(parameters.values())

    def _jointly_identified(self, model: JointModel) -> Iterator[Parameter]:
        """Yield what the sets tell together, and none alone: n and c by their loads, k_2 by their widths."""
        loads = np.concatenate([data.rig.load for data in self.sets.values()])
        widths = [float(data.rig.wheel.b) for data in self.sets.values()]
        if loads.max() >= SAME_LOAD * loads.min():
            yield self.parameter(model, "soil.n", 0.3)
            yield self.parameter(model, "soil.c", max(300.0, self.value(model, "soil.c")))
        if max(widths) >= OTHER_WIDTH * min(widths):
            yield self.parameter(model, "soil.k_2", self.value(model, "soil.k_1") / min(widths))

    def candidates(self, model: JointModel, kinds: Sequence[type[Effect]]) -> tuple[Candidate, ...]:
        """Return what a rig can show and every set, where it needs speeds, has them for; geometry as declared."""
        pairs = [(data, model.of(name)) for name, data in self.sets.items()]
        return candidates(model, pairs, self.declared, kinds)

    @property
    def declared(self) -> WheelRig:
        """The wheel with the highest lugs, with all that any set declares of the sand."""
        rigs = sorted((data.rig for data in self.sets.values()), key=lambda rig: rig.beside.get("lug_height", 0.0))
        all_declare_lugs = all("lug_height" in rig.beside for rig in rigs)
        beside = {name: value for rig in rigs for name, value in rig.beside.items()}
        if not all_declare_lugs and beside.get("lug_height") == 0.0:
            del beside["lug_height"]
        return dataclasses.replace(rigs[-1], beside=beside)

    def sensitivities(self, model: JointModel, parameters: Sequence[Parameter], u: np.ndarray) -> Sensitivities:
        """Return the channels of every set and their exact slopes."""
        predicted, slopes = {}, {}
        for name, experiment in self._each.items():
            set_model = model.of(name)
            local = [(at, _local(parameter.name, name)) for at, parameter in enumerate(parameters)]
            acting = [(at, word) for at, word in local if word and _stands(set_model, word)]
            local_parameters = [dataclasses.replace(parameters[at], name=word) for at, word in acting]
            local_parameters = [
                _scaled(parameter, model.lug_share(name)) if _is_height(parameter.name) else parameter
                for parameter in local_parameters
            ]
            set_sensitivities = experiment.sensitivities(
                set_model, local_parameters, np.asarray(u)[[at for at, _ in acting]]
            )
            table = np.zeros((len(parameters), *set_sensitivities.predicted.shape))
            table[[at for at, _ in acting]] = set_sensitivities.slopes
            predicted[name], slopes[name] = set_sensitivities.predicted, table
        return Sensitivities(self._whole(predicted, 0.0), self._whole(slopes, 0.0))

    def predict(self, models: Sequence[JointModel]) -> np.ndarray:
        """Return the channels of each model (models, folds, channels, samples)."""
        return np.array([self.sensitivities(model, (), np.zeros(0)).predicted for model in models])

    def unpredicted(self, model: JointModel) -> str:
        """Return which run no sinkage carries, of the first set that has one; empty where all are carried."""
        reasons = ((name, experiment.unpredicted(model.of(name))) for name, experiment in self._each.items())
        return next((f"{name}: {why}" for name, why in reasons if why), "")

    def insufficient(self) -> str:
        """Return why the sets tell nothing together, and what would."""
        if len(self.folds) >= FEWEST_LEVELS:
            return ""
        return f"{len(self.folds)} levels in all sets: measure at {FEWEST_LEVELS} or more, or give more sets."


def _local(name: str, set_name: str) -> str:
    """Return a parameter's name as a set's own model has it; empty where it is another set's."""
    for kind, _ in OWN:
        owner, separator, quantity = name.rpartition(f".{kind}.")
        if separator:
            return f"{kind}.{quantity}" if owner == set_name else ""
    return name


def _stands(model: RigModel, name: str) -> bool:
    return name.rpartition(".")[0] in model.records


def _is_height(name: str) -> bool:
    return name.rpartition(".")[2] in LUGS


def _scaled(parameter: Parameter, share: float) -> Parameter:
    """Return a parameter whose value at u is this share of the given one's."""
    scale = parameter.scale if parameter.log else parameter.scale * share
    return dataclasses.replace(
        parameter, origin=parameter.origin * share, scale=scale, low=parameter.low * share, high=parameter.high * share
    )
