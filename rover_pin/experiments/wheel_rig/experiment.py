"""Wheel-rig data sets with one sand as one experiment for the fit of models.

A fold is a group of runs that are held out of a fit together: the runs of one slip level of one data set.
`RigExperiment` serves one data set or several. `join_sets` makes an experiment of several data sets. It uses a run that
two data sets contain only once.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.paths import is_file
from rover_pin.base.public import brief
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.estimation.experiment import Differentiable, Sensitivities
from rover_pin.estimation.noise import Noise, declared_noise
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.folded import stack
from rover_pin.experiments.soil_priors import SD
from rover_pin.experiments.wheel_rig.declared import SetNumbers, known_heights, known_trench
from rover_pin.experiments.wheel_rig.joint_model import SET_RECORDS, JointModel, SetRecords, of_one_sand
from rover_pin.experiments.wheel_rig.model import ASKEW, PAPER, RigModel
from rover_pin.experiments.wheel_rig.runs import PRESSED, RigRuns
from rover_pin.measurements.channel import RIG_CHANNELS, RigChannel
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_file import RIG_FILE
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import SAME_LOAD, RigSet

OTHER_WIDTH = 1.05
"""Minimum ratio of the widest to the narrowest wheel or pressed plate. From this ratio on, k_1 and k_2 can be
distinguished, so that k_2 is free. Widths are stated to about 1 %."""
SAME_RUN = 0.02
"""Maximum difference between the channels of two runs, as a fraction of their SDs. Up to this value, the runs of two
data sets count as one run."""
INPUT_SCALE = 0.05
"""Number that takes the place of the SD of slip, of slip angle [rad] and of the logarithm of the load when runs of two
data sets are compared. Two runs can be one run if these inputs differ by less than 0.001."""


@brief
@dataclass(frozen=True, eq=False)
class RigExperiment(Differentiable):
    """Runs of one wheel-rig data set, or of several data sets with one sand, as an experiment for the fit of models.

    The folds (groups of runs that are held out together) are the slip levels and the pressing trials of every data set.
    The channels are the channels of all data sets. The model of one data set is a `RigModel`. The model of several data
    sets is a `JointModel`: the names of its wheels and reading errors begin with the name of their data set.

    Parameters
    ----------
    sets : tuple of RigSet
        The data sets. Each has a name of its own.
    twice : tuple of Finding
        Findings on runs that two data sets contain.
    """

    sets: tuple[RigSet, ...]
    twice: tuple[Finding, ...] = ()
    """findings of the data check on runs that two data sets contain"""
    no_value = "no sinkage down to the axle carries the load"

    @cached_property
    def runs(self) -> dict[str, RigRuns]:
        """Name of each data set -> its runs as arrays."""
        return {data.name: RigRuns(data) for data in self.sets}

    def in_set(self, set_name: str, separator: str, name: str) -> str:
        """Return the name of something that belongs to one data set, such as a fold or a parameter, as the experiment
        uses it.

        If there are several data sets, the name of the data set and the separator are put in front of the name.
        """
        return f"{set_name}{separator}{name}" if len(self.sets) > 1 else name

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the experiment: the names of its data sets, joined by " + "."""
        return " + ".join(self.runs)

    @property
    def kinds(self) -> tuple[type[RigChannel], ...]:
        """Classes of the channels that at least one data set has, in the order of RIG_CHANNELS."""
        present = {type(channel) for data in self.sets for channel in data.channels}
        return tuple(kind for kind in RIG_CHANNELS if kind in present)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that at least one data set has, and of the channel of pressing trials."""
        return (*(kind.name for kind in self.kinds), *((PRESSED,) if any(data.trials for data in self.sets) else ()))

    def unit(self, channel: str) -> str:
        """Return the SI unit of a channel; empty for the logarithm of a pressing force."""
        return next((kind.unit for kind in self.kinds if kind.name == channel), "")

    @property
    def folds(self) -> tuple[str, ...]:
        """Names of the groups of runs that are held out together: slip levels and pressing trials of each data set.

        If there are several data sets, each name begins with the name of its data set, as in `set: level`.
        """
        return tuple(self.in_set(name, ": ", fold) for name, runs in self.runs.items() for fold in runs.folds)

    @property
    def campaigns(self) -> np.ndarray:
        """Index of each fold's data set (folds,). A fold is a group of runs that are held out together."""
        return np.array([number for number, runs in enumerate(self.runs.values()) for _ in runs.folds])

    def of_set(self, name: str) -> np.ndarray:
        """Return a mask (folds,) of the folds (groups of runs held out together) that belong to the data set `name`."""
        return self.campaigns == list(self.runs).index(name)

    def _whole(self, tables: Sequence[np.ndarray], empty: float) -> np.ndarray:
        """Join the tables (..., folds, channels, samples) of all data sets to one table. Cells without a value become
        `empty`.
        """
        rows = map(self._rows, self.runs.values())
        return stack(list(zip(tables, rows, strict=True)), len(self.channels), empty)

    def _rows(self, runs: RigRuns) -> list[int]:
        """Return the indices that the channels of one data set have among the channels of the experiment."""
        return [self.channels.index(channel) for channel in runs.channels]

    @cached_property
    def observed(self) -> np.ndarray:
        """Measured values (folds, channels, samples); NaN in cells without a measurement."""
        return self._whole([runs.observed for runs in self.runs.values()], np.nan)

    def in_sds(self, residual: np.ndarray) -> np.ndarray:
        """Return the residual of a single data set, divided by the stated SDs, as rows (channels, runs).

        `residual` has the shape (folds, channels, samples).
        """
        (runs,) = self.runs.values()
        return runs.in_sds(residual[:, self._rows(runs)])

    def noise(self) -> Noise:
        """Return the noise model of the measured values: independent noise with the SDs that each data set states."""
        return declared_noise(self._whole([runs.sds for runs in self.runs.values()], 1.0), self.observed)

    @property
    def varied(self) -> np.ndarray:
        """Inputs of each sample (folds, samples, inputs) on which a smooth deviation between model and data may depend.

        The speed is omitted if a data set states no speeds.
        """
        # If one data set lacks the speed, the last input is left out of all.
        tables = [np.moveaxis(runs.varied, 2, 1) for runs in self.runs.values()]
        count = min(table.shape[1] for table in tables)
        parts = [(table[:, :count], range(count)) for table in tables]
        return np.moveaxis(stack(parts, count, np.nan), 1, 2)

    def turns(self) -> np.ndarray | None:
        """Return the position of each run of a single data set in the order of measurement (folds, samples), to
        identify drifts.

        The result is None for several data sets. It is also None if the runs were measured level by level, because a
        drift cannot be identified then.
        """
        return None if len(self.sets) > 1 else next(iter(self.runs.values())).turns()

    def base_model(self, soil: Soil | None = None) -> RigModel | JointModel:
        """Return the base model: wheels, soil and effects as the data sets declare them, or with the given `soil`.

        For several data sets, a constant of the sand is taken from a data set that declares it. If every data set
        declares the height of its lugs, the base model includes the trench that the lugs dig. If runs have a slip
        angle, the base model includes sideways shear.
        """
        # The trench follows from the volume of the lugs, so it is no missing effect if all lugs are declared.
        rigs = self.sets
        trench = known_trench(self.declared) if all("lug_height" in rig.beside for rig in rigs) else ()
        effects = (*(ASKEW if any(rig.askew.any() for rig in rigs) else PAPER), *trench)
        sand = soil or of_one_sand(rigs).soil()
        if len(rigs) == 1:
            return RigModel(rigs[0].wheel, sand, effects, rigs[0].errors)
        gravity = self.declared.gravity
        parts = {
            rig.name: SetRecords(rig.wheel, rig.errors, rig.beside.get("lug_height"), rig.gravity / gravity)
            for rig in rigs
        }
        return JointModel(sand, effects, parts)

    @property
    def declared(self) -> RigSet:
        """A data set that holds everything that all data sets declare about lugs and sand: lug sizes, density, angle of
        repose.

        It is the data set with the highest lugs, completed by the declarations of the other data sets. A declared lug
        height of 0 (no lugs) is dropped unless every data set declares its lug height. The gravity is the gravity for
        which the joint model's soil holds.
        """
        # Later entries overwrite earlier ones, so the data set with the highest lugs decides.
        rigs = sorted(self.sets, key=lambda rig: rig.beside.get("lug_height", 0.0))
        all_declare_lugs = all("lug_height" in rig.beside for rig in rigs)
        beside = {name: value for rig in rigs for name, value in rig.beside.items()}
        if not all_declare_lugs and beside.get("lug_height") == 0.0:
            del beside["lug_height"]
        gravity = of_one_sand(self.sets).gravity
        assumed = any(rig.gravity_is_assumed for rig in self.sets)
        return replace(rigs[-1], beside=beside, gravity=gravity, gravity_is_assumed=assumed)

    def records(self, model: RigModel | JointModel) -> Mapping[str, Any]:
        """Return a mapping from names to the parts of a model that have numbers to fit.

        The parts are the soil, the effects, and the wheel and the reading errors of each data set.
        """
        return model.records

    def replace_record(self, model: RigModel | JointModel, owner: str, record: Any) -> RigModel | JointModel:
        """Return the model with another part: `record` replaces the part named `owner`, for example "soil"."""
        return model.with_record(owner, record)

    def _numbers(self, model: RigModel | JointModel) -> dict[str, SetNumbers]:
        """Return the uncertain parameters of each data set: name of the data set -> `SetNumbers`."""
        return {data.name: SetNumbers(data, model.of(data.name)) for data in self.sets}

    def uncertain(self, model: RigModel | JointModel) -> tuple[Parameter, ...]:
        """Return the uncertain parameters of a model. They belong to the shared sand, to the lugs, and to each wheel
        and rig.

        If the model includes the trench of digging lugs, the declared lug height has a relative prior SD of 0.3,
        because the pockets between lugs may be partly empty or heaped.
        """
        of_sets = self._numbers(model)
        # A prior that one set declares takes precedence over a number without a prior of another set.
        parameters: dict[str, Parameter] = {}
        for parameter in (parameter for numbers in of_sets.values() for parameter in numbers.of_sand()):
            if parameter.name not in parameters or (parameter.prior and not parameters[parameter.name].prior):
                parameters[parameter.name] = parameter
        # Several data sets together determine n and c if their loads differ, and k_2 if the widths of their wheels
        # or plates differ. Within one data set these constants may be inseparable.
        joint: list[Parameter] = []
        loads = np.concatenate([data.load for data in self.sets])
        widths = [float(data.wheel.b) for data in self.sets]
        widths += [of.plate.b for data in self.sets for of in data.trials if of.plate is not None]
        if loads.max() >= SAME_LOAD * loads.min():
            joint.append(self.parameter(model, "soil.n", SD["n"].undeclared))
            joint.append(self.parameter(model, "soil.c", max(SD["c"].undeclared, float(model.soil.c))))
        if max(widths) >= OTHER_WIDTH * min(widths):
            joint.append(self.parameter(model, "soil.k_2", float(model.soil.k_1) / min(widths)))
        for parameter in (*joint, *known_heights(self.declared, model.records)):
            parameters.setdefault(parameter.name, parameter)
        of_rigs = self._named_parameters({name: numbers.of_rig() for name, numbers in of_sets.items()})
        return (*parameters.values(), *of_rigs)

    def reading_errors(self, model: RigModel | JointModel) -> tuple[Parameter, ...]:
        """Return, as parameters of a fit, the offset and the scale of each reading whose errors the rig.toml of its
        data set does not declare.
        """
        numbers_by_set = self._numbers(model).items()
        return tuple(self._named_parameters({name: numbers.reading_errors() for name, numbers in numbers_by_set}))

    def _named_parameters(self, of_sets: Mapping[str, Iterable[Parameter]]) -> Iterator[Parameter]:
        """Yield the parameters of each data set under the names that they have in the model of all data sets."""
        for name, parameters in of_sets.items():
            yield from (replace(parameter, name=self.in_set(name, ".", parameter.name)) for parameter in parameters)

    def sensitivities(
        self, model: RigModel | JointModel, parameters: Sequence[Parameter], u: np.ndarray
    ) -> Sensitivities:
        """Return the predicted channels of all data sets, and their exact derivatives by the parameters.

        `u` (parameters,) holds the values of the parameters in fit coordinates, that is, in units of the prior SD.
        """
        predicted, slopes = [], []
        for name, runs in self.runs.items():
            set_model = model.of(name)
            # The name of each parameter in the model of this data set; '' if it belongs to another data set. Parameters
            # of the shared soil and effects have the same name in every data set.
            names = [parameter.name for parameter in parameters]
            for i, parameter in enumerate(parameters):
                for kind, _ in SET_RECORDS:
                    owner, separator, quantity = parameter.name.rpartition(f".{kind}.")
                    if separator:
                        names[i] = f"{kind}.{quantity}" if owner == name else ""
                        break
            # Only the numbers that this set's model has can change its channels; all other slopes are 0.
            acting = [i for i, local in enumerate(names) if local and local.rpartition(".")[0] in set_model.records]
            acting_parameters = []
            for number in (replace(parameters[i], name=names[i]) for i in acting):
                # Heights of lugs, and under another gravity the weight and the moduli of the sand, have another value
                # in this data set; `share` is its ratio to the value of the joint model.
                share = model.share(name, number.name)
                if share != 1.0:
                    number = replace(
                        number,
                        origin=number.origin * share,
                        scale=number.scale if number.log else number.scale * share,
                        low=number.low * share,
                        high=number.high * share,
                    )
                acting_parameters.append(number)
            of_set = runs.sensitivities(set_model, acting_parameters, np.asarray(u)[acting])
            table = np.zeros((len(parameters), *of_set.predicted.shape))
            table[acting] = of_set.slopes
            predicted.append(of_set.predicted)
            slopes.append(table)
        return Sensitivities(self._whole(predicted, 0.0), self._whole(slopes, 0.0))

    def predict(self, models: Sequence[RigModel | JointModel]) -> np.ndarray:
        """Return the channels that each model predicts (models, folds, channels, samples).

        The values of a run are NaN if the model cannot predict the run.
        """
        return np.array([self.sensitivities(model, (), np.zeros(0)).predicted for model in models])

    def unpredicted_part(self, model: RigModel | JointModel) -> str:
        """Return a clause on the runs that the model cannot predict; an empty text if the model predicts every run.

        A run cannot be predicted if no sinkage down to the axle carries its load. If several data sets have such runs,
        the clause is about the first one.
        """
        reasons = ((name, runs.unpredicted_part(model.of(name))) for name, runs in self.runs.items())
        return next((self.in_set(name, ": ", why) for name, why in reasons if why), "")


