"""Whether a rig set can answer at all: refusals, and findings that a reader should know of."""

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.experiments.wheel_rig.declared import as_declared
from rover_pin.experiments.wheel_rig.runs import RigRuns
from rover_pin.measurements.channel import RIG_CHANNELS, RigChannel
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_physics import refuse_impossible, suspicions
from rover_pin.measurements.rig_set import SAME_SLIP, STRAIGHT, RigSet

FEWEST_LEVELS = 3
"""Levels with which an effect that depends on slip can be held out and distinguished from a constant."""

SAME_WEIGHT = 1.1
"""Runs of a level whose loads, in order, step by less than this are repeats: assumed, a hung weight varies by 5 %."""

OUTLYING = 5.0
"""A run this many SDs from the median of its repeats is named."""


def refuse_unfit(data: RigSet) -> None:
    """Refuse a set that cannot answer whatever the model.

    Raises DataError: one level, constant slip, a channel that never moves, or what `refuse_impossible` refuses.
    """
    where = data.name
    span = float(np.ptp(data.slip))
    if span < SAME:
        raise DataError(
            f"{where}: slip is {data.slip[0]:g} in every run, so no effect differs from a constant; add runs at other "
            "slips, best from 0 to 0.8."
        )
    if len(data.level_names) < 2:
        raise DataError(
            f"{where}: all runs are one level ({data.level_names[0]}), so none can be held out; give the runs at "
            "different slips different levels, or leave the column out."
        )
    for channel in data.channels:
        _refuse_frozen(channel, where)
    refuse_impossible(data)


SAME = 1e-6
"""Slips that differ by less are one."""


def _refuse_frozen(channel: RigChannel, where: str) -> None:
    values = channel.measured[channel.has_value]
    if values.size > 2 and np.ptp(values) == 0.0:
        raise DataError(
            f"{where}: {channel.column} is {values[0]:g} in all {values.size} runs, as of a sensor "
            "that is stuck or unplugged; remove the column or mend it."
        )


def too_poor(data: RigSet, nuisances: int) -> str:
    """Return why the set cannot tell an effect from its nuisance parameters and what would, or an empty string."""
    values = sum(int(channel.has_value.sum()) for channel in data.channels)
    if len(data.level_names) < FEWEST_LEVELS:
        return (
            f"{len(data.level_names)} levels of slip: with one held out nothing that depends on slip is left to fit; "
            f"measure at {FEWEST_LEVELS} or more."
        )
    if np.ptp(data.slip) < SAME_SLIP:
        return f"slips span {np.ptp(data.slip):.2f} only; measure from about 0 to 0.6 or more."
    if values < nuisances + FEWEST_LEVELS:
        return (
            f"{values} measured values for {nuisances} uncertain soil constants leave too little to tell an effect "
            "from them; measure more levels, or sinkage and torque as well."
        )
    return ""


def findings(data: RigSet) -> list[Finding]:
    """Return what a reader should know of the set before any result."""
    set_findings = [*data.unread, *suspicions(data)]
    if lost := RigRuns(data).unpredicted(as_declared(data)):
        todo = "if that load is right, declare a firmer soil.k_1: a fit starts at the next one that carries all runs"
        set_findings.append(Finding(f"{lost} with the soil as declared", data.place("load_N"), todo))
    present = [type(channel) for channel in data.channels]
    missing = [kind for kind in RIG_CHANNELS if kind not in present and not kind.is_sideways]
    for kind in missing:
        set_findings.append(
            Finding(f"{kind.name} was not measured", data.place(kind.column), "effects that it alone shows stay hidden")
        )
    if not data.loads_vary:
        what = f"all loads are alike ({np.min(data.load):.3g} to {np.max(data.load):.3g} N)"
        set_findings.append(
            Finding(
                what, data.place("load_N"), "n, c and effects of the load are not identifiable; vary the load 1.5 times"
            )
        )
    if np.bincount(repeats(data)).max() < 2:
        set_findings.append(
            Finding(
                "no level is repeated", data.place("level"), "the noise is as stated, not measured; repeat each level"
            )
        )
    if data.speeds is None:
        todo = "effects of speed are left out; give rim or travel speed, as a column or in [speed]"
        set_findings.append(Finding("no speeds", data.place("rim_speed_mps"), todo))
    for channel in data.channels:
        set_findings += [*_missing_cells(data, channel), *_of_repeats(data, channel)]
    return set_findings


def _missing_cells(data: RigSet, channel: RigChannel) -> list[Finding]:
    empty = int((~channel.has_value).sum())
    what = f"{empty} of {channel.has_value.size} runs have no {channel.name}"
    return [Finding(what, data.place(channel.column), "their other channels are used")] if empty else []


def repeats(data: RigSet) -> np.ndarray:
    """Return which group of repeats each run is of: of a level and slip angle, loads by less than SAME_WEIGHT apart."""
    askew = _apart(data.slip_angle)
    order = np.lexsort((data.load, askew, data.level))
    load, level, angle = data.load[order], data.level[order], askew[order]
    is_new_group = (np.diff(level) != 0) | (np.diff(angle) != 0) | (load[1:] > SAME_WEIGHT * load[:-1])
    group = np.empty(order.size, dtype=int)
    group[order] = np.concatenate([[0], np.cumsum(is_new_group)])
    return group


def _apart(angle: np.ndarray) -> np.ndarray:
    """Return which class of slip angles each run is of: neighbours by less than STRAIGHT apart are of one."""
    order = np.argsort(angle)
    angle_class = np.empty(angle.size, dtype=int)
    angle_class[order] = np.concatenate([[0], np.cumsum(np.diff(angle[order]) > STRAIGHT)])
    return angle_class


def repeat_sd(data: RigSet, channel: RigChannel) -> float:
    """Return the pooled SD of repeats in stated SDs, NaN where no run is repeated."""
    scaled, group = (channel.measured / channel.sd)[channel.has_value], repeats(data)[channel.has_value]
    count = np.bincount(group)
    mean = np.bincount(group, scaled) / np.maximum(count, 1)
    freedom = scaled.size - np.count_nonzero(count)
    return float(np.sqrt(np.sum((scaled - mean[group]) ** 2) / freedom)) if freedom > 0 else float("nan")


def _of_repeats(data: RigSet, channel: RigChannel) -> list[Finding]:
    repeat_findings: list[Finding] = []
    scatter, group = repeat_sd(data, channel), repeats(data)
    if scatter > 1.6:
        what = f"repeats scatter {scatter:.1f} times as much as the stated noise"
        repeat_findings.append(Finding(what, data.place(channel.column), "state the larger noise"))
    for i in range(group.max() + 1):
        at = np.flatnonzero((group == i) & channel.has_value)
        if at.size < 3:
            continue
        off = np.abs(channel.measured[at] - np.median(channel.measured[at])) / channel.sd[at]
        if off.max() > OUTLYING:
            what = f"{data.runs[at[off.argmax()]]} lies {off.max():.0f} SD from its repeats"
            repeat_findings.append(
                Finding(what, data.place(channel.column), "look at that run; it counts less in the fits")
            )
    return repeat_findings
