"""Whether rig sets can answer at all, alone or together: refusals, and findings that a reader should know of."""

from collections.abc import Iterator

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.estimation.noise import HUBER_THRESHOLD
from rover_pin.estimation.wording import NOISE_LIKE
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.measurements.channel import RIG_CHANNELS, RigChannel
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_physics import Check, refuse_impossible, suspicions
from rover_pin.measurements.rig_set import SAME_SLIP, STRAIGHT, RigSet, classes

FEWEST_LEVELS = 3
"""Levels without which nothing that depends on slip can be held out. Why: one is left out, and two are a slope."""
SAME_WEIGHT = 1.1
"""Runs of a level whose loads, in order, step by less than this are repeats: assumed, a hung weight varies by 5 %."""


def refuse_unfit(experiment: RigExperiment) -> None:
    """Refuse sets that cannot answer whatever the model; of several only what no wheel on any soil gives.

    Raises DataError: of one set one level, constant slip, or a channel that never moves; what `refuse_impossible`
    refuses.
    """
    for data in experiment.sets:
        if len(experiment.sets) == 1:
            _refuse_unvaried(data)
        refuse_impossible(data)


def _refuse_unvaried(data: RigSet) -> None:
    if not np.ptp(data.slip) > 0.0:
        raise DataError(
            f"{data.name}: slip is {data.slip[0]:g} in every run, so no effect differs from a constant; add runs at "
            "other slips, best from 0 to 0.8."
        )
    if len(data.level_names) < 2:
        raise DataError(
            f"{data.name}: all runs are one level ({data.level_names[0]}), so none can be held out; give the runs at "
            "different slips different levels, or leave the column out."
        )
    for channel in data.channels:
        values = channel.measured[channel.has_value]
        if values.size > 2 and np.ptp(values) == 0.0:
            raise DataError(
                f"{data.name}: {channel.column} is {values[0]:g} in all {values.size} runs, as of a sensor "
                "that is stuck or unplugged; remove the column or mend it."
            )


def too_poor(experiment: RigExperiment, nuisances: int) -> str:
    """Return why the sets cannot tell an effect from nuisance parameters and what would, or an empty string."""
    if len(experiment.sets) > 1:
        levels = len(experiment.folds)
        least = f"{levels} levels in all sets: measure at {FEWEST_LEVELS} or more, or give more sets."
        return least if levels < FEWEST_LEVELS else ""
    (data,) = experiment.sets
    values, span = sum(int(channel.has_value.sum()) for channel in data.channels), np.ptp(data.slip)
    if len(data.level_names) < FEWEST_LEVELS:
        return (
            f"{len(data.level_names)} levels of slip: with one held out nothing that depends on slip is left to fit; "
            f"measure at {FEWEST_LEVELS} or more."
        )
    if span < SAME_SLIP:
        return f"slips span {span:.2f} only; measure from about 0 to 0.6 or more."
    if values < nuisances + FEWEST_LEVELS:
        return (
            f"{values} measured values for {nuisances} uncertain soil constants leave too little to tell an effect "
            "from them; measure more levels, or sinkage and torque as well."
        )
    return ""


def findings(experiment: RigExperiment) -> list[Finding]:
    """Return what a reader should know before any result, of several sets with the set's name before its place."""
    of_sets = ((data.name, finding) for data in experiment.sets for finding in _of_set(data))
    placed = (row._replace(where=experiment.in_set(name, ", ", row.where)) for name, row in of_sets)
    return [*experiment.twice, *placed]


def _of_set(data: RigSet) -> list[Finding]:
    checks = [*_lacks(data), *(check for channel in data.channels for check in _of_channel(data, channel))]
    of_data = [Finding(check.what, data.place(check.column), check.todo) for check in checks if check.is_beyond]
    return [*data.unread, *suspicions(data), *of_data]


def _lacks(data: RigSet) -> Iterator[Check]:
    alone = RigExperiment((data,))
    lost = alone.unpredicted_part(alone.base_model())
    todo = "if that load is right, declare a firmer soil.k_1: a fit starts at the next one that carries all runs"
    yield Check(bool(lost), f"{lost} with the soil as declared", todo, "load_N")
    present = {type(channel) for channel in data.channels}
    for kind in (kind for kind in RIG_CHANNELS if not kind.is_sideways):
        what, todo = f"{kind.name} was not measured", "effects that it alone shows stay hidden"
        yield Check(kind not in present, what, todo, kind.column)
    what = f"all loads are alike ({np.min(data.load):.3g} to {np.max(data.load):.3g} N)"
    todo = "n, c and effects of the load are not identifiable; vary the load 1.5 times"
    yield Check(not data.loads_vary, what, todo, "load_N")
    todo = "the noise is as stated, not measured; repeat each level"
    yield Check(bool(np.bincount(repeats(data)).max() < 2), "no level is repeated", todo, "level")
    todo = "effects of speed are left out; give rim or travel speed, as a column or in [speed]"
    yield Check(data.speeds is None, "no speeds", todo, "rim_speed_mps")


def _of_channel(data: RigSet, channel: RigChannel) -> Iterator[Check]:
    empty, scatter, group = int((~channel.has_value).sum()), repeat_sd(data, channel), repeats(data)
    what = f"{empty} of {channel.has_value.size} runs have no {channel.name}"
    yield Check(empty > 0, what, "their other channels are used", channel.column)
    what = f"repeats scatter {scatter:.1f} times as much as the stated noise"
    yield Check(scatter > NOISE_LIKE, what, "state the larger noise", channel.column)
    for number in range(group.max() + 1):
        at = np.flatnonzero((group == number) & channel.has_value)
        if at.size >= 3:
            off = np.abs(channel.measured[at] - np.median(channel.measured[at])) / channel.sd[at]
            what = f"{data.runs[at[off.argmax()]]} lies {off.max():.0f} SD from its repeats"
            todo = "look at that run; it counts less in the fits"
            yield Check(off.max() > HUBER_THRESHOLD, what, todo, channel.column)


def repeats(data: RigSet) -> np.ndarray:
    """Return which group of repeats each run is of: of a level and slip angle, loads by less than SAME_WEIGHT apart."""
    askew = classes(data.slip_angle, STRAIGHT)
    order = np.lexsort((data.load, askew, data.level))
    load, level, angle = data.load[order], data.level[order], askew[order]
    is_new_group = (np.diff(level) != 0) | (np.diff(angle) != 0) | (load[1:] > SAME_WEIGHT * load[:-1])
    group = np.empty(order.size, dtype=int)
    group[order] = np.concatenate([[0], np.cumsum(is_new_group)])
    return group


def repeat_sd(data: RigSet, channel: RigChannel) -> float:
    """Return the pooled SD of repeats in stated SDs, NaN where no run is repeated."""
    scaled, group = (channel.measured / channel.sd)[channel.has_value], repeats(data)[channel.has_value]
    count = np.bincount(group)
    mean = np.bincount(group, scaled) / np.maximum(count, 1)
    freedom = scaled.size - np.count_nonzero(count)
    return float(np.sqrt(np.sum((scaled - mean[group]) ** 2) / freedom)) if freedom > 0 else float("nan")