def join_sets(sets: Sequence[RigSet]) -> RigExperiment:
    """Join several data sets to one experiment. A run that two data sets contain is used only once.

    Raises
    ------
    ParameterError
        There are fewer than two data sets.
    DataError
        Two data sets have equal names, all runs of a data set are in another data set, or two data sets declare
        different values of one constant of the sand.
    """
    if len(sets) < 2:
        raise ParameterError(
            "A joint fit needs two or more data sets; give a single data set to the loop without joining it."
        )
    # Counting a run twice would halve its variance, so repeated runs are removed before the sets are joined.
    named: dict[str, RigSet] = {}
    findings = []
    for data in sets:
        name = data.name
        if name in named:
            raise DataError(f"{name}: two data sets have this name; give each data set another name in its rig.toml.")
        new = ~seen_before(data, named.values())
        if not new.any():
            raise DataError(f"{name}: every run of this data set is in another data set too; leave this data set out.")
        if not new.all():
            what = f"{int((~new).sum())} of {new.size} runs are in another data set too"
            findings.append(Finding(what, name, "these runs are used once"))
        named[name] = data if new.all() else data.rows(new)
    # Contradicting declarations of the sand are refused here, before any fit.
    of_one_sand(tuple(named.values()))
    return RigExperiment(tuple(named.values()), tuple(findings))


