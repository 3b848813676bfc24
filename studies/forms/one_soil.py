"""One soil under all wheels: every set's levels held out, and whole sets predicted from the others."""

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
"""What stands before a set's name where pressings are no data of the fit."""
FROM = "from the others: "
"""What stands before a set's name where it is predicted from the other sets."""
ONE = "one sand: "
"""What stands before a set's name where all sets are fitted with one soil."""
THE_LAW = "the law"
"""The law by which a set is predicted from the others."""
GRIP = "LugGrip.h_l"
Cells = tuple[str, str, float, float, float, float, str]
"""Set, law, errors of pull [N], sinkage [mm] and side force [N], of all in their noise, and what was fitted."""


def fitted(joint: RigExperiment, effects: tuple[Effect, ...]) -> Fit:
    """Return one soil and the sizes of these effects fitted to all sets; the lugs' height is declared, to 30 %."""
    model = dataclasses.replace(joint.base_model(), effects=(*ASKEW, *effects))
    known = joint.uncertain(model)
    sizes = [declared(joint, model, size) for size in present_amplitudes(model.effects, known)]
    return calibrated(joint, model, (*known, *sizes))


def declared(joint: RigExperiment, model: JointModel, size: Parameter) -> Parameter:
    """Return a size, the grip's height of lugs around what it is in the model."""
    height = joint.value(model, size.name)
    return dataclasses.replace(size, origin=height, scale=FULL_BY * height, prior=True) if size.name == GRIP else size


def one_sand(sets: Mapping[str, RigSet], laws: Mapping[str, tuple[Effect, ...]]) -> Iterator[Cells]:
    """Yield the errors of each set and law, each level predicted from all the others of all sets."""
    joint = join_sets(list(sets.values()))
    words = {data.name: name for name, data in sets.items()}
    for law, effects in laws.items():
        fit = fitted(joint, effects)
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
    """Yield the errors of each set as one soil fitted to the other sets predicts it, and as curves through them do.

    Runs that stand in the set as well are taken out of the others. Curves know slip, slip angle and lugs.
    """
    for name, data in sets.items():
        others = unseen((other for other in sets.values() if other is not data), [data])
        joint = join_sets(others)
        fit = fitted(joint, effects)
        whole = join_sets([data, *joint.sets]).base_model()
        model = dataclasses.replace(whole, soil=fit.model.soil, effects=fit.model.effects).of(data.name)
        found = model.predict(data.load, data.slip, data.speeds, data.slip_angle)
        values = {"drawbar pull": found.drawbar_pull, "sinkage": found.sinkage, "side force": found.side_force}
        sds = np.array([channel.sd for channel in data.channels])
        errors = {channel.name: values[channel.name] - channel.measured for channel in data.channels}
        yield cells(FROM + name, THE_LAW, errors, sds, said(fit))
        for curve, predict in BASELINES.items():
            errors = {channel.name: carried(others, data, channel.name, predict) for channel in data.channels}
            yield cells(FROM + name, curve, errors, sds)


def pressings_apart(sets: Mapping[str, RigSet], effects: tuple[Effect, ...], law: str) -> Iterator[Cells]:
    """Yield the errors of one soil where pressings only start the fit, and n is held where the first set's have it."""
    sand = next(data.soil() for data in sets.values() if data.trials)
    held = {name: apart(data, sand) if data.trials else data for name, data in sets.items()}
    for name, of, *rest in (*one_sand(held, {law: effects}), *from_the_others(held, effects)):
        if of in (law, THE_LAW):
            yield APART + name, of, *rest


def apart(data: RigSet, sand: Soil) -> RigSet:
    """Return a set without its pressings, n and k_1 declared as this sand has them."""
    declared = {**data.declared, "n": float(sand.n), "k_1": float(sand.k_1), "k_2": 0.0}
    return dataclasses.replace(data, trials=(), declared=declared)


def cells(name: str, law: str, errors: Mapping[str, np.ndarray], sds: np.ndarray, words: str = "") -> Cells:
    """Return errors of channels by their names as a row; NaN where a channel was not measured."""
    rms = {
        channel: float(np.sqrt(np.nanmean(e**2))) if np.isfinite(e).any() else np.nan for channel, e in errors.items()
    }
    noise = float(np.sqrt(np.nanmean((np.array(list(errors.values())) / sds) ** 2)))
    return name, law, rms["drawbar pull"], 1e3 * rms["sinkage"], rms.get("side force", np.nan), noise, words


def said(fit: Fit) -> str:
    """Return what was fitted, in words."""
    return ", ".join(f"{one.name} = {fit.value(one.name):.3g}" for one in fit.parameters)


def unseen(sets: Iterable[RigSet], besides: Sequence[RigSet] = ()) -> list[RigSet]:
    """Return the sets with each run once, and none that stands in `besides`: no set that holds no other run."""
    kept: list[RigSet] = []
    for data in sets:
        new = ~seen_before(data, (*besides, *kept))
        kept += [data.rows(new)] if new.any() else []
    return kept


def carried(others: Sequence[RigSet], data: RigSet, channel: str, predict: Predict) -> np.ndarray:
    """Return the errors on a set of a curve through the others' points of a channel."""
    seen = [(inputs(one), each.measured) for one in others for each in one.channels if each.name == channel]
    points, values = (np.concatenate(part) for part in zip(*seen, strict=True))
    varied = np.ptp(points, axis=0) > 0
    measured = next(each.measured for each in data.channels if each.name == channel)
    return predict(points[:, varied], values, inputs(data)[:, varied]) - measured


def inputs(data: RigSet) -> np.ndarray:
    """Return slip, slip angle and the lugs' height in cm of each run."""
    lugs = np.full(data.slip.size, 100.0 * data.beside.get("lug_height", 0.0))
    return np.column_stack([data.slip, np.asarray(data.slip_angle), lugs])
