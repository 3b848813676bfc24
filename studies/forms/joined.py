"""Two rig sets of one soil as one set."""

from __future__ import annotations

import numpy as np

from rover_pin.experiments.wheel_rig.data import RigSet, as_rig_set
from rover_pin.measurements.wheel_rig import WheelRig


def joined(first: RigSet, second: RigSet) -> RigSet:
    """Return the runs of both as one set of one soil, each with its own levels and noise."""
    rigs = (first.rig, second.rig)
    channels = tuple(
        type(one)(np.concatenate([one.measured, other.measured]), np.concatenate([one.sd, other.sd]))
        for one, other in zip(first.rig.channels, second.rig.channels, strict=True)
    )
    labels = [
        f"{i} {name}" for i, each in enumerate((first, second)) for name in np.array(each.level_names)[each.level]
    ]
    slip, load = (np.concatenate([np.asarray(getattr(rig, name)) for rig in rigs]) for name in ("slip", "load"))
    rig = WheelRig(first.rig.wheel, slip, load, channels, "both signs", levels=np.array(labels))
    speeds = np.concatenate([first.speeds, second.speeds])
    return as_rig_set(rig, (*first.runs, *second.runs), speeds)
