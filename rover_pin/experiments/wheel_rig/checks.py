"""Checks of wheel-rig data sets: refuse data sets that cannot give an answer, and list findings for a report."""

from collections.abc import Iterator

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.estimation.residual import HUBER_THRESHOLD
from rover_pin.estimation.wording import MAX_NOISE_RATIO
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.measurements.channel import DrawbarPull, MotorTorque, RigChannel, Sinkage, Torque
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.repeats import repeat_groups
from rover_pin.measurements.rig_physics import PhysicsCheck, refuse_impossible, suspicions
from rover_pin.measurements.rig_set import SAME_SLIP, RigSet

MIN_LEVELS = 3
"""Minimum number of slip levels (groups of runs at one slip). If one level is held out, the two others still determine
how a channel changes with the slip."""


def refuse_unfit(experiment: RigExperiment) -> None:
    """Raise an error if data sets cannot give an answer with any model.

    A single data set must have several slips, several slip levels, and channels that change. If several data sets are
    used, a data set may lack information that another data set has, so that data sets are refused only because of
    physically impossible numbers.

    Raises
    ------
    DataError
        A single data set has one slip level, a constant slip, or a channel that never changes; or a data set has
        numbers that are physically impossible (`refuse_impossible`).
    """
    if len(experiment.sets) == 1:
        (data,) = experiment.sets
        # The three faults of a data set without variation: one slip, one level, or a channel that never changes.
        if not np.ptp(data.slip) > 0.0:
            raise DataError(
                f"{data.name}: slip is {data.slip[0]:g} in every run, so every effect looks like a constant; add runs "
                "at other slips, best from 0 to 0.8."
            )
        if len(data.level_names) < 2:
            raise DataError(
                f"{data.name}: all runs are of one level of slip ({data.level_names[0]}), so no level can be held out; "
                "give runs at different slips different levels, or delete the column 'level'."
            )
        for channel in data.channels:
            values = channel.measured[channel.has_value]
            if values.size > 2 and np.ptp(values) == 0.0:
                raise DataError(
                    f"{data.name}: {channel.column} is {values[0]:g} in all {values.size} runs, so the "
                    "sensor may be stuck or unplugged; remove the column or correct its values."
                )
    for data in experiment.sets:
        refuse_impossible(data)


def too_poor(experiment: RigExperiment, nuisances: int) -> str:
    """Return why the data sets cannot distinguish an effect from other uncertain numbers, with the remedy; empty if
    they can.

    `nuisances` is the number of uncertain soil constants that are fitted.
    """
    if len(experiment.sets) > 1:
        levels = len(experiment.folds)
        remedy = (
            f"there are {levels} levels of slip in all data sets together: measure at {MIN_LEVELS} or more, or give "
            "more data sets."
        )
        return remedy if levels < MIN_LEVELS else ""
    # A single data set is tested for few levels, a small range of slip, and few values.
    (data,) = experiment.sets
    values, span = sum(int(channel.has_value.sum()) for channel in data.channels), np.ptp(data.slip)
    if len(data.level_names) < MIN_LEVELS:
        return (
            f"there are {len(data.level_names)} levels of slip, and if one is held out, no dependence on slip can be "
            f"fitted; measure at {MIN_LEVELS} or more."
        )
    if span < SAME_SLIP:
        return f"the slips span only {span:.2f}; measure from about 0 to 0.6 or more."
    if values < nuisances + MIN_LEVELS:
        return (
            f"{values} measured values are too few to distinguish an effect from {nuisances} uncertain soil constants; "
            "measure more levels, or sinkage and torque as well."
        )
    return ""


def findings(experiment: RigExperiment) -> list[Finding]:
    """Return the findings of the data check that a reader should know before reading results of a fit.

    Findings are gaps, scatter beyond the stated noise, and missing measurements. If there are several data sets, each
    finding names its data set.
    """
    # Only checks that are beyond their limit become findings.
    rows = list(experiment.twice)
    for data in experiment.sets:
        findings_of_set = [
            *data.unread,
            *suspicions(data),
            *(Finding(check.what, data.place(check.column), check.todo) for check in _checks(data) if check.is_beyond),
        ]
        rows += [row._replace(where=experiment.in_set(data.name, ", ", row.where)) for row in findings_of_set]
    return rows


