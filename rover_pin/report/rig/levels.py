"""What a rig's levels mean: the slip that was set, and angle and load where these differ."""

import math
from collections import Counter

import numpy as np

from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.measurements.wheel_rig import SAME_LOAD

LEVEL = 0.005
"""Half of the last digit of a slip as it is said: what lies within is one level."""


def meanings(data: RigSet) -> dict[str, str]:
    """Return the meaning of every level by its name: 'S = 0.5', with slip angle and load where they differ."""
    rig = data.rig
    angled = bool(np.ptp(rig.slip_angle) > 1e-3)
    loaded = _several_loads(data)
    descriptions = {}
    for number, name in enumerate(data.level_names):
        at = data.level == number
        parts = [f"S = {_slip(float(np.mean(rig.slip[at])))}"]
        parts += [f"{math.degrees(float(np.mean(rig.slip_angle[at]))):.3g} deg"] if angled else []
        parts += [f"{float(np.mean(rig.load[at])):.3g} N"] if loaded else []
        descriptions[name] = ", ".join(parts)
    twice = {words for words, times in Counter(descriptions.values()).items() if times > 1}
    return {name: f"{words} ({name})" if words in twice else words for name, words in descriptions.items()}


def _slip(slip: float) -> str:
    return f"{0.0 if abs(slip) < LEVEL else slip:.2g}"


def _several_loads(data: RigSet) -> bool:
    load = np.asarray(data.rig.load)
    return bool(load.max() >= SAME_LOAD * load.min())
