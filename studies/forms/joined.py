"""Two rig sets of one soil as one set."""

from __future__ import annotations

import numpy as np

from rover_pin.measurements.rig_set import RigSet


def joined(first: RigSet, second: RigSet) -> RigSet:
    """Return the runs of both sets as one set of one soil, each with its own levels and noise."""
    rigs = (first, second)
    channels = tuple(
        type(channel)(
            np.concatenate([channel.measured, second_channel.measured]), np.concatenate([channel.sd, second_channel.sd])
        )
        for channel, second_channel in zip(first.channels, second.channels, strict=True)
    )
    # Equal level names in both sets would merge, so a number of the set goes first.
    labels = [
        f"{i} {name}"
        for i, rig_set in enumerate((first, second))
        for name in np.array(rig_set.level_names)[rig_set.level]
    ]
    slip, load = (np.concatenate([np.asarray(getattr(rig, name)) for rig in rigs]) for name in ("slip", "load"))
    runs, speeds = (*first.runs, *second.runs), np.concatenate([first.speeds, second.speeds])
    return RigSet(first.wheel, slip, load, channels, "both signs", levels=labels, runs=runs, speeds=speeds)