def _checks(data: RigSet) -> Iterator[PhysicsCheck]:
    """Yield checks for missing measurements, and for gaps, scatter and outliers of each channel."""
    # If the declared soil cannot carry a load, the declaration is wrong: a fit starts from a firmer soil then.
    alone = RigExperiment((data,))
    lost = alone.unpredicted_part(alone.base_model())
    todo = "if the load is right, declare a firmer soil.k_1: a fit starts at the next value that carries all runs"
    yield PhysicsCheck(bool(lost), f"{lost} with the soil as declared", todo, "load_N")
    # Side force and moment exist only with a slip angle, so their absence is no finding.
    present = {type(channel) for channel in data.channels}
    # A torque by motor current is a measured torque.
    present |= {Torque} if MotorTorque in present else set()
    for kind in (DrawbarPull, Torque, Sinkage):
        what = f"{kind.name} was not measured"
        todo = f"an effect that changes only the {kind.name} cannot be found"
        yield PhysicsCheck(kind not in present, what, todo, kind.column)
    what = f"all loads are nearly equal ({np.min(data.load):.3g} to {np.max(data.load):.3g} N)"
    todo = "n, c and effects of the load are not identifiable; vary the load by a factor of 1.5"
    yield PhysicsCheck(not data.loads_vary, what, todo, "load_N")
    todo = "the noise is stated but not measured; repeat each level"
    yield PhysicsCheck(bool(np.bincount(repeats(data)).max() < 2), "no level is repeated", todo, "level")
    todo = "effects of the speed are left out; give rim or travel speed, as a column or in [speed]"
    yield PhysicsCheck(data.speeds is None, "no speeds", todo, "rim_speed_mps")
    # Each channel may have gaps, repeated runs that scatter more than the stated noise, and outliers among these runs.
    for channel in data.channels:
        # A stated noise below the scatter of repeats would make scatter look like an effect.
        empty, scatter, group = int((~channel.has_value).sum()), repeat_sd(data, channel), repeats(data)
        what = f"{empty} of {channel.has_value.size} runs have no {channel.name}"
        yield PhysicsCheck(empty > 0, what, "their other channels are used", channel.column)
        what = f"the SD of repeats is {scatter:.1f} times the stated noise"
        yield PhysicsCheck(scatter > MAX_NOISE_RATIO, what, "state the larger noise", channel.column)
        # Fewer than three repeats do not show which of them is the outlier.
        for number in range(group.max() + 1):
            members = np.flatnonzero((group == number) & channel.has_value)
            if members.size >= 3:
                values = channel.measured[members]
                off = np.abs(values - np.median(values)) / channel.sd[members]
                what = f"{data.runs[members[off.argmax()]]} lies {off.max():.0f} SD from its repeats"
                todo = "check this run; the run has less weight in the fits"
                yield PhysicsCheck(off.max() > HUBER_THRESHOLD, what, todo, channel.column)


def repeats(data: RigSet) -> np.ndarray:
    """Return for each run the number of its group of repeated runs (runs,): runs with equal slip level, load and slip
    angle.
    """
    return repeat_groups(data.level, data.load, data.slip_angle)


def repeat_sd(data: RigSet, channel: RigChannel) -> float:
    """Return the SD of a channel among repeated runs, pooled over all groups and divided by the stated SD.

    About 1 means that the stated noise is right. The result is NaN if no run is repeated.
    """
    scaled, group = (channel.measured / channel.sd)[channel.has_value], repeats(data)[channel.has_value]
    # Each group loses one degree of freedom by its mean.
    count = np.bincount(group)
    mean = np.bincount(group, scaled) / np.maximum(count, 1)
    freedom = scaled.size - np.count_nonzero(count)
    return float(np.sqrt(np.sum((scaled - mean[group]) ** 2) / freedom)) if freedom > 0 else float("nan")