def read_joint(folders: Sequence[str | Path], trust: Trust = Trust()) -> RigExperiment:
    """Read the data sets of several folders and join them to one experiment.

    If a data set names code of the user, this code runs only if `trust` allows it.

    Raises
    ------
    ParameterError, DataError
        A folder has no rig data set, a data set cannot be read (`read_rig_set`), or the data sets cannot be joined
        (`join_sets`).
    """
    for folder in folders:
        if not is_file(Path(folder) / RIG_FILE):
            raise DataError(
                f"{folder}: there is no {RIG_FILE} in this folder, but several data sets can be joined only if all of "
                "them are rig data sets with the same sand; leave this folder out."
            )
    return join_sets([read_rig_set(folder, trust) for folder in folders])


def seen_before(data: RigSet, others: Iterable[RigSet]) -> np.ndarray:
    """Return a mask (runs,) of the runs of `data` that one of the data sets `others` contains too.

    Two runs count as one run if slip, slip angle, load and the values of all channels that both have are equal.
    """
    # Two missing values (NaN) count as equal.
    duplicate = np.zeros(data.slip.size, dtype=bool)
    for other_set in others:
        mine, theirs = _fingerprint(data, other_set), _fingerprint(other_set, data)
        is_close = np.abs(mine[:, None] - theirs[None]) < SAME_RUN
        duplicate |= (is_close | (np.isnan(mine[:, None]) & np.isnan(theirs[None]))).all(axis=2).any(axis=1)
    return duplicate


def _fingerprint(data: RigSet, other_set: RigSet) -> np.ndarray:
    """Return the numbers for the comparison of the runs of one data set with the runs of another one (runs, numbers).

    The numbers are slip, slip angle, logarithm of the load, and the channels that both data sets have. Each is divided
    by its SD, or by INPUT_SCALE if it is an input.
    """
    mine, theirs = ({type(channel): channel for channel in rig.channels} for rig in (data, other_set))
    inputs = np.array([data.slip, data.slip_angle, np.log(data.load)]) / INPUT_SCALE
    both = (kind for kind in RIG_CHANNELS if kind in mine and kind in theirs)
    return np.vstack(
        [inputs, *(mine[kind].measured / (mine[kind].sd.mean() + theirs[kind].sd.mean()) for kind in both)]
    ).T
