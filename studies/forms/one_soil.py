"""One soil under all wheels: the levels of every set held out, and whole sets predicted from the others."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from shared.rig_fits import calibrated

from forms.curves import BASELINES, Predict
from rover_pin.contact import Soil
from rover_pin.discrepancy.held_out_errors import held_out_residual
from rover_pin.effects.effect import Effect
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.parameter import Parameter
from rover_pin.experiments.wheel_rig.candidates import present_amplitudes
from rover_pin.experiments.wheel_rig.declared import FULL_BY
from rover_pin.experiments.wheel_rig.experiment import RigExperiment, join_sets, seen_before
from rover_pin.experiments.wheel_rig.joint_model import JointModel
from rover_pin.experiments.wheel_rig.model import ASKEW
from rover_pin.measurements.rig_set import RigSet

APART = "pressings apart: "
"""Prefix of a set's name if the pressings are not data of the fit."""
FROM = "from the others: "
"""Prefix of a set's name if it is predicted from the other sets."""
ONE = "one sand: "
"""Prefix of a set's name if all sets are fitted with one soil."""
THE_LAW = "the law"
"""Name of the law that predicts a set from the others."""
GRIP = "LugGrip.h_l"
Cells = tuple[str, str, float, float, float, float, str]
"""Row of the table of results: data set, law, errors of pull [N], of sinkage [mm] and of side force [N], error of all
channels together in units of their noise, and fitted sizes as text."""


def fitted(joint: RigExperiment, effects: tuple[Effect, ...]) -> Fit:
    """Return the fit of one soil and the sizes of these effects to all sets. The lug height has a prior of 30 %."""
    model = dataclasses.replace(joint.base_model(), effects=(*ASKEW, *effects))
    uncertain = joint.uncertain(model)
    sizes = [declared(joint, model, size) for size in present_amplitudes(model.effects, uncertain)]
    return calibrated(joint, model, (*uncertain, *sizes))


def declared(joint: RigExperiment, model: JointModel, size: Parameter) -> Parameter:
    """Return a size; the lug height of the grip gets a prior around its value in the model."""
    height = joint.value(model, size.name)
    return dataclasses.replace(size, origin=height, scale=FULL_BY * height, prior=True) if size.name == GRIP else size


def one_sand(sets: Mapping[str, RigSet], laws: Mapping[str, tuple[Effect, ...]]) -> Iterator[Cells]:
    """Yield the errors of each set and law, with each level predicted from all other levels of all sets."""
    joint = join_sets(list(sets.values()))
    words = {data.name: name for name, data in sets.items()}
    for law, effects in laws.items():
        fit = fitted(joint, effects)
        # Entries that were not measured must not count as errors.
        left = np.where(np.isfinite(joint.observed), held_out_residual(fit), np.nan)[:, : len(joint.kinds)]
        for name in joint.runs:
            mine = joint.of_set(name)
            errors, sds = (
                np.moveaxis(table[mine], 1, 0).reshape(len(joint.kinds), -1)
                for table in (left, joint.noise().sd[:, : len(joint.kinds)])
            )
            by_channel = {kind.name: row for kind, row in zip(joint.kinds, errors, strict=True)}
            yield cells(ONE + words[name], law, by_channel, sds, said(fit))


