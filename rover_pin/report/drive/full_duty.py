"""How much an effect does to a rover that drives on level ground with all motors at full duty, with and without it."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from rover_pin.base.errors import RoverPinError
from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.effect import SensorEffect
from rover_pin.report.words import listing, pair
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.shapes import flat

SECONDS, LAST = 8.0, 2.0
"""How long is driven, and over which end of it means are taken [s]."""
MIN_RELATIVE_CHANGE = 0.005
"""Relative change below which a mean is the same."""
WHOLE = {"body_vx": ("speed", "m/s"), "battery_V": ("bus voltage", "V")}
WHEELS = {"slip": ("slip", ""), "sinkage": ("sinkage", "m"), "current": ("current a motor", "A")}
"""Means that are said: of the rover, and over its wheels; words and unit."""


def at_full_duty(model: Model, effect: Any) -> str:
    """Return one sentence: what an effect of a model changes on level ground at full duty; empty where nothing."""
    if isinstance(effect, SensorEffect):
        return ""
    level = model.replace(terrain=flat())
    bare = level.having(effect.replace(**effect.neutral))
    try:
        traces = [
            simulate(variant, ConstantDuty(1.0), SECONDS, measure_error=False)
            for variant in (bare, level.having(effect))
        ]
    except RoverPinError:  # a drive that cannot be driven says nothing of the effect
        return ""
    changes = list(_changes(*(_means(trace) for trace in traces)))
    return f"At full duty on level ground {listing(changes)}." if changes else ""


def _means(trace: Trace) -> dict[str, tuple[float, str]]:
    """Return means over the end of a drive, with their unit, by what they are called."""
    late = trace.t >= trace.t[-1] - LAST
    means = {words: (float(np.mean(trace[name][late])), unit) for name, (words, unit) in WHOLE.items() if name in trace}
    for name, (words, unit) in WHEELS.items():
        means[words] = (float(np.mean(trace.stack(name)[late])), unit)
    return means


def _changes(before: dict[str, tuple[float, str]], after: dict[str, tuple[float, str]]) -> Iterator[str]:
    for words, (was, unit) in before.items():
        now = after[words][0]
        if abs(now - was) > MIN_RELATIVE_CHANGE * max(abs(was), abs(now)):
            first, second = pair(was, now, unit)
            share = f" ({now / was - 1:+.0%})" if unit and was else ""
            yield f"{words} goes from {first} to {second}{share}"