def from_the_others(sets: Mapping[str, RigSet], effects: tuple[Effect, ...]) -> Iterator[Cells]:
    """Yield the errors of each set, predicted by one soil fitted to the other sets and by curves through them.

    Runs that are also in the predicted set are removed from the others. The curves depend on slip, slip angle and lugs.
    """
    for name, data in sets.items():
        others = unseen((candidate for candidate in sets.values() if candidate is not data), [data])
        joint = join_sets(others)
        fit = fitted(joint, effects)
        # The joint model of all sets holds the geometry of this wheel; soil and sizes come from the fit without this
        # set.
        joint_model = join_sets([data, *joint.sets]).base_model()
        model = dataclasses.replace(joint_model, soil=fit.model.soil, effects=fit.model.effects).of(data.name)
        predicted = model.predict(data.load, data.slip, data.speeds, data.slip_angle)
        values = {
            "drawbar pull": predicted.drawbar_pull,
            "sinkage": predicted.sinkage,
            "side force": predicted.side_force,
        }
        sds = np.array([channel.sd for channel in data.channels])
        errors = {channel.name: values[channel.name] - channel.measured for channel in data.channels}
        yield cells(FROM + name, THE_LAW, errors, sds, said(fit))
        for curve, predict in BASELINES.items():
            errors = {channel.name: carried(others, data, channel.name, predict) for channel in data.channels}
            yield cells(FROM + name, curve, errors, sds)


def pressings_apart(sets: Mapping[str, RigSet], effects: tuple[Effect, ...], law: str) -> Iterator[Cells]:
    """Yield the errors of one soil when pressings only start the fit, and n is fixed at the first set's value."""
    sand = next(data.soil() for data in sets.values() if data.trials)
    prepared = {name: apart(data, sand) if data.trials else data for name, data in sets.items()}
    for name, of, *rest in (*one_sand(prepared, {law: effects}), *from_the_others(prepared, effects)):
        if of in (law, THE_LAW):
            yield APART + name, of, *rest


def apart(data: RigSet, sand: Soil) -> RigSet:
    """Return a set without its pressings, with n and k_1 declared as in this sand."""
    declared = {**data.declared, "n": float(sand.n), "k_1": float(sand.k_1), "k_2": 0.0}
    return dataclasses.replace(data, trials=(), declared=declared)


def cells(name: str, law: str, errors: Mapping[str, np.ndarray], sds: np.ndarray, words: str = "") -> Cells:
    """Return the RMS of the errors of each channel as a row; NaN if a channel was not measured."""
    rms = {
        channel: float(np.sqrt(np.nanmean(e**2))) if np.isfinite(e).any() else np.nan for channel, e in errors.items()
    }
    noise = float(np.sqrt(np.nanmean((np.array(list(errors.values())) / sds) ** 2)))
    return name, law, rms["drawbar pull"], 1e3 * rms["sinkage"], rms.get("side force", np.nan), noise, words


def said(fit: Fit) -> str:
    """Return a line of text with the names and the values of the fitted parameters."""
    return ", ".join(f"{parameter.name} = {fit.value(parameter.name):.3g}" for parameter in fit.parameters)


def unseen(sets: Iterable[RigSet], besides: Sequence[RigSet] = ()) -> list[RigSet]:
    """Return the sets without repeated runs and without the runs of `besides`; empty sets are dropped."""
    unique: list[RigSet] = []
    for data in sets:
        new = ~seen_before(data, (*besides, *unique))
        unique += [data.rows(new)] if new.any() else []
    return unique


def carried(others: Sequence[RigSet], data: RigSet, channel: str, predict: Predict) -> np.ndarray:
    """Return the errors with which a curve through the other sets' points of a channel predicts a set."""
    samples = [
        (inputs(rig), measured_channel.measured)
        for rig in others
        for measured_channel in rig.channels
        if measured_channel.name == channel
    ]
    points, values = (np.concatenate(part) for part in zip(*samples, strict=True))
    # Inputs that do not vary in the others cannot carry a curve.
    varied = np.ptp(points, axis=0) > 0
    measured = next(measured_channel.measured for measured_channel in data.channels if measured_channel.name == channel)
    return predict(points[:, varied], values, inputs(data)[:, varied]) - measured


def inputs(data: RigSet) -> np.ndarray:
    """Return slip, slip angle and lug height in cm of each run."""
    lugs = np.full(data.slip.size, 100.0 * data.beside.get("lug_height", 0.0))
    return np.column_stack([data.slip, np.asarray(data.slip_angle), lugs])
